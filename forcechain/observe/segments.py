"""Three-particle segments of force chains, and what is measured on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forcechain.arrays import FloatArray, IntArray, freeze, int_array, sum_at
from forcechain.observe.chains import BOUNDARY_TOLERANCE, Chains
from forcechain.observe.neighbours import Neighbours, find_neighbours
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.snapshot import Snapshot

LATERAL_FORCES = ("support", "magnitude", "supporting", "horizontal")
STRAIGHT_TOLERANCE = 1e-12  # a centre this close to the line 1-3, over the line's length, lies on it


@dataclass(frozen=True, slots=True, kw_only=True)
class Measures:
    """What is measured on three-particle segments; every array has one shape, segments along the last axis.

    Attributes:
        buckling_angle: mean of the two acute angles between the line 1-3 and the lines 2-1 and 2-3 [rad].
        axial_force: mean of the compressive forces on the ends along the line 1-3, from the particles beyond them [N].
        axial_displacement: decrease of the distance 1-3 since the reference [m].
        normal_displacement: mean over the contacts 1-2 and 2-3 of normal force over normal stiffness [m]; a contact
            that is lost counts as zero.
        rotation: half of the difference of the rotations of 1 and 3 since the reference, absolute [rad].
        lateral_force: force on 2 from all but 1 and 3, across the line 1-3 and towards it [N].
    """

    buckling_angle: FloatArray
    axial_force: FloatArray
    axial_displacement: FloatArray
    normal_displacement: FloatArray
    rotation: FloatArray
    lateral_force: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.buckling_angle, self.axial_force, self.axial_displacement)
        freeze(self.normal_displacement, self.rotation, self.lateral_force)


def find_segments(snapshot: Snapshot, chains: Chains, options: AnalysisOptions) -> IntArray:
    """Return the three-particle segments of the chains (n_segments, 3): end, centre, end.

    A centre lies between links on both sides of it, the sides being those of its major principal direction. With
    `segment_rule` "best" it joins the best-aligned link of each side (largest absolute cosine with its own direction;
    a tie goes to the larger normal force, then to the smaller number), so an unbranched chain of N particles has N-2
    segments; with "every" it joins each pair of links. The ends stand in order of their numbers, the rows in order of
    centre and ends. With `wall_segments` "drop", segments of which a particle touches a wall are left out.
    """
    inside = chains.label[chains.links[:, 0]] >= 0
    links, cosines = chains.links[inside], chains.link_cosine[inside]
    force = snapshot.normal_force[chains.link_contact[inside]]
    owner = np.concatenate((links[:, 0], links[:, 1]))
    partner = np.concatenate((links[:, 1], links[:, 0]))
    cosine = np.concatenate((cosines[:, 0], cosines[:, 1]))
    branch = snapshot.position[partner] - snapshot.position[owner]
    ahead = np.einsum("ij,ij->i", branch, chains.stress.direction[owner]) > 0
    side = 2 * owner + ahead
    if options.segment_rule == "best":
        segments = _best_pairs(side, cosine, np.concatenate((force, force)), partner, snapshot.n_particles)
    else:
        segments = _every_pair(owner, partner, side, ahead)
    if options.wall_segments == "drop":
        at_wall = np.zeros(snapshot.n_particles, dtype=np.bool_)
        at_wall[snapshot.contact_ids[snapshot.contact_ids[:, 1] < 0, 0]] = True
        segments = segments[~at_wall[segments].any(axis=1)]
    low, high = np.minimum(segments[:, 0], segments[:, 2]), np.maximum(segments[:, 0], segments[:, 2])
    segments = np.stack((low, segments[:, 1], high), axis=1)
    if options.segment_rule == "every":  # the best come in order
        segments = segments[np.lexsort((high, low, segments[:, 1]))]
    freeze(segments)
    return segments


def _best_pairs(side: IntArray, cosine: FloatArray, force: FloatArray, partner: IntArray, n_particles: int) -> IntArray:
    """Return the best (partner behind, owner, partner ahead) of each owner with both, in order of the owners."""
    best = np.full(2 * n_particles, -1.0)
    np.maximum.at(best, side, cosine)
    rows = np.flatnonzero(cosine >= best[side] - BOUNDARY_TOLERANCE)
    tied = np.bincount(side[rows], minlength=2 * n_particles)[side[rows]] > 1
    chosen = np.full(2 * n_particles, -1, dtype=np.int64)
    chosen[side[rows[~tied]]] = partner[rows[~tied]]
    ties = rows[tied]
    ties = ties[np.lexsort((-partner[ties], force[ties], side[ties]))]
    chosen[side[ties]] = partner[ties]  # the last of a side wins: the largest force, then the smallest number
    owner = np.flatnonzero((chosen[0::2] >= 0) & (chosen[1::2] >= 0))
    return np.stack((chosen[2 * owner], owner, chosen[2 * owner + 1]), axis=1)


def _every_pair(owner: IntArray, partner: IntArray, side: IntArray, ahead: IntArray) -> IntArray:
    """Return every (partner behind, owner, partner ahead), shape (n, 3)."""
    order = np.argsort(side, kind="stable")
    owner, partner, ahead, side = owner[order], partner[order], ahead[order], side[order]
    behind_rows = np.flatnonzero(~ahead)
    opposite = side[behind_rows] + 1
    start, stop = np.searchsorted(side, opposite, "left"), np.searchsorted(side, opposite, "right")
    count = stop - start
    behind = np.repeat(behind_rows, count)
    row = np.repeat(np.arange(len(behind_rows)), count)
    across = np.arange(len(behind)) + (start - (np.cumsum(count) - count))[row]
    return np.stack((partner[behind], owner[behind], partner[across]), axis=1)


def measure(
    snapshot: Snapshot,
    reference: Snapshot,
    segments: IntArray,
    *,
    lateral_force: str = "support",
    neighbours: Neighbours | None = None,
) -> Measures:
    """Measure `segments` (n_segments, 3) in `snapshot`; displacement and rotation count from `reference`.

    Axial force: for each end, the forces from contacts whose partner's centre lies beyond the line through the end
    across 1-3 (a wall lies beyond it if its contact point does), projected on 1-3, compression positive; the mean of
    the two ends. Lateral force: the total force on 2 from all contacts, walls included, but those with 1 and 3, across
    1-3, positive towards the line, where it holds the buckling back; if 2 lies on the line there is no such side and
    its magnitude is given, as it is everywhere with `lateral_force` "magnitude". With "supporting" only contacts that
    press towards the line count; with "horizontal" the magnitudes along x of all of them are added up, which is another
    reading of the source's "total lateral (horizontal) supporting force". `neighbours` saves listing the contacts of
    `snapshot` again.

    Raises ValueError for segments of the wrong shape, unknown particles, or ends at one point.
    Source: Tordesillas & Muthuswamy (2009), sections 5.1.1, 5.1.2 and 5.2.
    """
    segments = checked_segments(segments, snapshot.n_particles)
    if reference.n_particles != snapshot.n_particles:
        raise ValueError(f"reference: expected {snapshot.n_particles} particles, found {reference.n_particles}")
    if lateral_force not in LATERAL_FORCES:
        expected = ", ".join(repr(choice) for choice in LATERAL_FORCES)
        raise ValueError(f"lateral_force: expected one of {expected}, found {lateral_force!r}")
    neighbours = find_neighbours(snapshot) if neighbours is None else neighbours
    axis, length = axial_line(snapshot, segments)
    force = snapshot.contact_force
    axial = 0.5 * (
        _force_from_beyond(snapshot, neighbours, force, segments, axis, end=0)
        + _force_from_beyond(snapshot, neighbours, force, segments, -axis, end=2)
    )
    lateral = _lateral_force(snapshot, neighbours, force, segments, axis, length, lateral_force)
    turned = snapshot.rotation - reference.rotation
    return Measures(
        buckling_angle=buckling_angle(snapshot, segments),
        axial_force=axial,
        axial_displacement=axial_line(reference, segments)[1] - length,
        normal_displacement=_normal_displacement(snapshot, neighbours, segments),
        rotation=0.5 * np.abs(turned[segments[:, 0]] - turned[segments[:, 2]]),
        lateral_force=lateral,
    )


def checked_segments(segments: IntArray, n_particles: int) -> IntArray:
    """Return `segments` as (n_segments, 3) particle numbers; ValueError if it is not."""
    found = int_array(segments, "segments", (None, 3))
    wrong = ((found < 0) | (found >= n_particles)).any(axis=1)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(f"segments, row {row}: expected particles 0 to {n_particles - 1}, found {found[row].tolist()}")
    return found


def axial_line(snapshot: Snapshot, segments: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the unit vector from 1 to 3 (n_segments, 2) and the distance between them (n_segments,) [m]."""
    line = snapshot.position[segments[:, 2]] - snapshot.position[segments[:, 0]]
    length = np.hypot(line[:, 0], line[:, 1])
    if (length == 0).any():
        row = int(np.argmin(length))
        raise ValueError(f"segments, row {row}: expected two ends, found both at one point")
    return line / length[:, None], length


