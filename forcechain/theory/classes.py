"""Which class of buckling the parameters lead to, and which stiffnesses keep the overlaps small."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forcechain.arrays import BoolArray, FloatArray
from forcechain.theory.equilibrium import Number, series_stiffness
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import Status
from forcechain.theory.yielding import yield_angles

NO_BUCKLING, BOTH_ELASTIC, TOGETHER, LATERAL_FIRST, MOMENT_FIRST = range(5)
TYPICAL_OVERLAP = 0.1  # of R: the paper's example for bound (30)


def buckling_class(
    parameters: ChainParameters, *, largest_angle: float = np.pi / 2, together_within: float = 0.0
) -> NDArray[np.int8]:
    """Class of Table 1 that the model itself predicts under monotonic loading.

    Args:
        parameters: one set or arrays.
        largest_angle: the buckling ends here [rad]; what has not yielded by then counts as elastic.
        together_within: difference of the yield angles [rad] up to which both yield together.

    Returns:
        int8 codes: 1 neither yields, 2 together, 3 lateral support first, 4 chain moment first, 0 no buckling.

    Raises ValueError for an angle or a difference that is negative or no number.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> buckling_class(TABLE_3.with_ratios(rolling_friction=[0.2, 0.02])).tolist()
    [3, 4]
    """
    for name, value in (("largest_angle", largest_angle), ("together_within", together_within)):
        if not value >= 0:
            raise ValueError(f"{name}: expected at least 0 rad, found {value:g}")
    angles = yield_angles(parameters)
    lateral = np.where(angles.lateral <= largest_angle, angles.lateral, np.inf)
    moment = np.where(angles.moment <= largest_angle, angles.moment, np.inf)
    neither = np.isinf(lateral) & np.isinf(moment)
    with np.errstate(invalid="ignore"):
        together = np.abs(lateral - moment) <= together_within
    result = np.where(lateral < moment, LATERAL_FIRST, MOMENT_FIRST)
    result = np.where(together, TOGETHER, result)
    result = np.where(neither, BOTH_ELASTIC, result)
    return np.where(angles.status == Status.TOO_STIFF, NO_BUCKLING, result).astype(np.int8)


def overlap_margin(parameters: ChainParameters, largest_overlap: Number = TYPICAL_OVERLAP) -> FloatArray:
    """How much of bound (30) is left: (2 l - l^2)/2 - (2 K + ks)/kn, positive where it holds.

    It keeps the overlap at the critical load below `largest_overlap` = l radii (0 to 1), where contacts are linear.

    >>> from forcechain.theory.parameters import TABLE_3
    >>> bool(overlap_margin(TABLE_3) > 0)
    True
    """
    overlap = _checked_overlap(largest_overlap)
    p = parameters
    K = series_stiffness(p.chain_tangential_stiffness, p.rolling_stiffness)
    return np.asarray((2 * overlap - overlap**2) / 2 - (2 * K + p.lateral_stiffness) / p.normal_stiffness)


def overlap_bound_holds(parameters: ChainParameters, largest_overlap: Number = TYPICAL_OVERLAP) -> BoolArray:
    """Whether bound (30) holds."""
    return np.asarray(overlap_margin(parameters, largest_overlap) > 0)


def largest_lateral_stiffness(parameters: ChainParameters, largest_overlap: Number = TYPICAL_OVERLAP) -> FloatArray:
    """Upper edge of the region of (kFC, ks) that bound (30) admits: ks below kn (2 l - l^2)/2 - 2 K [N/m].

    The parameters' own lateral stiffness does not enter. Negative where no lateral stiffness is admitted.
    """
    own = np.asarray(parameters.lateral_stiffness)
    return np.asarray(own + parameters.normal_stiffness * overlap_margin(parameters, largest_overlap))


def _checked_overlap(value: Number) -> FloatArray:
    overlap = np.asarray(value, dtype=np.float64)
    if not np.all((overlap > 0) & (overlap < 1)):
        raise ValueError(f"largest_overlap: expected above 0 and below 1 (of the radius), found {overlap}")
    return overlap
