"""The tables of a snapshot of our own discs, read quickly: what follows from positions and rules is not read at all.

Between our discs normal, overlap, contact point, normal force and all stiffnesses follow from ids and positions. Left
to read are ids, tangential forces, moments, the contacts with walls, and the discs' states: from memory
(`memory_layout`), or through YADE's interface where that is not to be had. Both ways give the same bytes, one in an
eighth of the other's time.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from yade_scripts import export, materials, memory_layout

try:
    import yade
except ImportError:
    yade = None

VARIABLE = "FORCECHAIN_TABLES"  # environment: "interface" keeps from reading memory
MEMORY, INTERFACE = "memory", "interface"
SAMPLED = 8  # discs, contacts between them and contacts with walls that are looked at again in every snapshot
AGREEMENT = 1e-9  # of the largest normal force: between those in memory and those that follow from positions


class Readings(NamedTuple):
    """What has to be read of a simulation.

    Attributes:
        states: (7, n) position, velocity, spin, and sine and cosine of half the rotation, of the discs.
        ids: (m, 2) bodies of the contacts between discs.
        shear_force: (2, m) on the second body [N].
        moment: (m,) about z, on the second body [N m].
        at_walls: contact table of the contacts with walls, in no order.
        normal_force: (2, m) on the second body [N], where it was read: it follows from the positions.
    """

    states: np.ndarray
    ids: np.ndarray
    shear_force: np.ndarray
    moment: np.ndarray
    at_walls: export.Table
    normal_force: np.ndarray | None = None


class QuickTables:
    """Reads the tables of one simulation whose discs are bodies 0 to n-1 under our contact rules.

    Attributes:
        radii: (n,) [m].
        walls: wall number of each wall's body number.
        rules: of the contacts.
        mean_radius: [m], replaces the pair's radii in the rolling stiffness; None: it does not.
        way: how the simulation is read, "memory" or "interface"; "" before the first table.
    """

    def __init__(
        self, radii: np.ndarray, walls: Mapping[int, int], rules: materials.ContactRules, mean_radius: float | None
    ) -> None:
        """Nothing is read yet: the simulation may still change."""
        self.radii, self.walls, self.rules, self.mean_radius = radii, walls, rules, mean_radius
        self.way = ""
        self._layout: memory_layout.Layout | None = None
        self._generator = np.random.default_rng(0)  # which discs and contacts are looked at again

    def tables(self, previous_rotation: np.ndarray | None) -> tuple[export.Table, export.Table]:
        """Particle table and contact table of what is simulated now; see `export.tables`."""
        if not self.way:
            self._find_a_way()
        if self._layout is not None:
            read = by_memory(self._layout, len(self.radii), self.walls)
            if read is not None and self._sample_agrees(read):
                particles = self._particles(read, previous_rotation)
                between = self._between_discs(particles, read)
                if _agrees(between, read):
                    return particles, _joined(between, read.at_walls)
            self._layout, self.way = None, INTERFACE  # whatever it was that has been read, it is not these contacts
            print("tables are read through YADE's interface from here on: its memory has something else", flush=True)
        read = by_interface(len(self.radii), self.walls)
        particles = self._particles(read, previous_rotation)
        return particles, _joined(self._between_discs(particles, read), read.at_walls)

    def _find_a_way(self) -> None:
        """Rely on the memory if YADE's interface says of all that is simulated now what the memory says."""
        self.way = INTERFACE
        if os.environ.get(VARIABLE) == INTERFACE:
            return
        count = len(self.radii)
        layout = memory_layout.learn(count)
        read = None if layout is None else by_memory(layout, count, self.walls)
        if read is None:
            return
        told = by_interface(count, self.walls)
        same = all(np.array_equal(one, other) for one, other in zip(read[:4], told[:4], strict=True))
        if same and _same(export.in_order(read.at_walls), export.in_order(told.at_walls)):
            self._layout, self.way = layout, MEMORY

    def _sample_agrees(self, read: Readings) -> bool:
        """Whether YADE's interface says of some discs and contacts, others each time, what was read of them.

        At the start forces and velocities are zero, which any place may be: only later can they be told apart.
        """

        def some(count: int) -> np.ndarray:
            return self._generator.integers(count, size=min(count, SAMPLED))

        for number in some(len(self.radii)).tolist():
            if _state(number) != tuple(read.states[:, number].tolist()):
                return False
        for number in some(len(read.ids)).tolist():
            physics = yade.O.interactions[tuple(read.ids[number].tolist())].phys
            told = physics.shearForce[0], physics.shearForce[1], physics.moment_bending[2]
            if told != (*read.shear_force[:, number].tolist(), float(read.moment[number])):
                return False
        chosen = some(len(read.at_walls["id1"]))
        rows = {name: values[chosen] for name, values in read.at_walls.items()}
        bodies = {wall: body for body, wall in self.walls.items()}
        ends = zip(rows["id1"].tolist(), rows["id2"].tolist(), strict=True)
        pairs = [(bodies.get(one, one), bodies.get(other, other)) for one, other in ends]
        numbers = {body: self.walls.get(body, body) for pair in pairs for body in pair}
        told_rows = export.contact_table(numbers, [yade.O.interactions[pair] for pair in pairs])
        return _same(told_rows, export.in_order(rows))

    def _particles(self, read: Readings, previous_rotation: np.ndarray | None) -> export.Table:
        x, y, vx, vy, spin, sine, cosine = read.states
        return {
            "id": np.arange(len(self.radii)),
            "radius": self.radii.copy(),
            "x": x,
            "y": y,
            "rotation": export.unwrapped(2 * np.arctan2(sine, cosine), previous_rotation),
            "vx": vx,
            "vy": vy,
            "spin": spin,
        }

    def _between_discs(self, particles: export.Table, read: Readings) -> export.Table:
        """Contact table of the contacts between discs, in the order of `read`."""
        rules, moments = self.rules, self.rules.bears_moment
        one, other = read.ids[:, 0], read.ids[:, 1]
        radius, x, y = particles["radius"], particles["x"], particles["y"]
        branch_x, branch_y = x[other] - x[one], y[other] - y[one]
        distance = np.hypot(branch_x, branch_y)
        nx, ny = branch_x / distance, branch_y / distance
        overlap = radius[one] + radius[other] - distance
        arm = radius[one] - overlap / 2
        smaller = np.minimum(radius[one], radius[other])
        squared = radius[one] * radius[other] if self.mean_radius is None else np.full(len(one), self.mean_radius**2)
        return {
            "id1": one,
            "id2": other,
            "x": x[one] + arm * nx,
            "y": y[one] + arm * ny,
            "nx": nx,
            "ny": ny,
            "overlap": overlap,
            "fn": rules.normal_stiffness * overlap,
            "ft": read.shear_force[1] * nx - read.shear_force[0] * ny,
            "moment": read.moment if moments else np.zeros(len(one)),
            "kn": np.full(len(one), rules.normal_stiffness),
            "kt": np.full(len(one), rules.normal_stiffness * rules.tangential_stiffness_ratio),
            "kr": rules.normal_stiffness * rules.rolling_stiffness_ratio * squared * moments,
            "friction": np.full(len(one), math.tan(math.atan(rules.friction))),  # as YADE keeps it
            "rolling_limit": rules.rolling_friction * smaller * moments,
        }


