"""Unjamming transitions: the drops of the stress ratio, found or given, and the snapshots that cover them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import find_peaks, peak_prominences

from forcechain.arrays import FloatArray, IntArray, float_array
from forcechain.observe.options import AnalysisOptions

STEPS_A_DROP = 140  # the curve is searched in steps of this share of a drop's length
LENGTH_TOLERANCE = 1e-6  # lengths of given drops may differ by this share, the rounding of printed strains


@dataclass(frozen=True, slots=True, kw_only=True)
class Drop:
    """One drop of the stress ratio over a strain interval.

    Attributes:
        start: axial strain A at which it begins.
        end: axial strain B at which it ends.
        peak: stress ratio at A, averaged over the smoothing length.
        fall: stress ratio at A less that at B.
        largest_fall: stress ratio at A less its least value up to B.
        prominence: height of the peak at A above the higher of the troughs that part it from higher peaks; zero if a
            given drop does not begin at a peak.
    """

    start: float
    end: float
    peak: float
    fall: float
    largest_fall: float
    prominence: float

    @property
    def length(self) -> float:
        """Axial strain from A to B."""
        return self.end - self.start


def smoothed(axial_strain: FloatArray, stress_ratio: FloatArray, at: FloatArray, length: float) -> FloatArray:
    """Return the stress ratio averaged over `length` of axial strain around each strain of `at`.

    The average is that of the straight lines between the samples, so it does not depend on where or how often the
    curve was sampled beyond what that changes in the lines. Near the ends the interval shrinks to stay centred.
    """
    if length == 0:
        return np.interp(at, axial_strain, stress_ratio)
    half = np.minimum(0.5 * length, np.minimum(at - axial_strain[0], axial_strain[-1] - at))
    half = np.maximum(half, 1e-3 * length)  # at the very ends, where the value itself is the average
    # The integral of straight lines is a parabola between samples: sample it at the ends of every interval as well.
    ends = np.concatenate((at - half, at + half))
    knots = np.unique(np.concatenate((axial_strain, ends)))
    integral = cumulative_trapezoid(np.interp(knots, axial_strain, stress_ratio), knots, initial=0)
    low, high = np.searchsorted(knots, ends).reshape(2, -1)
    average: FloatArray = (integral[high] - integral[low]) / (2 * half)
    return average


def find_drops(axial_strain: FloatArray, stress_ratio: FloatArray, options: AnalysisOptions) -> tuple[Drop, ...]:
    """Find the drops of a curve of stress ratio (n_samples,) against axial strain (n_samples,), in order of strain.

    The curve is averaged over `drop_smoothing` and searched for peaks with a prominence of at least `drop_prominence`.
    A drop begins at its peak and is `drop_length` long; it must end within the curve, lie at least `drop_prominence`
    below its peak somewhere, and end below it. Drops do not overlap: they are taken one after the other, from the first
    on or from the largest fall down (`drop_selection`), up to `drop_count`. A curve with fewer gives fewer.

    Raises ValueError for arrays that differ in length, strains that do not increase, or a curve shorter than a drop.
    """
    strain, ratio = _checked_curve(axial_strain, stress_ratio)
    length = options.drop_length
    if strain[-1] - strain[0] <= length:
        raise ValueError(f"axial_strain: expected more than a drop's {length:g}, found {strain[-1] - strain[0]:g}")
    count = int(np.ceil((strain[-1] - strain[0]) / length * STEPS_A_DROP)) + 1
    grid = np.linspace(strain[0], strain[-1], count)
    curve = smoothed(strain, ratio, grid, options.drop_smoothing)
    peaks, _ = find_peaks(curve, prominence=max(options.drop_prominence, np.finfo(float).tiny))
    drops = [_drop(strain, ratio, grid, curve, float(grid[p]), float(grid[p]) + length, options) for p in peaks]
    drops = [
        drop
        for drop in drops
        if drop.end <= strain[-1] and drop.fall > 0 and drop.largest_fall >= options.drop_prominence
    ]
    if options.drop_selection == "largest":
        drops.sort(key=lambda drop: -drop.fall)
    chosen: list[Drop] = []
    for drop in drops:
        if len(chosen) < options.drop_count and all(_apart(drop, other) for other in chosen):
            chosen.append(drop)
    return tuple(sorted(chosen, key=lambda drop: drop.start))


def given_drops(
    axial_strain: FloatArray,
    stress_ratio: FloatArray,
    intervals: Sequence[tuple[float, float]],
    options: AnalysisOptions,
) -> tuple[Drop, ...]:
    """Return the drops over given `intervals` (A, B) of axial strain, in order of strain.

    Raises ValueError as `find_drops` does, and for an interval that is reversed, leaves the curve, overlaps another, or
    is not as long as the first (averages by increment need equal lengths).
    """
    strain, ratio = _checked_curve(axial_strain, stress_ratio)
    drops: list[Drop] = []
    for start, end in sorted((float(a), float(b)) for a, b in intervals):
        where = f"drop {start:g}-{end:g}"
        if not start < end:
            raise ValueError(f"{where}: expected a start below the end")
        if start < strain[0] or end > strain[-1]:
            raise ValueError(f"{where}: expected strains between {strain[0]:g} and {strain[-1]:g}")
        drop = _drop(strain, ratio, None, None, start, end, options)
        if drops and not _apart(drop, drops[-1]):
            raise ValueError(f"{where}: expected no overlap, found {drops[-1].start:g}-{drops[-1].end:g}")
        if drops and abs(drop.length - drops[0].length) > LENGTH_TOLERANCE * drops[0].length:
            raise ValueError(f"{where}: expected a length of {drops[0].length:g}, found {drop.length:g}")
        drops.append(drop)
    return tuple(drops)


def snapshots_of_drop(axial_strain: FloatArray, drop: Drop, options: AnalysisOptions) -> IntArray:
    """Return the rows (increments + 1,) of the snapshots at axial strains (n_snapshots,) that cover `drop`.

    Each is the one nearest to A + i (B - A)/increments. Raises ValueError if one is further off than half an
    increment, which says that the snapshots are too far apart for `increments`.
    """
    strain = float_array(axial_strain, "axial_strain", (None,))
    if len(strain) < 2 or (np.diff(strain) <= 0).any():
        raise ValueError("axial_strain: expected at least two snapshots, in order of strain")
    step = drop.length / options.increments
    wanted = drop.start + step * np.arange(options.increments + 1)
    after = np.clip(np.searchsorted(strain, wanted), 1, len(strain) - 1)
    nearest = np.where(wanted - strain[after - 1] <= strain[after] - wanted, after - 1, after)
    distance = np.abs(strain[nearest] - wanted)
    far = distance > 0.5 * step * (1 + LENGTH_TOLERANCE)
    if far.any() or (np.diff(nearest) == 0).any():
        worst = int(np.argmax(distance))
        raise ValueError(
            f"drop {drop.start:g}-{drop.end:g}: expected a snapshot every {step:.3g} of axial strain for "
            f"{options.increments} increments, found {strain[nearest[worst]]:.6g} nearest to {wanted[worst]:.6g}; "
            "ask for fewer increments"
        )
    return nearest.astype(np.int64)


def _checked_curve(axial_strain: FloatArray, stress_ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
    strain = float_array(axial_strain, "axial_strain", (None,))
    ratio = float_array(stress_ratio, "stress_ratio", strain.shape)
    if len(strain) < 2:
        raise ValueError(f"axial_strain: expected at least 2 samples, found {len(strain)}")
    back = np.diff(strain) <= 0
    if back.any():
        row = int(np.argmax(back)) + 1
        raise ValueError(f"axial_strain, row {row}: expected more than {strain[row - 1]:g}, found {strain[row]:g}")
    return strain, ratio


def _drop(
    strain: FloatArray,
    ratio: FloatArray,
    grid: FloatArray | None,
    curve: FloatArray | None,
    start: float,
    end: float,
    options: AnalysisOptions,
) -> Drop:
    if grid is None or curve is None:
        steps = int(np.ceil((strain[-1] - strain[0]) / (end - start) * STEPS_A_DROP)) + 1
        grid = np.unique(np.append(np.linspace(strain[0], strain[-1], steps), start))
        curve = smoothed(strain, ratio, grid, options.drop_smoothing)
    top = int(np.argmin(np.abs(grid - start)))
    last = int(np.argmin(np.abs(grid - end)))
    at_peak = 0 < top < len(grid) - 1 and curve[top - 1] < curve[top] >= curve[top + 1]
    prominence = float(peak_prominences(curve, [top])[0][0]) if at_peak else 0.0
    return Drop(
        start=start,
        end=end,
        peak=float(curve[top]),
        fall=float(curve[top] - curve[last]),
        largest_fall=float(curve[top] - curve[top : last + 1].min()),
        prominence=prominence,
    )


def _apart(drop: Drop, other: Drop) -> bool:
    return drop.start >= other.end or drop.end <= other.start
