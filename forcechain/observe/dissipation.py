"""Energy dissipated at contacts by sliding and rolling between two snapshots, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcechain.arrays import FloatArray, IntArray, freeze
from forcechain.observe.neighbours import find_neighbours
from forcechain.observe.segments import checked_segments
from forcechain.observe.snapshot import LOWEST_WALL, Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class Dissipation:
    """Energy dissipated between two snapshots at the contacts between particles that exist in both.

    Attributes:
        ids: (n_contacts, 2) the two particles.
        sliding: (n_contacts,) [J].
        rolling: (n_contacts,) [J].
    """

    ids: IntArray
    sliding: FloatArray
    rolling: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.ids, self.sliding, self.rolling)


def dissipation(before: Snapshot, after: Snapshot) -> Dissipation:
    """Return what sliding and rolling dissipate from one snapshot to the next.

    The tangential displacement of a contact is du = (u2 - u1) . t - R1 dw1 - R2 dw2, of which -dft/kt is elastic; the
    rest is slip, against the mean tangential force. Rolling likewise: dw2 - dw1, of which -dm/kr is elastic, against
    the mean moment. The normal of the mean of both instants is used, so the snapshots must be close: a contact should
    turn and slide little in between. Contacts made or lost in between, and those with walls, are left out; a
    contact without a stiffness dissipates nothing.

    Raises ValueError for snapshots of other particles.
    """
    if before.n_particles != after.n_particles:
        raise ValueError(f"after: expected {before.n_particles} particles, found {after.n_particles}")
    old, new = _matching(before, after)
    one, two = after.contact_ids[new].T
    # A contact may be listed the other way round, which turns its moment but not its tangential force.
    same_way = before.contact_ids[old, 0] == one
    moment_before = np.where(same_way, 1.0, -1.0) * before.moment[old]
    normal_before = np.where(same_way, 1.0, -1.0)[:, None] * before.contact_normal[old]
    normal = 0.5 * (normal_before + after.contact_normal[new])
    tangent = np.stack((-normal[:, 1], normal[:, 0]), axis=1)
    moved = after.position - before.position
    turned = after.rotation - before.rotation
    shear = np.einsum("ij,ij->i", moved[two] - moved[one], tangent)
    shear -= after.radius[one] * turned[one] + after.radius[two] * turned[two]
    force_change = after.tangential_force[new] - before.tangential_force[old]
    slip = shear + _elastic(force_change, after.tangential_stiffness[new], shear)
    roll = turned[two] - turned[one]
    moment_change = after.moment[new] - moment_before
    rolled = roll + _elastic(moment_change, after.rolling_stiffness[new], roll)
    mean_force = 0.5 * (after.tangential_force[new] + before.tangential_force[old])
    mean_moment = 0.5 * (after.moment[new] + moment_before)
    return Dissipation(ids=np.stack((one, two), axis=1), sliding=-mean_force * slip, rolling=-mean_moment * rolled)


def share_near(dissipated: Dissipation, snapshot: Snapshot, segments: IntArray) -> float:
    """Return the share of the dissipation at contacts of the particles of `segments` (n_segments, 3) and neighbours.

    Neighbours are the particles in contact with them in `snapshot`. Raises ValueError if nothing is dissipated.
    """
    segments = checked_segments(segments, snapshot.n_particles)
    near = np.zeros(snapshot.n_particles, dtype=np.bool_)
    members = np.unique(segments)
    near[members] = True
    neighbours = find_neighbours(snapshot)
    partner = neighbours.partner[neighbours.ends_of(members)[1]]
    near[partner[partner >= 0]] = True
    energy = dissipated.sliding + dissipated.rolling
    total = float(energy.sum())
    if not total > 0:
        raise ValueError(f"dissipated: expected a total above 0, found {total:g} J")
    return float(energy[near[dissipated.ids].any(axis=1)].sum() / total)


def _matching(before: Snapshot, after: Snapshot) -> tuple[IntArray, IntArray]:
    """Return the rows of the contacts between particles that are in both snapshots."""
    keys = []
    for snapshot in (before, after):
        low, high = np.sort(snapshot.contact_ids, axis=1).T
        keys.append(high * (snapshot.n_particles - LOWEST_WALL) + low - LOWEST_WALL)
        keys[-1][low < 0] = -1 - np.arange(np.count_nonzero(low < 0)) - len(keys) * len(low)  # walls never match
    _, old, new = np.intersect1d(keys[0], keys[1], assume_unique=True, return_indices=True)
    return old, new


def _elastic(load_change: FloatArray, stiffness: FloatArray, displacement: FloatArray) -> FloatArray:
    """Return the elastic displacement (positive with the load), or minus all of it where there is no stiffness."""
    return np.divide(load_change, stiffness, out=-displacement, where=stiffness > 0)
