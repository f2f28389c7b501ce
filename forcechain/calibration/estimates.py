"""From fits of the data and of their resamples to estimates: intervals, what the data tell, profiles, goodness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from forcechain.arrays import BoolArray, FloatArray
from forcechain.calibration.bounded_fit import STEP, fit_many
from forcechain.calibration.column_fit import FITTED_MEASURES, SMALLEST, ColumnFit
from forcechain.calibration.resampling import Means, jackknife_error
from forcechain.calibration.result import Estimate, Goodness, Identified, Interval
from forcechain.theory.parameters import ChainParameters

FITTED = ("chain_tangential_stiffness", "lateral_stiffness")
CALIBRATED = (*FITTED, "lateral_strength")
CONFIDENCE = 0.95
EDGE = 1e-3  # of the admissible range: closer to its end a fit stands at the bound
MOST_OF_RANGE = 0.95  # an interval that wide tells nothing
NOTHING = 1e-10  # sum of squares a parameter moves per its own size: less is the rounding of finite differences
GRID = 24  # points of a search in each direction
LEAST_ERROR = 1e-6  # of kn R or of 1: weighs data whose segments are all alike


@dataclass(frozen=True, slots=True, kw_only=True)
class Ends:
    """kFC, ks and ls over kn (n, 3): the value, and the ends of the values that fit as well."""

    value: FloatArray
    low: FloatArray
    high: FloatArray
    on_plateau: BoolArray


def ends(fit: ColumnFit, means: Means, coordinates: FloatArray) -> Ends:
    """Ends of the values that fit as well as the fits at `coordinates` (n, 2), one for each set of `means`."""
    stiffness = fit.stiffnesses(coordinates)
    inside, low, high = fit.plateau(means, stiffness)
    chain, lateral = stiffness.T
    strength = fit.strength(means)

    def three(of_lateral: FloatArray) -> FloatArray:
        return np.column_stack([chain, np.where(inside, of_lateral, lateral), strength])

    return Ends(value=three((low + high) / 2), low=three(low), high=three(high), on_plateau=inside)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resampling:
    """How the sets were made: first `segments` bootstrap samples of segments, then all but one of the runs."""

    segments: int
    n_runs: int


def measure_errors(sets: Means, resampling: Resampling, parameters: ChainParameters) -> FloatArray:
    """Standard errors (4,) of `FITTED_MEASURES`, the larger of over segments and runs, rms over the increments."""
    n = resampling.segments
    errors = []
    for name in FITTED_MEASURES:
        values = getattr(sets, name)
        every = values[:n].std(axis=0, ddof=1)
        if resampling.n_runs > 1:
            every = np.maximum(every, [jackknife_error(column) for column in values[n:].T])
        scale = float(parameters.normal_stiffness * parameters.radius) if name == "axial_force" else 1.0
        errors.append(max(float(np.sqrt((every**2).mean())), LEAST_ERROR * scale))
    return np.array(errors)


def intervals(
    centre: float, low: FloatArray, high: FloatArray, resampling: Resampling, admissible: Interval
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


def estimate(
    fit: ColumnFit,
    data: Means,
    best: FloatArray,
    index: int,
    found: Ends,
    resampled: Ends,
    resampling: Resampling,
    information: dict[str, float],
    profile_points: int,
) -> Estimate:
    """Return parameter `index` of `CALIBRATED`: value, intervals, what the data tell, profile."""
    name = CALIBRATED[index]
    admissible = _admissible(fit, name)
    low, high = resampled.low[:, index], resampled.high[:, index]
    segments, runs, error = intervals(float(found.low[0, index]), low, high, resampling, admissible)
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


def information_shares(fit: ColumnFit, data: Means, value: FloatArray) -> tuple[dict[str, float], ...]:
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


def goodness(
    fit: ColumnFit, data: Means, sets: Means, found: Ends, resampled: Ends, resampling: Resampling
) -> tuple[Goodness, ...]:
    """Return how well each measure is met, calibrated and with the given parameters, with intervals over resamples."""
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
        segments, runs, _ = intervals(centre, values, values, resampling, admissible)
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
