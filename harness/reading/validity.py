"""Is a run valid? The first stage of every verdict: judged from the run's manifest, before any number is compared."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from harness.study import RunSettings
from yade_scripts import parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """One figure of a run against its bounds.

    Attributes:
        name: as in the manifest.
        meaning: what it is, in words.
        value: as the manifest has it; nan when it does not have it.
        lower, upper: admissible range; None: no bound on that side.
        passed: whether the value is a number within its bounds.
    """

    name: str
    meaning: str
    value: float
    lower: float | None
    upper: float | None
    passed: bool

    def __str__(self) -> str:
        """Say value and bounds in one phrase."""
        if math.isnan(self.value):
            return f"{self.meaning} ({self.name}) is not told"
        limits = [f"at least {self.lower:g}"] if self.lower is not None else []
        limits += [f"at most {self.upper:g}"] if self.upper is not None else []
        return f"{self.meaning} ({self.name}) is {self.value:.4g}, expected {' and '.join(limits)}"


def judge(manifest: Mapping[str, Any], settings: RunSettings) -> tuple[Figure, ...]:
    """Return every figure that decides whether a run is valid.

    A run of our own script has to tell all of them; of a script of the user's own, those it tells are judged.
    """
    ours = str(manifest.get("script")).removesuffix(".py") in parameters.TESTS
    preparation, validity = "preparation", "validity"
    asked: tuple[tuple[str, str, str, float | None, float | None], ...] = (
        (
            preparation,
            "solid_fraction",
            "solid fraction after preparation",
            settings.solid_fraction_low,
            settings.solid_fraction_high,
        ),
        (validity, "servo_error_max", "largest error of the confining stress", None, settings.servo_bound),
        (validity, "unbalanced_force_max", "largest unbalanced force", None, settings.unbalanced_force_bound),
        (validity, "inertial_number", "inertial number", None, settings.inertial_number_bound),
        (
            validity,
            "kinetic_over_elastic_max",
            "largest kinetic over elastic energy",
            None,
            settings.kinetic_over_elastic_bound,
        ),
        (validity, "overlap_max", "largest overlap over the mean radius", None, settings.overlap_bound),
        (validity, "escaped_discs", "number of discs outside the walls", None, 0),
        (validity, "settled", "whether the packing came to rest (1) or not (0)", 1, None),
    )
    figures = []
    for part, name, meaning, lower, upper in asked:
        told = manifest.get(part)
        value = told.get(name) if isinstance(told, Mapping) else None
        if value is None and not ours:
            continue
        number = float(value) if isinstance(value, int | float) else math.nan
        passed = (lower is None or number >= lower) and (upper is None or number <= upper) and math.isfinite(number)
        figures.append(Figure(name=name, meaning=meaning, value=number, lower=lower, upper=upper, passed=passed))
    return tuple(figures)


def faults(figures: tuple[Figure, ...]) -> str | None:
    """Return what makes a run invalid in one line, or None when it is valid."""
    broken = [str(figure) for figure in figures if not figure.passed]
    return "; ".join(broken) or None
