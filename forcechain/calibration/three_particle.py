"""Calibration: the stiffnesses and the lateral strength of the model from averaged buckling data, with intervals.

What the data can tell about each parameter differs, and the result says so. The lateral strength is measured: the mean
lateral force over R, as section 5.2 of Tordesillas & Muthuswamy (2009) does. Once the lateral support has yielded, the
model no longer depends on its stiffness ks: a perfect column whose data start at 14 degrees then only bounds ks from
below, by sin theta_s = ls/(2 ks). The chain's tangential stiffness kFC enters the force through K = kFC kr/(kFC + kr),
and the rotation through the angle at which the moment yields.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial

import numpy as np
from scipy.optimize import least_squares

from forcechain.arrays import FloatArray
from forcechain.calibration.bounded_fit import fit_many
from forcechain.calibration.column_fit import ColumnFit
from forcechain.calibration.estimates import (
    CALIBRATED,
    GRID,
    Resampling,
    ends,
    estimate,
    goodness,
    information_shares,
    measure_errors,
)
from forcechain.calibration.resampling import (
    Means,
    SegmentHistories,
    resampled_segments,
    weighted_means,
    without_each_run,
)
from forcechain.calibration.result import Calibration, Column
from forcechain.theory.classes import TYPICAL_OVERLAP
from forcechain.theory.parameters import ChainParameters

MIN_SAMPLES = 40  # fewer have no 2.5 % quantile
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
    resampling = Resampling(segments=samples, n_runs=sum(count > 0 for count in counts))
    fit = ColumnFit(
        fixed=reference,
        imperfect=column is Column.IMPERFECT,
        bound=largest_overlap - largest_overlap**2 / 2,
        errors=measure_errors(sets, resampling, reference),
    )
    starts = _search(fit, data)
    best = starts[0]
    found = ends(fit, data, best[None, :])
    resampled = ends(fit, sets, _fitted_sets(fit, sets, starts))
    information = information_shares(fit, data, found.value)
    estimates = tuple(
        estimate(fit, data, best, index, found, resampled, resampling, information[index], profile_points)
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
        goodness=goodness(fit, data, sets, found, resampled, resampling),
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


def _one_set(parameters: ChainParameters) -> ChainParameters:
    return ChainParameters(
        **{item.name: float(np.asarray(getattr(parameters, item.name)).flat[0]) for item in fields(ChainParameters)}
    )
