"""Energies of the three-particle chain under monotonic loading: work, stored, dissipated; the balance (18)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from forcechain.arrays import FloatArray, freeze
from forcechain.theory.equilibrium import Number, sine_growth
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import ChainState, CodeArray, Status
from forcechain.theory.three_particle import checked_angles, loading
from forcechain.theory.yielding import yield_angles

ORDER = 32  # of the quadrature between two yield angles
NODES, WEIGHTS = np.polynomial.legendre.leggauss(ORDER)


@dataclass(frozen=True, slots=True, kw_only=True)
class Energies:
    """Energies [J] since the unloaded column, arrays of one shape, read-only; NaN where `status` says why.

    Attributes:
        work: of the axial force, stage 1a included.
        stored: psi of (20).
        moment_dissipation, lateral_dissipation: in the two moments of the chain and in the lateral support, (21).
        status: `Status` codes. BEYOND_FOLD has no energies: what is lost in a jump is not work of equilibrium.
    """

    work: FloatArray
    stored: FloatArray
    moment_dissipation: FloatArray
    lateral_dissipation: FloatArray
    status: CodeArray

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(*(getattr(self, name) for name in self.__dataclass_fields__))


def stored_energy(parameters: ChainParameters, state: ChainState) -> FloatArray:
    """Stored energy [J] of (20): kn d^2 + kFC (2 st - w)^2 + kr (w - wp)^2 + 2 ks (st - tp)^2, times R^2.

    With an imperfection st = sin t - sin ti (appendix). A spring behind a slider without strength stores nothing.
    """
    p = parameters
    st = sine_growth(state.angle, p.imperfection)
    d, w = state.normal_displacement_over_R, state.rotation
    psi = p.normal_stiffness * d**2 + p.chain_tangential_stiffness * (2 * st - w) ** 2
    psi = psi + p.rolling_stiffness * (w - state.plastic_rotation) ** 2
    psi = psi + 2 * p.lateral_stiffness * (st - state.plastic_support) ** 2
    return np.asarray(p.radius**2 * psi)


def energies(parameters: ChainParameters, angle: ArrayLike) -> Energies:
    """Energies at each angle, the angle having grown monotonically from the start.

    Work by (19) with F = kn R d/cos t: R^2 kn (d^2 + 2 int d (2 - d) tan t dt). Dissipation by (21): lateral
    2 R^2 ls tp; moments 2 R^2 mu_r kn int d dwp, with dwp = 2 cos t dt - mu_r kn dd/K. Work and moment dissipation
    are integrated by Gauss-Legendre quadrature between the yield angles, each by itself, so that the balance (18),
    work = stored + dissipated, is a check and not a definition.

    Args:
        parameters: one set or arrays.
        angle: [rad], any shape that broadcasts with the parameters.

    Raises ValueError as `loading` does.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> e = energies(TABLE_3, 0.5)
    >>> bool(abs(e.work - e.stored - e.moment_dissipation - e.lateral_dissipation) < 1e-14 * e.work)
    True
    """
    t = checked_angles(angle)
    state = loading(parameters, t)
    p, t = parameters, state.angle
    yields = yield_angles(p)
    start = np.broadcast_to(p.imperfection, t.shape)
    inside = state.status == Status.EQUILIBRIUM
    end = np.where(inside, t, start)
    corners = np.sort(np.stack(np.broadcast_arrays(yields.lateral, yields.moment)), axis=0)
    bounds = [start, *(np.clip(np.where(np.isnan(corner), start, corner), start, end) for corner in corners), end]
    first_moment = np.clip(np.where(np.isnan(yields.moment), start, yields.moment), start, end)

    lever, turning = np.zeros(t.shape), np.zeros(t.shape)
    for low, high in pairwise(bounds):
        nodes, weights = _nodes(low, high)
        d = np.asarray(loading(_with_axis(p, t.ndim), nodes).normal_displacement_over_R)
        d = np.where(np.isnan(d), 0.0, d)  # beyond the range, which the status masks below
        lever += (d * (2 - d) * np.tan(nodes) * weights).sum(axis=-1)
        turning += np.where(low >= first_moment, (2 * d * np.cos(nodes) * weights).sum(axis=-1), 0.0)

    R, kn, mu_r, kr = p.radius, p.normal_stiffness, p.rolling_friction, np.asarray(p.rolling_stiffness)
    d = state.normal_displacement_over_R
    d_yield = loading(p, np.where(inside, first_moment, start)).normal_displacement_over_R
    with np.errstate(divide="ignore", invalid="ignore"):
        compliance = 1 / kr + 1 / np.asarray(p.chain_tangential_stiffness)  # 1/K
        moment = 2 * R**2 * mu_r * kn * (turning - mu_r * kn * compliance * (d**2 - d_yield**2) / 2)
    moment = np.where((kr > 0) & (np.asarray(mu_r) > 0), moment, 0.0)

    def shown(values: Number) -> FloatArray:
        return np.where(inside, values, np.nan)

    return Energies(
        work=shown(R**2 * kn * (d**2 + 2 * lever)),
        stored=shown(stored_energy(p, state)),
        moment_dissipation=shown(moment),
        lateral_dissipation=shown(2 * R**2 * p.lateral_strength * state.plastic_support),
        status=state.status.copy(),
    )


def _nodes(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Quadrature nodes and weights from `low` to `high`, on a last axis; in log t over a long range.

    A moment that yields at a very small angle leaves d varying on the scale of that angle.
    """
    x, weight = (NODES + 1) / 2, WEIGHTS / 2
    low, high = low[..., None], high[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(high / low)
        geometric = (low > 0) & (high > 3 * low)
        nodes = np.where(geometric, low * np.exp(np.where(geometric, logarithm, 0.0) * x), low + (high - low) * x)
        weights = weight * np.where(geometric, nodes * logarithm, high - low)
    return nodes, weights


def _with_axis(p: ChainParameters, ndim: int) -> ChainParameters:
    """Return the parameters with a last axis of 1, to broadcast with quadrature nodes on points of `ndim` axes."""
    if not p.shape:
        return p
    return ChainParameters(
        **{
            name: np.asarray(getattr(p, name)).reshape(
                (1,) * (ndim - np.ndim(getattr(p, name))) + np.shape(getattr(p, name)) + (1,)
            )
            for name in p.__dataclass_fields__
        }
    )
