"""Who touches whom: the contacts of a snapshot, listed by particle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from forcechain.arrays import FloatArray, IntArray, freeze
from forcechain.observe.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbours:
    """The ends of all contacts, grouped by the particle that owns them; a contact with a wall has one end.

    Attributes:
        start: (n_particles + 1,) the ends of particle p are start[p] to start[p + 1] - 1.
        partner: (n_ends,) the particle or wall at the other end.
        contact: (n_ends,) row of the contact.
        sign: (n_ends,) +1 where the owner is the second of the contact and so feels the contact force, else -1.
    """

    start: IntArray
    partner: IntArray
    contact: IntArray
    sign: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.start, self.partner, self.contact, self.sign)

    def ends_of(self, particles: IntArray) -> tuple[IntArray, IntArray]:
        """Return the ends of each of `particles` (n,): row in `particles` and end, both (n_found,)."""
        first = self.start[particles]
        count = self.start[particles + 1] - first
        row = np.repeat(np.arange(len(particles)), count)
        offset = first - (np.cumsum(count) - count)
        return row, np.arange(len(row)) + offset[row]


def find_neighbours(snapshot: Snapshot) -> Neighbours:
    """List the contacts of `snapshot` by particle, in time linear in their number."""
    first, second = snapshot.contact_ids.T
    with_particle = np.flatnonzero(second >= 0)
    owner = np.concatenate((first, second[with_particle]))
    partner = np.concatenate((second, first[with_particle]))
    contact = np.concatenate((np.arange(len(first)), with_particle))
    sign = np.ones(len(owner))
    sign[: len(first)] = -1
    # A sparse matrix with one entry a column sorts the ends by owner without comparing them.
    ends = np.arange(len(owner))
    grouped = sparse.coo_array((sign, (owner, ends)), shape=(snapshot.n_particles, len(owner))).tocsr()
    order = grouped.indices
    return Neighbours(
        start=grouped.indptr.astype(np.int64), partner=partner[order], contact=contact[order], sign=grouped.data
    )
