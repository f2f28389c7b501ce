"""Columns of more than three particles against stretches of a chain of that length.

A stretch of N particles has N-2 overlapping three-particle segments. Their measures are averaged over the stretch, in
the data and in the model alike: the angle of a segment is half the angle between its two contacts, its displacement
the decrease of the distance of its ends, its rotation half the difference of theirs. So N = 3 is the three-particle
column, and both are compared at the mean angle of the segments.

The model is the perfect column, buckled in the mode of the lowest load: neighbours to opposite sides. Bound (30) is on
the overlap at the critical load, which for N > 3 is that of this mode.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from forcechain.arrays import FloatArray
from forcechain.calibration.column_fit import COUNTED_FROM_START, FITTED_MEASURES, NO_EQUILIBRIUM
from forcechain.calibration.estimates import CALIBRATED, CONFIDENCE, Resampling, measure_errors
from forcechain.calibration.resampling import (
    Means,
    SegmentHistories,
    jackknife_error,
    resampled_segments,
    weighted_means,
    without_each_run,
)
from forcechain.calibration.result import Identified, Interval
from forcechain.theory.classes import TYPICAL_OVERLAP
from forcechain.theory.column import buckling_modes, mode_stiffness
from forcechain.theory.continuation import follow_column
from forcechain.theory.parameters import ChainParameters

FEWEST = 8  # stretches: a mean over fewer has no error worth weighing by
SAMPLES = 200
GRID = 6
STEP = 1e-3  # of a finite difference, of the admissible range: paths come in finite steps
SMALLEST, LARGEST_CHAIN_STIFFNESS = 1e-3, 0.2  # kFC over kn
WIDEST = math.radians(75)  # largest angle of a contact that is followed
REACH = 2.4  # the largest angle of a contact over the mean angle of the segments, at first
STEP_OF_PATH = 0.05  # between points, over which measures are interpolated
STRONGER = 0.05  # of the strength, for a derivative
INSIDE = 1e-6
EDGE = 1e-2  # of the admissible range: closer to its end a fit stands at the bound
TELLS = 0.95  # of the admissible range: a wider interval tells nothing
NOTHING = 1e-6  # sum of squares a parameter moves over its whole range: less is not moved at all


@dataclass(frozen=True, slots=True, kw_only=True)
class LongEstimate:
    """A parameter over kn: value, 95 % interval within what is admissible, and what the data tell."""

    name: str
    value: float
    interval: Interval
    standard_error: float
    identified: Identified


@dataclass(frozen=True, slots=True, kw_only=True)
class LongColumn:
    """The column of N particles fitted to stretches of that length.

    Attributes:
        n_particles: N.
        n_stretches, n_runs: what was averaged.
        means: of the data, one set.
        estimates: kFC, ks, ls in the order of `CALIBRATED`.
        parameters: the calibrated set.
        critical_force: of the calibrated column [N]; `first_force` is that of the data at their first increment.
        first_force: [N].
        sum_of_squares: at the best fit; about the number of measures for a model that is right.
        deviation: measure -> root-mean-square difference over the mean absolute value, calibrated.
        of_three: measure -> the same with the parameters fitted to N = 3, ls its own; None where they give no path.
    """

    n_particles: int
    n_stretches: int
    n_runs: int
    means: Means
    estimates: tuple[LongEstimate, ...]
    parameters: ChainParameters
    critical_force: float
    first_force: float
    sum_of_squares: float
    deviation: dict[str, float]
    of_three: dict[str, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Path:
    """A column's path by the mean angle of its segments: points (n_points,) and the four measures there."""

    angle: FloatArray
    curves: dict[str, FloatArray]

    def at(self, angle: FloatArray) -> FloatArray:
        """Return the four measures (4, *angle.shape); not a number beyond the path."""
        values = [np.interp(angle, self.angle, self.curves[name], right=np.nan) for name in FITTED_MEASURES]
        return np.stack(values)


def _follow(parameters: ChainParameters, n_particles: int, largest: float) -> _Path:
    """Follow the column until its mean segment angle is at least `largest`, or as far as that grows."""
    for contact_angle in (min(largest * REACH, WIDEST), WIDEST):
        path = follow_column(parameters, n_particles, largest_angle=contact_angle, largest_step=STEP_OF_PATH)
        t, u, w = path.angles, path.lateral_displacement_over_R, path.rotations
        mean = (np.abs(np.diff(t, axis=1)) / 2).mean(axis=1)
        turn = int(np.argmax(np.append(np.diff(mean) <= 0, True))) + 1  # buckling gathers in one segment
        if turn < len(mean) or mean[-1] >= largest:
            break
    d = path.normal_displacement_over_R
    along = (2 - d) * np.cos(t)
    ends = np.hypot(along[:, 1:] + along[:, :-1], u[:, 2:] - u[:, :-2])
    curves = {
        "axial_force": path.axial_force,
        "normal_displacement_over_R": ((d[:, 1:] + d[:, :-1]) / 2).mean(axis=1),
        "axial_displacement_over_R": (4 - ends).mean(axis=1),
        "rotation": (np.abs(w[:, 2:] - w[:, :-2]) / 2).mean(axis=1),
    }
    return _Path(angle=mean[:turn], curves={name: curve[:turn] for name, curve in curves.items()})