def buckling_angle(snapshot: Snapshot, segments: IntArray) -> FloatArray:
    """Return the mean of the two acute angles between the line 1-3 and the lines 2-1 and 2-3 (n_segments,) [rad].

    Source: Tordesillas & Muthuswamy (2009), section 5.1.1.
    """
    axis, _ = axial_line(snapshot, segments)
    centre = snapshot.position[segments[:, 1]]
    total = np.zeros(len(segments))
    for end in (0, 2):
        arm = snapshot.position[segments[:, end]] - centre
        across = axis[:, 0] * arm[:, 1] - axis[:, 1] * arm[:, 0]
        along = np.einsum("ij,ij->i", axis, arm)
        total += np.arctan2(np.abs(across), np.abs(along))
    return 0.5 * total


def _force_from_beyond(
    snapshot: Snapshot,
    neighbours: Neighbours,
    force: FloatArray,
    segments: IntArray,
    inward: FloatArray,
    *,
    end: int,
) -> FloatArray:
    """Return the inward force (n_segments,) on the particles of column `end` from what lies beyond them."""
    row, contact_end = neighbours.ends_of(segments[:, end])
    partner, contact = neighbours.partner[contact_end], neighbours.contact[contact_end]
    far = np.where((partner >= 0)[:, None], snapshot.position[np.maximum(partner, 0)], snapshot.contact_point[contact])
    inward = inward[row]
    reach = np.einsum("ij,ij->i", far - snapshot.position[segments[row, end]], inward)
    beyond = (reach < 0) & (partner != segments[row, 1]) & (partner != segments[row, 2 - end])
    push = neighbours.sign[contact_end] * np.einsum("ij,ij->i", force[contact], inward)
    return sum_at(row, np.where(beyond, push, 0.0), len(segments))