def _same(one: export.Table, other: export.Table) -> bool:
    return all(np.array_equal(one[name], other[name]) for name in other)


def _agrees(between: export.Table, read: Readings) -> bool:
    """Whether the normal forces read from memory are those that follow from the discs' positions."""
    if read.normal_force is None:
        return False
    along = read.normal_force[0] * between["nx"] + read.normal_force[1] * between["ny"]
    fn = between["fn"]
    return bool(np.all(np.abs(along - fn) <= AGREEMENT * np.abs(fn).max(initial=0.0)))


def _joined(between: export.Table, at_walls: export.Table) -> export.Table:
    return export.in_order({name: np.concatenate((column, at_walls[name])) for name, column in between.items()})


def by_memory(layout: memory_layout.Layout, count: int, walls: Mapping[int, int]) -> Readings | None:
    """Read a simulation from memory; None where its contacts are not where they should be."""
    try:
        return _by_memory(layout, count, walls)
    except LookupError:
        return None


def _by_memory(layout: memory_layout.Layout, count: int, walls: Mapping[int, int]) -> Readings | None:
    found = memory_layout.contacts(layout)
    if found is None:
        return None

    def vector(objects: np.ndarray, attribute: str) -> np.ndarray:
        return np.stack([memory_layout.values(layout, objects, attribute, part) for part in (0, 1)])

    with_wall = (found.ids >= count).any(axis=1)
    discs, at_walls = found.those(~with_wall), found.those(with_wall)
    states = [memory_layout.values(layout, layout.states, *number) for number in STATE_NUMBERS]
    return Readings(
        states=np.stack(states),
        ids=discs.ids,
        shear_force=vector(discs.physics, "shearForce"),
        moment=memory_layout.values(layout, discs.physics, "moment_bending", 2),
        at_walls=_wall_table(layout, at_walls, count, walls),
        normal_force=vector(discs.physics, "normalForce"),
    )


