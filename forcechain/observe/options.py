"""Every choice the analysis leaves open, by name, with its default: one flat record, written into every result."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

ENERGY_TERMS = ("normal", "tangential", "rolling")


def _choice(default: str, choices: tuple[str, ...], meaning: str) -> Any:
    return field(default=default, metadata={"choices": choices, "unit": "-", "meaning": meaning})


def _number(
    default: float, meaning: str, *, unit: str = "-", low: float = 0.0, high: float = math.inf, low_allowed: bool = True
) -> Any:
    limits = {"low": low, "high": high, "low_allowed": low_allowed}
    return field(default=default, metadata={"unit": unit, "meaning": meaning, **limits})


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysisOptions:
    """The choices between exported tables and averaged buckling data. Angles in radians, strains as ratios.

    The metadata of each field holds its `unit`, its `meaning`, and either its `choices` or its limits.

    Raises:
        ValueError: a value of the wrong kind or outside its limits; one line with name, expected, found.

    >>> AnalysisOptions(segment_rule="every").segment_rule
    'every'
    >>> AnalysisOptions(segment_rule="evry")
    Traceback (most recent call last):
        ...
    ValueError: segment_rule: expected one of 'best', 'every', found 'evry'
    """

    stress_weight: str = _choice("area", ("area", "none"), "particle stress: over the disc's area, or the bare moment")
    stress_threshold: float = _number(
        1.0, "highly stressed: major principal stress at or above this many means", low_allowed=False
    )
    alignment_rule: str = _choice(
        "angle", ("angle", "180/Z"), "largest angle of a link: alignment_angle, or 180 degrees over the coordination"
    )
    alignment_angle: float = _number(
        math.pi / 4, "largest angle between link and principal direction", unit="rad", high=math.pi / 2
    )
    minimum_chain_length: int = _number(3, "fewest particles of a chain", low=2)
    segment_rule: str = _choice(
        "best", ("best", "every"), "three-particle segments: best-aligned link on each side, or every pair of links"
    )
    wall_segments: str = _choice("keep", ("keep", "drop"), "segments of which a particle touches a wall")
    energy_terms: tuple[str, ...] = field(
        default=ENERGY_TERMS, metadata={"unit": "-", "meaning": "terms of a particle's potential energy"}
    )
    energy_tolerance: float = _number(0.0, "smallest loss of potential energy, over its first value", high=1.0)
    minimum_angle_growth: float = _number(
        math.radians(1), "smallest growth of the buckling angle of a buckled segment", unit="rad", high=math.pi / 2
    )
    lateral_force: str = _choice(
        "support",
        ("support", "magnitude", "supporting", "horizontal"),
        "lateral force: positive towards the line 1-3, its magnitude, that of contacts alone that press towards the "
        "line, or the sum of every contact's magnitude along x",
    )
    drop_length: float = _number(0.007, "axial strain of a drop", high=1.0, low_allowed=False)
    drop_count: int = _number(3, "number of drops", low=1)
    drop_fall: float = _number(0.01, "smallest fall of the stress ratio over a drop")
    drop_prominence: float = _number(
        0.01, "smallest prominence of a drop: its fall above that of the same length moved to either side"
    )
    drop_smoothing: float = _number(0.001, "axial strain over which the stress ratio is averaged to find drops")
    drop_selection: str = _choice("first", ("first", "largest"), "the first of the drops, or those that fall most")
    increments: int = _number(28, "equal strain increments of a drop", low=1)
    plastic_tolerance: float = _number(
        1e-9, "a contact is plastic within this distance of its limit, over the limit", high=0.1
    )
    already_plastic: str = _choice(
        "ignore", ("ignore", "count"), "contacts plastic at the start: ignored until they yield anew, or counted"
    )
    neighbour_ring: str = _choice(
        "between",
        ("centre", "chain", "between", "all"),
        "contacts of the weak neighbours: with the centre, with the segment, also between themselves, or all they have",
    )
    neighbours_at: str = _choice(
        "current", ("current", "start"), "weak neighbours touch the segment at each increment, or at the start"
    )

    def __post_init__(self) -> None:
        """Check every value."""
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name == "energy_terms":
                object.__setattr__(self, item.name, _checked_terms(value))
            elif "choices" in item.metadata:
                if value not in item.metadata["choices"]:
                    expected = ", ".join(repr(choice) for choice in item.metadata["choices"])
                    raise ValueError(f"{item.name}: expected one of {expected}, found {value!r}")
            else:
                object.__setattr__(self, item.name, _checked_number(item.name, value, item.default, item.metadata))
        if self.drop_smoothing > self.drop_length:
            raise ValueError(
                f"drop_smoothing: expected at most drop_length = {self.drop_length:g}, found {self.drop_smoothing:g}"
            )


def _checked_terms(value: Any) -> tuple[str, ...]:
    if isinstance(value, str) or not isinstance(value, (tuple, list)):
        raise ValueError(f"energy_terms: expected a sequence of terms, found {value!r}")
    if not value or len(set(value)) != len(value) or any(term not in ENERGY_TERMS for term in value):
        raise ValueError(f"energy_terms: expected some of {', '.join(ENERGY_TERMS)}, each once, found {value!r}")
    return tuple(term for term in ENERGY_TERMS if term in value)


def _checked_number(name: str, value: Any, default: Any, limits: Mapping[str, Any]) -> Any:
    kind = type(default)
    words = "a whole number" if kind is int else "a number"
    words += f" {'from' if limits['low_allowed'] else 'above'} {limits['low']:g}"
    if math.isfinite(limits["high"]):
        words += f" up to {limits['high']:g}"
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError(f"{name}: expected {words}, found {value!r}")
    too_low = value < limits["low"] or (value == limits["low"] and not limits["low_allowed"])
    if too_low or value > limits["high"] or (kind is int and value != int(value)):
        raise ValueError(f"{name}: expected {words}, found {value!r}")
    return kind(value)
