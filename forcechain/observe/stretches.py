"""Buckled segments that overlap: stretches of a chain in which particle after particle buckles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from forcechain.arrays import BoolArray, IntArray, freeze, int_array


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretches:
    """Which stretch each segment belongs to.

    Attributes:
        label: (n_segments,) number of the segment's stretch, from 0.
        n_particles: (n_stretches,) particles of each: its segments and two.
        is_line: (n_stretches,) False where segments branch or close a ring, so that the stretch is no column.
    """

    label: IntArray
    n_particles: IntArray
    is_line: BoolArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.label, self.n_particles, self.is_line)


def find_stretches(segments: IntArray) -> Stretches:
    """Join three-particle segments (n_segments, 3), end, centre, end, that overlap in two particles.

    Two segments overlap where the centre of each is an end of the other. A segment that overlaps none is a stretch of
    three particles. Raises ValueError for another shape.

    >>> find_stretches(np.array([[0, 1, 2], [1, 2, 3], [7, 8, 9]])).n_particles
    array([4, 3])
    """
    segments = int_array(segments, "segments", (None, 3))
    n = len(segments)
    centre = segments[:, 1]
    # Every (segment, end) against every segment of that centre; more than one where chains branch.
    by_centre = np.argsort(centre, kind="stable")
    first, second = [], []
    for end in (0, 2):
        start = np.searchsorted(centre[by_centre], segments[:, end], "left")
        stop = np.searchsorted(centre[by_centre], segments[:, end], "right")
        count = stop - start
        this = np.repeat(np.arange(n), count)
        offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        other = by_centre[np.repeat(start, count) + offset]
        mutual = (segments[other][:, [0, 2]] == centre[this][:, None]).any(axis=1)
        first.append(this[mutual])
        second.append(other[mutual])
    here, there = np.concatenate(first), np.concatenate(second)
    links = coo_array((np.ones(len(here)), (here, there)), shape=(n, n))
    n_stretches, found = connected_components(links, directed=False) if n else (0, np.zeros(0))
    label = np.asarray(found, dtype=np.int64)
    size = np.bincount(label, minlength=n_stretches)
    n_links = np.bincount(label[here], minlength=n_stretches) // 2  # each is found from both of its segments
    centres = np.unique(np.stack((label, centre), axis=1), axis=0)[:, 0]
    distinct = np.bincount(centres, minlength=n_stretches) == size  # a chain that branches is centred there twice
    return Stretches(label=label, n_particles=size + 2, is_line=(n_links == size - 1) & distinct)
