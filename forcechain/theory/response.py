"""What a testing machine sees: the response to a prescribed axial displacement, with its snapdowns.

Along the equilibrium path the displacement may fall while the angle grows. A prescribed displacement cannot follow it
there: the chain leaves equilibrium and arrives, at the same displacement, at the next larger angle where equilibrium
has that displacement again; the force snaps down (section 6.3 of Tordesillas and Muthuswamy 2009).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq, elementwise, minimize_scalar

from forcechain.arrays import FloatArray
from forcechain.theory.energy import energies
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import ChainState, Status
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement, too_stiff, yield_angles

GRID = 3000  # angles among which turning points of the displacement are looked for
LARGEST_ANGLE = math.radians(89.99)
ROUNDING = 1e-12  # of D/R: a fall smaller than that is none
BESIDE = 1e-12  # rad, to either side of a corner


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapdown:
    """A jump at prescribed displacement.

    Attributes:
        axial_displacement_over_R: at which it happens.
        angle_before, angle_after: [rad].
        force_before, force_after: [N].
        energy_released: what the jump loses to motion [J]; NaN for a jump past a fold, where the equilibrium between
            before and after is no function of the angle.
    """

    axial_displacement_over_R: float  # noqa: N815
    angle_before: float
    angle_after: float
    force_before: float
    force_after: float
    energy_released: float


def snapdowns(parameters: ChainParameters) -> tuple[Snapdown, ...]:
    """Return every snapdown of one chain whose axial displacement grows from zero, in order.

    Raises ValueError for arrays of parameters or a chain too stiff to buckle.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> len(snapdowns(TABLE_3)), len(snapdowns(TABLE_3.with_ratios(rolling_friction=0.02)))
    (0, 2)
    """
    grid = _angles(parameters)
    displacement = loading(parameters, grid).axial_displacement_over_R

    def shortfall(angle: float, target: float) -> float:
        return float(loading(parameters, angle).axial_displacement_over_R) - target

    found: list[Snapdown] = []
    index = 0
    while True:
        ahead = displacement[index:]
        below = np.flatnonzero(ahead < np.maximum.accumulate(ahead) - ROUNDING)
        if not len(below):
            return tuple(found)
        peak = index + int(np.argmax(ahead[: below[0]]))
        before, top = float(grid[peak]), float(displacement[peak])
        if 0 < peak < len(grid) - 1 and grid[peak + 1] - grid[peak] > 3 * BESIDE:
            refined = minimize_scalar(
                lambda angle: -shortfall(angle, 0.0), bounds=(grid[peak - 1], grid[peak + 1]), method="bounded"
            )
            if -refined.fun > top:
                before, top = float(refined.x), float(-refined.fun)
        later = np.flatnonzero(displacement[peak + 1 :] >= top)
        if not len(later):
            return tuple(found)
        index = peak + 1 + int(later[0])
        after = float(brentq(shortfall, grid[index - 1], grid[index], args=(top,), xtol=1e-14))
        states = loading(parameters, np.array([before, after]))
        work = energies(parameters, np.array([before, after])).work
        found.append(
            Snapdown(
                axial_displacement_over_R=top,
                angle_before=before,
                angle_after=after,
                force_before=float(states.axial_force[0]),
                force_after=float(states.axial_force[1]),
                energy_released=float(work[0] - work[1]),
            )
        )


def displacement_controlled(parameters: ChainParameters, axial_displacement_over_R: ArrayLike) -> ChainState:  # noqa: N803
    """States of one chain when the axial displacement grows from zero to each given value.

    Args:
        parameters: one set.
        axial_displacement_over_R: (n,) D/R, at least 0. Stage 1a up to the critical displacement; past a snapdown the
            branch that the jump arrives on; status ABOVE_RIGHT_ANGLE where the angle would reach 90 degrees.

    Raises ValueError as `snapdowns` does, and for a displacement that is negative or no number.
    """
    D = np.atleast_1d(np.asarray(axial_displacement_over_R, dtype=np.float64)).ravel()
    bad = ~(np.isfinite(D) & (D >= 0))
    if bad.any():
        raise ValueError(f"axial displacement over R: expected finite numbers of at least 0, found {D[bad][0]:g}")
    grid = _angles(parameters)
    jumps = snapdowns(parameters)
    kept = np.ones(grid.shape, dtype=bool)
    for jump in jumps:
        kept &= (grid <= jump.angle_before) | (grid >= jump.angle_after)
    ends = [angle for jump in jumps for angle in (jump.angle_before, jump.angle_after)]
    grid = np.unique(np.concatenate((grid[kept], ends)))
    displacement = np.maximum.accumulate(loading(parameters, grid).axial_displacement_over_R)
    perfect = parameters.imperfection == 0
    before = perfect & (critical_displacement(parameters) >= D)
    beyond = displacement[-1] < D
    upper = np.clip(np.searchsorted(displacement, D), 1, len(grid) - 1)

    def shortfall(angle: FloatArray, target: FloatArray) -> FloatArray:
        return np.asarray(loading(parameters, angle).axial_displacement_over_R) - target

    angle = np.where(beyond, np.pi / 2, 0.0)
    search = ~before & ~beyond
    low, high = grid[upper - 1], grid[upper]
    exact = search & (displacement[upper] == D)  # also the two ends of a jump, which bracket nothing
    angle[exact] = high[exact]
    search &= ~exact
    if search.any():
        root = elementwise.find_root(shortfall, (low[search], high[search]), args=(D[search],))
        angle[search] = np.where(root.success, root.x, low[search])
    state = loading(parameters, angle)
    if not before.any():
        return state
    first = straight(parameters, np.where(before, D, 0.0))
    return ChainState(
        **{
            name: np.where(before, getattr(first, name), getattr(state, name))
            for name in ChainState.__dataclass_fields__
        }
    )


def _angles(parameters: ChainParameters) -> FloatArray:
    """Angles over the whole range, fine at its beginning, with both sides of each yield."""
    if parameters.shape:
        raise ValueError(f"response: expected one parameter set, found shape {parameters.shape}")
    if bool(too_stiff(parameters)):
        raise ValueError(f"response: {Status.TOO_STIFF.meaning}")
    start = float(parameters.imperfection)
    yields = yield_angles(parameters)
    corners = [float(angle) for angle in (yields.lateral, yields.moment) if start < angle < LARGEST_ANGLE]
    beside = [corner + side for corner in corners for side in (-BESIDE, BESIDE)]
    span = LARGEST_ANGLE - start
    even = start + span * np.linspace(0, 1, GRID)
    fine = start + span * np.geomspace(1e-8, 1e-2, GRID // 6)
    grid = np.unique(np.concatenate((even, fine, beside)))
    return grid[(grid >= start) & (grid <= LARGEST_ANGLE)]
