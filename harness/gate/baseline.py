"""Approved results as a file that people read and one command writes: every number with its error and its tolerance."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from scipy.stats import t as student

from harness.errors import InputError
from harness.gate.headlines import Headline
from harness.gate.measured import Case, Measured
from harness.text_table import number
from harness.toml_text import dumps
from yade_scripts.run_folder import write

FORMAT = 1
FALSE_ALARMS = 0.02  # chance that a study of new seeds drifts in any number at all, shared among the numbers
FEWEST_SEGMENTS = 5
SEGMENTS_TOGETHER = 3  # those of one chain overlap and share neighbours, so even a rare class comes in twos and threes
HEAD = "# Approved results, written by `forcechain approve` alone; `forcechain check` holds a study against them.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """How far two means may differ, and where that comes from."""

    value: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """A baseline file: what was measured, and the history of its approvals, oldest first."""

    measured: Measured
    history: tuple[Mapping[str, Any], ...]


def tolerance_for(reference: Headline, found: Headline, numbers: int) -> Tolerance | None:
    """Return how far the number `found` may lie from `reference`; None where no spread of seeds is known.

    The difference of two means over seeds, the variance of a seed pooled from both, by Student's t for the seeds
    there are. One number in `numbers` drifts by chance with a probability of `FALSE_ALARMS` at most, all together.
    A share may in any case move by `SEGMENTS_TOGETHER` segments.

    >>> one = Headline(case="", quantity="", unit="N", value=10.0, standard_error=0.5, runs=4, count=4, count_of="runs")
    >>> tolerance_for(one, one, 1)
    Tolerance(value=2.222..., source='spread of 4 and 4 seeds')
    """
    sides = [(one.runs, one.standard_error) for one in (reference, found)]
    freedom = sum(runs - 1 for runs, error in sides if error is not None)
    if freedom < 1 or found.runs < 1:
        return None
    variance = sum((runs - 1) * runs * error**2 for runs, error in sides if error is not None) / freedom
    quantile = float(student.ppf(1 - FALSE_ALARMS / numbers / 2, freedom))
    reach = quantile * (variance * (1 / reference.runs + 1 / found.runs)) ** 0.5
    floor, source = reference.floor, "floor"
    if reference.unit == "%":
        few = 100.0 * SEGMENTS_TOGETHER / min(reference.count, found.count)
        floor, source = max((floor, source), (few, f"{SEGMENTS_TOGETHER} segments"))
    if reach <= floor:
        return Tolerance(value=floor, source=source)
    return Tolerance(value=reach, source=f"spread of {reference.runs} and {found.runs} seeds")


def judged_numbers(measured: Measured) -> int:
    """Count the numbers to hold others to."""
    return max(1, sum(number.judged for case in measured.cases for number in case.headlines))


def power_words(measured: Measured) -> str:
    """Say in words how far a number may lie from the baseline before it drifts, which follows from the seeds alone."""
    numbers = judged_numbers(measured)
    fewest = min((entry.runs for case in measured.cases for entry in case.headlines if entry.judged), default=0)
    if fewest < 2:
        return "a number without a spread of seeds cannot be judged"
    reach = float(student.ppf(1 - FALSE_ALARMS / numbers / 2, fewest - 1)) * (1 + 1 / fewest) ** 0.5
    return (
        f"from {fewest} seeds: one new seed drifts where it lies {reach:.1f} standard deviations of a seed away; "
        "more seeds narrow this"
    )


def read_baseline(path: Path) -> Baseline:
    """Read a baseline file. InputError in one line when it is missing, no TOML, of another format or incomplete."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such baseline; make one with: forcechain approve DIR --baseline {path} --reason TEXT"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not TOML: {error}") from None
    if content.get("format") != FORMAT:
        raise InputError(f"{path}: expected a baseline of format {FORMAT}, found {content.get('format')!r}")
    try:
        return _from_plain(content)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{path}: not a whole baseline ({error!r}); approve it anew") from None


def _from_plain(content: Mapping[str, Any]) -> Baseline:
    cases = []
    for case in content["cases"]:
        numbers = tuple(
            Headline(
                case=case["name"],
                quantity=str(entry["quantity"]),
                unit=str(entry["unit"]),
                value=None if "value" not in entry else float(entry["value"]),
                standard_error=None if "standard_error" not in entry else float(entry["standard_error"]),
                runs=int(entry["runs"]),
                count=int(entry["count"]),
                count_of=str(entry["count_of"]),
                told=str(entry.get("told", "")),
            )
            for entry in case["numbers"]
        )
        for entry in numbers:
            _ = entry.floor  # KeyError for a unit that is not known
        cases.append(
            Case(
                name=str(case["name"]),
                seeds=tuple(case["seeds"]),
                parameters=dict(case["parameters"]),
                contacts={name: tuple(values) for name, values in case["contacts"].items()},
                consistency={name: float(value) for name, value in case["consistency"].items()},
                tables=dict(case["tables"]),
                headlines=numbers,
            )
        )
    if not any(number.judged for case in cases for number in case.headlines):
        raise ValueError("no number in it")
    measured = Measured(
        study=str(content["study"]),
        cases=tuple(cases),
        options=dict(content["options"]),
        versions={name: tuple(values) for name, values in content["versions"].items()},
        broken={},
    )
    return Baseline(measured=measured, history=tuple(content["history"]))