def _lateral_force(
    snapshot: Snapshot,
    neighbours: Neighbours,
    force: FloatArray,
    segments: IntArray,
    axis: FloatArray,
    length: FloatArray,
    choice: str,
) -> FloatArray:
    """Return the lateral force on the centres (n_segments,), by one of `LATERAL_FORCES`."""
    row, contact_end = neighbours.ends_of(segments[:, 1])
    partner = neighbours.partner[contact_end]
    other = (partner != segments[row, 0]) & (partner != segments[row, 2])
    if choice == "horizontal":
        sideways = np.where(other, np.abs(force[neighbours.contact[contact_end], 0]), 0.0)
        return sum_at(row, sideways, len(segments))
    left = np.stack((-axis[:, 1], axis[:, 0]), axis=1)
    push = neighbours.sign[contact_end] * np.einsum("ij,ij->i", force[neighbours.contact[contact_end]], left[row])
    arm = snapshot.position[segments[:, 1]] - snapshot.position[segments[:, 0]]
    offset = np.einsum("ij,ij->i", arm, left)
    on_line = np.abs(offset) <= STRAIGHT_TOLERANCE * length
    if choice == "supporting":
        towards = np.where(other, -np.sign(offset)[row] * push, 0.0)
        return np.where(on_line, 0.0, sum_at(row, np.maximum(towards, 0.0), len(segments)))
    to_left = sum_at(row, np.where(other, push, 0.0), len(segments))
    if choice == "magnitude":
        return np.abs(to_left)
    return np.where(on_line, np.abs(to_left), -np.sign(offset) * to_left)


def _normal_displacement(snapshot: Snapshot, neighbours: Neighbours, segments: IntArray) -> FloatArray:
    row, contact_end = neighbours.ends_of(segments[:, 1])
    partner, contact = neighbours.partner[contact_end], neighbours.contact[contact_end]
    own = (partner == segments[row, 0]) | (partner == segments[row, 2])
    row, contact = row[own], contact[own]
    return 0.5 * sum_at(row, snapshot.normal_force[contact] / snapshot.normal_stiffness[contact], len(segments))
