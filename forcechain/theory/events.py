"""What a chain does next: which sliders slip from a given point on, and where along an arc that changes.

The rule is that of rate-independent plasticity: a slider on its limit holds if the elastic response moves it inwards,
otherwise it slips, and slip must go forward. Where the moment would slip backwards the equilibrium needs a falling
angle; where every choice contradicts itself there is no equilibrium to go on to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from forcechain.arrays import FloatArray
from forcechain.theory.arcs import STRAIGHT_ANGLE, Arc, Chain, Point

SCAN = 240  # samples of an arc in which events are looked for
ON_LIMIT = 1e-9  # a moment within this part of its limit is on it
ROUNDING = 1e-15  # of kn, in a moment over R^2


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Where a chain is: angle, plastic displacements, overlap, m and s [N/m]; whether the path just turned in angle."""

    t: float
    wp: float
    tp: float
    d: float  # NaN: at the very start
    m: float
    s: float
    turned: bool = False
    larger_root: bool = False  # of (26), on the arc that led here


def next_arc(chain: Chain, position: Position, target: float, sense: int, leg: int, held: bool) -> Arc | None:
    """Choose which sliders slip from `position` on, and with it the arc; None where nothing is admissible."""
    if position.turned:  # the path turned: the same plastic moment, the other root
        return _plastic_arc(chain, position, target, sense, leg)
    direction = 1 if target > position.t else -1
    lateral = 0 if held else _lateral_sense(chain, position, direction)
    elastic = Arc(
        chain=chain,
        start=position.t,
        end=target,
        moment_sense=0,
        lateral_sense=lateral,
        larger_root=False,
        wp=position.wp,
        tp=position.tp,
        goal=sense,
        leg=leg,
    )
    if held or chain.K == 0:
        return elastic
    if math.isnan(position.d):  # the very start: an imperfect column may slip at once
        step = elastic.at(position.t + 1e-7 * (math.pi / 2 - position.t))
        if float(step.m) < chain.mu_r * chain.kn * float(step.d):
            return elastic
        return replace(elastic, moment_sense=1)
    limit = chain.mu_r * chain.kn * position.d
    e = 1 if position.m > 0 else -1
    if abs(position.m) < limit * (1 - ON_LIMIT) - ROUNDING * chain.kn:
        return elastic
    here = elastic.at(position.t)
    outward = e * 2 * chain.K * math.cos(position.t) - chain.mu_r * chain.kn * float(elastic.overlap_slope(here))
    if direction * outward <= 0:
        return elastic
    return _plastic_arc(chain, position, target, sense, leg, e, lateral)


def _lateral_sense(chain: Chain, position: Position, direction: int) -> int:
    if chain.ks == 0:
        return 0
    on_limit = abs(position.s) >= chain.ls / 2 * (1 - 1e-12)
    return direction if on_limit and position.s * direction > 0 else 0


def _plastic_arc(
    chain: Chain,
    position: Position,
    target: float,
    sense: int,
    leg: int,
    e: int | None = None,
    lateral: int = 0,
) -> Arc | None:
    """Return the arc with a slipping moment whose slip goes forward, turned back in angle if it must be."""
    e = e or (1 if position.m > 0 else -1)
    direction = 1 if target > position.t else -1
    gap = (1 - position.d) * math.sin(position.t) - e * chain.mu_r * math.cos(position.t) ** 2
    larger = gap < 0
    if position.turned:
        larger = not position.larger_root
        lateral = 0
    arc = Arc(
        chain=chain,
        start=position.t,
        end=target,
        moment_sense=e,
        lateral_sense=lateral,
        larger_root=larger,
        wp=position.wp,
        tp=position.tp,
        goal=sense,
        leg=leg,
        turns_at_start=position.turned,
    )
    if position.turned or float(arc.slip_rate(arc.at(position.t))) > 0:
        return arc
    back = replace(
        arc,
        end=STRAIGHT_ANGLE if direction > 0 else math.pi / 2 - 1e-9,
        lateral_sense=_lateral_sense(chain, position, -direction),
    )
    return back if float(back.slip_rate(back.at(position.t))) > 0 else None


def to_first_event(arc: Arc, held: bool) -> tuple[Arc, str]:
    """End the arc at its first event; return the arc and the event's name."""
    fraction = np.linspace(0, 1, SCAN + 1)
    angles = arc.angles(fraction)[0]
    angles[0], angles[-1] = arc.start, arc.end
    events = _events(arc, held)
    where, name = _first_crossing(arc, events, angles)
    if name == "turn":  # near a turn everything changes with the square root of the angle: look closer
        closer = (
            where + (angles[np.flatnonzero(arc.direction * (where - angles) > 0)[-1]] - where) * fraction[::-1] ** 2
        )
        others = {event: function for event, function in events.items() if event != "turn"}
        earlier, event = _first_crossing(arc, others, closer[:-1])
        if event != "end":
            where, name = earlier, event
    return arc.until(where, turns=name == "turn"), name


def _first_crossing(
    arc: Arc, events: dict[str, Callable[[Point], FloatArray]], angles: FloatArray
) -> tuple[float, str]:
    """Return where the first event's function rises through zero, and the event; else the last angle and "end"."""
    first, name, where = len(angles), "end", float(angles[-1])
    for event, function in events.items():
        with np.errstate(invalid="ignore", divide="ignore"):
            values = function(arc.at(angles))
        # Past a turn there is no state, nor past an overlap of a radius, which is an event in itself.
        missing = math.inf if event == "overlapped" else -math.inf
        values = np.where(np.isnan(values), missing, values)
        if angles[0] == arc.start:
            values[0] = -math.inf  # an arc begins where its sliders just changed: on a limit, moving off it
        crossed = np.flatnonzero(values >= 0)
        if not len(crossed) or (index := int(crossed[0])) > first:
            continue
        if index == 0:
            return float(angles[0]), event
        root = _refined(arc, function, angles[index - 1], angles[index], angles[index - 1] == arc.start)
        if index < first or arc.direction * (root - where) < 0:
            first, name, where = index, event, root
    return where, name


def _events(arc: Arc, held: bool) -> dict[str, Callable[[Point], FloatArray]]:
    """Return functions of the state that reach zero, from below, where the arc ends."""
    ch = arc.chain
    events: dict[str, Callable[[Point], FloatArray]] = {}
    if not held:
        if arc.moment_sense:
            events["turn"] = lambda at: -arc.roots_apart(at)
            events["moment holds"] = lambda at: -arc.slip_rate(at)
        elif ch.K > 0:
            events["moment slips"] = lambda at: np.abs(at.m) / ch.kn - ch.mu_r * at.d
        if not arc.lateral_sense and ch.ks > 0:
            events["lateral slips"] = lambda at: arc.direction * at.s / ch.kn - ch.ls / 2 / ch.kn
    events["separated"] = lambda at: -at.d
    if not arc.moment_sense:
        events["overlapped"] = lambda at: at.d - 1
    return events


def _refined(arc: Arc, function: Callable[[Point], FloatArray], low: float, high: float, at_start: bool) -> float:
    """Return the angle between `low` (below zero) and `high` where the function vanishes."""

    def value(angle: float) -> float:
        with np.errstate(invalid="ignore", divide="ignore"):
            result = float(function(arc.at(angle)))
        return 1.0 if math.isnan(result) else result  # past a turn there is no state

    if at_start:
        low = low + 1e-9 * (high - low)
        if value(low) >= 0:
            return float(low)
    return float(brentq(value, low, high, xtol=1e-16, rtol=8.9e-16))