def column_measures(parameters: ChainParameters, n_particles: int, angle: FloatArray) -> dict[str, FloatArray]:
    """Return the measures of a perfect column of N particles at mean segment angles `angle` (n,) [rad].

    The four of `FITTED_MEASURES`, averaged over the N-2 segments; not a number at angles its path does not reach.
    Raises ValueError as `follow_column` does.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> column_measures(TABLE_3, 3, np.radians([14.0]))["axial_force"].round(2)
    array([9.29])
    """
    values = _follow(parameters, n_particles, float(np.max(angle))).at(angle)
    return dict(zip(FITTED_MEASURES, values, strict=True))


def largest_lateral_stiffness(
    chain_stiffness: FloatArray, rolling_stiffness: float, n_particles: int, largest_overlap: float = TYPICAL_OVERLAP
) -> FloatArray:
    """Return the largest ks/kn, at each kFC/kn, that keeps the overlap at the critical load within `largest_overlap`.

    The lowest of the N-2 modes has d (2 - d) = L/kn; L grows with ks in every mode. For N = 3 this is bound (30).
    """
    largest = 2 * largest_overlap - largest_overlap**2
    wave = np.pi * np.arange(1, n_particles - 1) / (n_particles - 1)
    chain = np.asarray(chain_stiffness, dtype=np.float64)[..., None]
    without, _ = mode_stiffness(wave, chain, rolling_stiffness, 0.0)
    return np.asarray(((largest - without) * (1 - np.cos(wave)) / 2).max(axis=-1))


