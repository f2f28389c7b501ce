"""The options of the analysis at the edge: names and degrees of a study file to `AnalysisOptions`, and back."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from forcechain.observe.options import AnalysisOptions
from harness.errors import InputError

GIVEN_DROPS = "drops"  # axial strains [start, end] of each drop, instead of finding them


def _edge_names() -> dict[str, tuple[str, bool]]:
    """Name at the edge -> name of the field, and whether it is an angle in degrees."""
    names = {}
    for item in fields(AnalysisOptions):
        angle = item.metadata.get("unit") == "rad"
        names[f"{item.name}_deg" if angle else item.name] = (item.name, angle)
    return names


def read_options(
    given: Mapping[str, Any], where: str
) -> tuple[AnalysisOptions, tuple[tuple[float, float], ...] | None]:
    """Return the options of a study's table [analysis], and its given drops (None: find them).

    Angles are in degrees and their names end in `_deg`. InputError in one line for an unknown name or a bad value.
    """
    edge = _edge_names()
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name == GIVEN_DROPS:
            continue
        if name not in edge:
            close = difflib.get_close_matches(name, [*edge, GIVEN_DROPS], 1)
            hint = f"did you mean {close[0]!r}?" if close else "known: " + ", ".join([*edge, GIVEN_DROPS])
            raise InputError(f"{where}: [analysis] unknown option {name!r}; {hint}")
        field_name, angle = edge[name]
        if angle and isinstance(value, int | float) and not isinstance(value, bool):
            value = math.radians(value)
        values[field_name] = tuple(value) if isinstance(value, list) else value
    try:
        return AnalysisOptions(**values), _given_drops(given.get(GIVEN_DROPS), where)
    except ValueError as error:
        raise InputError(f"{where}: [analysis] {error}") from None


def _given_drops(value: Any, where: str) -> tuple[tuple[float, float], ...] | None:
    if value is None:
        return None
    expected = "pairs of axial strains as in [[0.046, 0.053], [0.059, 0.066]]"
    if not isinstance(value, list) or not value:
        raise InputError(f"{where}: [analysis] {GIVEN_DROPS}: expected {expected}, found {value!r}")
    drops = []
    for pair in value:
        if not isinstance(pair, list) or len(pair) != 2 or not all(type(x) in (int, float) for x in pair):
            raise InputError(f"{where}: [analysis] {GIVEN_DROPS}: expected {expected}, found {pair!r}")
        drops.append((float(pair[0]), float(pair[1])))
    return tuple(drops)


def describe_options(options: AnalysisOptions) -> dict[str, dict[str, Any]]:
    """Return every option by its name at the edge: value, unit, meaning; what `options.json` and the report show."""
    described = {}
    for name, (field_name, angle) in _edge_names().items():
        item = next(item for item in fields(AnalysisOptions) if item.name == field_name)
        value = getattr(options, field_name)
        if angle:
            value = round(math.degrees(value), 10)
        described[name] = {
            "value": list(value) if isinstance(value, tuple) else value,
            "unit": "deg" if angle else item.metadata["unit"],
            "meaning": item.metadata["meaning"],
        }
    return described
