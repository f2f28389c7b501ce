"""The model held against averaged buckling data: coordinates of the search, differences, residuals."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from forcechain.arrays import BoolArray, FloatArray, freeze
from forcechain.calibration.resampling import Means
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.three_particle import loading

FITTED_MEASURES = ("axial_force", "normal_displacement_over_R", "axial_displacement_over_R", "rotation")
COUNTED_FROM_START = ("axial_displacement_over_R", "rotation")  # zero at the first increment, in data as in the model
LARGEST_CHAIN_STIFFNESS = 1.0  # over kn: no tangential spring of a contact is stiffer than its normal one
SMALLEST = 1e-4  # of the admissible range: kFC = 0 would be no chain
ROUNDING = 1e-9  # of the plateau's edge, where a search that comes from below ends
NO_EQUILIBRIUM = 1e3  # residual, in standard errors, where the model has no equilibrium at the data's angle


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnFit:
    """What stays fixed during a fit.

    The search runs over two coordinates from 0 to 1 that cover exactly the pairs (kFC, ks) which bound (30) admits:
    the first is 2 K/kn, K = kFC kr/(kFC + kr), over its largest value, the second ks over what (30) leaves for it.

    Attributes:
        fixed: one set; radius, kn, kr, mu_r are used.
        imperfect: whether the column is unloaded at the first angle, or perfect.
        bound: largest (2 K + ks)/kn.
        errors: (4,) the standard error of each measure of `FITTED_MEASURES`.
    """

    fixed: ChainParameters
    imperfect: bool
    bound: float
    errors: FloatArray

    def __post_init__(self) -> None:
        """Freeze the array."""
        freeze(self.errors)

    @property
    def rolling(self) -> float:
        """kr/kn."""
        return float(self.fixed.rolling_stiffness / self.fixed.normal_stiffness)

    @property
    def largest_series(self) -> float:
        """Largest 2 K/kn: by (30), or by the largest kFC."""
        kr, kFC = self.rolling, LARGEST_CHAIN_STIFFNESS
        return min(self.bound, 2 * kr * kFC / (kr + kFC))

    def chain_stiffness(self, series: FloatArray) -> FloatArray:
        """Return kFC/kn from 2 K/kn."""
        half = series / 2
        return half * self.rolling / (self.rolling - half)

    def series(self, chain_stiffness: FloatArray) -> FloatArray:
        """Return 2 K/kn from kFC/kn."""
        return 2 * chain_stiffness * self.rolling / (chain_stiffness + self.rolling)

    def room(self, chain_stiffness: FloatArray) -> FloatArray:
        """Return what (30) leaves for ks/kn; at its edge zero, which rounding may miss by its last digit."""
        return np.maximum(self.bound - self.series(chain_stiffness), 0.0)

    @property
    def largest_chain_stiffness(self) -> float:
        """Largest admissible kFC/kn."""
        if self.rolling == 0:  # (30) does not bind it: without a rolling spring K = 0 whatever kFC
            return LARGEST_CHAIN_STIFFNESS
        return float(self.chain_stiffness(np.asarray(self.largest_series)))

    def stiffnesses(self, coordinates: FloatArray) -> FloatArray:
        """Return kFC/kn and ks/kn (n, 2) at coordinates (n, 2)."""
        first = SMALLEST + (1 - SMALLEST) * coordinates[:, 0]
        if self.rolling == 0:
            chain = first * LARGEST_CHAIN_STIFFNESS
        else:
            chain = self.chain_stiffness(first * self.largest_series)
        return np.column_stack([chain, coordinates[:, 1] * self.room(chain)])

    def strength(self, means: Means) -> FloatArray:
        """Return ls/kn (n,): the mean lateral force over all increments, over R; section 5.2 of the paper."""
        p = self.fixed
        return np.asarray(np.abs(means.lateral_force.mean(axis=1)) / (p.radius * p.normal_stiffness))

    def parameters(self, means: Means, stiffnesses: FloatArray, strength: FloatArray | None = None) -> ChainParameters:
        """Return the parameter sets (n, 1); the strength is that of the means if not given, both over kn."""
        kn = self.fixed.normal_stiffness
        values = {item.name: getattr(self.fixed, item.name) for item in fields(ChainParameters)}
        values["chain_tangential_stiffness"] = kn * stiffnesses[:, :1]
        values["lateral_stiffness"] = kn * stiffnesses[:, 1:]
        values["lateral_strength"] = kn * (self.strength(means) if strength is None else strength)[:, None]
        values["imperfection"] = means.buckling_angle[:, :1] if self.imperfect else 0.0
        return ChainParameters(**values)

    def compared(self, means: Means) -> BoolArray:
        """Which increments can be compared (n, n_increments + 1): an imperfect column has no load below its angle."""
        if not self.imperfect:
            return np.ones(means.buckling_angle.shape, dtype=bool)
        return means.buckling_angle >= means.buckling_angle[:, :1]

    def differences(self, means: Means, parameters: ChainParameters) -> FloatArray:
        """Data minus model (n, 4, n_increments + 1), zero where not compared, not a number without an equilibrium.

        Displacement and rotation are those since the first increment on both sides. For the displacement this is the
        paper's shift: the data are moved to the model's displacement at the mean initial angle.
        """
        compared = self.compared(means)
        angle = np.where(compared, means.buckling_angle, means.buckling_angle[:, :1])
        state = loading(parameters, angle)
        found = []
        for name in FITTED_MEASURES:
            model = getattr(state, name)
            if name in COUNTED_FROM_START:
                model = model - model[:, :1]
            found.append(np.where(compared, getattr(means, name) - model, 0.0))
        return np.stack(found, axis=1)

    def residuals_at(self, means: Means, stiffnesses: FloatArray) -> FloatArray:
        """Differences over standard errors (n, 4 (n_increments + 1)), a measure's mean square counted once."""
        difference = self.differences(means, self.parameters(means, stiffnesses))
        scaled = difference / self.errors[:, None]
        # A wall, finite so that the search can turn back from it.
        walled = np.where(np.isfinite(scaled), scaled, NO_EQUILIBRIUM)
        return np.asarray(walled.reshape(len(walled), -1) / np.sqrt(difference.shape[-1]))

    def residuals(self, means: Means, coordinates: FloatArray) -> FloatArray:
        """`residuals_at` the stiffnesses of the coordinates."""
        return self.residuals_at(means, self.stiffnesses(coordinates))

    def plateau(self, means: Means, stiffnesses: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
        """Whether ks lies where the data do not depend on it, and the ends of that range over kn, each (n,).

        It does for a perfect column whose support has yielded before the smallest angle of the data; from there ks may
        be anything up to what (30) admits.
        """
        low = self.strength(means) / (2 * np.sin(means.buckling_angle.min(axis=1)))
        high = self.room(stiffnesses[:, 0])
        inside = (stiffnesses[:, 1] >= low * (1 - ROUNDING)) & (low < high)
        return inside & (not self.imperfect), low, high
