"""Which chain is which from one snapshot to the next: chains that persist, are born, or collapse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from forcechain.arrays import BoolArray, IntArray, freeze
from forcechain.observe.chains import Chains
from forcechain.observe.segments import checked_segments


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainMatches:
    """The same chains in two snapshots.

    Attributes:
        later: (n_chains before,) number of the chain in the later snapshot that it persists as, or -1: it collapsed.
        earlier: (n_chains after,) number of the chain in the earlier snapshot that it was, or -1: it was born.
        shared: (n_chains before,) particles it shares with the one it persists as.
    """

    later: IntArray
    earlier: IntArray
    shared: IntArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.later, self.earlier, self.shared)


def match_chains(before: Chains, after: Chains) -> ChainMatches:
    """Match the chains of two snapshots of the same particles.

    A chain persists as the one with which it shares most particles if that one shares most with it too; ties go to the
    smaller number. A chain that splits persists as its largest part; of chains that merge the largest contribution
    persists. Raises ValueError for other particles.
    """
    if len(before.label) != len(after.label):
        raise ValueError(f"after: expected {len(before.label)} particles, found {len(after.label)}")
    in_both = before.in_chain & after.in_chain
    pairs = before.label[in_both] * max(after.n_chains, 1) + after.label[in_both]
    pair, shared = np.unique(pairs, return_counts=True)
    one, other = pair // max(after.n_chains, 1), pair % max(after.n_chains, 1)
    best_later = _best(one, other, shared, before.n_chains)
    best_earlier = _best(other, one, shared, after.n_chains)
    later = np.full(before.n_chains, -1, dtype=np.int64)
    earlier = np.full(after.n_chains, -1, dtype=np.int64)
    common = np.zeros(before.n_chains, dtype=np.int64)
    mutual = (best_later[one] == other) & (best_earlier[other] == one)
    later[one[mutual]] = other[mutual]
    earlier[other[mutual]] = one[mutual]
    common[one[mutual]] = shared[mutual]
    return ChainMatches(later=later, earlier=earlier, shared=common)


def persisting_segments(segments: IntArray, after: IntArray, n_particles: int) -> BoolArray:
    """Return which of `segments` (n_segments, 3) are among the segments `after` (n_after, 3), in canonical order.

    Raises ValueError for segments of the wrong shape or unknown particles.
    """
    found, later = checked_segments(segments, n_particles), checked_segments(after, n_particles)
    every, where = np.unique(np.concatenate((later, found)), axis=0, return_inverse=True)
    there = np.zeros(len(every), dtype=np.bool_)
    there[where.ravel()[: len(later)]] = True
    return there[where.ravel()[len(later) :]]


def ordered_members(chains: Chains) -> tuple[IntArray, IntArray]:
    """Return the particles of all chains in order: members (n_members,), and where each chain starts (n_chains + 1,).

    A chain runs from its end with the smallest number (a ring from its smallest number) by the number of links from
    there, so an unbranched chain is listed along its length; particles equally far stand in order of their numbers.
    """
    particles = np.flatnonzero(chains.in_chain)
    label = chains.label[particles]
    is_end = chains.degree[particles] == 1
    order = np.lexsort((particles, ~is_end, label))
    first = particles[order[np.searchsorted(label[order], np.arange(chains.n_chains))]]
    distance = _links_from(first, chains)
    members = particles[np.lexsort((particles, distance[particles], label))]
    return members, np.concatenate(([0], np.cumsum(chains.length)))


def _links_from(starts: IntArray, chains: Chains) -> IntArray:
    """Return the number of links from each particle to the start of its chain."""
    n = len(chains.label)
    # One source joined to every start makes the chains one tree, walked once.
    one = np.concatenate((chains.links[:, 0], np.full(len(starts), n)))
    other = np.concatenate((chains.links[:, 1], starts))
    graph = sparse.coo_array((np.ones(len(one), dtype=np.int8), (one, other)), shape=(n + 1, n + 1)).tocsr()
    order, parent = csgraph.breadth_first_order(graph, n, directed=False, return_predecessors=True)
    distance = np.zeros(n + 1, dtype=np.int64)
    above = np.arange(n + 1)
    above[order[1:]] = parent[order[1:]]
    hops = (above != np.arange(n + 1)).astype(np.int64)
    # Pointer doubling: after k rounds every particle knows its distance to the ancestor 2^k links up.
    while (above != above[above]).any():
        hops = hops + hops[above]
        above = above[above]
    distance[:] = hops
    return distance[:n]


def _best(one: IntArray, other: IntArray, shared: IntArray, n_one: int) -> IntArray:
    """Return for each of `one` the `other` with the largest share, the smaller number on a tie, or -1."""
    best = np.full(n_one, -1, dtype=np.int64)
    order = np.lexsort((-other, shared))  # the last written wins
    best[one[order]] = other[order]
    return best
