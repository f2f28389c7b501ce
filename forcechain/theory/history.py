"""Any history of one three-particle chain: loading, unloading, reloading, and the turns in angle a snap leaves behind.

`follow` takes the chain through turning angles, finds each event (a slider slips, holds, slips the other way; the path
turns; the chain comes apart) by a bracketed root search, and accounts for every joule on the way. The paper's stage 4
lets neither slider slip while unloading. But the moment's limit mu_r kn d falls with the normal force and ends at
zero, so before the chain is unloaded its moments must slip again: stage 4' here. `sliders="held"` gives the print.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forcechain.arrays import FloatArray, freeze
from forcechain.theory.arcs import STRAIGHT_ANGLE, Arc, Chain, Point, arc_energies, stored_energy
from forcechain.theory.equilibrium import axial_displacement, axial_force, growths
from forcechain.theory.events import Position, next_arc, to_first_event
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import STAGES, STRAIGHT, ChainState, CodeArray, Stability, Status, TextArray
from forcechain.theory.three_particle import checked_angles
from forcechain.theory.yielding import too_stiff

SHORTEST_ARC = 1e-9  # rad
MOST_ARCS = 200


class Ending(IntEnum):
    """Why a path ended."""

    REACHED = 0  # the last turning angle
    SEPARATED = 1  # no axial force left
    STRAIGHT = 2  # unloaded to a straight column, which unloads further as it was loaded (stage 1a)
    DEAD_END = 3  # no equilibrium follows: each choice of slip and hold contradicts itself, the chain snaps dynamically
    OVERLAPPED = 4  # the contacts overlap by a radius


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """An equilibrium path: states in order, energies [J] since the unloaded column, and how it ended.

    Attributes:
        state: ChainState, arrays of shape (n_points,).
        leg: (n_points,) number of the leg between turning angles.
        work, stored, moment_dissipation, lateral_dissipation: (n_points,) of the paper's (18) to (21).
        ending: why the path ended.
        arcs: its pieces.
    """

    state: ChainState
    leg: NDArray[np.int64]
    work: FloatArray
    stored: FloatArray
    moment_dissipation: FloatArray
    lateral_dissipation: FloatArray
    ending: Ending
    arcs: tuple[Arc, ...]

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(self.leg, self.work, self.stored, self.moment_dissipation, self.lateral_dissipation)

    @property
    def energy_error(self) -> float:
        """Largest |work - stored - dissipated| over the largest work: how well (18) closes; 0 without any work."""
        gap = self.work - self.stored - self.moment_dissipation - self.lateral_dissipation
        scale = float(np.abs(self.work).max())
        return float(np.abs(gap).max()) / scale if scale > 0 else 0.0


def follow(
    parameters: ChainParameters,
    turning_angles: Sequence[float],
    *,
    points: int = 200,
    sliders: Literal["free", "held"] = "free",
) -> History:
    """Take one chain from its start through each of `turning_angles` in turn.

    Args:
        parameters: one set.
        turning_angles: [rad], the first above the imperfection; each later one reverses the angle.
        points: samples of each leg, shared among its arcs.
        sliders: "free" to slip whenever at their limit; "held": neither slips while the angle falls, as printed.

    Returns:
        History up to the last angle, or to where `ending` says.

    Raises:
        ValueError: angles that are not finite, not above the imperfection or not below pi/2, a repeated angle, arrays
            of parameters, a chain too stiff to buckle.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> path = follow(TABLE_3, np.radians([25.0, 20.0]))
    >>> path.state.stage[-1], path.ending.name, path.energy_error < 1e-12
    (np.str_('4'), 'REACHED', True)
    """
    chain = Chain.of(parameters)
    goals = [float(angle) for angle in checked_angles(turning_angles, "turning_angles").ravel()]
    if not goals or not all(chain.ti < goal < math.pi / 2 for goal in goals[:1]):
        raise ValueError(
            f"turning_angles: expected the first above the imperfection {chain.ti:g} and below pi/2 rad, "
            f"found {goals[0] if goals else 'none'}"
        )
    if any(goal >= math.pi / 2 for goal in goals):
        raise ValueError(f"turning_angles: expected angles below pi/2 rad, found {max(goals):g}")
    if bool(too_stiff(parameters)):
        raise ValueError(f"path: {Status.TOO_STIFF.meaning}")
    arcs: list[Arc] = []
    position = Position(t=max(chain.ti, STRAIGHT_ANGLE), wp=0.0, tp=0.0, d=math.nan, m=0.0, s=0.0)
    ending = Ending.REACHED
    for leg, goal in enumerate(goals):
        if goal == position.t:
            raise ValueError(f"turning_angles: expected angles that differ, found {goal:g} rad twice in a row")
        ending, position = _follow_leg(chain, position, goal, leg, sliders == "held", arcs)
        if ending != Ending.REACHED:
            break
    return _sampled(arcs, points, ending)


def _follow_leg(
    chain: Chain, position: Position, goal: float, leg: int, held: bool, arcs: list[Arc]
) -> tuple[Ending, Position]:
    """Append the arcs of one leg; return how it ended and where."""
    sense = 1 if goal > position.t else -1
    direction = sense
    for _ in range(MOST_ARCS):
        target = goal if direction == sense else (STRAIGHT_ANGLE if direction < 0 else math.pi / 2 - 1e-9)
        arc = next_arc(chain, position, target, sense, leg, held and sense < 0)
        if arc is None:
            return Ending.DEAD_END, position
        if arc.direction != direction:
            direction = arc.direction
        arc, event = to_first_event(arc, held and sense < 0)
        end = arc.at(arc.end)
        position = Position(
            t=arc.end,
            wp=float(end.wp),
            tp=float(end.tp),
            d=float(end.d),
            m=float(end.m),
            s=float(end.s),
            turned=event == "turn",
            larger_root=arc.larger_root,
        )
        if abs(arc.end - arc.start) < SHORTEST_ARC and arcs and abs(arcs[-1].end - arcs[-1].start) < SHORTEST_ARC:
            return Ending.DEAD_END, position  # slip and hold in turn without getting anywhere
        arcs.append(arc)
        if event == "separated":
            return Ending.SEPARATED, position
        if event == "overlapped":
            return Ending.OVERLAPPED, position
        if event == "turn":
            direction = -direction
        elif event == "end":
            if arc.end <= STRAIGHT_ANGLE:
                return Ending.STRAIGHT, position
            return (Ending.REACHED if direction == sense else Ending.DEAD_END), position
    raise ValueError(f"path: more than {MOST_ARCS} changes of the sliders in one leg; no path can be trusted")


def _sampled(arcs: list[Arc], points: int, ending: Ending) -> History:
    """Evaluate all arcs and add up the energies."""
    if not arcs:
        raise ValueError("path: no equilibrium follows from the start; no path exists")
    columns: list[ChainState] = []
    legs: list[NDArray[np.int64]] = []
    energies: list[FloatArray] = []
    begin = arcs[0].at(arcs[0].start)
    # The straight column stores in two contacts what the axial force has worked (stage 1a).
    total = np.array([float(stored_energy(arcs[0].chain, begin)), 0.0, 0.0])
    for arc in arcs:
        span = sum(abs(other.end - other.start) for other in arcs if other.leg == arc.leg)
        n = max(2, 1 + round(points * abs(arc.end - arc.start) / span)) if span > 0 else 2
        fraction = np.linspace(0, 1, n)
        point = arc.at(arc.angles(fraction)[0])
        done = np.array(arc_energies(arc, fraction))
        energies.append(np.vstack((total[:, None] + done, stored_energy(arc.chain, point))))
        total = total + done[:, -1]
        columns.append(arc_state(arc, point))
        legs.append(np.full(n, arc.leg))
    work, moment, lateral, stored = (np.concatenate([block[i] for block in energies]) for i in range(4))
    joined = {
        name: np.concatenate([getattr(column, name) for column in columns]) for name in ChainState.__dataclass_fields__
    }
    return History(
        state=ChainState(**joined),
        leg=np.concatenate(legs),
        work=work,
        stored=stored,
        moment_dissipation=moment,
        lateral_dissipation=lateral,
        ending=ending,
        arcs=tuple(arcs),
    )


def arc_state(arc: Arc, point: Point) -> ChainState:
    """Return points of an arc as a ChainState."""
    ch, t = arc.chain, np.where(point.t <= STRAIGHT_ANGLE, 0.0, point.t)
    slope = arc.overlap_slope(point)
    sine, c = np.sin(t), np.cos(t)
    D_rate = arc.goal * arc.direction * ((2 - point.d) * sine + slope * c)
    F_rate = arc.goal * arc.direction * (slope * c + point.d * sine)
    if arc.goal > 0:  # at t = 0 slopes vanish by symmetry; curvatures decide
        D_rate, F_rate = np.where(t > 0, D_rate, 1 - 2 * point.d), np.where(t > 0, F_rate, -1.0)
    holds = D_rate > 0
    stability: CodeArray = (holds.astype(np.int8) + (holds & (F_rate > 0))).astype(np.int8)
    return ChainState(
        angle=t,
        stage=_stage(arc, t),
        axial_force=np.asarray(axial_force(point.d, c, ch.R, ch.kn)),
        axial_displacement_over_R=np.asarray(axial_displacement(point.d, c, growths(t, ch.ti)[1])),
        normal_displacement_over_R=point.d,
        rotation=point.w,
        lateral_force=2 * ch.R * point.s,
        contact_moment=ch.R**2 * point.m,
        plastic_rotation=point.wp,
        plastic_support=point.tp,
        status=np.zeros(t.shape, dtype=np.int8),
        stability=np.where(np.isnan(point.d), np.int8(Stability.NO_EQUILIBRIUM), stability).astype(np.int8),
    )


def _stage(arc: Arc, t: FloatArray) -> TextArray:
    ch = arc.chain
    lateral, moment = arc.lateral_sense != 0 or ch.slack_support, arc.moment_sense != 0 or ch.slack_moment
    returning = arc.goal < 0 or (arc.leg > 0 and not (lateral or moment))
    names = np.full(t.shape, STAGES[int(lateral) + 2 * int(moment) + 4 * int(returning)])
    if arc.goal > 0:
        names[t == 0] = STRAIGHT
    return names


def unloading(
    parameters: ChainParameters,
    from_angle: float,
    angle: ArrayLike,
    *,
    sliders: Literal["free", "held"] = "free",
) -> ChainState:
    """State at each angle while the chain is unloaded from `from_angle`, after monotonic loading up to it.

    Args:
        parameters: one set.
        from_angle: [rad] where unloading begins, in any stage.
        angle: (n,) [rad], at most `from_angle`. Below the angle at which the force vanishes, or the path turns back
            in angle: Status.SEPARATED. `follow` has the path beyond such a turn.
        sliders: as in `follow`.

    Raises ValueError as `follow` does, for an angle above `from_angle`, and for a `from_angle` that the path of
    equilibrium does not reach.
    """
    t = np.atleast_1d(checked_angles(angle)).ravel()
    if (t > from_angle).any():
        raise ValueError(f"angle: expected at most the angle of unloading, {from_angle:g} rad, found {t.max():g}")
    path = follow(parameters, [from_angle, 0.0], points=2, sliders=sliders)
    arcs = [arc for arc in path.arcs if arc.leg == 1]
    if not arcs:
        last = float(path.state.angle[-1])
        raise ValueError(
            f"unloading: expected a start that loading reaches, found {from_angle:g} rad; "
            f"the path ends at {last:g} rad ({path.ending.name})"
        )
    turns = [arc.direction > 0 for arc in arcs]
    arcs = arcs[: turns.index(True)] if any(turns) else arcs
    result: dict[str, NDArray[np.generic]] = {}
    beyond = np.ones(t.shape, dtype=bool)
    for arc in arcs:
        inside = (t <= arc.start) & (t >= np.where(arc.end <= STRAIGHT_ANGLE, 0.0, arc.end))
        state = arc_state(arc, arc.at(t))
        for name in ChainState.__dataclass_fields__:
            values = getattr(state, name)
            blank = {"stage": "", "status": np.int8(Status.SEPARATED), "stability": np.int8(Stability.NO_EQUILIBRIUM)}
            old = result.get(name, np.full(t.shape, blank.get(name, np.nan), dtype="<U3" if name == "stage" else None))
            result[name] = np.where(inside, values, old)
        beyond &= ~inside
    result["angle"] = t.copy()
    result["status"] = np.where(beyond, np.int8(Status.SEPARATED), np.int8(Status.EQUILIBRIUM)).astype(np.int8)
    return ChainState(**result)  # type: ignore[arg-type]
