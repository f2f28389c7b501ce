"""What the model says of one point: state, stage, status, stability. Shared by closed form, history and column."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from forcechain.arrays import FloatArray, freeze

CodeArray = NDArray[np.int8]
TextArray = NDArray[np.str_]

# By code: lateral support plastic (1), moment plastic (2), unloading (4).
STAGES = np.array(["1b", "2", "2'", "3", "4", "4s", "4'", "4's"])
STRAIGHT = "1a"


class Status(IntEnum):
    """What kind of point this is; every point has one, and a point without numbers says here why."""

    EQUILIBRIUM = 0
    BEYOND_FOLD = 1
    BELOW_IMPERFECTION = 2
    ABOVE_RIGHT_ANGLE = 3
    TOO_STIFF = 4
    SEPARATED = 5

    @property
    def meaning(self) -> str:
        """One line: what it means and what to try."""
        return _STATUS_MEANINGS[self]


_STATUS_MEANINGS = {
    Status.EQUILIBRIUM: "equilibrium on the path",
    Status.BEYOND_FOLD: "an equilibrium that is reached only by a jump in angle: the chain snaps when its moment "
    "yields because the lateral support is too weak to hold it; follow the path by arc length instead",
    Status.BELOW_IMPERFECTION: "no equilibrium under compression: the angle is below that of the unloaded column",
    Status.ABOVE_RIGHT_ANGLE: "outside the model: buckling angles lie below 90 degrees",
    Status.TOO_STIFF: "no buckling: 2 (2 kFC kr/(kFC + kr) + ks) exceeds kn, the contacts would overlap by a radius "
    "first; lower the stiffness of the supports",
    Status.SEPARATED: "no equilibrium: the path ends before this angle, the contacts would have to pull",
}


class Stability(IntEnum):
    """How a point behaves when displacement, or load, is prescribed."""

    NO_EQUILIBRIUM = -1
    UNSTABLE = 0  # also under displacement control: the force snaps down
    DISPLACEMENT_CONTROLLED = 1  # softening: stable only while the displacement is held
    STABLE = 2  # under displacement control and under load control


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainState:
    """States of a three-particle chain, all arrays of one shape, read-only; NaN where `status` says why.

    Attributes:
        angle: buckling angle t [rad].
        stage: text; 1a straight, 1b elastic, 2 lateral support plastic, 2' moment plastic, 3 both plastic. Unloading
            and reloading: 4 elastic, 4' moment slipping, 4s lateral support slipping, 4's both.
        axial_force: F [N], compression positive.
        axial_displacement_over_R, normal_displacement_over_R: D/R and d.
        rotation: w of the end particles, which turn in opposite senses [rad].
        lateral_force: on the middle particle [N].
        contact_moment: [N m].
        plastic_rotation: wp [rad].
        plastic_support: tp, the plastic lateral displacement over 2R.
        status: `Status` codes.
        stability: `Stability` codes.
    """

    angle: FloatArray
    stage: TextArray
    axial_force: FloatArray
    axial_displacement_over_R: FloatArray  # noqa: N815 (the paper's axis, and the column's name)
    normal_displacement_over_R: FloatArray  # noqa: N815
    rotation: FloatArray
    lateral_force: FloatArray
    contact_moment: FloatArray
    plastic_rotation: FloatArray
    plastic_support: FloatArray
    status: CodeArray
    stability: CodeArray

    def __post_init__(self) -> None:
        """Make every array read-only."""
        freeze(*(getattr(self, name) for name in self.__dataclass_fields__))
