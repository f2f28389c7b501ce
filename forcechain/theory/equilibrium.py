"""The one equilibrium of the three-particle chain: overlap, force and displacement from the angle and its supports.

Symbols are the paper's: t buckling angle, d normal displacement of a chain contact over R, m = chain moment/R^2 and
s = lateral force/(2R), both in N/m. The energy balance (22) of Tordesillas and Muthuswamy (2009) gives in every stage

    d (2 - d) sin t = (2 cos^2 t/kn) (m + s),    F = kn R d/cos t,    D/R = 4 cos ti - 2 (2 - d) cos t.

In every stage the supports are linear in sin t: m + s = A sin t + C, which keeps slopes free of cancellation.
"""

from __future__ import annotations

import numpy as np

from forcechain.arrays import FloatArray

Number = float | FloatArray


def series_stiffness(chain_tangential_stiffness: Number, rolling_stiffness: Number) -> Number:
    """Stiffness K = kr kFC/(kr + kFC) of rolling spring and tangential spring in series [N/m].

    The end particles turn until both carry the same: kr (w - wp) = kFC (2 st - w), the last line of stage 1 to 4.
    """
    return rolling_stiffness * chain_tangential_stiffness / (rolling_stiffness + chain_tangential_stiffness)


def overlap_elastic(load: Number) -> Number:
    """Overlap d of (12), (25) and stage 4: the smaller root of d (2 - d) = u, u = 2 cos^2 t (m + s)/(kn sin t) <= 1.

    Written so that a small load loses no digits; NaN where u > 1 (no overlap below a radius bears that load).

    >>> float(overlap_elastic(0.19))
    0.1
    """
    u = np.asarray(load, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        overlap: FloatArray = u / (1 + np.sqrt(1 - u))
        return overlap


def overlap_moment_plastic(
    sine: Number, cosine_squared: Number, support: Number, rolling_friction: Number, larger_root: bool = False
) -> Number:
    """Overlap d of (26): m = mu_r kn d, so sin t d^2 - 2 (sin t - mu_r c^2) d + 2 c^2 s/kn = 0.

    Args:
        sine, cosine_squared: sin t > 0 and c^2 = cos^2 t.
        support: s/kn.
        rolling_friction: mu_r; negative for a moment that yields the other way.
        larger_root: the root that (26) leaves out. It is met where the lateral support is too weak to hold a chain
            whose moment has yielded, and there equilibrium needs a falling angle.

    NaN where neither root exists: the moment's strength exceeds what the chain can load it with.
    """
    half_sum = sine - rolling_friction * cosine_squared  # of the roots, times sin t
    product = 2 * cosine_squared * support * sine  # of the roots, times sin^2 t
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(half_sum * half_sum - product)
        if larger_root:
            return (half_sum + root) / sine
        # The stable form of (half_sum - root)/sine. Without a lateral support the smaller root is no overlap at all.
        return np.where(half_sum > 0, product / sine / (half_sum + root), np.nan)


def overlap_slope(
    overlap: Number,
    sine: Number,
    cosine: Number,
    support_slope: Number,
    support_constant: Number,
    normal_stiffness: Number,
    rolling_friction: Number = 0.0,
) -> Number:
    """Slope d' = dd/dt along a branch on which the supports are m + s = A sin t + C (plus mu_r kn d if given).

    Args:
        overlap: d.
        sine, cosine: sin t, cos t.
        support_slope, support_constant: A and C [N/m].
        normal_stiffness: kn [N/m].
        rolling_friction: mu_r where the moment is plastic, 0 where it is elastic.

    Differentiates (2 - d) d = (2 c^2/sin t) (mu_r d + (A sin t + C)/kn). At t = 0 it holds for C = mu_r = 0.
    """
    c2 = cosine * cosine
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(sine > 0, 1 / sine, 0.0)
        bend = 2 * cosine + c2 * cosine * inverse**2  # -d(c^2/sin t)/dt
        gain = -(2 * cosine * support_slope * sine + bend * support_constant) / normal_stiffness
        gain = gain - rolling_friction * overlap * bend
        slope: FloatArray = gain / (1 - overlap - rolling_friction * c2 * inverse)
        return slope


def axial_force(overlap: Number, cosine: Number, radius: Number, normal_stiffness: Number) -> Number:
    """Axial force F = kn R d/cos t [N]: the balance of forces at the end particles, (10), (23), (26)."""
    return normal_stiffness * radius * overlap / cosine


def axial_displacement(overlap: Number, cosine: Number, cosine_loss: Number) -> Number:
    """Axial displacement over R of three particles, (8): D/R = 4 cos ti - 2 (2 - d) cos t = 4 cosine_loss + 2 d cos t.

    `cosine_loss` = cos ti - cos t comes from `growths`, so that small displacements keep their digits.
    """
    return 4 * cosine_loss + 2 * overlap * cosine


def growths(angle: Number, imperfection: Number) -> tuple[Number, Number]:
    """Return st = sin t - sin ti and cos ti - cos t without cancellation.

    st is the lateral displacement of the middle particle over 2R.
    """
    half_sum, half_difference = (angle + imperfection) / 2, (angle - imperfection) / 2
    twice = 2 * np.sin(half_difference)
    return np.cos(half_sum) * twice, np.sin(half_sum) * twice


def sine_growth(angle: Number, imperfection: Number) -> Number:
    """Return st = sin t - sin ti without cancellation."""
    return 2 * np.cos((angle + imperfection) / 2) * np.sin((angle - imperfection) / 2)
