"""Studies beside one another: what each headline number moves by, seed by seed, and by how much chance moves it.

Runs of one seed share their packing, so their numbers are compared in pairs. After the peak two runs of one packing
part ways even where only rounding differs, so chance has to be measured too: from what is left of all numbers when each
study and each seed has had its mean (the residual of a two-way layout), with Student's t for its degrees of freedom.
Studies that a quantity does not reach, with differences of exactly zero, take no part in it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd
from scipy.stats import t as student

from harness.analysing.buckling_data import Analysis
from harness.comparing.run_numbers import QUANTITIES, Quantity, run_numbers
from harness.errors import InputError
from harness.reading.exports import read_run, run_folders
from harness.text_table import number, render

CONFIDENCE = 0.95
BEYOND_CHANCE, BEYOND_ALL = "*", "**"
LEGEND = (
    "differences are means over the shared seeds, ± half their 95 % interval (none where no second seed tells chance)\n"
    f"{BEYOND_CHANCE} beyond it: of a hundred such differences five are by chance; "
    f"{BEYOND_ALL} beyond what chance does to any one of them all (Bonferroni)"
)
Numbers = Mapping[str, pd.DataFrame]


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One number of one study less that of the base, over the seeds that have both.

    Attributes:
        study: the study's name.
        quantity: what is compared.
        base, found: means over the shared seeds; None without any.
        difference: found less base; None without shared seeds.
        seeds: how many are shared.
        standard_error: of the difference; None where chance cannot be told.
        degrees_of_freedom: of the standard error.
        reach: half the 95 % interval.
        mark: "", "*" beyond the interval, "**" beyond that for all differences of the table together.
    """

    study: str
    quantity: Quantity
    base: float | None
    found: float | None
    difference: float | None
    seeds: int
    standard_error: float | None = None
    degrees_of_freedom: int = 0
    reach: float | None = None
    mark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variations:
    """What studies differ in, and what that moves.

    Attributes:
        base: name of the study the others are held against.
        case: its case.
        seeds: its runs.
        changes: study -> what differs from the base, in words: parameters, options of the analysis, versions.
        differences: quantity after quantity, study after study.
    """

    base: str
    case: str
    seeds: tuple[str, ...]
    changes: Mapping[str, tuple[str, ...]]
    differences: tuple[Difference, ...]


def vary(base: Analysis, others: Mapping[str, Analysis], case: str | None = None) -> Variations:
    """Hold the studies `others` (name -> analysis) against `base`, in its `case` (None: its first).

    Of another study the case of that name is taken, or its only one. Raises InputError for a case that is none, a study
    with several cases of which none has that name, or one that shares no seed with the base.
    """
    case = _case_of(base, case)
    numbers = {base.name: run_numbers(base, case)}
    conditions = _conditions(base, case)
    changes = {}
    for name, other in others.items():
        if name in numbers:
            raise InputError(f"{name}: expected studies of different names, found two of this one")
        only = other.cases[0] if len(other.cases) == 1 else None
        if case not in other.cases and only is None:
            raise InputError(
                f"{name}: expected the case {case!r}, or only one, found {', '.join(other.cases)}; name one with --case"
            )
        chosen = case if case in other.cases else other.cases[0]
        numbers[name] = run_numbers(other, chosen)
        shared = numbers[name].index.intersection(numbers[base.name].index)
        if not len(shared):
            raise InputError(
                f"{name}: expected a seed of {base.name} ({', '.join(numbers[base.name].index)}), "
                f"found {', '.join(numbers[name].index)}"
            )
        changes[name] = changes_in_words(conditions, _conditions(other, chosen))
    return Variations(
        base=base.name,
        case=case,
        seeds=tuple(numbers[base.name].index),
        changes=changes,
        differences=differences(numbers, base.name),
    )


