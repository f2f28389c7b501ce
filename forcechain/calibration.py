"""Calibration: the stiffnesses and the lateral strength of the model from averaged buckling data, with intervals.

What the data can tell about each parameter differs, and the result says so. The lateral strength is measured: the mean
lateral force over R, as section 5.2 of Tordesillas & Muthuswamy (2009) does. Once the lateral support has yielded, the
model no longer depends on its stiffness ks: a perfect column whose data start at 14 degrees then only bounds ks from
below, by sin theta_s = ls/(2 ks). The chain's tangential stiffness kFC enters the force through K = kFC kr/(kFC + kr),
and the rotation through the angle at which the moment yields.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from forcechain.arrays import BoolArray, FloatArray
from forcechain.bounded_fit import STEP, fit_many
from forcechain.calibration_result import Calibration, Column, Estimate, Goodness, Identified, Interval
from forcechain.column_fit import FITTED_MEASURES, SMALLEST, ColumnFit
from forcechain.resampling import (
    Means,
    SegmentHistories,
    jackknife_error,
    resampled_segments,
    weighted_means,
    without_each_run,
)
from forcechain.theory.classes import TYPICAL_OVERLAP
from forcechain.theory.parameters import ChainParameters

FITTED = ("chain_tangential_stiffness", "lateral_stiffness")
CALIBRATED = (*FITTED, "lateral_strength")
CONFIDENCE = 0.95
MIN_SAMPLES = 40  # fewer have no 2.5 % quantile
EDGE = 1e-3  # of the admissible range: closer to its end a fit stands at the bound
MOST_OF_RANGE = 0.95  # an interval that wide tells nothing
NOTHING = 1e-10  # sum of squares a parameter moves per its own size: less is the rounding of finite differences
LEAST_ERROR = 1e-6  # of kn R or of 1: weighs data whose segments are all alike
GRID = 24  # points of the search in each direction
APART = 0.15  # of the range: how far starts of the search lie from each other
STARTS = 4
RIVAL_FACTOR, RIVAL_RISE = 2.0, 12.0  # a minimum of the data that is less deep is the deepest of hardly any resample
INSIDE = 1e-9


def calibrate(
    runs: Sequence[SegmentHistories],
    reference: ChainParameters,
    *,
    column: Column = Column.PERFECT,
    largest_overlap: float = TYPICAL_OVERLAP,
    samples: int = 400,
    profile_points: int = 41,
    random_seed: int = 0,
) -> Calibration:
    """Fit kFC and ks to averaged histories of buckled segments; ls is their mean lateral force over R.

    Weighted least squares on axial force, normal displacement, axial displacement and rotation at the mean buckling
    angle of each increment, over all kFC and ks that bound (30) admits. A measure's weight is its standard error, one
    for all increments (its root mean square): single ones run over decades, as displacement and rotation start from
    exactly zero, and would leave all the weight to the first increments. Increments of a segment are so correlated
    that a measure counts as one observation, and intervals come from resampling segments and runs, not from residuals.

    Args:
        runs: one a packing, at least one, with at least two segments in all, on the same increments.
        reference: radius, kn, kr, mu_r of the simulation; its kFC, ks and ls are those the fit is compared with.
        column: the perfect one, from its state at the mean initial angle, or the imperfect one.
        largest_overlap: over R, in (30).
        samples: bootstrap samples of the segments; runs are left out one by one (jackknife).
        profile_points: of the profile of each fitted parameter; 0 for none.
        random_seed: of the resampling.

    Raises:
        ValueError: too few segments or samples, different numbers of increments, reference not one set, an overlap
            outside 0 to 1.
    """
    _check(runs, reference, largest_overlap, samples)
    rng = np.random.default_rng(random_seed)
    counts = [run.buckling_angle.shape[1] for run in runs]
    by_segment = resampled_segments(runs, samples, rng)
    by_run = without_each_run(runs)
    data = weighted_means(runs, np.ones((1, sum(counts))))
    sets = weighted_means(runs, np.concatenate([by_segment, by_run]))
    resampling = _Resampling(segments=samples, n_runs=sum(count > 0 for count in counts))
    fit = ColumnFit(
        fixed=reference,
        imperfect=column is Column.IMPERFECT,
        bound=largest_overlap - largest_overlap**2 / 2,
        errors=_errors(sets, resampling, reference),
    )
    starts = _search(fit, data)
    best = starts[0]
    found = _ends(fit, data, best[None, :])
    resampled = _ends(fit, sets, _fitted_sets(fit, sets, starts))
    information = _information(fit, data, found.value)
    estimates = tuple(
        _estimate(fit, data, best, index, found, resampled, resampling, information[index], profile_points)
        for index in range(len(CALIBRATED))
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.corrcoef(resampled.low[:samples].T)
    final = fit.residuals_at(data, found.value[:, :2])
    return Calibration(
        column=column,
        parameters=_one_set(fit.parameters(data, found.value[:, :2])),
        estimates=estimates,
        correlation=np.asarray(correlation, dtype=np.float64),
        goodness=_goodness(fit, data, sets, found, resampled, resampling),
        sum_of_squares=float((final**2).sum()),
        bound=fit.bound,
        n_segments=sum(counts),
        n_runs=resampling.n_runs,
        left_out=int((~fit.compared(data)).sum()),
    )


def _check(runs: Sequence[SegmentHistories], reference: ChainParameters, largest_overlap: float, samples: int) -> None:
    shapes = [run.buckling_angle.shape for run in runs]
    if not shapes or sum(shape[1] for shape in shapes) < 2:
        raise ValueError(f"runs: expected at least 2 segments in all, found {sum(shape[1] for shape in shapes)}")
    if len({shape[0] for shape in shapes}) > 1 or shapes[0][0] < 2:
        raise ValueError(
            f"runs: expected at least 2 increments, as many in each, found {sorted({s[0] for s in shapes})}"
        )
    if reference.shape:
        raise ValueError(f"reference: expected one parameter set, found shape {reference.shape}")
    if not 0 < largest_overlap < 1:
        raise ValueError(f"largest_overlap: expected above 0 and below 1 (of the radius), found {largest_overlap:g}")
    if samples < MIN_SAMPLES:
        raise ValueError(f"samples: expected at least {MIN_SAMPLES}, found {samples}")


def _errors(sets: Means, resampling: _Resampling, p: ChainParameters) -> FloatArray:
    """Standard error of each measure, the larger of that over segments and over runs, rms over the increments."""
    n = resampling.segments
    errors = []
    for name in FITTED_MEASURES:
        values = getattr(sets, name)
        every = values[:n].std(axis=0, ddof=1)
        if resampling.n_runs > 1:
            every = np.maximum(every, [jackknife_error(column) for column in values[n:].T])
        least = LEAST_ERROR * (float(p.normal_stiffness * p.radius) if name == "axial_force" else 1.0)
        errors.append(max(float(np.sqrt((every**2).mean())), least))
    return np.array(errors)


def _search(fit: ColumnFit, data: Means) -> FloatArray:
    """Return the coordinates of the deepest minima (n_starts, 2), deepest first: a grid, then a search from the best.

    The sum of squares has several minima: with the moment yielding before, within or after the data.
    """
    ticks = (np.arange(GRID) + 0.5) / GRID
    grid = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    total = (fit.residuals(data.repeated(len(grid)), grid) ** 2).sum(axis=1)
    starts: list[FloatArray] = []
    for index in np.argsort(total, kind="stable"):
        if all(np.abs(grid[index] - other).max() > APART for other in starts):
            starts.append(grid[index])
        if len(starts) == STARTS:
            break
    found = fit_many(partial(fit.residuals, data.repeated(len(starts))), np.array(starts))
    order = np.argsort(found.sum_of_squares, kind="stable")
    minima = found.coordinates[order]
    least = found.sum_of_squares[order]

    def one(coordinates: FloatArray) -> FloatArray:
        return np.asarray(fit.residuals(data, coordinates[None, :])[0])

    # A second method of another kind has the last word on the deepest; it stops just inside of an edge.
    polished = least_squares(one, np.clip(minima[0], INSIDE, 1 - INSIDE), bounds=(0.0, 1.0), xtol=1e-10, max_nfev=30)
    if 2 * polished.cost < least[0]:
        minima[0], least[0] = polished.x, 2 * polished.cost
    rivals = least <= RIVAL_FACTOR * least[0] + RIVAL_RISE
    return np.asarray(minima[rivals])


def _fitted_sets(fit: ColumnFit, sets: Means, starts: FloatArray) -> FloatArray:
    """Fit every resample from the minima of the data; return the coordinates of the better one (n_sets, 2)."""
    n_sets = len(sets.buckling_angle)
    best = np.repeat(starts[:1], n_sets, axis=0)
    least = np.full(n_sets, np.inf)
    for start in starts:
        every = np.repeat(start[None, :], n_sets, axis=0)
        fitted = fit_many(partial(fit.residuals, sets), every, tolerance=1e-4, iterations=30)
        better = fitted.sum_of_squares < least
        best = np.where(better[:, None], fitted.coordinates, best)
        least = np.where(better, fitted.sum_of_squares, least)
    return best


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ends:
    """kFC, ks and ls over kn (n, 3): the value, and the ends of the values that fit as well."""

    value: FloatArray
    low: FloatArray
    high: FloatArray
    on_plateau: BoolArray


def _ends(fit: ColumnFit, means: Means, coordinates: FloatArray) -> _Ends:
    stiffness = fit.stiffnesses(coordinates)
    inside, low, high = fit.plateau(means, stiffness)
    chain, lateral = stiffness.T
    strength = fit.strength(means)

    def three(of_lateral: FloatArray) -> FloatArray:
        return np.column_stack([chain, np.where(inside, of_lateral, lateral), strength])

    return _Ends(value=three((low + high) / 2), low=three(low), high=three(high), on_plateau=inside)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Resampling:
    """How the sets were made: first `segments` bootstrap samples of segments, then all but one of the runs."""

    segments: int
    n_runs: int


def _intervals(
    centre: float, low: FloatArray, high: FloatArray, resampling: _Resampling, admissible: Interval
) -> tuple[Interval, Interval | None, float]:
    """Return the interval over segments (quantiles), that over runs (Student's t), and the larger standard error."""
    n, tail = resampling.segments, (1 - CONFIDENCE) / 2
    segments = Interval(low=float(np.quantile(low[:n], tail)), high=float(np.quantile(high[:n], 1 - tail)))
    error = float(np.std(low[:n], ddof=1))
    if resampling.n_runs < 2:
        return segments, None, error
    of_runs = jackknife_error(low[n:])
    reach = float(student.ppf(1 - tail, resampling.n_runs - 1)) * of_runs
    runs = Interval(low=max(centre - reach, admissible.low), high=min(centre + reach, admissible.high))
    return segments, runs, max(error, of_runs)


def _estimate(
    fit: ColumnFit,
    data: Means,
    best: FloatArray,
    index: int,
    found: _Ends,
    resampled: _Ends,
    resampling: _Resampling,
    information: dict[str, float],
    profile_points: int,
) -> Estimate:
    name = CALIBRATED[index]
    admissible = _admissible(fit, name)
    low, high = resampled.low[:, index], resampled.high[:, index]
    segments, runs, error = _intervals(float(found.low[0, index]), low, high, resampling, admissible)
    _, edge, top_of_plateau = fit.plateau(data, found.value)
    top = float(top_of_plateau[0])
    reached = max(segments.high, -np.inf if runs is None else runs.high) >= float(edge[0])
    open_above = name == "lateral_stiffness" and not fit.imperfect and reached and float(edge[0]) < top
    if open_above:  # where one such value fits, all up to (30) do
        segments = Interval(low=segments.low, high=top)
        runs = None if runs is None else Interval(low=runs.low, high=top)
    interval = segments if runs is None or segments.width >= runs.width else runs
    if name == "lateral_strength":
        identified = Identified.MEASURED
    elif open_above:
        tells = interval.width < MOST_OF_RANGE * top
        identified = Identified.BOUNDED_BELOW if tells else Identified.NO
    elif not information:
        identified = Identified.NO
    elif _at_edge(best, index):
        identified = Identified.AT_BOUND
    else:
        tells = interval.width < MOST_OF_RANGE * admissible.width
        identified = Identified.YES if tells else Identified.NO
    held, least = _profile(fit, data, index, profile_points) if name in FITTED else (np.zeros(0), np.zeros(0))
    return Estimate(
        name=name,
        value=float(found.value[0, index]),
        by_segments=segments,
        by_runs=runs,
        interval=admissible if identified is Identified.NO else interval,
        standard_error=error,
        identified=identified,
        determined_by=information,
        profile_value=held,
        profile_sum=least,
    )


def _admissible(fit: ColumnFit, name: str) -> Interval:
    largest = {
        "chain_tangential_stiffness": fit.largest_chain_stiffness,
        "lateral_stiffness": fit.bound,
        "lateral_strength": np.inf,
    }
    return Interval(low=0.0, high=largest[name])


def _at_edge(best: FloatArray, index: int) -> bool:
    on_bound = bool(best[1] > 1 - EDGE)  # of (30), which holds kFC and ks together
    return on_bound or bool(best[index] < EDGE or best[index] > 1 - EDGE)


def _information(fit: ColumnFit, data: Means, value: FloatArray) -> tuple[dict[str, float], ...]:
    """Share of each measure in what the data tell about kFC and ks: squared derivatives by the parameter's logarithm.

    Empty where nothing moves. The lateral strength is told by the lateral force alone.
    """
    at = fit.residuals_at(data, value[:, :2])
    shares: list[dict[str, float]] = []
    for index in range(len(FITTED)):
        moved = value[:, :2].copy()
        moved[:, index] *= 1 + STEP
        slope = ((fit.residuals_at(data, moved) - at) / STEP).reshape(len(FITTED_MEASURES), -1)
        each = (slope**2).sum(axis=1)
        tells = each.sum() > NOTHING
        shares.append(
            {name: float(part / each.sum()) for name, part in zip(FITTED_MEASURES, each, strict=True)} if tells else {}
        )
    return (*shares, {"lateral_force": 1.0})


def _profile(fit: ColumnFit, data: Means, index: int, points: int) -> tuple[FloatArray, FloatArray]:
    """Least sum of squares (n_points,) with one stiffness held at each value, the other free within (30)."""
    if points == 0:
        return np.zeros(0), np.zeros(0)
    share = (np.arange(points) + 0.5) / points
    held = share * _admissible(fit, FITTED[index]).high

    def stiffnesses(free: FloatArray, fixed: FloatArray) -> FloatArray:
        if index == 0:
            return np.column_stack([fixed, free * fit.room(fixed)])
        if fit.rolling == 0:
            return np.column_stack([SMALLEST + free * (fit.largest_chain_stiffness - SMALLEST), fixed])
        room = np.minimum(fit.largest_series, fit.bound - fixed)
        return np.column_stack([fit.chain_stiffness(room * (SMALLEST + (1 - SMALLEST) * free)), fixed])

    ticks = (np.arange(GRID) + 0.5) / GRID
    free, fixed = np.tile(ticks, points), np.repeat(held, GRID)
    grid = fit.residuals_at(data.repeated(len(free)), stiffnesses(free, fixed))
    start = ticks[(grid**2).sum(axis=1).reshape(points, GRID).argmin(axis=1)]
    many = data.repeated(points)
    ended = fit_many(lambda x: fit.residuals_at(many, stiffnesses(x[:, 0], held)), start[:, None], iterations=30)
    return held, ended.sum_of_squares.copy()


def _goodness(
    fit: ColumnFit, data: Means, sets: Means, found: _Ends, resampled: _Ends, resampling: _Resampling
) -> tuple[Goodness, ...]:
    kn = fit.fixed.normal_stiffness
    given = np.array([[getattr(fit.fixed, name) / kn for name in CALIBRATED]])

    def deviations(means: Means, values: FloatArray) -> FloatArray:
        values = np.broadcast_to(values, (len(means.buckling_angle), len(CALIBRATED)))
        difference = fit.differences(means, fit.parameters(means, values[:, :2], values[:, 2]))
        level = np.stack([np.abs(getattr(means, name)).mean(axis=1) for name in FITTED_MEASURES], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt((difference**2).mean(axis=2)) / level)

    calibrated, of_sets = deviations(data, found.value)[0], deviations(sets, resampled.value)
    reference, of_reference = deviations(data, given)[0], deviations(sets, given)
    squares = fit.residuals_at(data, found.value[:, :2])[0].reshape(len(FITTED_MEASURES), -1)
    admissible = Interval(low=0.0, high=np.inf)

    def interval(centre: float, values: FloatArray) -> Interval:
        segments, runs, _ = _intervals(centre, values, values, resampling, admissible)
        return segments if runs is None or segments.width >= runs.width else runs

    return tuple(
        Goodness(
            measure=name,
            calibrated=float(calibrated[k]),
            calibrated_interval=interval(float(calibrated[k]), of_sets[:, k]),
            reference=float(reference[k]),
            reference_interval=interval(float(reference[k]), of_reference[:, k]),
            sum_of_squares=float((squares[k] ** 2).sum()),
        )
        for k, name in enumerate(FITTED_MEASURES)
    )


def _one_set(parameters: ChainParameters) -> ChainParameters:
    return ChainParameters(
        **{item.name: float(np.asarray(getattr(parameters, item.name)).flat[0]) for item in fields(ChainParameters)}
    )
