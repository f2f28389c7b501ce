"""A bed of discs in the simulation, a rigid flat punch on it: how it is loaded, and what is measured on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from yade_scripts import export, materials, packing, punch_surcharge, quick_tables, walls
from yade_scripts.recorder import Quantity

try:
    import yade
except ImportError:
    yade = None

AT_REST = (walls.LEFT, walls.RIGHT, walls.BOTTOM)
SIDES = (*AT_REST, walls.PUNCH)
SETTLED = 1e-3  # mean resultant force over mean contact force at which the bed is at rest under its surcharge
MOST_SETTLING_STEPS = 20_000
BETWEEN_PRESSES = 20  # steps, while it settles
# A dead load has no spring. The tables have a stiffness for every contact, so its is large: the energy it would hold
# is lost among that of the others.
DEAD_STIFFNESS = 1e6


class Bed:
    """Discs between two side walls and a bottom at rest, under a surcharge and a punch.

    Attributes:
        count: number of discs.
        radii: (count,) [m].
        mean_radius: [m].
        disc_area: sum of the discs' areas [m^2].
        masses: (count,) [kg].
        walls: left, right, bottom and the punch in the simulation.
        width, height: of the bed at the start [m].
        punch_width: [m].
        punch_start: height of the punch's face at the start [m].
        surface: the discs that bear the surcharge now, and how much of it.
        reader: of the tables, without the surcharge.
    """

    def __init__(self, values: Mapping[str, Any], start: packing.Packing, build: bool = True) -> None:
        """Put a packing's discs, walls and the punch into an empty simulation, at rest.

        With `build` false they are there already: a simulation that began like this has been loaded.
        """
        self.values = values
        self.count = len(start.radii)
        self.radii = start.radii
        self.mean_radius = float(start.radii.mean())
        self.disc_area = math.pi * float((start.radii**2).sum())
        self.masses, inertias = materials.masses_and_inertias(
            start.radii, values["density"], values["mass"], values["shape"]
        )
        self.rules = materials.contact_rules(values)
        left, right, bottom, top = (float(face) for face in start.faces)
        self.left, self.right, self.bottom, self.punch_start = left, right, bottom, top
        self.width, self.height = right - left, top - bottom
        self.punch_width = values["punch_width_over_bed_width"] * self.width
        self.punch_left = (left + right - self.punch_width) / 2
        self.punch_right = self.punch_left + self.punch_width
        self.free_spans = ((left, self.punch_left), (self.punch_right, right))
        self.free_width = self.width - self.punch_width
        self.spacing = float(start.radii.min()) / punch_surcharge.COLUMNS_PER_RADIUS
        largest = float(start.radii.max())
        if build:
            materials.add_discs(start.radii, start.positions, self.masses, inertias, self.rules)
            self.walls = walls.add_walls(start.faces, largest, self.rules, AT_REST)
            thick = self.walls.half_thickness + values["final_axial_strain"] * self.punch_width
            rough = self.rules._replace(wall_friction=values["punch_friction"])
            self.walls.body[walls.PUNCH] = walls.add_box(
                ((left + right) / 2, top + thick, 0),
                (self.punch_width / 2, thick, self.walls.half_thickness),
                yade.O.materials.append(materials.wall_material(rough)),
            )
            yade.O.engines = materials.engines(self.rules, values["damping"])
        else:
            self.walls = walls.walls_after(self.count, largest, SIDES)
        mean_radius = self.mean_radius if values["rolling_stiffness_radius"] == "mean" else None
        self.reader = quick_tables.QuickTables(self.radii, self.walls.numbers, self.rules, mean_radius)
        self.punch = yade.O.bodies[self.walls.body[walls.PUNCH]]
        self.surface = punch_surcharge.Surface(np.zeros(0, dtype=np.int64), np.zeros(0), top)

    def settle(self, report: packing.Report) -> tuple[float, dict[str, Any]]:
        """Let the bed come to rest under surcharge and punch: a rigid cover pressed on it while it was made."""
        steps, unbalanced = 0, math.inf
        while unbalanced > SETTLED and steps < MOST_SETTLING_STEPS:
            self.press()
            self.advance(BETWEEN_PRESSES)
            steps += BETWEEN_PRESSES
            if steps % 100 == 0:
                unbalanced = yade.utils.unbalancedForce()
                report(steps)
        for number in range(self.count):
            state = yade.O.bodies[number].state
            state.vel, state.angVel = (0, 0, 0), (0, 0, 0)
        settled = unbalanced <= SETTLED
        return self.surcharge_error(), {
            "settled": settled,
            "settling_steps": steps,
            "settling_unbalanced_force": float(unbalanced),
        }

    def press(self) -> None:
        """Put the surcharge on the discs that are seen from above now."""
        x, y = (yade.utils.coordsAndDisplacements(axis)[0][: self.count] for axis in (0, 1))
        surface = punch_surcharge.seen_from_above(np.array(x), np.array(y), self.radii, self.free_spans, self.spacing)
        put = yade.O.forces.setPermF
        for number in np.setdiff1d(self.surface.numbers, surface.numbers).tolist():
            put(number, (0, 0, 0))
        loads = self.values["confining_stress"] * surface.widths
        for number, load in zip(surface.numbers.tolist(), loads.tolist(), strict=True):
            put(number, (0, -load, 0))
        self.surface = surface

    def load(self, strain_rate: float) -> None:
        """Set the punch moving down."""
        self.punch.state.vel = (0, -strain_rate * self.punch_width, 0)

    def advance(self, count: int) -> float:
        """Make `count` steps; return the sum over them of the surcharge's relative error."""
        packing.step(count)
        materials.keep_rolling_stiffness(self.values, self.rules, self.mean_radius)
        return count * self.surcharge_error()

    def surcharge_error(self) -> float:
        """Total surcharge over what the free surface should bear, minus 1."""
        return float(self.surface.widths.sum()) / self.free_width - 1

    def axial_strain(self) -> float:
        """Settlement of the punch since the start, over its width."""
        face = self.punch.state.pos[1] - self.punch.shape.extents[1]
        return float(self.punch_start - face) / self.punch_width

    def history_row(self, servo_error: float) -> dict[str, float]:
        """One row of the history, in the columns of the biaxial test: `docs/punch.md` has what they mean here.

        `imbalance`, no column of the file, is the vertical force that walls, punch and surcharge leave over, over
        that on the bottom.
        """
        force = {wall: yade.O.forces.f(body) for wall, body in self.walls.body.items()}
        at_walls = walls.contacts(self.walls)
        surface = self.surface.mean_height - self.bottom
        pressure = force[walls.PUNCH][1] / self.punch_width
        surcharge = self.values["confining_stress"] * float(self.surface.widths.sum())
        vertical = sum(on_wall[1] for on_wall in force.values())
        return {
            "axial_strain": self.axial_strain(),
            "lateral_strain": 0.0,
            "axial_stress": pressure,
            "lateral_stress": (force[walls.RIGHT][0] - force[walls.LEFT][0]) / (2 * surface),
            "stress_ratio": pressure / self.values["confining_stress"],
            "solid_fraction": self.disc_area / self.area(),
            "coordination": packing.coordination(self.count, len(at_walls)),
            "unbalanced_force": yade.utils.unbalancedForce(),
            "kinetic_energy": yade.utils.kineticEnergy(),
            "elastic_energy": materials.elastic_energy(self.rules, at_walls),
            "servo_error": servo_error,
            "time": yade.O.time,
            "iteration": yade.O.iter,
            "imbalance": (vertical + surcharge) / -force[walls.BOTTOM][1],
        }

    def area(self) -> float:
        """Area [m^2] between walls, punch and the surface the discs show from above."""
        under_punch = self.height - self.axial_strain() * self.punch_width
        return self.free_width * (self.surface.mean_height - self.bottom) + self.punch_width * under_punch

    def tables(self, previous_rotation: np.ndarray | None) -> tuple[export.Table, export.Table]:
        """Particle table and contact table; the surcharge is in it as contacts with the top wall (-4).

        `previous_rotation`: (count,) of the last snapshot [rad].
        """
        particles, contacts = self.reader.tables(previous_rotation)
        loads = self.surcharge_table(particles)
        return particles, export.in_order(
            {name: np.concatenate((column, loads[name])) for name, column in contacts.items()}
        )

    def surcharge_table(self, particles: export.Table) -> export.Table:
        """Contact table of the dead loads: each on top of its disc, pushing straight down."""
        numbers, count = self.surface.numbers, len(self.surface.numbers)
        force = self.values["confining_stress"] * self.surface.widths
        stiffness = np.full(count, DEAD_STIFFNESS * self.rules.normal_stiffness)
        none = np.zeros(count)
        return {
            "id1": numbers,
            "id2": np.full(count, walls.TOP),
            "x": particles["x"][numbers],
            "y": particles["y"][numbers] + self.radii[numbers],
            "nx": none,
            "ny": np.ones(count),
            "overlap": force / stiffness,
            "fn": force,
            "ft": none,
            "moment": none,
            "kn": stiffness,
            "kt": stiffness,
            "kr": none,
            "friction": none,
            "rolling_limit": none,
        }

    def escaped(self, particles: export.Table) -> int:
        """Count discs whose centre is beyond a wall or in the punch."""
        x, y = particles["x"], particles["y"]
        out = (x <= self.left) | (x >= self.right) | (y <= self.bottom)
        face = self.punch_start - self.axial_strain() * self.punch_width
        out |= (x > self.punch_left) & (x < self.punch_right) & (y > face)
        return int(out.sum())

    def derived(self) -> dict[str, Quantity]:
        """Size of the bed at the start, width and velocity of the punch."""
        return {
            "initial_width": (self.width, "m"),
            "initial_height": (self.height, "m"),
            "punch_width": (self.punch_width, "m"),
            "punch_velocity": (-self.punch.state.vel[1], "m/s"),
        }

    def figures(self, loading: Sequence[Mapping[str, float]], strain_rate: float) -> dict[str, float]:
        """Inertial number, and the largest imbalance of the vertical forces on the bed."""
        confining_stress = self.values["confining_stress"]
        return {
            "inertial_number": strain_rate * math.sqrt(float(self.masses.mean()) / confining_stress),
            "imbalance_max": max(abs(row["imbalance"]) for row in loading),
        }
