"""When a three-particle chain buckles and in which order its supports yield."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy.optimize import elementwise

from forcechain.arrays import BoolArray, FloatArray, freeze
from forcechain.theory.equilibrium import Number, axial_force, overlap_elastic, series_stiffness, sine_growth
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import CodeArray, Status

FIELDS = tuple(field.name for field in fields(ChainParameters))


@dataclass(frozen=True, slots=True, kw_only=True)
class YieldAngles:
    """Angles at which the sliders yield under monotonic loading; infinite where one never does.

    Attributes:
        lateral: theta_s [rad], of the lateral support.
        moment: theta_* [rad], of the chain's moments.
        folds: whether the path turns back in angle when the moment yields.
        status: `Status` codes; angles are NaN where it is not EQUILIBRIUM.
    """

    lateral: FloatArray
    moment: FloatArray
    folds: BoolArray
    status: CodeArray

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(self.lateral, self.moment, self.folds, self.status)


def too_stiff(parameters: ChainParameters) -> BoolArray:
    """Whether the chain cannot buckle at all: 2 (2 K + ks) > kn, the root of (14) is not real."""
    K = effective_rolling(parameters)
    return np.asarray(2 * (2 * K + effective_lateral(parameters)) > parameters.normal_stiffness)


def effective_rolling(parameters: ChainParameters) -> Number:
    """Return K of the elastic moment; without rolling friction there is never a moment."""
    K = series_stiffness(parameters.chain_tangential_stiffness, parameters.rolling_stiffness)
    return np.where(np.asarray(parameters.rolling_friction) > 0, K, 0.0)


def effective_lateral(parameters: ChainParameters) -> Number:
    """Return ks; a support without strength is none."""
    return np.where(np.asarray(parameters.lateral_strength) > 0, parameters.lateral_stiffness, 0.0)


def secant_support(parameters: ChainParameters, growth: Number) -> tuple[Number, BoolArray]:
    """Return s/st [N/m], and whether the lateral support is plastic, at st = `growth`."""
    ks, strength = effective_lateral(parameters), parameters.lateral_strength
    plastic = np.asarray(2 * ks * growth >= strength) & np.asarray(np.asarray(parameters.lateral_stiffness) > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(plastic & (growth > 0), strength / 2 / growth, ks), plastic


def moment_excess(angle: Number, parameters: ChainParameters) -> Number:
    """Elastic moment minus its limit, times sin t/st [N/m]: the sign says whether the moment yields.

    2 K st - mu_r kn d, with d/st = (2 c^2/(kn sin t)) (2 K + s/st)/(1 + sqrt(1 - u)); finite also at st = 0.
    """
    K = series_stiffness(parameters.chain_tangential_stiffness, parameters.rolling_stiffness)
    sine, cosine = np.sin(angle), np.cos(angle)
    growth = np.maximum(sine_growth(angle, parameters.imperfection), 0.0)
    secant, _ = secant_support(parameters, growth)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(sine > 0, growth / sine, 1.0)
        demand = 2 * cosine * cosine * (2 * K + secant)
        u = demand * ratio / parameters.normal_stiffness
        # u exceeds 1 by no more than rounding, but for chains too stiff to buckle, which have no yield angles.
        root = np.sqrt(np.maximum(1 - u, 0.0))
        excess: FloatArray = 2 * K * sine - parameters.rolling_friction * demand / (1 + root)
        return excess


def yield_angles(parameters: ChainParameters) -> YieldAngles:
    """Angles at which lateral support and moment yield under monotonic loading, by which the model has its class.

    sin theta_s = sin ti + ls/(2 ks); theta_* solves 2 K st = mu_r kn d(t), the equation before (26), with the lateral
    support elastic or plastic as it then is. For a chain that can buckle the root is single and bracketed by ti and
    pi/2, where the axial force vanishes and the moment does not.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> angles = yield_angles(TABLE_3)
    >>> float(np.degrees(angles.lateral).round(6)), float(np.degrees(angles.moment).round(6))
    (11.536959, 22.311269)
    """
    shape = parameters.shape
    whole = subset(parameters, np.ones(shape, dtype=bool))
    stiff = too_stiff(whole)
    start = np.asarray(whole.imperfection)
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = np.sin(start) + np.asarray(whole.lateral_strength) / (2 * np.asarray(whole.lateral_stiffness))
        lateral = np.where(limit < 1, np.arcsin(np.minimum(limit, 1.0)), np.inf)
    # Zero strength on zero stiffness: no support, nothing to yield.
    lateral = np.where(np.asarray(whole.lateral_stiffness) > 0, lateral, np.inf)
    lateral = np.where(np.asarray(whole.lateral_strength) > 0, lateral, np.where(np.isinf(lateral), np.inf, start))

    moment = np.full(start.shape, np.inf)
    rolls = np.asarray(whole.rolling_stiffness) > 0
    slack = np.asarray(whole.rolling_friction) == 0
    at_once = rolls & (slack | (np.asarray(moment_excess(start, whole)) >= 0))
    moment[at_once] = start[at_once]
    search = rolls & ~at_once & ~stiff
    if search.any():
        some = subset(whole, search)
        columns = tuple(np.asarray(getattr(some, name)) for name in FIELDS)

        def excess(angle: FloatArray, *values: FloatArray) -> FloatArray:
            return np.asarray(moment_excess(angle, ChainParameters(**dict(zip(FIELDS, values, strict=True)))))

        found = elementwise.find_root(
            excess, (np.asarray(some.imperfection), np.full(int(search.sum()), np.pi / 2)), args=columns
        )
        if not np.all(found.success):
            raise ValueError("yield_angles: the bracketed search for the moment's yield did not converge")
        moment[search] = found.x
    folds = np.zeros(start.shape, dtype=bool)
    check = search & ~never_folds(whole)
    if check.any():
        some = subset(whole, check)
        folds[check] = folds_at(np.asarray(moment[check]), some)
    status = np.where(stiff, np.int8(Status.TOO_STIFF), np.int8(Status.EQUILIBRIUM)).astype(np.int8)
    return YieldAngles(
        lateral=np.where(stiff, np.nan, lateral).reshape(shape),
        moment=np.where(stiff, np.nan, moment).reshape(shape),
        folds=folds.reshape(shape),
        status=status.reshape(shape),
    )


def subset(parameters: ChainParameters, chosen: BoolArray) -> ChainParameters:
    """Return the parameters, broadcast to the shape of `chosen`, where it is true: arrays of shape (n_chosen,)."""
    return ChainParameters(
        **{name: np.broadcast_to(getattr(parameters, name), chosen.shape)[chosen] for name in FIELDS}
    )


def never_folds(parameters: ChainParameters) -> BoolArray:
    """Whether a bound on the parameters alone excludes a fold (`folds_at`), which spares the search for theta_*.

    At theta_* the moment is 2 K st = mu_r kn d, and the path folds where (1 - d) 2 s < m d. With an elastic support,
    s = ks st, that is (1 - d) ks < K d; with a plastic one, s = ls/2, (1 - d) ls < m d. The overlap there is at most
    that at the critical load, m at most 2 K and at most mu_r kn d.
    """
    K, ks = effective_rolling(parameters), effective_lateral(parameters)
    with np.errstate(invalid="ignore"):
        d = overlap_elastic(2 * (2 * K + ks) / parameters.normal_stiffness)
        elastic = (1 - d) * ks >= K * d
        moment = np.minimum(2 * K, parameters.rolling_friction * parameters.normal_stiffness * d)
        plastic = (1 - d) * parameters.lateral_strength >= moment * d
    return np.asarray(elastic & plastic)


def folds_at(angle: FloatArray, parameters: ChainParameters) -> BoolArray:
    """Whether the path turns back in angle when the moment yields at `angle`.

    It does where the equilibrium with a plastic moment sits on the larger root of (26): (1 - d) sin t < mu_r c^2.
    """
    K = series_stiffness(parameters.chain_tangential_stiffness, parameters.rolling_stiffness)
    sine, c2 = np.sin(angle), np.cos(angle) ** 2
    growth = sine_growth(angle, parameters.imperfection)
    secant, _ = secant_support(parameters, growth)
    d = overlap_elastic(2 * c2 * (2 * K + secant) * growth / (parameters.normal_stiffness * sine))
    return np.asarray((1 - d) * sine < parameters.rolling_friction * c2)


def critical_displacement(parameters: ChainParameters) -> FloatArray:
    """Axial displacement over R at which the straight column buckles, (15); NaN where it is too stiff to.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> float(critical_displacement(TABLE_3).round(9))
    0.182831552
    """
    K, ks = effective_rolling(parameters), effective_lateral(parameters)
    return np.asarray(2 * overlap_elastic(2 * (2 * K + ks) / parameters.normal_stiffness))


def critical_force(parameters: ChainParameters) -> FloatArray:
    """Axial force at which the straight column buckles [N], (14); NaN where it is too stiff to.

    A column whose moment (mu_r = 0) or lateral support (ls = 0) has no strength buckles as if it had no stiffness.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> float(critical_force(TABLE_3).round(9))
    10.942468405
    """
    d = critical_displacement(parameters) / 2
    return np.asarray(axial_force(d, 1.0, parameters.radius, parameters.normal_stiffness))
