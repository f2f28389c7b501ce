"""Pieces of an equilibrium path on which each slider either holds or slips: closed form, events, work.

On such an arc the state is a function of the angle with the plastic displacements of the holding sliders frozen, which
is how the paper writes stage 4. An arc ends where a slider begins or ceases to slip, where the path turns back in
angle, where the chain comes apart or stands straight again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.theory.equilibrium import (
    Number,
    overlap_elastic,
    overlap_moment_plastic,
    overlap_slope,
    series_stiffness,
    sine_growth,
)
from forcechain.theory.parameters import ChainParameters

# The straight column is the limit t -> 0: at this angle all ratios of sines are exact and nothing underflows.
STRAIGHT_ANGLE = 1e-100
FEWEST_PANELS = 32  # of the quadrature, on every arc
NODES, WEIGHTS = (0.5 * (np.polynomial.legendre.leggauss(10)[0] + 1), 0.5 * np.polynomial.legendre.leggauss(10)[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """One parameter set as plain numbers: paper symbols, stiffnesses in N/m, K of rolling and tangential in series."""

    R: float
    kn: float
    kFC: float  # noqa: N815
    kr: float
    mu_r: float
    ks: float
    ls: float
    ti: float
    K: float
    slack_moment: bool  # a spring behind a slider without strength: slips at every motion
    slack_support: bool

    @classmethod
    def of(cls, p: ChainParameters) -> Chain:
        """Take the numbers of one parameter set; a support without strength has no stiffness either."""
        if p.shape:
            raise ValueError(f"path: expected one parameter set, found shape {p.shape}")
        kr, kFC = float(p.rolling_stiffness), float(p.chain_tangential_stiffness)
        mu_r, ls = float(p.rolling_friction), float(p.lateral_strength)
        return cls(
            R=float(p.radius),
            kn=float(p.normal_stiffness),
            kFC=kFC,
            kr=kr,
            mu_r=mu_r,
            ks=float(p.lateral_stiffness) if ls > 0 else 0.0,
            ls=ls,
            ti=float(p.imperfection),
            K=float(series_stiffness(kFC, kr)) if mu_r > 0 else 0.0,
            slack_moment=mu_r == 0 and kr > 0,
            slack_support=ls == 0 and float(p.lateral_stiffness) > 0,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """Arrays of one shape along an arc: angle, overlap d, m = moment/R^2 and s = lateral force/(2R) [N/m], wp, tp."""

    t: FloatArray
    d: FloatArray
    m: FloatArray
    s: FloatArray
    w: FloatArray
    wp: FloatArray
    tp: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc:
    """An arc from angle `start` to `end`; senses are 0 (the slider holds), +1 or -1 (it slips that way).

    `wp` and `tp` are the plastic rotation and support displacement at its start, `turns_at_start` and `turns_at_end`
    whether the path turns back in angle there, `larger_root` which root of (26) holds.
    """

    chain: Chain
    start: float
    end: float
    moment_sense: int
    lateral_sense: int
    larger_root: bool
    wp: float
    tp: float
    goal: int  # +1 loading, -1 unloading
    leg: int
    turns_at_start: bool = False
    turns_at_end: bool = False

    @property
    def direction(self) -> int:
        """Return +1 where the angle grows along the arc, -1 where it falls."""
        return 1 if self.end > self.start else -1

    def at(self, angle: Number) -> Point:
        """Return the state at each angle; d is NaN where no equilibrium exists."""
        ch = self.chain
        t = np.maximum(np.asarray(angle, dtype=np.float64), STRAIGHT_ANGLE)
        st = np.asarray(sine_growth(t, ch.ti))
        sine, c2 = np.sin(t), np.cos(t) ** 2
        s = ch.ks * (st - self.tp) if self.lateral_sense == 0 else np.full(t.shape, self.lateral_sense * ch.ls / 2)
        if self.moment_sense:
            mu = self.moment_sense * ch.mu_r
            d = np.asarray(overlap_moment_plastic(sine, c2, s / ch.kn, mu, self.larger_root))
            turn = ((t == self.start) & self.turns_at_start) | ((t == self.end) & self.turns_at_end)
            d = np.where(turn, 1 - mu * c2 / sine, d)  # both roots there, which rounding would keep apart
            m = mu * ch.kn * d
        else:
            m = ch.K * (2 * st - self.wp)
            d = np.asarray(overlap_elastic(2 * c2 * (m + s) / (ch.kn * sine)))
        w = 2 * st - m / ch.kFC
        wp = w - m / ch.kr if self.moment_sense or ch.slack_moment else np.full(t.shape, self.wp)
        tp = np.full(t.shape, self.tp)
        if self.lateral_sense or ch.slack_support:
            tp = st - (s / ch.ks if self.lateral_sense else 0.0)
        return Point(t=t, d=d, m=m, s=s, w=w, wp=wp, tp=tp)

    def overlap_slope(self, point: Point) -> FloatArray:
        """Return dd/dt at points of the arc."""
        ch = self.chain
        K = 0.0 if self.moment_sense else ch.K
        ks = 0.0 if self.lateral_sense else ch.ks
        C = self.lateral_sense * ch.ls / 2 if self.lateral_sense else -ks * (math.sin(ch.ti) + self.tp)
        C -= K * (2 * math.sin(ch.ti) + self.wp)
        mu = self.moment_sense * ch.mu_r
        return np.asarray(overlap_slope(point.d, np.sin(point.t), np.cos(point.t), 2 * K + ks, C, ch.kn, mu))

    def slip_rate(self, point: Point) -> FloatArray:
        """Rate of moment slip along the arc in its sense, per radian: negative where the slider must hold again."""
        ch, e = self.chain, self.moment_sense
        growth = 2 * np.cos(point.t) - e * ch.mu_r * ch.kn / ch.K * self.overlap_slope(point)
        return e * self.direction * growth

    def roots_apart(self, point: Point) -> FloatArray:
        """Return the discriminant of (26): zero where its roots meet and the path turns, negative past that."""
        c2, mu = np.cos(point.t) ** 2, self.moment_sense * self.chain.mu_r
        sine = np.sin(point.t)
        return np.asarray((sine - mu * c2) ** 2 - 2 * point.s * sine * c2 / self.chain.kn)

    def angles(self, fraction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return angles at fractions 0 to 1 of the arc, and their derivative.

        Quadratic where the path turns (there d varies as the square root of the angle), geometric over a long range.
        """
        a, b, x = self.start, self.end, fraction
        if self.turns_at_start and self.turns_at_end:
            y, dy = np.sin(np.pi * x / 2) ** 2, np.pi / 2 * np.sin(np.pi * x)
        elif self.turns_at_start:
            y, dy = x * x, 2 * x
        elif self.turns_at_end:
            y, dy = 1 - (1 - x) ** 2, 2 * (1 - x)
        elif min(a, b) > 1e-9 and max(a, b) > 3 * min(a, b):
            t = a * (b / a) ** x
            return t, t * math.log(b / a)
        else:
            y, dy = x, np.ones_like(x)
        return a + (b - a) * y, (b - a) * dy

    def until(self, end: float, turns: bool = False) -> Arc:
        """Return the same arc, ended at `end`."""
        return replace(self, end=end, turns_at_end=turns)


