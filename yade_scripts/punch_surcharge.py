"""A uniform pressure on a bed's free surface, as dead loads on the discs that are seen from above. Plain numpy.

A rigid cover would keep the surface flat and hinder the heave beside the punch; a dead load follows the surface, like
a shallow layer of soil that has weight and no strength (a surcharge, in the words of foundation engineering).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

COLUMNS_PER_RADIUS = 32  # of the smallest disc; a load then changes by 1.6 % of that disc's full load at once
DEEPEST_HOLE = 6  # largest radii below the highest disc nearby at which a disc is still looked for


class Surface(NamedTuple):
    """What is seen of the discs from above.

    Attributes:
        numbers: (k,) of the discs that are seen, increasing.
        widths: (k,) how wide each is seen [m].
        mean_height: of the surface over the spans [m].
    """

    numbers: np.ndarray
    widths: np.ndarray
    mean_height: float


def seen_from_above(
    x: np.ndarray, y: np.ndarray, radius: np.ndarray, spans: Sequence[tuple[float, float]], spacing: float
) -> Surface:
    """Look straight down on discs (n,) within the `spans` of x [m], on columns about `spacing` [m] apart.

    A column in which no disc is near the surface adds no width: what is seen then falls short of the spans' width.

    >>> discs = np.array([1.0, 3.0, 2.0]), np.array([0.0, 0.0, -1.0]), np.array([1.0, 1.0, 1.0])
    >>> surface = seen_from_above(*discs, [(0.0, 4.0)], 0.01)
    >>> surface.numbers.tolist(), surface.widths.round(2).tolist()
    ([0, 1], [2.0, 2.0])
    """
    counts = [max(1, int(np.ceil((end - begin) / spacing))) for begin, end in spans]
    wide = [(end - begin) / count for (begin, end), count in zip(spans, counts, strict=True)]
    columns = np.concatenate(
        [begin + step * (np.arange(count) + 0.5) for (begin, _), count, step in zip(spans, counts, wide, strict=True)]
    )
    width = np.repeat(wide, counts)
    near = _near_the_surface(x, y, radius)
    x, y, radius = x[near], y[near], radius[near]
    first, last = np.searchsorted(columns, x - radius), np.searchsorted(columns, x + radius)
    covered = last - first
    disc = np.repeat(np.arange(len(x)), covered)
    column = np.arange(len(disc)) - np.repeat(np.cumsum(covered) - covered - first, covered)
    squared = radius[disc] ** 2 - (columns[column] - x[disc]) ** 2
    height = y[disc] + np.sqrt(np.maximum(squared, 0.0))  # at a disc's very edge rounding may leave less than zero
    order = np.lexsort((height, column))
    highest = order[np.flatnonzero(np.diff(column[order], append=-1))]
    seen = np.bincount(disc[highest], weights=width[column[highest]], minlength=len(x))
    shown = np.flatnonzero(seen)
    mean_height = float(np.average(height[highest], weights=width[column[highest]]))
    return Surface(near[shown], seen[shown], mean_height)


def _near_the_surface(x: np.ndarray, y: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Numbers of the discs whose top is not far below the highest one's nearby; all others are certainly covered."""
    largest = float(radius.max())
    place = np.floor((x - x.min()) / (2 * largest)).astype(np.int64) + 1
    highest = np.full(place.max() + 2, -np.inf)
    np.maximum.at(highest, place, y + radius)
    around = np.minimum(np.minimum(highest[:-2], highest[2:]), highest[1:-1])
    return np.flatnonzero(y + radius > around[place - 1] - DEEPEST_HOLE * largest)
