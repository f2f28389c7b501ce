"""Which choices of the analysis to vary, and how far: one at a time about the options in use."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, NamedTuple

from forcechain.observe.options import AnalysisOptions

# What moves the initial angle, the lateral force, the counts and the classes; angles in radians.
VARIATIONS: Mapping[str, tuple[Any, ...]] = {
    "stress_weight": ("area", "none"),
    "stress_threshold": (0.8, 0.9, 1.0, 1.1, 1.25),
    "alignment_rule": ("angle", "180/Z"),
    "alignment_angle": tuple(math.radians(angle) for angle in (30, 37.5, 45, 52.5, 60)),
    "minimum_chain_length": (3, 4, 5),
    "segment_rule": ("best", "every"),
    "wall_segments": ("keep", "drop"),
    "energy_terms": (("normal", "tangential", "rolling"), ("normal", "tangential"), ("normal",)),
    "energy_tolerance": (0.0, 0.1, 0.25),
    "minimum_angle_growth": tuple(math.radians(angle) for angle in (0.0, 0.5, 1.0, 2.0, 4.0)),
    "lateral_force": ("support", "magnitude", "supporting", "horizontal"),
    "drop_length": (0.0035, 0.005, 0.007, 0.01),
    "increments": (7, 14, 28),
    "already_plastic": ("ignore", "count"),
    "neighbour_ring": ("centre", "chain", "between", "all"),
    "neighbours_at": ("current", "start"),
}


class Variation(NamedTuple):
    """One option changed: its name, its value (SI units, radians), and all the options with it."""

    name: str
    value: Any
    options: AnalysisOptions

    @property
    def is_reference(self) -> bool:
        """Whether the value is that of the options about which the others vary."""
        return self.name == ""


def variations(options: AnalysisOptions, table: Mapping[str, Sequence[Any]] = VARIATIONS) -> tuple[Variation, ...]:
    """Return the options in use, first and named "", then each value of `table` that differs from them, one at a time.

    A drop of another length keeps the strain of an increment as nearly as whole increments allow, so that the snapshots
    serve it. Raises ValueError for a name that is no option or a value it does not take.

    >>> [(name, value) for name, value, _ in variations(AnalysisOptions(), {"segment_rule": ("best", "every")})]
    [('', None), ('segment_rule', 'every')]
    """
    known = {item.name for item in fields(AnalysisOptions)}
    found = [Variation("", None, options)]
    for name, values in table.items():
        if name not in known:
            raise ValueError(f"table: expected options, found {name!r}")
        for value in values:
            changes = {name: value}
            if name == "drop_length":
                changes["increments"] = max(1, round(options.increments * value / options.drop_length))
            if name == "alignment_angle":
                changes["alignment_rule"] = "angle"
            changed = replace(options, **changes)
            if getattr(changed, name) != getattr(options, name):
                found.append(Variation(name, getattr(changed, name), changed))
    return tuple(found)
