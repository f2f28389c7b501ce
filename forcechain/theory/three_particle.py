"""The three-particle chain loaded monotonically: state, status and stability at any angle, for arrays of parameters.

What the paper prints for stages 1b, 2 and 3, what it leaves out (the moment yielding first: stages 2' and 3) and its
appendix on an imperfect column are one equilibrium with two sliders (`forcechain.theory.equilibrium`). During monotonic
growth of the angle the state depends on the angle alone, with no history to carry along, because for every chain that
can buckle, that is for 2 (2 K + ks) <= kn with K = kr kFC/(kr + kFC):

- the lateral force follows s = min(ks st, ls/2): nothing unloads it while the angle grows;
- where the elastic moment meets its limit, 2 K st = mu_r kn d, it does so from below, so at most once;
- after that the plastic rotation wp = 2 st - mu_r kn d/K grows with the angle, so the moment never turns elastic again.

(`docs/equations.md` has the proof; other histories are in `forcechain.theory.history`.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from forcechain.arrays import FloatArray
from forcechain.theory.equilibrium import (
    Number,
    axial_displacement,
    axial_force,
    growths,
    overlap_elastic,
    overlap_moment_plastic,
    overlap_slope,
    series_stiffness,
)
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import STAGES, STRAIGHT, ChainState, CodeArray, Stability, Status
from forcechain.theory.yielding import (
    critical_displacement,
    effective_lateral,
    effective_rolling,
    moment_excess,
    never_folds,
    secant_support,
    subset,
    too_stiff,
    yield_angles,
)


def checked_angles(angle: ArrayLike, name: str = "angle") -> FloatArray:
    """Return `angle` as float64; ValueError for what is no number, NaN, infinite or negative."""
    try:
        t = np.asarray(angle, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers in radians, found {angle!r}") from None
    bad = ~(np.isfinite(t) & (t >= 0))
    if bad.any():
        raise ValueError(f"{name}: expected finite angles of at least 0 rad, found {t[bad].flat[0]:g}")
    return t


def loading(parameters: ChainParameters, angle: ArrayLike) -> ChainState:
    """State of the chain at each buckling angle, the angle having grown monotonically from the start.

    The order of yielding comes from the parameters. At angle 0 a perfect column stands at its critical load, the end
    of stage 1a; `straight` gives that stage.

    Args:
        parameters: one set or arrays.
        angle: [rad], any shape that broadcasts with the parameters.

    Returns:
        ChainState of the broadcast shape. Angles outside the range of equilibrium are points with a status.

    Raises:
        ValueError: an angle that is not finite or negative, or shapes that do not broadcast.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> state = loading(TABLE_3, np.radians([5, 14, 25]))
    >>> state.stage
    array(['1b', '2', '3'], dtype='<U3')
    >>> state.axial_force.round(9)
    array([10.89666667,  9.27307142,  5.20710456])
    """
    t = checked_angles(angle)
    try:
        shape = np.broadcast_shapes(t.shape, parameters.shape)
    except ValueError:
        raise ValueError(
            f"angle: expected a shape that broadcasts with the parameters' {parameters.shape}, found {t.shape}"
        ) from None
    t = np.broadcast_to(t, shape)
    status = _status(t, parameters)
    inside = status == Status.EQUILIBRIUM
    safe = np.where(inside, t, parameters.imperfection)
    return _state(t, safe, status, parameters)


def _status(t: FloatArray, parameters: ChainParameters) -> CodeArray:
    status = np.zeros(t.shape, dtype=np.int8)
    status[np.broadcast_to(too_stiff(parameters), t.shape)] = Status.TOO_STIFF
    status[t < parameters.imperfection] = Status.BELOW_IMPERFECTION
    status[t >= np.pi / 2] = Status.ABOVE_RIGHT_ANGLE
    return status


def _state(t: FloatArray, safe: FloatArray, status: CodeArray, p: ChainParameters) -> ChainState:
    kn, kFC, kr, mu_r = p.normal_stiffness, p.chain_tangential_stiffness, p.rolling_stiffness, p.rolling_friction
    ti = p.imperfection
    K, K0 = series_stiffness(kFC, kr), effective_rolling(p)
    sine, c = np.sin(safe), np.cos(safe)
    c2 = c * c
    growth, cosine_loss = growths(safe, ti)
    secant, lateral_plastic = secant_support(p, growth)
    s = secant * growth
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(sine > 0, growth / sine, 1.0)  # st/sin t, which is 1 for a perfect column
        u = 2 * c2 * (2 * K0 + secant) * ratio / kn
    d = overlap_elastic(u)
    m = 2 * K * growth
    limit = mu_r * kn * d
    moment_plastic = np.asarray((m > limit) & (sine > 0))
    # At the very start of an imperfect column load and strength are both zero; the sign of their ratio decides.
    start = (growth == 0) & (sine > 0) & np.asarray(K > 0)
    if start.any():
        moment_plastic = moment_plastic | start & (np.asarray(moment_excess(safe, p)) >= 0)
    slips = moment_plastic & (growth > 0)
    d = np.where(slips, overlap_moment_plastic(np.where(slips, sine, 1.0), c2, s / kn, mu_r), d)
    m = np.where(moment_plastic, mu_r * kn * d, np.where(np.asarray(mu_r) > 0, m, 0.0))
    # Both springs in series carry m; what the moment spring has not taken up elastically is plastic.
    w = 2 * growth - m / kFC
    with np.errstate(divide="ignore", invalid="ignore"):
        wp = np.where(moment_plastic, w - m / kr, 0.0)
        tp = np.where(lateral_plastic, growth - s / p.lateral_stiffness, 0.0)

    status = status.copy()
    beyond = np.array(slips & ~never_folds(p))
    if beyond.any():
        beyond[beyond] = yield_angles(subset(p, beyond)).folds
        status[beyond & (status == Status.EQUILIBRIUM)] = Status.BEYOND_FOLD
    outside = status > Status.BEYOND_FOLD

    ks0 = effective_lateral(p)
    A = np.where(moment_plastic, 0.0, 2 * K0) + np.where(lateral_plastic, 0.0, ks0)
    C = np.where(lateral_plastic, np.asarray(p.lateral_strength) / 2, -ks0 * np.sin(ti))
    C = C - np.where(moment_plastic, 0.0, 2 * K0 * np.sin(ti))
    slope = overlap_slope(d, sine, c, A, C, kn, np.where(moment_plastic, mu_r, 0.0))
    stability = np.array(_stability(d, slope, sine, c))
    stage_code = lateral_plastic.astype(np.int8) + 2 * moment_plastic.astype(np.int8)
    stage = np.array(STAGES[stage_code])
    stage[sine == 0] = STRAIGHT
    stage[outside] = ""
    stability[outside] = Stability.NO_EQUILIBRIUM

    some_outside = bool(outside.any())

    def shown(values: Any) -> FloatArray:
        if some_outside or np.shape(values) != t.shape:
            return np.where(outside, np.nan, values)
        return np.asarray(values)

    return ChainState(
        angle=t.copy(),
        stage=stage,
        axial_force=shown(axial_force(d, c, p.radius, kn)),
        axial_displacement_over_R=shown(axial_displacement(d, c, cosine_loss)),
        normal_displacement_over_R=shown(d),
        rotation=shown(w),
        lateral_force=shown(2 * p.radius * s),
        contact_moment=shown(m * p.radius**2),
        plastic_rotation=shown(wp),
        plastic_support=shown(tp),
        status=status,
        stability=stability,
    )


def _stability(d: Number, slope: Number, sine: Number, c: Number) -> CodeArray:
    """Return `Stability` codes where the angle grows along the path with dd/dt = `slope`.

    D and F must both grow for stability under load control, D alone for stability under displacement control. At
    t = 0 both slopes vanish by symmetry and the curvature decides: (2 - d)(1 - 2 d)/(1 - d) for D, negative for F.
    """
    with np.errstate(invalid="ignore"):
        displacement = np.where(sine > 0, (2 - d) * sine + slope * c, 1 - 2 * np.asarray(d))
        force = np.where(sine > 0, slope * c + d * sine, -1.0)
        holds = displacement > 0
        return holds.astype(np.int8) + (holds & (force > 0)).astype(np.int8)


def straight(parameters: ChainParameters, axial_displacement_over_R: ArrayLike) -> ChainState:  # noqa: N803
    """Stage 1a of one perfect column: angle 0 and F = kn D/2, (9), up to the critical displacement and beyond.

    Beyond it the straight column is an unstable equilibrium. Raises ValueError for an imperfect column, which is never
    straight, for arrays of parameters and for a displacement that is not finite, negative or 2 and more.
    """
    if parameters.shape:
        raise ValueError(f"straight: expected one parameter set, found shape {parameters.shape}")
    if parameters.imperfection != 0:
        raise ValueError(f"straight: expected a perfect column, found imperfection {parameters.imperfection:g} rad")
    D = np.array(axial_displacement_over_R, dtype=np.float64)
    bad = ~((D >= 0) & (D < 2))
    if bad.any():
        raise ValueError(f"axial displacement over R: expected 0 to below 2, found {D[bad].flat[0]:g}")
    critical = critical_displacement(parameters)
    zero = np.zeros(D.shape)
    buckles = ~np.isnan(critical) & (critical < D)
    return ChainState(
        angle=zero.copy(),
        stage=np.full(D.shape, STRAIGHT),
        axial_force=np.asarray(axial_force(D / 2, 1.0, parameters.radius, parameters.normal_stiffness)),
        axial_displacement_over_R=D,
        normal_displacement_over_R=D / 2,
        rotation=zero.copy(),
        lateral_force=zero.copy(),
        contact_moment=zero.copy(),
        plastic_rotation=zero.copy(),
        plastic_support=zero.copy(),
        status=np.zeros(D.shape, dtype=np.int8),
        stability=np.where(buckles, np.int8(Stability.UNSTABLE), np.int8(Stability.STABLE)).astype(np.int8),
    )