def calibrate_long(
    runs: Sequence[SegmentHistories],
    reference: ChainParameters,
    n_particles: int,
    *,
    three: ChainParameters | None = None,
    largest_overlap: float = TYPICAL_OVERLAP,
    random_seed: int = 0,
) -> LongColumn:
    """Fit kFC and ks of the column of N particles to stretches of that length; ls is their mean lateral force over R.

    Weighted least squares as `calibrate`, on the same four measures averaged over each stretch. Intervals: Student's t
    times the larger of two standard errors, that over stretches (bootstrap samples through the derivative of the fit)
    and that over runs (fits without each).

    Args:
        runs: one a packing; a "segment" of the histories is a stretch, its measures the means over its N-2 segments.
        reference: radius, kn, kr, mu_r of the simulation.
        n_particles: N, from 3.
        three: the parameters fitted to N = 3, to see how far they carry; None: not asked.
        largest_overlap: over R, at the critical load.
        random_seed: of the resampling.

    Raises ValueError for fewer than 8 stretches, or data no admissible column reaches.
    """
    counts = [run.buckling_angle.shape[1] for run in runs]
    if sum(counts) < FEWEST:
        raise ValueError(f"runs: expected at least {FEWEST} stretches of {n_particles} particles, found {sum(counts)}")
    rng = np.random.default_rng(random_seed)
    data = weighted_means(runs, np.ones((1, sum(counts))))
    sets = weighted_means(runs, np.concatenate([resampled_segments(runs, SAMPLES, rng), without_each_run(runs)]))
    resampling = Resampling(segments=SAMPLES, n_runs=sum(count > 0 for count in counts))
    fit = _Fit(
        fixed=reference,
        n_particles=n_particles,
        largest_overlap=largest_overlap,
        errors=measure_errors(sets, resampling, reference),
    )
    best, cost = fit.best(data, fit.starts(data))
    if not cost < NO_EQUILIBRIUM:
        raise ValueError(f"runs: no admissible column of {n_particles} particles reaches their angles")
    at = fit.residuals(data, best)
    slope = np.stack([(fit.residuals(data, moved) - at) / step for moved, step in _moved(best)], axis=1)
    singular = (slope**2).sum(axis=0) < NOTHING
    inverse = np.linalg.pinv(slope)
    resampled = fit.residuals_of_sets(data, sets, best)[:SAMPLES]
    by_segment = best - (resampled - at) @ inverse.T
    refitted = [fit.best(_one(sets, SAMPLES + k), [best])[0] for k in range(len(sets.buckling_angle) - SAMPLES)]
    every = np.array([fit.stiffnesses(np.clip(x, 0, 1)) for x in [*by_segment, *refitted]])
    values = np.column_stack([every, fit.strengths(sets)])
    found = np.append(fit.stiffnesses(best), fit.strengths(data)[0])
    room = float(largest_lateral_stiffness(found[0], fit.rolling, n_particles, largest_overlap))
    highest = (LARGEST_CHAIN_STIFFNESS, room, np.inf)
    estimates = tuple(
        _estimate(
            name,
            float(found[k]),
            values[:, k],
            resampling,
            highest[k],
            unmoved=bool([*singular, False][k]),
            at_edge=bool(best[1] > 1 - EDGE or best[0] < EDGE or best[0] > 1 - EDGE),
        )
        for k, name in enumerate(CALIBRATED)
    )
    parameters = fit.parameters(data, found[:2])
    of_three = None
    if three is not None:
        kn = float(three.normal_stiffness)
        ratios = np.array([float(three.chain_tangential_stiffness) / kn, float(three.lateral_stiffness) / kn])
        of_three = fit.deviation(data, ratios)
    return LongColumn(
        n_particles=n_particles,
        n_stretches=sum(counts),
        n_runs=resampling.n_runs,
        means=data,
        estimates=estimates,
        parameters=parameters,
        critical_force=float(buckling_modes(parameters, n_particles).critical_force[0]),
        first_force=float(data.axial_force[0, 0]),
        sum_of_squares=float((at**2).sum()),
        deviation=fit.deviation(data, found[:2]) or {},
        of_three=of_three,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Fit:
    """What stays fixed during a fit; coordinates run from 0 to 1 over the admissible kFC and, then, ks."""

    fixed: ChainParameters
    n_particles: int
    largest_overlap: float
    errors: FloatArray

    @property
    def rolling(self) -> float:
        """kr/kn; 0 where the moment has no strength."""
        strong = float(self.fixed.rolling_friction) > 0
        return float(self.fixed.rolling_stiffness / self.fixed.normal_stiffness) if strong else 0.0

    def stiffnesses(self, coordinates: FloatArray) -> FloatArray:
        """Return kFC/kn and ks/kn at coordinates (2,); kFC in equal steps of its logarithm."""
        ends = np.log([SMALLEST, self._largest_chain_stiffness()])
        chain = float(np.exp(ends[0] + coordinates[0] * (ends[1] - ends[0])))
        room = float(largest_lateral_stiffness(np.array(chain), self.rolling, self.n_particles, self.largest_overlap))
        return np.array([chain, coordinates[1] * max(room, 0.0)])

    def _largest_chain_stiffness(self) -> float:
        tried = np.geomspace(SMALLEST, LARGEST_CHAIN_STIFFNESS, 400)
        room = largest_lateral_stiffness(tried, self.rolling, self.n_particles, self.largest_overlap)
        return float(tried[room > 0].max())

    def strengths(self, means: Means) -> FloatArray:
        """Return ls/kn (n_sets,): the mean lateral force over R."""
        p = self.fixed
        return np.asarray(np.abs(means.lateral_force.mean(axis=1)) / (p.radius * p.normal_stiffness))

    def parameters(self, data: Means, stiffnesses: FloatArray) -> ChainParameters:
        """Return the set at these ratios to kn; the strength is that of the data's first set."""
        kn = float(self.fixed.normal_stiffness)
        values = {item.name: getattr(self.fixed, item.name) for item in fields(ChainParameters)}
        values["chain_tangential_stiffness"], values["lateral_stiffness"] = (float(kn * ratio) for ratio in stiffnesses)
        values["lateral_strength"] = float(kn * self.strengths(data)[0])
        values["imperfection"] = 0.0
        return ChainParameters(**values)

    def path(self, data: Means, stiffnesses: FloatArray, strength: float = 1.0) -> _Path | None:
        """Return the column's path, its lateral strength `strength` times the data's; None where it is too stiff."""
        p = self.parameters(data, stiffnesses)
        p = replace(p, lateral_strength=strength * float(p.lateral_strength))
        try:
            return _follow(p, self.n_particles, float(data.buckling_angle[0].max()))
        except ValueError:
            return None

    def differences(self, sets: Means, path: _Path | None) -> FloatArray:
        """Data minus model (4, n_sets, n_increments + 1); not a number where the path does not reach."""
        if path is None:
            return np.full((len(FITTED_MEASURES), *sets.buckling_angle.shape), np.nan)
        model = path.at(sets.buckling_angle)
        for k, name in enumerate(FITTED_MEASURES):
            if name in COUNTED_FROM_START:
                model[k] -= model[k][:, :1]
        return np.stack([getattr(sets, name) for name in FITTED_MEASURES]) - model

    def scaled(self, difference: FloatArray) -> FloatArray:
        """Differences (4, ..., n) over standard errors, (..., 4 n), a measure's mean square counted once."""
        over = difference / self.errors.reshape(-1, *([1] * (difference.ndim - 1))) / np.sqrt(difference.shape[-1])
        over = np.moveaxis(np.where(np.isfinite(over), over, NO_EQUILIBRIUM), 0, -2)
        return np.asarray(over.reshape(*over.shape[:-2], -1))

    def residuals(self, data: Means, coordinates: FloatArray) -> FloatArray:
        """Return what is squared and summed, at coordinates (2,)."""
        return self.scaled(self.differences(data, self.path(data, self.stiffnesses(coordinates)))[:, 0])

    def residuals_of_sets(self, data: Means, sets: Means, coordinates: FloatArray) -> FloatArray:
        """Return the residuals of resamples (n_sets, ...) without following a path for each.

        The column depends on a resample through its lateral strength alone, and little: a derivative will do.
        """
        stiffnesses = self.stiffnesses(coordinates)
        here = self.differences(sets, self.path(data, stiffnesses))
        stronger = self.differences(sets, self.path(data, stiffnesses, 1 + STRONGER))
        share = (self.strengths(sets) / self.strengths(data)[0] - 1) / STRONGER
        return self.scaled(here + (stronger - here) * share[:, None])

    def starts(self, data: Means) -> list[FloatArray]:
        """Return the two best points of a grid that lie apart."""
        ticks = (np.arange(GRID) + 0.5) / GRID
        grid = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
        total = [float((self.residuals(data, point) ** 2).sum()) for point in grid]
        order = np.argsort(total, kind="stable")
        apart = [k for k in order if np.abs(grid[k] - grid[order[0]]).max() > 2 / GRID]
        return [grid[order[0]], grid[apart[0]]]

    def best(self, data: Means, starts: Sequence[FloatArray]) -> tuple[FloatArray, float]:
        """Return the coordinates of the least sum of squares found from `starts`, and that sum."""

        def of(x: FloatArray) -> FloatArray:
            return self.residuals(data, x)

        found = [
            least_squares(
                of,
                np.clip(start, INSIDE, 1 - INSIDE),
                bounds=(0.0, 1.0),
                diff_step=[STEP, STEP],
                xtol=1e-3,
                ftol=1e-4,
                max_nfev=15,
            )
            for start in starts
        ]
        least = min(found, key=lambda result: float(result.cost))
        return np.asarray(least.x), float(2 * least.cost)

    def deviation(self, data: Means, stiffnesses: FloatArray) -> dict[str, float] | None:
        """Root-mean-square difference of each measure over its mean absolute value; None where no path reaches."""
        difference = self.differences(data, self.path(data, stiffnesses))[:, 0]
        if not np.isfinite(difference).all():
            return None
        level = [float(np.abs(getattr(data, name)[0]).mean()) for name in FITTED_MEASURES]
        rms = np.sqrt((difference**2).mean(axis=1))
        return {name: float(rms[k] / level[k]) for k, name in enumerate(FITTED_MEASURES)}


def _moved(coordinates: FloatArray) -> list[tuple[FloatArray, float]]:
    """Return the coordinates, each moved in turn by a step that stays within 0 and 1, and the steps."""
    moved = []
    for k in range(len(coordinates)):
        step = STEP if coordinates[k] < 0.5 else -STEP
        other = coordinates.copy()
        other[k] += step
        moved.append((other, step))
    return moved


def _one(sets: Means, index: int) -> Means:
    return Means(**{item.name: getattr(sets, item.name)[index : index + 1] for item in fields(Means)})


def _estimate(
    name: str,
    value: float,
    resampled: FloatArray,
    resampling: Resampling,
    highest: float,
    *,
    unmoved: bool,
    at_edge: bool,
) -> LongEstimate:
    error, freedom = float(resampled[: resampling.segments].std(ddof=1)), 60
    if resampling.n_runs > 1:
        of_runs = jackknife_error(resampled[resampling.segments :])
        if of_runs > error:
            error, freedom = of_runs, resampling.n_runs - 1
    reach = float(student.ppf((1 + CONFIDENCE) / 2, freedom)) * error
    interval = Interval(low=max(0.0, value - reach), high=float(min(highest, value + reach)))
    if name == "lateral_strength":
        identified = Identified.MEASURED
    elif unmoved or interval.width > TELLS * highest:
        identified, interval = Identified.NO, Interval(low=0.0, high=highest)
    else:
        identified = Identified.AT_BOUND if at_edge else Identified.YES
    return LongEstimate(name=name, value=value, interval=interval, standard_error=error, identified=identified)