STATE_NUMBERS = (("pos", 0), ("pos", 1), ("vel", 0), ("vel", 1), ("angVel", 2), ("ori", 2), ("ori", 3))


def _wall_table(
    layout: memory_layout.Layout, contacts: memory_layout.Contacts, count: int, walls: Mapping[int, int]
) -> export.Table:
    def of(objects: np.ndarray, attribute: str, part: int = 0) -> np.ndarray:
        return memory_layout.values(layout, objects, attribute, part)

    geometry, physics = contacts.geometry, contacts.physics
    numbers = np.arange(max((count - 1, *walls)) + 1)
    numbers[list(walls)] = list(walls.values())
    nx, ny = of(geometry, "normal", 0), of(geometry, "normal", 1)
    none = np.zeros(len(physics))
    return {
        "id1": numbers[contacts.ids[:, 0]],
        "id2": numbers[contacts.ids[:, 1]],
        "x": of(geometry, "contactPoint", 0),
        "y": of(geometry, "contactPoint", 1),
        "nx": nx,
        "ny": ny,
        "overlap": of(geometry, "penetrationDepth"),
        "fn": of(physics, "normalForce", 0) * nx + of(physics, "normalForce", 1) * ny,
        "ft": of(physics, "shearForce", 1) * nx - of(physics, "shearForce", 0) * ny,
        "moment": none,
        "kn": of(physics, "kn"),
        "kt": of(physics, "ks"),
        "kr": none,
        "friction": of(physics, "tangensOfFrictionAngle"),
        "rolling_limit": none,
    }


def _state(body: int) -> tuple[float, ...]:
    state = yade.O.bodies[body].state
    position, velocity, turn = state.pos, state.vel, state.ori
    return (position[0], position[1], velocity[0], velocity[1], state.angVel[2], turn[2], turn[3])


def by_interface(count: int, walls: Mapping[int, int]) -> Readings:
    """Read a simulation through YADE's interface."""
    states = []
    for body in range(count):
        states.append(_state(body))
    ids: list[int] = []
    numbers: list[float] = []
    at_walls = []
    for contact in yade.O.interactions:
        one, other = contact.id1, contact.id2
        if one >= count or other >= count:
            at_walls.append(contact)
            continue
        physics = contact.phys
        shear = physics.shearForce
        ids.extend((one, other))
        numbers.extend((shear[0], shear[1], physics.moment_bending[2]))
    fx, fy, moment = np.array(numbers, dtype=np.float64).reshape(-1, 3).T
    touching = {number: number for contact in at_walls for number in (contact.id1, contact.id2) if number < count}
    return Readings(
        states=np.array(states, dtype=np.float64).reshape(count, 7).T.copy(),
        ids=np.array(ids, dtype=np.int64).reshape(-1, 2),
        shear_force=np.stack((fx, fy)),
        moment=moment.copy(),
        at_walls=export.contact_table({**touching, **walls}, at_walls),
    )
