"""Histories of buckled segments, their averages over all segments, and the same averages of resampled data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from forcechain.arrays import FloatArray, float_array, freeze


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentHistories:
    """Buckled segments of one run (one packing): each array (n_increments + 1, n_segments), drops side by side.

    Displacement and rotation are counted from the start of the drop, where they are zero.

    Attributes:
        buckling_angle: [rad], between 0 and pi/2.
        axial_force: [N].
        normal_displacement_over_R, axial_displacement_over_R: ratios.
        rotation: [rad].
        lateral_force: on the middle particle [N].

    Raises ValueError for arrays of different shapes, numbers that are not finite, or angles out of their range.
    """

    buckling_angle: FloatArray
    axial_force: FloatArray
    normal_displacement_over_R: FloatArray  # noqa: N815 (the paper's axis, and the column's name)
    axial_displacement_over_R: FloatArray  # noqa: N815
    rotation: FloatArray
    lateral_force: FloatArray

    def __post_init__(self) -> None:
        """Check every array and freeze it."""
        shape: tuple[int | None, ...] = (None, None)
        for item in fields(self):
            array = float_array(np.array(getattr(self, item.name)), item.name, shape)
            shape = array.shape
            freeze(array)
            object.__setattr__(self, item.name, array)
        angle = self.buckling_angle
        if angle.size and not (angle.min() >= 0 and angle.max() < np.pi / 2):
            raise ValueError(
                f"buckling_angle: expected 0 to pi/2 rad, found {angle.min():.4g} to {angle.max():.4g}; in degrees?"
            )


MEASURES = tuple(item.name for item in fields(SegmentHistories))


@dataclass(frozen=True, slots=True, kw_only=True)
class Means:
    """Means over segments, each array (n_sets, n_increments + 1): one set of the data themselves, or one a resample."""

    buckling_angle: FloatArray
    axial_force: FloatArray
    normal_displacement_over_R: FloatArray  # noqa: N815
    axial_displacement_over_R: FloatArray  # noqa: N815
    rotation: FloatArray
    lateral_force: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(*(getattr(self, name) for name in MEASURES))

    def repeated(self, count: int) -> Means:
        """Return `count` copies of the first set."""
        return Means(**{name: np.repeat(getattr(self, name)[:1], count, axis=0) for name in MEASURES})


def weighted_means(runs: Sequence[SegmentHistories], weights: FloatArray) -> Means:
    """Return the means in which the segments, run after run, count as often as `weights` (n_sets, n_segments) say."""
    total = weights.sum(axis=1, keepdims=True)
    return Means(
        **{name: weights @ np.concatenate([getattr(run, name) for run in runs], axis=1).T / total for name in MEASURES}
    )


def resampled_segments(runs: Sequence[SegmentHistories], samples: int, rng: np.random.Generator) -> FloatArray:
    """Weights (samples, n_segments) of bootstrap samples in which every segment is drawn by itself."""
    n = sum(run.buckling_angle.shape[1] for run in runs)
    return rng.multinomial(n, np.full(n, 1 / n), size=samples).astype(np.float64)


def without_each_run(runs: Sequence[SegmentHistories]) -> FloatArray:
    """Weights (n_runs, n_segments) that leave one run out after the other; none with fewer than two filled runs.

    Runs without segments do not take part.
    """
    owner = np.repeat(np.arange(len(runs)), [run.buckling_angle.shape[1] for run in runs])
    filled = np.unique(owner)
    if len(filled) < 2:
        return np.zeros((0, len(owner)))
    return np.asarray(owner != filled[:, None], dtype=np.float64)


def jackknife_error(values: FloatArray) -> float:
    """Standard error from the values (n_runs,) found without each run.

    Of a mean over equal runs it is the usual one: standard deviation of the runs over the root of their number. Few
    runs have but few different bootstrap samples, and this needs none of them.

    >>> runs = np.array([1.0, 2.0, 6.0])
    >>> float(round(jackknife_error((runs.sum() - runs) / 2) * np.sqrt(3) / runs.std(ddof=1), 9))
    1.0
    """
    n = len(values)
    return float(np.sqrt((n - 1) / n * ((values - values.mean()) ** 2).sum()))