def arc_energies(arc: Arc, fraction: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Work, moment dissipation and lateral dissipation [J] done since the arc's start, at rising fractions from 0.

    From (19) with F = kn R d/c:  dW = R^2 kn d(d^2) + 2 R^2 kn d (2 - d) tan t dt.
    From (21):  dissipation 2 R^2 mu_r kn d |dwp| + 2 R^2 ls |dtp|, with dwp = 2 c dt - mu_r kn dd/K.
    Both are integrated by Gauss-Legendre quadrature, without derivatives of d, so nothing is singular at a turn.
    """
    ch = arc.chain
    parts = -(-FEWEST_PANELS // (len(fraction) - 1))  # panels to each interval, rounded up
    coarse = fraction
    fraction = np.concatenate(
        ((coarse[:-1, None] + np.diff(coarse)[:, None] * np.arange(parts) / parts).ravel(), coarse[-1:])
    )
    left, width = fraction[:-1, None], np.diff(fraction)[:, None]
    t, rate = arc.angles(left + width * NODES)
    weight = width * WEIGHTS * rate
    inner = arc.at(t)
    ends = arc.at(arc.angles(fraction)[0])
    zero = np.zeros(1)

    def since_start(integrand: FloatArray) -> FloatArray:
        return np.concatenate((zero, np.cumsum((integrand * weight).sum(axis=1))))

    squares = ends.d**2 - ends.d[0] ** 2
    tangent = np.tan(inner.t)
    work = ch.R**2 * ch.kn * (squares + since_start(2 * inner.d * (2 - inner.d) * tangent))
    moment = np.zeros_like(work)
    if arc.moment_sense:
        e, mu = arc.moment_sense, ch.mu_r
        turned = since_start(2 * inner.d * np.cos(inner.t)) - e * mu * ch.kn / ch.K * squares / 2
        moment = 2 * ch.R**2 * mu * ch.kn * e * turned
    lateral = 2 * ch.R**2 * ch.ls * arc.lateral_sense * (ends.tp - ends.tp[0])
    return work[::parts], moment[::parts], lateral[::parts]


def stored_energy(chain: Chain, point: Point) -> FloatArray:
    """Stored energy psi [J] of (20) at points of an arc; with an imperfection sin t counts from sin ti."""
    st = np.asarray(sine_growth(point.t, chain.ti))
    psi = chain.kn * point.d**2 + chain.kFC * (2 * st - point.w) ** 2 + chain.kr * (point.w - point.wp) ** 2
    return chain.R**2 * (psi + 2 * chain.ks * (st - point.tp) ** 2)