def differences(numbers: Numbers, base: str) -> tuple[Difference, ...]:
    """Hold the tables of `run_numbers` (study -> table) against that of `base`, quantity after quantity."""
    others = [name for name in numbers if name != base]
    found = [
        difference
        for quantity in QUANTITIES
        for difference in _of_quantity(quantity, {name: numbers[name][quantity.name] for name in numbers}, base, others)
    ]
    judged = sum(difference.reach is not None for difference in found)
    return tuple(_marked(difference, judged) for difference in found)


def _of_quantity(
    quantity: Quantity, values: Mapping[str, pd.Series], base: str, others: Sequence[str]
) -> list[Difference]:
    pairs = {}
    for name in others:
        both = pd.concat({"base": values[base], "found": values[name]}, axis=1, join="inner").dropna()
        pairs[name] = both
    reached = [name for name, both in pairs.items() if len(both) and not both["base"].equals(both["found"])]
    scatter, freedom = _residual([values[base], *(values[name] for name in reached)])
    rows = []
    for name, both in pairs.items():
        n = len(both)
        if n == 0:
            rows.append(Difference(study=name, quantity=quantity, base=None, found=None, difference=None, seeds=0))
            continue
        each = (both["found"] - both["base"]).to_numpy(dtype=np.float64)
        error, of_error = None, 0
        if name in reached and freedom > 0:
            # A study that scatters more than the others (another packing, say) is not to profit from their calm.
            own = float(each.std(ddof=1)) / math.sqrt(n) if n > 1 else 0.0
            error, of_error = max(scatter * math.sqrt(2 / n), own), freedom
        rows.append(
            Difference(
                study=name,
                quantity=quantity,
                base=float(both["base"].mean()),
                found=float(both["found"].mean()),
                difference=float(each.mean()),
                seeds=n,
                standard_error=error,
                degrees_of_freedom=of_error,
                reach=None if error is None else float(student.ppf((1 + CONFIDENCE) / 2, of_error)) * error,
            )
        )
    return rows


def _residual(columns: Sequence[pd.Series]) -> tuple[float, int]:
    """Standard deviation of what neither study nor seed explains, and its degrees of freedom; least squares."""
    table = pd.concat(columns, axis=1, keys=range(len(columns))).to_numpy(dtype=np.float64)
    seeds, studies = np.nonzero(np.isfinite(table))
    values = table[seeds, studies]
    if not len(values):
        return math.nan, 0
    # The indicators of seeds and of studies both sum to one, so there is a column too many: the rank counts.
    design = np.concatenate([np.eye(table.shape[0])[seeds], np.eye(table.shape[1])[studies]], axis=1)
    fitted, _, rank, _ = np.linalg.lstsq(design, values, rcond=None)
    freedom = len(values) - int(rank)
    if freedom == 0:
        return math.nan, 0
    return float(np.sqrt(((values - design @ fitted) ** 2).sum() / freedom)), freedom


def _marked(found: Difference, judged: int) -> Difference:
    if found.difference is None or found.reach is None or found.standard_error is None:
        return found
    reach_of_all = float(student.ppf(1 - (1 - CONFIDENCE) / (2 * judged), found.degrees_of_freedom))
    mark = ""
    if abs(found.difference) > found.reach:
        mark = BEYOND_ALL if abs(found.difference) > reach_of_all * found.standard_error else BEYOND_CHANCE
    return replace(found, mark=mark)


def _case_of(base: Analysis, case: str | None) -> str:
    if case is None:
        return base.cases[0]
    if case not in base.cases:
        raise InputError(f"{base.name}: expected one of the cases {', '.join(base.cases)}, found {case!r}")
    return case


