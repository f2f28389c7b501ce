"""Rigid walls around the sample: driven at a given velocity, free to slide under a given pressure, or at rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from yade_scripts import materials

try:
    import yade
except ImportError:
    yade = None

LEFT, RIGHT, BOTTOM, TOP, PUNCH = -1, -2, -3, -4, -5
# Inward direction of each wall: axis, and the sign of a push on the sample.
INWARD = {LEFT: (0, 1.0), RIGHT: (0, -1.0), BOTTOM: (1, 1.0), TOP: (1, -1.0)}
THICKNESS = 10  # half thickness of a wall over the largest radius; thin walls let fast discs through


class Walls(NamedTuple):
    """The walls in the simulation.

    Attributes:
        body: body number in YADE of each wall (-1 left, -2 right, -3 bottom, -4 top, -5 punch).
        half_thickness: distance from a box's centre to its inner face [m].
    """

    body: dict[int, int]
    half_thickness: float

    @property
    def numbers(self) -> dict[int, int]:
        """Wall number in the export of each body number."""
        return {body: wall for wall, body in self.body.items()}


def add_walls(
    faces: Sequence[float], largest_radius: float, rules: materials.ContactRules, sides: Sequence[int] = tuple(INWARD)
) -> Walls:
    """Put boxes at the `sides` of the rectangle `faces` = (left, right, bottom, top) [m], at rest."""
    left, right, bottom, top = (float(face) for face in faces)
    thick = THICKNESS * largest_radius
    centre = ((left + right) / 2, (bottom + top) / 2)
    reach = 2 * max(right - left, top - bottom) + 2 * thick  # long enough to close the corners at any strain
    material = yade.O.materials.append(materials.wall_material(rules))
    boxes = {
        LEFT: ((left - thick, centre[1], 0), (thick, reach, thick)),
        RIGHT: ((right + thick, centre[1], 0), (thick, reach, thick)),
        BOTTOM: ((centre[0], bottom - thick, 0), (reach, thick, thick)),
        TOP: ((centre[0], top + thick, 0), (reach, thick, thick)),
    }
    body = {}
    for wall in sides:
        body[wall] = add_box(*boxes[wall], material)
    return Walls(body, thick)


def add_box(middle: Sequence[float], half: Sequence[float], material: Any) -> int:
    """Put a box at rest, given by its middle and half extents [m], into the simulation; return its body number."""
    number = int(yade.O.bodies.append(yade.utils.box(middle, half, fixed=True, material=material)))
    yade.O.forces.setPermF(number, (0, 0, 0))  # YADE crashes on reading a permanent force never set
    return number


def walls_after(count: int, largest_radius: float, sides: Sequence[int] = tuple(INWARD)) -> Walls:
    """Return the walls of a loaded simulation, which had been put there, in this order, after `count` discs."""
    return Walls({wall: count + place for place, wall in enumerate(sides)}, THICKNESS * largest_radius)


def faces(walls: Walls) -> np.ndarray:
    """(4,) positions [m] of the inner faces: left, right, bottom, top."""
    bodies = yade.O.bodies
    return np.array(
        [
            bodies[walls.body[wall]].state.pos[axis] + sign * walls.half_thickness
            for wall, (axis, sign) in INWARD.items()
        ]
    )


def extents(walls: Walls) -> tuple[float, float]:
    """Width and height [m] of the space between the walls."""
    left, right, bottom, top = faces(walls)
    return float(right - left), float(top - bottom)


def drive(walls: Walls, wall: int, inward_velocity: float) -> None:
    """Move a wall into the sample at a constant velocity [m/s], whatever the forces on it."""
    axis, sign = INWARD[wall]
    velocity = [0.0, 0.0, 0.0]
    velocity[axis] = sign * inward_velocity
    state = yade.O.bodies[walls.body[wall]].state
    state.blockedDOFs = "xyzXYZ"
    state.vel = velocity
    yade.O.forces.setPermF(walls.body[wall], (0, 0, 0))


def release(walls: Walls, wall: int, mass: float) -> None:
    """Let a wall of the given mass [kg] slide freely along its normal.

    A free wall under a constant push has no gain to tune and no lag: at any steady velocity the sample's stress is the
    push itself, and differs from it only by the wall's own inertia while the wall accelerates.
    """
    axis, _ = INWARD[wall]
    state = yade.O.bodies[walls.body[wall]].state
    state.mass = mass
    state.blockedDOFs = ("yzXYZ", "xzXYZ")[axis]
    state.vel = (0, 0, 0)


def push(walls: Walls, pressed: Sequence[int], stress: float) -> None:
    """Press the walls `pressed` on the sample with `stress` [N/m] times the length they confine now."""
    width, height = extents(walls)
    for wall in pressed:
        axis, sign = INWARD[wall]
        force = [0.0, 0.0, 0.0]
        force[axis] = sign * stress * (height, width)[axis]
        yade.O.forces.setPermF(walls.body[wall], force)


@contextmanager
def held(walls: Walls) -> Iterator[None]:
    """Hold the free walls meanwhile, so that YADE's measures over all free bodies count the discs alone."""
    states = [yade.O.bodies[body].state for body in walls.body.values()]
    blocked = [state.blockedDOFs for state in states]
    try:
        for state in states:
            state.blockedDOFs = "xyzXYZ"
        yield
    finally:
        for state, degrees in zip(states, blocked, strict=True):
            state.blockedDOFs = degrees


def contacts(walls: Walls) -> list[Any]:
    """Contacts between discs and walls that bear a force."""
    return [contact for body in walls.body.values() for contact in yade.O.bodies[body].intrs() if contact.isReal]


def stresses(walls: Walls) -> tuple[float, float]:
    """Lateral (x) and axial (y) stress [N/m], compression positive: contact force on a wall over its length."""
    width, height = extents(walls)
    forces = yade.O.forces
    total = [0.0, 0.0]
    for wall, (axis, sign) in INWARD.items():
        body = walls.body[wall]
        total[axis] -= sign * (forces.f(body)[axis] - forces.permF(body)[axis])
    return total[0] / (2 * height), total[1] / (2 * width)
