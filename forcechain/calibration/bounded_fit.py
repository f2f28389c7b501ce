"""Least squares of many small problems at once: the same model fitted to every resample of the data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from forcechain.arrays import BoolArray, FloatArray, freeze

Residuals = Callable[[FloatArray], FloatArray]
STEP = 1e-6  # of a finite difference; coordinates run from 0 to 1
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-3, 1e-9, 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class ManyFits:
    """Minima of many problems.

    Attributes:
        coordinates: (n_problems, n_coordinates) from 0 to 1.
        sum_of_squares: (n_problems,).
        converged: (n_problems,) whether the last step was below the tolerance.
    """

    coordinates: FloatArray
    sum_of_squares: FloatArray
    converged: BoolArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.coordinates, self.sum_of_squares, self.converged)


def fit_many(residuals: Residuals, start: FloatArray, *, tolerance: float = 1e-7, iterations: int = 60) -> ManyFits:
    """Minimise the sum of squares of every problem from `start`, all coordinates within 0 and 1.

    Levenberg and Marquardt's method with steps projected on the box, a damping for each problem, and derivatives by
    finite differences that stay in the box. A coordinate that stands on an edge and is pushed outwards is left out of
    the step, so that the others move freely along the edge.

    Args:
        residuals: from coordinates (n_problems, n_coordinates) to residuals (n_problems, n_residuals), all finite.
        start: (n_problems, n_coordinates) within the box.
        tolerance: a step below it ends a problem.
        iterations: after so many all end.

    Raises ValueError for a start outside the box.

    >>> fit_many(lambda x: np.stack([x[:, 0] - 0.25, x[:, 1] - 2.0], axis=1), np.array([[0.5, 0.5]])).coordinates
    array([[0.25, 1.  ]])
    """
    x = np.array(start, dtype=np.float64)
    if x.ndim != 2 or not ((x >= 0) & (x <= 1)).all():
        raise ValueError(f"start: expected (n_problems, n_coordinates) within 0 and 1, found shape {x.shape}")
    n_problems, n_coordinates = x.shape
    damping = np.full(n_problems, FIRST_DAMPING)
    active = np.ones(n_problems, dtype=bool)
    r = residuals(x)
    total = np.einsum("bi,bi->b", r, r)
    for _ in range(iterations):
        jacobian = derivatives(residuals, x, r)
        gradient = np.einsum("bik,bi->bk", jacobian, r)
        free = ~(((x <= 0) & (gradient > 0)) | ((x >= 1) & (gradient < 0)))
        normal = np.einsum("bik,bil->bkl", jacobian, jacobian) * (free[:, :, None] & free[:, None, :])
        diagonal = np.einsum("bkk->bk", normal)
        # A coordinate that is held or moves nothing has a zero row: a one on the diagonal keeps its step at zero.
        scale = np.where(free & (diagonal > 0), diagonal, 1.0)
        normal = normal + np.eye(n_coordinates) * (damping[:, None] * scale + ~(free & (diagonal > 0)))[:, :, None]
        step = -np.linalg.solve(normal, np.where(free, gradient, 0.0)[:, :, None])[:, :, 0]
        trial = np.clip(x + step, 0.0, 1.0)
        r_trial = residuals(trial)
        total_trial = np.einsum("bi,bi->b", r_trial, r_trial)
        better = active & (total_trial < total)
        moved = np.abs(trial - x).max(axis=1)
        x = np.where(better[:, None], trial, x)
        r = np.where(better[:, None], r_trial, r)
        total = np.where(better, total_trial, total)
        damping = np.where(better, damping / 10, damping * 10)
        damping = np.where(damping < LEAST_DAMPING, LEAST_DAMPING, damping)
        active &= (moved > tolerance) & (damping < MOST_DAMPING)
        if not active.any():
            break
    return ManyFits(coordinates=x, sum_of_squares=total, converged=~active)


def derivatives(residuals: Residuals, coordinates: FloatArray, at: FloatArray) -> FloatArray:
    """Return d residual/d coordinate (n_problems, n_residuals, n_coordinates) by one-sided differences in the box."""
    columns = []
    for k in range(coordinates.shape[1]):
        moved = coordinates.copy()
        h = np.where(coordinates[:, k] < 0.5, STEP, -STEP)
        moved[:, k] += h
        columns.append((residuals(moved) - at) / h[:, None])
    return np.stack(columns, axis=2)