def approve(measured: Measured, path: Path, reason: str) -> Baseline:
    """Write `measured` as the baseline `path`, whole or not at all, its history kept and continued; return it.

    InputError for an empty reason, tables that differ from their checksums, a study without numbers, or a single seed.
    """
    if not reason.strip():
        raise InputError("approve: expected a reason, found nothing; say why these results are the ones to hold to")
    if measured.broken:
        run, difference = next(iter(measured.broken.items()))
        raise InputError(f"run {run}: {difference}; a baseline is made from tables as they were written")
    if not any(case.headlines for case in measured.cases):
        raise InputError(f"{measured.study}: no number to approve")
    for case in measured.cases:
        if all(entry.standard_error is None for entry in case.headlines):
            raise InputError(
                f"{measured.study}: {case.name}: expected at least 2 seeds, found {len(case.seeds)}: without their "
                "spread nothing can be judged; add seeds to the study"
            )
    before = read_baseline(path) if path.exists() else None
    entry = {
        "approved": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "reason": reason.strip(),
        "versions": {name: list(values) for name, values in measured.versions.items()},
        "moved": _moved(before.measured, measured) if before is not None else ["everything: the first approval"],
    }
    baseline = Baseline(measured=measured, history=(*(before.history if before else ()), entry))
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path.parent, path.name, (HEAD + dumps(_as_plain(baseline))).encode())
    return baseline


def _moved(before: Measured, now: Measured) -> list[str]:
    """Say in words which numbers changed, by how many standard errors of what was approved before."""
    old = {(n.case, n.quantity): n for case in before.cases for n in case.headlines}
    moved = []
    for new in (n for case in now.cases for n in case.headlines):
        was = old.pop((new.case, new.quantity), None)
        words = f"{new.case}: {new.quantity}"
        if was is None:
            moved.append(f"{words}: new, {number(new.value, 4)} {new.unit}")
        elif was.value != new.value:
            moved.append(f"{words}: {number(was.value, 4)} to {number(new.value, 4)} {new.unit}")
    return [*moved, *(f"{case}: {quantity}: no longer there" for case, quantity in old)]


def _as_plain(baseline: Baseline) -> dict[str, Any]:
    measured = baseline.measured
    numbers = judged_numbers(measured)
    return {
        "format": FORMAT,
        "study": measured.study,
        "versions": {name: list(values) for name, values in measured.versions.items()},
        "options": dict(measured.options),
        "cases": [
            {
                "name": case.name,
                "seeds": list(case.seeds),
                "parameters": dict(case.parameters),
                "contacts": {name: list(values) for name, values in case.contacts.items()},
                "consistency": dict(case.consistency),
                "tables": dict(case.tables),
                "numbers": [_number(entry, numbers) for entry in case.headlines],
            }
            for case in measured.cases
        ],
        "history": [dict(entry) for entry in baseline.history],
    }


def _number(entry: Headline, numbers: int) -> dict[str, Any]:
    tolerance = None
    if entry.judged:
        tolerance = tolerance_for(entry, entry, numbers)
    return {
        "quantity": entry.quantity,
        "value": entry.value,
        "standard_error": entry.standard_error,
        "unit": entry.unit,
        "runs": entry.runs,
        "count": entry.count,
        "count_of": entry.count_of,
        "told": entry.told or None,
        "tolerance": None if tolerance is None else tolerance.value,
        "tolerance_source": None if tolerance is None else f"{tolerance.source}, {FALSE_ALARMS:.0%} over all numbers",
    }


def differences(names: Sequence[str], before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Say in words where two mappings differ: name, value before, value now.

    >>> differences(["friction"], {"friction": 0.7}, {"friction": 0.56})
    ['friction 0.7 -> 0.56']
    """
    return [
        f"{name} {_told(before.get(name))} -> {_told(now.get(name))}"
        for name in names
        if before.get(name) != now.get(name)
    ]


def _told(value: Any) -> str:
    if isinstance(value, list | tuple) and len(value) > 2 and _counts_on(value):
        return f"{value[0]} to {value[-1]}"
    if value is None or value == () or value == []:
        return "none"
    if isinstance(value, list | tuple):
        return ", ".join(_told(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _counts_on(values: Sequence[Any]) -> bool:
    return type(values[0]) is int and list(values) == list(range(values[0], values[0] + len(values)))
