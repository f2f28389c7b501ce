"""A number held against a number: the row of a comparison table, its tolerance, and the verdict.

First is the run valid, then is the number right: nothing here is asked of a run that was judged invalid.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Verdict(StrEnum):
    """What a row says. Only FAIL makes a command exit with status 1.

    UNDECIDED: the value lies within its standard error of the tolerance, on whichever side, so that other packings, or
    another release of YADE, may well say the opposite. More packings decide.
    """

    PASS = "pass"
    FAIL = "FAIL"
    UNDECIDED = "undecided"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the comparison: the quantity, what was found, what was expected, and the verdict.

    `data` and `expected` share `unit`; `standard_error` is the larger of that over segments and that over seeds, None
    where a single value leaves none to compute. `count` says how many of `count_of` the value is the mean of.
    """

    case: str
    quantity: str
    unit: str
    data: float | None
    standard_error: float | None
    count: int
    count_of: str
    model: float | None = None
    paper: float | None = None
    tolerance: float | None = None
    tolerance_source: str = ""
    normalised_rms: float | None = None
    verdict: Verdict
    note: str = ""

    @property
    def counted(self) -> str:
        """How many of what the value is the mean of: "1 run", "25 segments"."""
        return f"{self.count} {self.count_of if self.count != 1 else self.count_of.removesuffix('s')}"

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON and tables."""
        return asdict(self) | {"verdict": self.verdict.value}


def judge(
    found: float | None,
    expected: float,
    tolerance: float,
    standard_error: float | None = None,
    *,
    upper_bound: bool = False,
) -> Verdict:
    """Say whether `found` lies within `tolerance` of `expected`, or for an upper bound not above it by more.

    Where the `standard_error` of `found` is known, it is undecided as long as `found` is that close to the tolerance's
    edge. A number that is missing or not finite never passes: None is not judged, NaN and infinity fail.

    >>> judge(1.05, 1.0, 0.1), judge(0.8, 1.0, 0.1), judge(0.8, 1.0, 0.1, upper_bound=True)
    (<Verdict.PASS: 'pass'>, <Verdict.FAIL: 'FAIL'>, <Verdict.PASS: 'pass'>)
    >>> judge(0.8, 1.0, 0.1, 0.05), judge(0.8, 1.0, 0.1, 0.15)
    (<Verdict.FAIL: 'FAIL'>, <Verdict.UNDECIDED: 'undecided'>)
    """
    if not (math.isfinite(expected) and math.isfinite(tolerance) and tolerance >= 0):
        raise ValueError(f"expected a finite reference and tolerance, found {expected} and {tolerance}")
    if found is None:
        return Verdict.NOT_JUDGED
    if not math.isfinite(found):
        return Verdict.FAIL
    difference = found - expected
    return decide((difference if upper_bound else abs(difference)) - tolerance, standard_error)


def decide(excess: float, standard_error: float | None) -> Verdict:
    """Verdict of a value that is `excess` beyond its tolerance (negative: within), known to `standard_error`."""
    if standard_error is not None and abs(excess) < standard_error:
        return Verdict.UNDECIDED
    return Verdict.PASS if excess <= 0 else Verdict.FAIL


def tolerance_for_one_print(floor: float, spread: float | None, count: int) -> tuple[float, str]:
    """Tolerance for a number printed from one simulation, held against the mean of `count` packings.

    The print is one draw from the distribution of packings, whose standard deviation s is `spread`, so it lies within
    2 s sqrt(1 + 1/count) of their mean. Never less than `floor`. Returns the tolerance and where it comes from.

    >>> tolerance_for_one_print(0.01, 0.02, 4)
    (0.044721..., 'spread of 4 packings')
    >>> tolerance_for_one_print(0.01, None, 1)
    (0.01, 'floor')
    """
    if spread is None or count < 2:
        return floor, "floor"
    from_spread = 2 * spread * math.sqrt(1 + 1 / count)
    return (from_spread, f"spread of {count} packings") if from_spread > floor else (floor, "floor")


def tolerance_for_a_mean(floor: float, standard_error: float | None) -> tuple[float, str]:
    """Tolerance for a mean held against an exact value: two standard errors, never less than `floor`."""
    if standard_error is None or 2 * standard_error <= floor:
        return floor, "floor"
    return 2 * standard_error, "2 s.e."


def failed(rows: list[Row]) -> int:
    """Count the rows that fail."""
    return sum(row.verdict is Verdict.FAIL for row in rows)
