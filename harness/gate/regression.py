"""The regression gate: a study against a baseline, a line each: pass, drifted, or not comparable and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from harness.gate.baseline import FEWEST_SEGMENTS, Baseline, differences, judged_numbers, tolerance_for
from harness.gate.headlines import Headline
from harness.gate.measured import Case, Measured
from harness.reading.consistency import MEANINGS
from harness.text_table import number

SAME = 1e-5  # relative: the same tables must give the same numbers, to where a fit ends and reduced results are rounded
CONSISTENT = (
    1e-4  # how far a figure of consistency may rise: our own tables agree to rounding, CSV ones to their digits
)


class Outcome(StrEnum):
    """What a line says. Everything but PASS makes the check fail: a gate that compares nothing must not pass."""

    PASS = "pass"
    DRIFTED = "DRIFTED"
    NOT_COMPARABLE = "NOT COMPARABLE"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line of the check.

    `drift` is the difference over the tolerance (above 1: drifted), `standard_errors` the difference over its own
    standard error; None where there is no number to compare, or no error.
    """

    case: str
    quantity: str
    unit: str = ""
    baseline: float | None = None
    found: float | None = None
    tolerance: float | None = None
    tolerance_source: str = ""
    drift: float | None = None
    standard_errors: float | None = None
    outcome: Outcome
    why: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self) | {"outcome": self.outcome.value}


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """All lines, and in words what differs between the making of the baseline and of the study."""

    lines: tuple[Line, ...]
    differs: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether every line passes, and there is one."""
        return bool(self.lines) and all(line.outcome is Outcome.PASS for line in self.lines)


def check(baseline: Baseline, found: Measured) -> Check:
    """Hold a study against a baseline."""
    reference = baseline.measured
    numbers = judged_numbers(reference)
    options = differences(sorted({*reference.options, *found.options}), reference.options, found.options)
    lines = [
        _line("", "options of the analysis", options, "other options: "),
        _line(
            "", "tables as they were written", [f"run {r}: {why}" for r, why in found.broken.items()], "", drift=True
        ),
    ]
    pairs, alone = _pairs(reference, found)
    differs = differences(("yade", "script", "package"), reference.versions, found.versions) + options
    for name in alone:
        where = "baseline" if any(case.name == name for case in reference.cases) else "study"
        lines.append(
            Line(case=name, quantity="case", outcome=Outcome.NOT_COMPARABLE, why=f"only in the {where}: other cases")
        )
    for before, now in pairs:
        other = differences(sorted({*before.parameters, *now.parameters}), before.parameters, now.parameters)
        contacts = differences(sorted({*before.contacts, *now.contacts}), before.contacts, now.contacts)
        lines.append(_line(now.name, "parameters", other, "other parameters: "))
        lines.append(_line(now.name, "contacts of the tables", contacts, "other contacts: "))
        lines += _consistency_lines(before, now)
        same = bool(before.tables) and sorted(before.tables.values()) == sorted(now.tables.values())
        seeds = differences(("seeds",), {"seeds": before.seeds}, {"seeds": now.seeds})
        differs += [item for item in dict.fromkeys((*other, *contacts, *seeds)) if item not in differs]
        if not seeds and not same and before.tables:
            differs.append(f"{now.name}: tables, of the same seeds")
        barred = "; ".join(dict.fromkeys((*(f"other options: {item}" for item in options), *other, *contacts)))
        lines += [_number_line(one, now, same, barred, numbers) for one in before.headlines]
        known = {one.quantity for one in before.headlines}
        lines += [
            _unknown(one.case, one.quantity, one.unit, "not in the baseline: approve it anew")
            for one in now.headlines
            if one.quantity not in known and one.judged
        ]
    cause = "; ".join(differs) or "nothing that is recorded: the analysis itself, or the machine"
    attributed = tuple(_attributed(line, cause) for line in lines)
    return Check(lines=attributed, differs=tuple(differs))


def _pairs(reference: Measured, found: Measured) -> tuple[list[tuple[Case, Case]], list[str]]:
    """Pair cases by name; two studies of one case each are paired whatever it is called."""
    if len(reference.cases) == 1 and len(found.cases) == 1:
        return [(reference.cases[0], found.cases[0])], []
    old = {case.name: case for case in reference.cases}
    new = {case.name: case for case in found.cases}
    pairs = [(old[name], new[name]) for name in old if name in new]
    return pairs, [name for name in (*old, *new) if not (name in old and name in new)]


def _line(case: str, quantity: str, found: Sequence[str], words: str, *, drift: bool = False) -> Line:
    outcome = Outcome.PASS
    if found:
        outcome = Outcome.DRIFTED if drift else Outcome.NOT_COMPARABLE
    return Line(case=case, quantity=quantity, outcome=outcome, why=words + "; ".join(found) if found else "")


def _consistency_lines(before: Case, now: Case) -> list[Line]:
    lines = []
    for name, meaning in MEANINGS.items():
        was, value = before.consistency.get(name, 0.0), now.consistency.get(name, 0.0)
        risen = value - was
        lines.append(
            Line(
                case=now.name,
                quantity=f"tables agree: {name.replace('_', ' ')}",
                unit="-",
                baseline=was,
                found=value,
                tolerance=CONSISTENT,
                tolerance_source="rounding",
                drift=max(risen, 0.0) / CONSISTENT,
                outcome=Outcome.PASS if risen <= CONSISTENT else Outcome.DRIFTED,
                why="" if risen <= CONSISTENT else f"the tables contradict themselves ({meaning}): one was changed",
            )
        )
    return lines


def _number_line(before: Headline, now: Case, same: bool, barred: str, numbers: int) -> Line:
    found = next((one for one in now.headlines if one.quantity == before.quantity), None)
    if before.value is None or before.told:  # it was not approved as a number
        return Line(
            case=now.name,
            quantity=before.quantity,
            unit=before.unit,
            baseline=before.value,
            found=None if found is None else found.value,
            outcome=Outcome.NOT_COMPARABLE if barred else Outcome.PASS,
            why=barred or f"not judged: {before.told} when it was approved",
        )
    if found is None or found.value is None:
        why = "not in the study" if found is None else f"no number: {found.told}"
        return _unknown(now.name, before.quantity, before.unit, barred or why, before.value)
    few = [one.count for one in (before, found) if one.count_of == "segments" and one.count < FEWEST_SEGMENTS]
    if few and not barred:
        barred = f"too few segments: {few[0]}, expected at least {FEWEST_SEGMENTS}"
    tolerance = tolerance_for(before, found, numbers)
    if same:
        limit, source = SAME * max(abs(before.value), abs(found.value)), "same tables: the numbers repeat"
    elif tolerance is None:
        return _unknown(
            now.name,
            before.quantity,
            before.unit,
            barred or f"too few seeds: {before.runs} in the baseline, {found.runs} here",
            before.value,
            found.value,
        )
    else:
        limit, source = tolerance.value, tolerance.source
    difference = abs(found.value - before.value)
    errors = (before.standard_error or 0.0) ** 2 + (found.standard_error or 0.0) ** 2
    outcome = Outcome.PASS if difference <= limit else Outcome.DRIFTED
    return Line(
        case=now.name,
        quantity=before.quantity,
        unit=before.unit,
        baseline=before.value,
        found=found.value,
        tolerance=limit,
        tolerance_source=source,
        drift=difference / limit if limit > 0 else None,
        standard_errors=difference / errors**0.5 if errors > 0 else None,
        outcome=Outcome.NOT_COMPARABLE if barred else outcome,
        why=barred,
    )


def _unknown(
    case: str, quantity: str, unit: str, why: str, baseline: float | None = None, found: float | None = None
) -> Line:
    return Line(
        case=case,
        quantity=quantity,
        unit=unit,
        baseline=baseline,
        found=found,
        outcome=Outcome.NOT_COMPARABLE,
        why=why,
    )


def _attributed(line: Line, cause: str) -> Line:
    """Say by how much a number drifted, and what differs that may be why."""
    if line.outcome is not Outcome.DRIFTED or line.why:
        return line
    errors = "" if line.standard_errors is None else f"{number(line.standard_errors, 2)} standard errors, "
    part = "" if line.drift is None else f"{number(line.drift, 2)} times the tolerance"
    values: Mapping[str, Any] = {name: getattr(line, name) for name in Line.__dataclass_fields__}
    return Line(**{**values, "why": f"by {errors}{part}; differs: {cause}"})
