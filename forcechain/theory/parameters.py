"""The eight inputs of the confined-buckling model (and an imperfection), in SI units, checked once."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from forcechain.arrays import FloatArray, freeze

POSITIVE = ("radius", "normal_stiffness", "chain_tangential_stiffness", "side_tangential_stiffness")

# Names whose values stand on the command line, in studies and in the paper as ratios to the normal stiffness.
RATIOS = (
    "chain_tangential_stiffness",
    "rolling_stiffness",
    "lateral_stiffness",
    "lateral_strength",
    "side_tangential_stiffness",
)

# Table 3 of Tordesillas and Muthuswamy (2009), J. Mech. Phys. Solids 57, 706-727, as printed.
TABLE_3_RATIOS = {
    "radius": 1.14e-3,  # m
    "normal_stiffness": 1.05e5,  # N/m
    "chain_tangential_stiffness": 0.014,
    "rolling_stiffness": 0.5,
    "rolling_friction": 0.2,
    "lateral_stiffness": 0.06,
    "lateral_strength": 0.024,
    "side_tangential_stiffness": 0.5,
    "imperfection_deg": 0.0,
}


def _checked(name: str, value: Any) -> float | FloatArray:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, found {value!r}") from None
    if name in POSITIVE:
        allowed, good = "a finite number above 0", np.isfinite(array) & (array > 0)
    elif name == "imperfection":
        allowed, good = "an angle of at least 0 and below pi/2 rad (90 degrees)", (array >= 0) & (array < np.pi / 2)
    else:
        allowed, good = "a finite number of at least 0", np.isfinite(array) & (array >= 0)
    if not np.all(good):
        where = "" if array.ndim == 0 else f", entry {tuple(int(i) for i in np.argwhere(~good)[0])}"
        raise ValueError(f"{name}{where}: expected {allowed}, found {array[~good].flat[0]:.6g}")
    if array.ndim == 0:
        return float(array)
    freeze(array)
    return array


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainParameters:
    """Particle-scale properties of a confined force chain: SI units, floats or arrays that broadcast together.

    Attributes:
        radius: R [m].
        normal_stiffness: kn [N/m].
        chain_tangential_stiffness: kFC, between particles of the chain [N/m].
        rolling_stiffness: kr [N/m]; the moment spring is kr R^2 [N m/rad]. Zero: no rolling resistance.
        rolling_friction: mu_r; the largest contact moment is mu_r R times the normal force. Zero: no moment.
        lateral_stiffness: ks, of the support by the weak network [N/m].
        lateral_strength: ls = mu_s sigma_s [N/m]; the largest lateral force is R ls.
        side_tangential_stiffness: kt, between the chain and its side particles [N/m].
        imperfection: buckling angle of the unloaded column [rad].

    Raises:
        ValueError: a value that is not finite, a negative one, a zero radius, kn, kFC or kt, an imperfection outside
            [0, pi/2), or shapes that do not broadcast; one line with the name, what is allowed and what was found.
    """

    radius: float | FloatArray
    normal_stiffness: float | FloatArray
    chain_tangential_stiffness: float | FloatArray
    rolling_stiffness: float | FloatArray
    rolling_friction: float | FloatArray
    lateral_stiffness: float | FloatArray
    lateral_strength: float | FloatArray
    side_tangential_stiffness: float | FloatArray
    imperfection: float | FloatArray = 0.0

    def __post_init__(self) -> None:
        """Check every value; arrays become read-only copies."""
        for field in fields(self):
            object.__setattr__(self, field.name, _checked(field.name, getattr(self, field.name)))
        self._broadcast_shape()

    def _broadcast_shape(self) -> tuple[int, ...]:
        shapes = {field.name: np.shape(getattr(self, field.name)) for field in fields(self)}
        try:
            return np.broadcast_shapes(*shapes.values())
        except ValueError:
            arrays = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
            raise ValueError(f"chain parameters: expected shapes that broadcast together, found {arrays}") from None

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape all parameters broadcast to; () for one parameter set."""
        return self._broadcast_shape()

    @classmethod
    def from_ratios(cls, **given: Any) -> Self:
        """Make parameters from the values as printed: stiffnesses and strength but the first over normal_stiffness.

        Names not given have the value of Table 3. The imperfection is `imperfection_deg`, in degrees.

        Raises ValueError for an unknown name or an inadmissible value.

        >>> ChainParameters.from_ratios(lateral_strength=0.04).lateral_strength
        4200.0
        """
        unknown = [name for name in given if name not in TABLE_3_RATIOS]
        if unknown:
            raise ValueError(f"unknown parameter {unknown[0]!r}; known: " + ", ".join(TABLE_3_RATIOS))
        values: dict[str, Any] = {**TABLE_3_RATIOS, **given}
        values["imperfection"] = np.radians(_checked("imperfection_deg", values.pop("imperfection_deg")))
        stiffness = _checked("normal_stiffness", values["normal_stiffness"])
        for name in RATIOS:
            values[name] = _checked(name, values[name]) * stiffness
        return cls(**values)

    def ratios(self) -> dict[str, float | FloatArray]:
        """Return the values as printed and as `from_ratios` takes them."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        for name in RATIOS:
            values[name] = values[name] / self.normal_stiffness
        values["imperfection_deg"] = np.degrees(values.pop("imperfection"))
        return values

    def with_ratios(self, **changes: Any) -> Self:
        """Return a copy with some values changed, given as `from_ratios` takes them; the other ratios stay.

        So a new normal_stiffness scales every stiffness and the strength, as in panel (a) of the paper's Fig. 6.

        >>> float(TABLE_3.with_ratios(normal_stiffness=2.1e5).lateral_strength)
        5040.0
        """
        return type(self).from_ratios(**{**self.ratios(), **changes})


TABLE_3 = ChainParameters.from_ratios()
