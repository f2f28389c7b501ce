"""Averages over buckled segments: by increment of the drops, by buckling angle, and how sure they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from forcechain.arrays import FloatArray, IntArray, float_array, freeze, int_array

QUARTILES = (0.25, 0.5, 0.75)
N_CLASSES = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Average:
    """Averages at several places (increments, or bins), each over the `count` segments found there.

    Attributes:
        count: (n_places,) number of segments averaged. A segment counts once a place: neither its three particles nor
            its observations are counted as if they were independent.
        mean: (n_places,); not a number where the count is 0.
        standard_deviation: (n_places,) of the segments; not a number where the count is below 2.
        standard_error: (n_places,) standard deviation over the root of the count.
        quartiles: (n_places, 3) lower quartile, median, upper quartile of the segments.
    """

    count: IntArray
    mean: FloatArray
    standard_deviation: FloatArray
    standard_error: FloatArray
    quartiles: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.count, self.mean, self.standard_deviation, self.standard_error, self.quartiles)


@dataclass(frozen=True, slots=True, kw_only=True)
class BootstrapError:
    """Standard errors of a mean over segments, by resampling.

    Attributes:
        by_segment: (n_places,) segments resampled, as if each were independent.
        by_seed: (n_places,) whole runs resampled, segments of one run staying together; not a number with one run.
        larger: (n_places,) the larger of the two, the one to quote.
    """

    by_segment: FloatArray
    by_seed: FloatArray
    larger: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.by_segment, self.by_seed, self.larger)


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassShares:
    """How many buckled segments belong to each class of yielding, 1 to 4 in this order.

    Attributes:
        count: (4,) segments.
        share: (4,) of all classified segments; not a number if there are none.
        standard_error: (4,) of the share, binomial: the root of p(1 - p)/n.
    """

    count: IntArray
    share: FloatArray
    standard_error: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.count, self.share, self.standard_error)


def average_by_increment(groups: Sequence[FloatArray]) -> Average:
    """Average over all segments of all `groups`, one group a drop, each (n_increments + 1, n_segments).

    The i-th average is over every buckled segment of every drop (and run) at the i-th increment after its own start, as
    in Tordesillas & Muthuswamy (2009), section 5.1; n is the number of segments. Raises ValueError for no group or for
    groups with different numbers of increments.

    >>> average_by_increment([[[1.0, 3.0]], [[5.0]]]).mean
    array([3.])
    """
    values = np.concatenate(_checked_groups(groups), axis=1)
    return _average(list(values))


def average_by_bins(coordinates: Sequence[FloatArray], groups: Sequence[FloatArray], edges: FloatArray) -> Average:
    """Average `groups` over bins of `coordinates` (a buckling angle, say), both as in `average_by_increment`.

    `edges` (n_bins + 1,) increase; a bin holds its lower edge, the last one both. A segment that stays in a bin for
    several increments enters it once, with its mean there, so n counts segments; those outside all bins are left out.
    Raises ValueError for groups and coordinates of different shapes, and for edges that do not increase.
    """
    edges = float_array(edges, "edges", (None,))
    if len(edges) < 2 or (np.diff(edges) <= 0).any():
        raise ValueError(f"edges: expected at least two, increasing, found {edges.tolist()}")
    values = np.concatenate(_checked_groups(groups), axis=1)
    where = np.concatenate(_checked_groups(coordinates), axis=1)
    if values.shape != where.shape:
        raise ValueError(f"coordinates: expected shape {values.shape}, found {where.shape}")
    n_bins, n_segments = len(edges) - 1, values.shape[1]
    place = np.searchsorted(edges, where, side="right") - 1
    place[where == edges[-1]] = n_bins - 1
    inside = (place >= 0) & (place < n_bins)
    segment = np.broadcast_to(np.arange(n_segments), values.shape)
    key = place[inside] * n_segments + segment[inside]
    times = np.bincount(key, minlength=n_bins * n_segments).reshape(n_bins, n_segments)
    total = np.bincount(key, weights=values[inside], minlength=n_bins * n_segments).reshape(n_bins, n_segments)
    return _average([total[b, times[b] > 0] / times[b, times[b] > 0] for b in range(n_bins)])


def bootstrap_error(seeds: Sequence[FloatArray], *, samples: int = 1000, random_seed: int = 0) -> BootstrapError:
    """Return standard errors of the mean at each increment, by resampling segments and by resampling runs.

    `seeds` holds for each independent run (packing) the values of all its segments (n_increments + 1, n_segments), its
    drops side by side. Segments of one packing share neighbours and history, so the error over runs is the honest one
    once there are enough of them; with few it is itself uncertain, and the larger of the two is to be quoted. With no
    segment at all the errors are not numbers. Resampling n values gives the error times the root of (n - 1)/n, 0.71 for
    two runs: both errors are corrected for it.

    Raises ValueError as `average_by_increment`, or for under 2 samples.
    """
    if samples < 2:
        raise ValueError(f"samples: expected at least 2, found {samples}")
    runs = _checked_groups(seeds)
    rng = np.random.default_rng(random_seed)
    values = np.concatenate(runs, axis=1)
    n_places, n_segments = values.shape
    by_segment = np.full(n_places, np.nan)
    by_seed = np.full(n_places, np.nan)
    if n_segments > 1:
        times = rng.multinomial(n_segments, np.full(n_segments, 1 / n_segments), size=samples)
        by_segment = np.std(times @ values.T / n_segments, axis=0, ddof=1) * _small_sample(n_segments)
    filled = [run for run in runs if run.shape[1]]
    if len(filled) > 1:
        times = rng.multinomial(len(filled), np.full(len(filled), 1 / len(filled)), size=samples)
        sums = np.stack([run.sum(axis=1) for run in filled])
        counts = np.array([run.shape[1] for run in filled])
        by_seed = np.std((times @ sums) / (times @ counts)[:, None], axis=0, ddof=1) * _small_sample(len(filled))
    return BootstrapError(by_segment=by_segment, by_seed=by_seed, larger=np.fmax(by_segment, by_seed))


def _small_sample(count: int) -> float:
    return float(np.sqrt(count / (count - 1)))


def class_shares(classes: Sequence[IntArray]) -> ClassShares:
    """Count the classes (n_segments,) of each drop, all drops together.

    >>> class_shares([[3, 3, 4], [1]]).share
    array([0.25, 0.  , 0.5 , 0.25])
    """
    found = [int_array(drop, f"classes of drop {i}", (None,)) for i, drop in enumerate(classes)]
    every = np.concatenate(found) if found else np.zeros(0, dtype=np.int64)
    wrong = (every < 1) | (every > N_CLASSES)
    if wrong.any():
        raise ValueError(f"classes: expected 1 to {N_CLASSES}, found {int(every[wrong][0])}")
    count = np.bincount(every, minlength=N_CLASSES + 1)[1:]
    total = len(every)
    share = count / total if total else np.full(N_CLASSES, np.nan)
    error = np.sqrt(share * (1 - share) / total) if total else np.full(N_CLASSES, np.nan)
    return ClassShares(count=count.astype(np.int64), share=share, standard_error=error)


def _checked_groups(groups: Sequence[FloatArray]) -> list[FloatArray]:
    if not len(groups):
        raise ValueError("groups: expected at least one drop, found none")
    checked = [float_array(group, f"group {i}", (None, None)) for i, group in enumerate(groups)]
    for i, group in enumerate(checked):
        if len(group) != len(checked[0]):
            raise ValueError(f"group {i}: expected {len(checked[0])} increments, found {len(group)}")
    return checked


def _average(places: Sequence[FloatArray]) -> Average:
    count = np.array([len(values) for values in places], dtype=np.int64)
    mean = np.array([values.mean() if len(values) else np.nan for values in places])
    deviation = np.array([values.std(ddof=1) if len(values) > 1 else np.nan for values in places])
    quartiles = np.array([np.quantile(v, QUARTILES) if len(v) else np.full(len(QUARTILES), np.nan) for v in places])
    return Average(
        count=count,
        mean=mean,
        standard_deviation=deviation,
        standard_error=deviation / np.sqrt(np.maximum(count, 1)),
        quartiles=quartiles.reshape(len(places), len(QUARTILES)),
    )
