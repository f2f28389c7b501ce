"""The sample in the simulation: discs between four walls, how it is loaded, and what is measured on it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from yade_scripts import checkpoint, export, materials, packing, quick_tables, walls
from yade_scripts.recorder import Quantity

try:
    import yade
except ImportError:
    yade = None


class Sample:
    """Discs and walls of a biaxial test.

    Attributes:
        count: number of discs.
        radii: (count,) [m].
        mean_radius: [m].
        disc_area: sum of the discs' areas [m^2].
        masses: (count,) [kg].
        walls: the four walls in the simulation.
        width, height: distances between opposite walls at the start [m].
        reader: of the tables.
    """

    def __init__(self, values: Mapping[str, Any], start: packing.Packing, build: bool = True) -> None:
        """Put a packing's discs and walls into an empty simulation, at rest, with the contact rules of `values`.

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
        left, right, bottom, top = start.faces
        self.width, self.height = float(right - left), float(top - bottom)
        largest = float(start.radii.max())
        if build:
            materials.add_discs(start.radii, start.positions, self.masses, inertias, self.rules)
            self.walls = walls.add_walls(start.faces, largest, self.rules)
            yade.O.engines = materials.engines(self.rules, values["damping"])
            for wall in (walls.LEFT, walls.RIGHT):
                walls.release(self.walls, wall, self.wall_mass)
        else:
            self.walls = walls.walls_after(self.count, largest)
        mean_radius = self.mean_radius if values["rolling_stiffness_radius"] == "mean" else None
        self.reader = quick_tables.QuickTables(self.radii, self.walls.numbers, self.rules, mean_radius)

    @property
    def wall_mass(self) -> float:
        """Mass of each side wall [kg]."""
        return packing.wall_mass(float(self.masses.mean()), self.count)

    def settle(self, _report: packing.Report) -> tuple[float, dict[str, Any]]:
        """Find the contacts, nothing moved yet; return the confining stress's error. (The packing has settled.)"""
        yade.O.dt = checkpoint.AT_REST
        packing.step(1)
        lateral, _ = walls.stresses(self.walls)
        return lateral / self.values["confining_stress"] - 1, {}

    def press(self) -> None:
        """Push the side walls with the confining stress over the height they confine now."""
        walls.push(self.walls, (walls.LEFT, walls.RIGHT), self.values["confining_stress"])

    def load(self, strain_rate: float) -> None:
        """Set the bottom and top walls moving, and the discs with them as in a homogeneous compression.

        Walls that start into a sample at rest send a stress wave through it, some per cent of the confining stress.
        """
        for wall in (walls.BOTTOM, walls.TOP):
            walls.drive(self.walls, wall, strain_rate * self.height / 2)
        _, _, bottom, top = walls.faces(self.walls)
        for number in range(self.count):
            state = yade.O.bodies[number].state
            state.vel = (0, -strain_rate * (state.pos[1] - (bottom + top) / 2), 0)

    def advance(self, count: int) -> float:
        """Make `count` steps; return the sum over them of the confining stress's relative error."""
        advance, force = yade.O.step, yade.O.forces.f
        left, right = self.walls.body[walls.LEFT], self.walls.body[walls.RIGHT]
        surplus = 0.0
        for _ in range(count):
            advance()
            # The force on a free wall is what the contacts exceed the push by.
            surplus += force(right)[0] - force(left)[0]
        materials.keep_rolling_stiffness(self.values, self.rules, self.mean_radius)
        _, height = walls.extents(self.walls)
        return surplus / (2 * self.values["confining_stress"] * height)

    def axial_strain(self) -> float:
        """Engineering strain along y since the start, compression positive."""
        return 1 - walls.extents(self.walls)[1] / self.height

    def history_row(self, servo_error: float) -> dict[str, float]:
        """One row of the history, with the confining stress's mean error since the row before."""
        width, height = walls.extents(self.walls)
        lateral, axial = walls.stresses(self.walls)
        at_walls = walls.contacts(self.walls)
        with walls.held(self.walls):
            unbalanced, kinetic = yade.utils.unbalancedForce(), yade.utils.kineticEnergy()
        return {
            "axial_strain": 1 - height / self.height,
            "lateral_strain": 1 - width / self.width,
            "axial_stress": axial,
            "lateral_stress": lateral,
            "stress_ratio": (axial - lateral) / (axial + lateral),
            "solid_fraction": self.disc_area / (width * height),
            "coordination": packing.coordination(self.count, len(at_walls)),
            "unbalanced_force": unbalanced,
            "kinetic_energy": kinetic,
            "elastic_energy": materials.elastic_energy(self.rules, at_walls),
            "servo_error": servo_error,
            "time": yade.O.time,
            "iteration": yade.O.iter,
        }

    def tables(self, previous_rotation: np.ndarray | None) -> tuple[export.Table, export.Table]:
        """Particle table and contact table; `previous_rotation`: (count,) of the last snapshot [rad]."""
        return self.reader.tables(previous_rotation)

    def escaped(self, particles: export.Table) -> int:
        """Count discs whose centre is outside the walls."""
        left, right, bottom, top = walls.faces(self.walls)
        inside = (particles["x"] > left) & (particles["x"] < right) & (particles["y"] > bottom) & (particles["y"] < top)
        return int((~inside).sum())

    def derived(self) -> dict[str, Quantity]:
        """Size of the sample at the start, and mass of each side wall."""
        return {
            "initial_width": (self.width, "m"),
            "initial_height": (self.height, "m"),
            "wall_mass": (self.wall_mass, "kg"),
        }

    def figures(self, loading: Sequence[Mapping[str, float]], strain_rate: float) -> dict[str, float]:
        """Inertial number, and the largest error of the confining stress at the instants of the rows.

        The latter is told but not judged: a disc may just rattle on a wall.
        """
        confining_stress = self.values["confining_stress"]
        lateral = sum(row["lateral_stress"] for row in loading) / len(loading)
        return {
            "servo_error_instant_max": max(abs(row["lateral_stress"] / confining_stress - 1) for row in loading),
            "inertial_number": strain_rate * math.sqrt(float(self.masses.mean()) / lateral),
        }
