"""Facts of the whole sample at one instant: box, solid fraction, coordination, stress from contacts and from walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcechain.arrays import BoolArray, FloatArray, float_array, freeze
from forcechain.observe.neighbours import find_neighbours
from forcechain.observe.snapshot import Snapshot
from forcechain.observe.stress import particle_stress

LEFT, RIGHT, BOTTOM, TOP = -1, -2, -3, -4
FEWEST_CONTACTS = 2  # with friction two contacts can hold a disc, one cannot


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """The rectangle between four walls [m]."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def width(self) -> float:
        """Distance between left and right wall [m]."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Distance between bottom and top wall [m]."""
        return self.top - self.bottom

    @property
    def area(self) -> float:
        """Area between the walls [m^2]."""
        return self.width * self.height


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordination:
    """Mean numbers of contacts that bear a force, contacts with walls included.

    Attributes:
        every_particle: contacts a particle, over all particles.
        without_rattlers: contacts a particle, over those that are no rattlers, contacts with rattlers left out.
        rattler: (n_particles,) has fewer than two contacts with walls or with particles that are no rattlers.
    """

    every_particle: float
    without_rattlers: float
    rattler: BoolArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.rattler)

    @property
    def rattler_share(self) -> float:
        """Rattlers over all particles."""
        return float(self.rattler.mean())


def box_of(snapshot: Snapshot) -> Box:
    """Return the box between the walls, read from the contacts with them.

    A wall's face is where the overlap of its contacts ends, from the centre along the normal; the mean over its
    contacts is taken. Raises ValueError if one of the four walls is not touched.
    """
    first, second = snapshot.contact_ids.T
    faces = {}
    for wall, axis, name in ((LEFT, 0, "left"), (RIGHT, 0, "right"), (BOTTOM, 1, "bottom"), (TOP, 1, "top")):
        rows = np.flatnonzero(second == wall)
        if not len(rows):
            raise ValueError(f"contacts: expected some with the {name} wall ({wall}), found none")
        particle = first[rows]
        reach = snapshot.radius[particle] - snapshot.overlap[rows]
        face = snapshot.position[particle, axis] + reach * snapshot.contact_normal[rows, axis]
        faces[name] = float(face.mean())
    return Box(**faces)


def solid_fraction(snapshot: Snapshot, area: float) -> float:
    """Return the area of all discs over `area` [m^2]; overlaps count twice, as they do in YADE's porosity."""
    if not area > 0:
        raise ValueError(f"area: expected above 0, found {area}")
    return float(np.pi * np.sum(snapshot.radius**2) / area)


def coordination(snapshot: Snapshot) -> Coordination:
    """Return the coordination numbers of `snapshot`; rattlers are removed until none is left.

    A sample of rattlers alone has a coordination of 0 without them.
    """
    loaded = (snapshot.normal_force != 0) | (snapshot.tangential_force != 0)
    neighbours = find_neighbours(snapshot)
    owner = np.repeat(np.arange(snapshot.n_particles), np.diff(neighbours.start))
    bears = loaded[neighbours.contact]
    owner, partner = owner[bears], neighbours.partner[bears]
    rattler = np.zeros(snapshot.n_particles, dtype=np.bool_)
    while True:
        holds = ~rattler[owner] & ((partner < 0) | ~rattler[np.maximum(partner, 0)])
        contacts = np.bincount(owner[holds], minlength=snapshot.n_particles)
        loose = (contacts < FEWEST_CONTACTS) & ~rattler
        if not loose.any():
            break
        rattler |= loose
    held = np.count_nonzero(~rattler)
    return Coordination(
        every_particle=len(owner) / snapshot.n_particles,
        without_rattlers=float(contacts[~rattler].sum() / held) if held else 0.0,
        rattler=rattler,
    )


def contact_stress(snapshot: Snapshot, area: float) -> FloatArray:
    """Return the mean stress (2, 2) [N/m] over `area` [m^2] from all contacts, compression positive, symmetrised."""
    if not area > 0:
        raise ValueError(f"area: expected above 0, found {area}")
    stress: FloatArray = np.sum(particle_stress(snapshot, weight="none"), axis=0) / area
    return stress


def wall_stress(snapshot: Snapshot, area: float) -> FloatArray:
    """Return the mean stress (2, 2) [N/m] over `area` [m^2] from the forces at the walls, symmetrised.

    −(1/A) Σ f ⊗ x over the contacts with walls, f the force on the particle and x the contact point, counted from the
    mean of the centres. In equilibrium this is `contact_stress`; the difference is what is out of balance.
    """
    if not area > 0:
        raise ValueError(f"area: expected above 0, found {area}")
    at_wall = snapshot.contact_ids[:, 1] < 0
    force_on_wall = snapshot.contact_force[at_wall]
    arm = snapshot.contact_point[at_wall] - snapshot.position.mean(axis=0)
    moment = force_on_wall.T @ arm
    stress: FloatArray = 0.5 * (moment + moment.T) / area
    return stress


def stress_ratio(stress: FloatArray) -> float:
    """Return (σ₁ − σ₂)/(σ₁ + σ₂) of the principal values of a stress (2, 2).

    Raises ValueError if the mean stress is not above zero.

    >>> stress_ratio([[1.0, 0.0], [0.0, 3.0]])
    0.5
    """
    tensor = float_array(stress, "stress", (2, 2))
    mean = 0.5 * (tensor[0, 0] + tensor[1, 1])
    if not mean > 0:
        raise ValueError(f"stress: expected a mean above 0, found {mean:g}")
    return float(np.hypot(0.5 * (tensor[0, 0] - tensor[1, 1]), 0.5 * (tensor[0, 1] + tensor[1, 0])) / mean)


def unbalanced_forces(snapshot: Snapshot) -> tuple[FloatArray, FloatArray]:
    """Return the resultant force (n_particles, 2) [N] and moment (n_particles,) [N m] of the contacts of each particle.

    The moment counts about the centre: of the forces at the contact points, and the contacts' own.
    """
    n = snapshot.n_particles
    force = snapshot.contact_force
    first, second = snapshot.contact_ids.T
    total_force, total_moment = np.zeros((n, 2)), np.zeros(n)
    for side, rows, sign in ((first, np.arange(len(first)), -1.0), (second, np.flatnonzero(second >= 0), 1.0)):
        particle = side[rows]
        pushed = sign * force[rows]
        arm = snapshot.contact_point[rows] - snapshot.position[particle]
        turning = arm[:, 0] * pushed[:, 1] - arm[:, 1] * pushed[:, 0] + sign * snapshot.moment[rows]
        for axis in (0, 1):
            total_force[:, axis] += np.bincount(particle, pushed[:, axis], n)
        total_moment += np.bincount(particle, turning, n)
    return total_force, total_moment
