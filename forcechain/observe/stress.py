"""Stress of each particle from its contacts, and its principal values and directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcechain.arrays import BoolArray, FloatArray, columns, float_array, freeze, sum_at
from forcechain.observe.snapshot import Snapshot

ISOTROPY_TOLERANCE = 1e-12  # below this share of the larger principal stress their difference is rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Principal:
    """Principal values and direction of symmetric tensors in two dimensions, compression positive.

    Attributes:
        major: (n,) the larger (more compressive) principal value.
        minor: (n,) the smaller.
        direction: (n, 2) unit vector of the major one, its sign without meaning; (0, 0) where the tensor is isotropic,
            which has no direction: nothing is aligned with it, however the axes are turned.
    """

    major: FloatArray
    minor: FloatArray
    direction: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.major, self.minor, self.direction)


def particle_stress(snapshot: Snapshot, *, weight: str = "area") -> FloatArray:
    """Return the stress of each particle (n_particles, 2, 2), compression positive, symmetrised.

    σ = −(1/A) Σ f ⊗ r over all contacts of the particle, walls included: f the force on the particle, r from its centre
    to the contact point, A = π R² the disc's area, so the unit is N/m. With `weight` "none" the sum is not divided
    (N m). The antisymmetric part, left out, is half the moment of the tangential forces, which rolling moments balance.

    Raises ValueError for an unknown weight. Source: Christoffersen, Mehrabadi & Nemat-Nasser, J. Appl. Mech. 48 (1981).
    """
    if weight not in ("area", "none"):
        raise ValueError(f"weight: expected 'area' or 'none', found {weight!r}")
    n = snapshot.n_particles
    first, second = columns(snapshot.contact_ids)
    # Columns are gathered one by one: numpy is several times slower at gathering rows.
    x, y = columns(snapshot.position)
    force_x, force_y = _components(snapshot)
    point_x, point_y = snapshot.contact_point.T
    arm_x, arm_y = point_x - x[first], point_y - y[first]
    xx = sum_at(first, force_x * arm_x, n)
    yy = sum_at(first, force_y * arm_y, n)
    xy = sum_at(first, 0.5 * (force_x * arm_y + force_y * arm_x), n)
    if (second < 0).any():
        inside = np.flatnonzero(second >= 0)
        second, force_x, force_y = second[inside], force_x[inside], force_y[inside]
        point_x, point_y = point_x[inside], point_y[inside]
    arm_x, arm_y = point_x - x[second], point_y - y[second]
    xx -= sum_at(second, force_x * arm_x, n)
    yy -= sum_at(second, force_y * arm_y, n)
    xy -= sum_at(second, 0.5 * (force_x * arm_y + force_y * arm_x), n)
    stress = np.empty((n, 2, 2))
    scale = 1 / (np.pi * snapshot.radius**2) if weight == "area" else np.ones(n)
    stress[:, 0, 0] = scale * xx
    stress[:, 1, 1] = scale * yy
    stress[:, 0, 1] = stress[:, 1, 0] = scale * xy
    return stress


def _components(snapshot: Snapshot) -> tuple[FloatArray, FloatArray]:
    normal_x, normal_y = snapshot.contact_normal.T
    force_x = snapshot.normal_force * normal_x - snapshot.tangential_force * normal_y
    force_y = snapshot.normal_force * normal_y + snapshot.tangential_force * normal_x
    return force_x, force_y


def principal(stress: FloatArray) -> Principal:
    """Return the principal values and directions of symmetric tensors (n, 2, 2), in closed form.

    (σ₁, σ₂) = mean ± √(((σ_xx − σ_yy)/2)² + σ_xy²); the direction solves (σ − σ₁) n = 0.
    Raises ValueError for another shape or a number that is not finite.

    >>> found = principal([[[3.0, 0.0], [0.0, 1.0]], [[2.0, 0.0], [0.0, 2.0]]])
    >>> found.major, found.minor
    (array([3., 2.]), array([1., 2.]))
    >>> found.direction
    array([[1., 0.],
           [0., 0.]])
    """
    tensors = float_array(stress, "stress", (None, 2, 2))
    mean = 0.5 * (tensors[:, 0, 0] + tensors[:, 1, 1])
    difference = 0.5 * (tensors[:, 0, 0] - tensors[:, 1, 1])
    shear = 0.5 * (tensors[:, 0, 1] + tensors[:, 1, 0])
    radius = np.hypot(difference, shear)
    # Both (radius + difference, shear) and (shear, radius - difference) lie along the major direction: take the longer,
    # which never cancels. An isotropic tensor has neither, and stays without a direction.
    upright = difference < 0
    along_x = np.where(upright, shear, radius + difference)
    along_y = np.where(upright, radius - difference, shear)
    length = np.hypot(along_x, along_y)
    length[radius <= ISOTROPY_TOLERANCE * (np.abs(mean) + radius)] = np.inf
    direction = np.stack((along_x / length, along_y / length), axis=1)
    return Principal(major=mean + radius, minor=mean - radius, direction=direction)


def bearing_force(snapshot: Snapshot) -> BoolArray:
    """Return which particles bear a force (n_particles,): at least one contact whose force is not zero."""
    loaded = (snapshot.normal_force != 0) | (snapshot.tangential_force != 0)
    first, second = columns(snapshot.contact_ids)
    bears = np.zeros(snapshot.n_particles, dtype=np.bool_)
    bears[first[loaded]] = True
    bears[second[loaded & (second >= 0)]] = True
    return bears