def _conditions(analysis: Analysis, case: str) -> dict[str, str]:
    """Return what the runs of a case and their analysis were made with: name to value, in words."""
    runs = set(analysis.runs.loc[analysis.runs["case"] == case, "run"])
    found: dict[str, set[str]] = {}
    for folder in run_folders(analysis.directory):
        if folder.name not in runs:
            continue
        run = read_run(folder)
        provenance = (run.manifest or {}).get("provenance", {})
        told = {name: value for name, value in run.parameters.items() if name != "seed"}
        told |= {"YADE": provenance.get("yade_version"), "script": str(provenance.get("script_hash", ""))[:8] or None}
        for name, value in told.items():
            found.setdefault(name, set()).add("unknown" if value is None else _brief(value))
    conditions = {name: " or ".join(sorted(values)) for name, values in found.items()}
    return conditions | {f"analysis: {name}": _brief(entry["value"]) for name, entry in analysis.options.items()}


def changes_in_words(base: Mapping[str, str], other: Mapping[str, str]) -> tuple[str, ...]:
    """List what differs between two sets of conditions.

    >>> changes_in_words({"mass": "equal", "YADE": "2023.02a"}, {"mass": "true", "YADE": "2023.02a"})
    ('mass true, not equal',)
    """
    names = [*base, *(name for name in other if name not in base)]
    return tuple(
        f"{name} {other.get(name, 'unknown')}, not {base.get(name, 'unknown')}"
        for name in names
        if base.get(name, "unknown") != other.get(name, "unknown")
    )


def _brief(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def frame(found: Variations) -> pd.DataFrame:
    """Return the differences as a table: a row a quantity and study; what is unknown is not a number."""
    rows = []
    for difference in found.differences:
        row = asdict(difference)
        quantity = row.pop("quantity")
        rows.append({"quantity": quantity["words"], "unit": quantity["unit"], "paper": quantity["paper"]} | row)
    table = pd.DataFrame(rows)
    numbers = ["paper", "base", "found", "difference", "standard_error", "reach"]
    table[numbers] = table[numbers].astype(np.float64)
    return table


def cells(found: Variations, studies: Sequence[str] | None = None) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and rows of the table of differences: a row a quantity, a column each of `studies` (None: all).

    `printed` is the paper's number; the base's is its mean over the seeds it shares with the study that has most.
    """
    chosen = list(found.changes) if studies is None else list(studies)
    rows = []
    for quantity in QUANTITIES:
        of_quantity = {d.study: d for d in found.differences if d.quantity == quantity}
        known = [d for d in of_quantity.values() if d.base is not None]
        base = max(known, key=lambda difference: difference.seeds).base if known else None
        rows.append(
            (
                quantity.words,
                quantity.unit,
                number(quantity.paper),
                number(base, 4),
                *(difference_text(of_quantity[name]) for name in chosen),
            )
        )
    return ("quantity", "unit", "printed", found.base, *chosen), rows


def difference_text(difference: Difference) -> str:
    """Write a difference with its sign, half its interval to two digits, and its mark.

    >>> force = next(quantity for quantity in QUANTITIES if quantity.unit == "N")
    >>> found = Difference(study="a", quantity=force, base=10, found=9.5, difference=-0.5, seeds=2, reach=0.31)
    >>> difference_text(found)
    '-0.50 ± 0.31'
    """
    if difference.difference is None:
        return "-"
    if difference.difference == 0 and difference.reach is None:
        return "0"
    if difference.reach is None or not difference.reach > 0:
        return f"{difference.difference:+.3g}"
    decimals = max(0, 1 - math.floor(math.log10(difference.reach)))
    text = f"{difference.difference:+.{decimals}f} ± {difference.reach:.{decimals}f}"
    return text + (f" {difference.mark}" if difference.mark else "")


def text(found: Variations, at_once: int = 5) -> str:
    """Write the tables of differences, `at_once` studies a table, what each changed, and what the marks mean."""
    names = list(found.changes)
    parts = [f"{found.base}: {found.case}. {len(found.seeds)} runs: {', '.join(found.seeds)}."]
    for first in range(0, len(names), at_once):
        header, rows = cells(found, names[first : first + at_once])
        parts.append(render(header, rows, right=range(2, len(header))))
    parts.append("\n".join(f"{name}: {'; '.join(found.changes[name]) or 'nothing differs'}" for name in names))
    return "\n\n".join([*parts, LEGEND])
