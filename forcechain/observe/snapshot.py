"""One instant of a simulation: particles, contacts and walls as arrays, checked once and read-only from then on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from forcechain.arrays import FloatArray, IntArray, float_array, freeze, int_array

_Array = TypeVar("_Array", FloatArray, IntArray)

LOWEST_WALL = -5
LARGEST, SMALLEST = 1e50, 1e-50  # SI: beyond these, products such as energies leave the range of a float
NORMAL_TOLERANCE = 1e-6  # a unit normal written with 7 digits still passes


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """The particles and contacts of one instant, SI units, two dimensions, compression positive.

    Particles are numbered 0 to n-1. A wall is a negative number (-1 left, -2 right, -3 bottom, -4 top, -5 punch) and
    stands second in its contacts.

    Attributes:
        axial_strain: engineering strain along y, compression positive.
        time: simulated time [s].
        iteration: step number.
        radius: (n_particles,) [m].
        position: (n_particles, 2) centres [m].
        rotation: (n_particles,) about z since the start, unwrapped [rad].
        velocity: (n_particles, 2) [m/s].
        spin: (n_particles,) [rad/s].
        contact_ids: (n_contacts, 2) particle, then particle or wall.
        contact_point: (n_contacts, 2) [m].
        contact_normal: (n_contacts, 2) unit vector from the first to the second.
        overlap: (n_contacts,) [m].
        normal_force: (n_contacts,) compression positive [N].
        tangential_force: (n_contacts,) on the second, along the normal turned by +90 degrees [N].
        moment: (n_contacts,) about z, on the second [N m].
        normal_stiffness, tangential_stiffness: (n_contacts,) [N/m].
        rolling_stiffness: (n_contacts,) [N m/rad], zero where the contact bears no moment.
        friction: (n_contacts,) coefficient of sliding friction.
        rolling_limit: (n_contacts,) largest moment over normal force [m].

    Raises:
        ValueError: an array of the wrong shape or kind, a number that is not finite, a contact with a particle that
            does not exist, a normal that is not of unit length, a radius or stiffness that is not positive, a
            magnitude beyond 1e50, or a radius or stiffness below 1e-50. One line with table, row, expected and found.
    """

    axial_strain: float
    time: float
    iteration: int
    radius: FloatArray
    position: FloatArray
    rotation: FloatArray
    velocity: FloatArray
    spin: FloatArray
    contact_ids: IntArray
    contact_point: FloatArray
    contact_normal: FloatArray
    overlap: FloatArray
    normal_force: FloatArray
    tangential_force: FloatArray
    moment: FloatArray
    normal_stiffness: FloatArray
    tangential_stiffness: FloatArray
    rolling_stiffness: FloatArray
    friction: FloatArray
    rolling_limit: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze every array."""
        n_particles = len(np.atleast_1d(self.radius))
        n_contacts = len(np.atleast_1d(self.contact_ids))
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(("radius", "rotation", "spin"), (n_particles,))
        shapes |= dict.fromkeys(("position", "velocity"), (n_particles, 2))
        shapes |= dict.fromkeys(("contact_point", "contact_normal"), (n_contacts, 2))
        shapes |= dict.fromkeys(CONTACT_SCALARS, (n_contacts,))
        for name, shape in shapes.items():
            object.__setattr__(self, name, _own(float_array(getattr(self, name), name, shape)))
            self._check_magnitude(name)
        ids = int_array(self.contact_ids, "contact_ids", (n_contacts, 2))
        object.__setattr__(self, "contact_ids", _own(ids))
        for name in ("axial_strain", "time"):
            value = float(getattr(self, name))
            if not np.isfinite(value):
                raise ValueError(f"{name}: expected a finite number, found {value}")
            object.__setattr__(self, name, value)
        self._check_ids(n_particles)
        self._check_values()

    def _check_magnitude(self, name: str) -> None:
        values: FloatArray = getattr(self, name)
        if values.size and max(values.max(), -values.min()) > LARGEST:
            row = tuple(int(i) for i in np.argwhere(np.abs(values) > LARGEST)[0])
            raise ValueError(
                f"{name}, row {row[0]}: expected a magnitude of at most {LARGEST:g}, found {values[row]:g}"
            )

    def _check_ids(self, n_particles: int) -> None:
        for side, lowest in ((0, 0), (1, LOWEST_WALL)):
            ids = self.contact_ids[:, side]
            wrong = (ids < lowest) | (ids >= n_particles)
            if wrong.any():
                row = int(np.argmax(wrong))
                kind = "a particle" if side == 0 else "a particle or a wall"
                raise ValueError(f"contacts row {row}: id{side + 1}={ids[row]} is not {kind} ({n_particles} particles)")
        same = self.contact_ids[:, 0] == self.contact_ids[:, 1]
        if same.any():
            row = int(np.argmax(same))
            raise ValueError(f"contacts row {row}: particle {self.contact_ids[row, 0]} touches itself")
        low = np.minimum(self.contact_ids[:, 0], self.contact_ids[:, 1])
        high = np.maximum(self.contact_ids[:, 0], self.contact_ids[:, 1])
        key = np.sort(high * (n_particles - LOWEST_WALL) + (low - LOWEST_WALL))
        repeated = key[1:] == key[:-1]
        if repeated.any():
            one, other = divmod(int(key[int(np.argmax(repeated))]), n_particles - LOWEST_WALL)
            raise ValueError(f"contacts: the contact of {other + LOWEST_WALL} and {one} is there twice")

    def _check_values(self) -> None:
        for name, row_of in (("radius", "particles"), ("normal_stiffness", "contacts")):
            values = getattr(self, name)
            if (values < SMALLEST).any():
                row = int(np.argmax(values < SMALLEST))
                kind = "positive" if values[row] <= 0 else f"greater ({SMALLEST:g})"
                raise ValueError(f"{row_of} row {row}: expected a {kind} {name}, found {values[row]:g}")
        for name in ("tangential_stiffness", "rolling_stiffness", "friction", "rolling_limit"):
            values = getattr(self, name)
            wrong = (values < SMALLEST) & (values != 0)
            if wrong.any():
                row = int(np.argmax(wrong))
                least = "0" if values[row] < 0 else f"{SMALLEST:g}, or 0"
                raise ValueError(f"contacts row {row}: expected a {name} of at least {least}, found {values[row]:g}")
        length = np.hypot(self.contact_normal[:, 0], self.contact_normal[:, 1])
        wrong = np.abs(length - 1) > NORMAL_TOLERANCE
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ValueError(f"contacts row {row}: expected a unit normal, found length {length[row]:.6g}")

    @property
    def n_particles(self) -> int:
        """Number of particles."""
        return len(self.radius)

    @property
    def n_contacts(self) -> int:
        """Number of contacts, walls included."""
        return len(self.contact_ids)

    @property
    def contact_force(self) -> FloatArray:
        """(n_contacts, 2) force on the second member of each contact [N]; the first feels its opposite."""
        normal = self.contact_normal
        turned = np.stack((-normal[:, 1], normal[:, 0]), axis=1)
        return self.normal_force[:, None] * normal + self.tangential_force[:, None] * turned


def _own(array: _Array) -> _Array:
    """Return `array` itself if nobody can write to it, else a read-only copy."""
    if array.flags.writeable or not array.flags.owndata:
        array = array.copy()
        freeze(array)
    return array


CONTACT_SCALARS = (
    "overlap",
    "normal_force",
    "tangential_force",
    "moment",
    "normal_stiffness",
    "tangential_stiffness",
    "rolling_stiffness",
    "friction",
    "rolling_limit",
)
