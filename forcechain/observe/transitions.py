"""Unjamming transitions: the drops of the stress ratio, found or given, and the snapshots that cover them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import find_peaks

from forcechain.arrays import FloatArray, IntArray, float_array
from forcechain.observe.options import AnalysisOptions

STEPS_A_DROP = 140  # the curve is searched in steps of this share of a drop's length
SHORTEST_SHARE = (
    1e-9  # an interval this short, over the curve's length, holds one value: dividing by it would only round
)
LENGTH_TOLERANCE = 1e-6  # lengths of given drops may differ by this share, the rounding of printed strains


@dataclass(frozen=True, slots=True, kw_only=True)
class Drop:
    """One drop of the stress ratio over a strain interval; ratios are averaged over the smoothing length.

    Attributes:
        start: axial strain A at which it begins.
        end: axial strain B at which it ends.
        peak: largest stress ratio from A to B.
        peak_strain: axial strain of that.
        fall: stress ratio at A less that at B; below zero if a given interval is no drop.
        prominence: by how much the fall exceeds that of the intervals of the same length on the way to a larger fall,
            on the side where this is less; zero for a given interval that moving it a little would improve.
    """

    start: float
    end: float
    peak: float
    peak_strain: float
    fall: float
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
    half = np.minimum(0.5 * length, np.minimum(at - axial_strain[0], axial_strain[-1] - at))
    # The integral of straight lines is a parabola between samples: take it at the ends of every interval as well.
    ends = np.concatenate((at - half, at + half))
    knots = np.unique(np.concatenate((axial_strain, ends)))
    integral = cumulative_trapezoid(np.interp(knots, axial_strain, stress_ratio), knots, initial=0)
    low, high = np.searchsorted(knots, ends).reshape(2, -1)
    average: FloatArray = np.interp(at, axial_strain, stress_ratio)
    wide = half > SHORTEST_SHARE * (axial_strain[-1] - axial_strain[0])
    average[wide] = (integral[high] - integral[low])[wide] / (2 * half[wide])
    return average


def find_drops(axial_strain: FloatArray, stress_ratio: FloatArray, options: AnalysisOptions) -> tuple[Drop, ...]:
    """Find the drops of a curve of stress ratio (n_samples,) against axial strain (n_samples,), in order of strain.

    A collapse takes less strain than `drop_length`, and the ratio may creep down for a while before it, so a drop does
    not begin at a peak: it is where an interval of `drop_length` falls most. The fall q(A) - q(A + length) of the curve
    averaged over `drop_smoothing` has a local maximum there, of at least `drop_fall` and with a prominence of at least
    `drop_prominence`. Where two such intervals overlap the one that falls more is kept. Of those left, `drop_count` are
    taken: the first, or those that fall most (`drop_selection`). A curve with fewer gives fewer.

    Raises ValueError for arrays that differ in length, strains that do not increase, or a curve shorter than a drop.
    """
    strain, ratio = _checked_curve(axial_strain, stress_ratio)
    starts, fall = _fall_curve(strain, ratio, options.drop_length, options.drop_smoothing)
    # A collapse cut off by the end of the curve is a maximum too, hence the padding.
    found, _ = find_peaks(np.pad(fall, 1, constant_values=fall.min() - 1), prominence=0)
    found = found - 1
    prominence = _prominence(fall, found)
    sufficient = (fall[found] >= options.drop_fall) & (fall[found] > 0) & (prominence >= options.drop_prominence)
    found = found[sufficient]
    apart: list[float] = []
    for start in starts[found[np.argsort(-fall[found], kind="stable")]]:
        if all(abs(start - other) >= options.drop_length for other in apart):
            apart.append(float(start))
    chosen = sorted(apart) if options.drop_selection == "first" else apart
    length = options.drop_length
    return tuple(_drop(strain, ratio, start, start + length, options) for start in sorted(chosen[: options.drop_count]))


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
        drop = _drop(strain, ratio, start, end, options)
        if drops and start < drops[-1].end:
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


def _fall_curve(
    strain: FloatArray, ratio: FloatArray, length: float, smoothing: float
) -> tuple[FloatArray, FloatArray]:
    """Return starts A on an even grid, and the fall of the smoothed curve from each A to A + length."""
    room = strain[-1] - strain[0] - length
    if room <= 0:
        raise ValueError(f"axial_strain: expected more than a drop's {length:g}, found {strain[-1] - strain[0]:g}")
    starts = np.linspace(strain[0], strain[0] + room, int(np.ceil(room / length * STEPS_A_DROP)) + 1)
    top, bottom = smoothed(strain, ratio, np.concatenate((starts, starts + length)), smoothing).reshape(2, -1)
    return starts, top - bottom


def _prominence(fall: FloatArray, places: IntArray) -> FloatArray:
    """Return how far `fall` at `places` stands above its lowest value on the way to a larger one, on the lesser side.

    A side on which the curve ends within a drop's length tells too little to count, unless the other does the same.
    """
    prominences: FloatArray = np.zeros(len(places))
    for row, place in enumerate(places):
        known: list[float] = []
        cut_off: list[float] = []
        for side in (fall[: place + 1][::-1], fall[place:]):
            higher = np.flatnonzero(side > fall[place])
            reach = side[: higher[0]] if len(higher) else side
            complete = len(higher) > 0 or len(side) > STEPS_A_DROP
            (known if complete else cut_off).append(float(fall[place] - reach.min()))
        prominences[row] = min(known) if known else max(cut_off)
    return prominences


def _drop(strain: FloatArray, ratio: FloatArray, start: float, end: float, options: AnalysisOptions) -> Drop:
    inside = np.linspace(start, end, STEPS_A_DROP + 1)
    curve = smoothed(strain, ratio, inside, options.drop_smoothing)
    prominence = 0.0
    if strain[-1] - strain[0] > end - start:
        starts, fall = _fall_curve(strain, ratio, end - start, options.drop_smoothing)
        prominence = float(_prominence(fall, np.array([np.argmin(np.abs(starts - start))]))[0])
    return Drop(
        start=start,
        end=end,
        peak=float(curve.max()),
        peak_strain=float(inside[int(np.argmax(curve))]),
        fall=float(curve[0] - curve[-1]),
        prominence=prominence,
    )
