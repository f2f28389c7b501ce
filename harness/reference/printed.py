"""Every number the paper prints beside the study's: value, interval over packings, verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from forcechain.arrays import FloatArray
from forcechain.calibration import Calibration, Column, Identified
from forcechain.theory.parameters import TABLE_3
from forcechain.theory.three_particle import loading
from harness.analysing.averages import mean_and_error
from harness.analysing.buckling_data import Analysis
from harness.comparing import paper
from harness.comparing.comparison import ModelCurves
from harness.comparing.verdicts import Row, Verdict, judge, tolerance_for_a_mean, tolerance_for_one_print
from harness.text_table import number

CONFIDENCE = 0.95
INITIAL_ANGLE_DEG = 14.0  # printed mean initial angle, section 5.1.1
DISPLACEMENT_THERE = 0.25  # printed D/R at it: "about"
DISPLACEMENT_TOLERANCE = 0.025  # a tenth of a number printed as "about"
DROPS = ((0.046, 0.053), (0.059, 0.066), (0.080, 0.087))  # section 5.1
DROP_FLOOR = 0.005  # two thirds of a drop's length: where collapses fall is a packing's own affair
SHARE_FLOOR = 0.05  # percent: a last digit of Table 1
SLIDING = 5.0  # percent, section 5.3: "in all our DEM simulations, less than"
CHANGE = "lateral force, change over the drop"
CALIBRATED = {
    "chain_tangential_stiffness": ("chain tangential stiffness kFC", 0.014),
    "lateral_stiffness": ("lateral stiffness ks", 0.06),
    "lateral_strength": ("lateral strength ls", 0.024),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """One printed number beside the study's.

    `low` and `high` are the 95 % interval over packings, None with one packing; `why` says how far the print may lie.
    """

    quantity: str
    unit: str
    printed: str
    found: float | None
    low: float | None = None
    high: float | None = None
    counted: str
    verdict: Verdict
    why: str = ""

    @property
    def found_text(self) -> str:
        """The study's number, to the digits its interval bears."""
        return rounded(self.found, self.low, self.high)

    @property
    def interval_text(self) -> str:
        """Both ends of the interval."""
        if self.low is None or self.high is None:
            return "-"
        return f"{rounded(self.low, self.low, self.high)} to {rounded(self.high, self.low, self.high)}"


def rounded(value: float | None, low: float | None = None, high: float | None = None) -> str:
    """Write a number with the decimals that an interval from `low` to `high` bears: two digits of its half width.

    >>> rounded(14.0589, 12.86, 15.26), rounded(0.710, 0.7068, 0.7132), rounded(15.2), rounded(None)
    ('14.1', '0.7100', '15.2', '-')
    """
    if value is None or low is None or high is None or not high > low:
        return number(value)
    decimals = max(0, 1 - math.floor(math.log10((high - low) / 2)))
    return f"{value:.{decimals}f}"


def over_packings(value: float | None, standard_error: float | None, runs: int) -> tuple[float | None, float | None]:
    """Return the 95 % interval of a mean over `runs` packings, by Student's t; none with one packing.

    >>> over_packings(10.0, 1.0, 5)
    (7.223..., 12.776...)
    """
    if value is None or standard_error is None or runs < 2:
        return None, None
    reach = float(student.ppf((1 + CONFIDENCE) / 2, runs - 1)) * standard_error
    return value - reach, value + reach


def printed_case(analysis: Analysis) -> str | None:
    """Return the case whose runs are under the conditions of the printed numbers, None if there is none."""
    for case in analysis.cases:
        facts = analysis.runs[analysis.runs["case"] == case].iloc[0]
        if not paper.departures({str(name): value for name, value in facts.items()}):
            return case
    return None


def printed_numbers(
    case: str,
    analysis: Analysis,
    rows: Sequence[Row],
    curves: Mapping[str, ModelCurves],
    calibrations: Mapping[str, Mapping[Column, Calibration]],
) -> list[Printed]:
    """Return the numbers of sections 5.1 to 5.3 beside those of `case`; `rows` are those of the comparison."""
    n_runs = int((analysis.runs["case"] == case).sum())
    found = [_of_row(row, n_runs) for row in rows if row.case == case and row.paper is not None]
    angle = next((one for one in found if one.quantity == "initial buckling angle, mean"), None)
    found.sort(key=lambda one: one.quantity == CHANGE)  # beside the numbers of the same section
    peak = next((place for place, one in enumerate(found) if one.quantity == "axial strain at the peak"), -1) + 1
    found[peak:peak] = _drops(case, analysis)
    if angle is not None:
        place = found.index(angle) + 1
        found[place:place] = _displacement_there(angle, curves.get(case))
    if case in calibrations:
        found += _calibrated(calibrations[case][Column.PERFECT])
    return found


def _of_row(row: Row, n_runs: int) -> Printed:
    low, high = over_packings(row.data, row.standard_error, n_runs)
    reference = next((one for one in paper.PRINTED if one.words == row.quantity), None)
    return Printed(
        quantity=row.quantity,
        unit=row.unit,
        printed=("< " if reference is not None and reference.upper_bound else "") + number(row.paper),
        found=row.data,
        low=low,
        high=high,
        counted=row.counted,
        verdict=row.verdict,
        why="" if row.tolerance is None else f"± {number(row.tolerance, 2)} ({row.tolerance_source})",
    )


def _drops(case: str, analysis: Analysis) -> list[Printed]:
    facts = analysis.runs[analysis.runs["case"] == case]
    counts = facts["drops"].to_numpy(dtype=np.float64)
    found = [_one_print("number of drops (3 at most are taken)", "-", "3", 3.0, counts, floor=1.0)]
    drops = analysis.drops[analysis.drops["case"] == case]
    for place, (start, end) in enumerate(DROPS, start=1):
        starts = drops.loc[drops["drop"] == place, "start"].to_numpy(dtype=np.float64)
        if place > 1 and not len(starts):
            continue  # the number of drops says so
        found.append(_one_print(f"start of drop {place}, axial strain", "-", f"{start} (to {end})", start, starts))
    return found


def _one_print(
    quantity: str,
    unit: str,
    text: str,
    printed: float,
    by_run: FloatArray,
    floor: float = DROP_FLOOR,
    known: tuple[float, float | None] | None = None,
) -> Printed:
    """Hold a print of one simulation against a value a packing; `known`: mean and error that are known better."""
    n = len(by_run)
    spread = float(by_run.std(ddof=1)) if n > 1 else None
    mean = float(by_run.mean()) if n else None
    error = None if spread is None else spread / math.sqrt(n)
    if known is not None:
        mean, error = known
    low, high = over_packings(mean, error, n)
    tolerance, source = tolerance_for_one_print(floor, spread, n)
    return Printed(
        quantity=quantity,
        unit=unit,
        printed=text,
        found=mean,
        low=low,
        high=high,
        counted=f"{n} run{'s' if n != 1 else ''}",
        verdict=judge(mean, printed, tolerance, error),
        why=f"± {number(tolerance, 2)} ({source})",
    )


def _displacement_there(angle: Printed, model: ModelCurves | None) -> list[Printed]:
    there = float(loading(TABLE_3, np.radians(INITIAL_ANGLE_DEG)).axial_displacement_over_R)
    rows = [
        Printed(
            quantity=f"the model's D/R at {INITIAL_ANGLE_DEG:g} deg, parameters of Table 3",
            unit="-",
            printed=f"about {DISPLACEMENT_THERE}",
            found=there,
            counted="exact",
            verdict=judge(there, DISPLACEMENT_THERE, DISPLACEMENT_TOLERANCE),
            why=f"± {DISPLACEMENT_TOLERANCE} (printed as about)",
        )
    ]
    if model is None or angle.low is None or angle.high is None:
        return rows
    low, high = (
        float(loading(model.parameters, np.radians(end)).axial_displacement_over_R) for end in (angle.low, angle.high)
    )
    rows.append(
        Printed(
            quantity="the model's D/R at our initial angle, where the data start",
            unit="-",
            printed=f"about {DISPLACEMENT_THERE}",
            found=model.shift,
            low=low,
            high=high,
            counted=angle.counted,
            verdict=judge(model.shift, DISPLACEMENT_THERE, max(DISPLACEMENT_TOLERANCE, (high - low) / 2)),
            why=f"± {number(max(DISPLACEMENT_TOLERANCE, (high - low) / 2), 2)}",
        )
    )
    return rows


def _calibrated(calibration: Calibration) -> list[Printed]:
    found = []
    for estimate in calibration.estimates:
        words, printed = CALIBRATED[estimate.name]
        inside = estimate.interval.low <= printed <= estimate.interval.high
        verdict = Verdict.PASS if inside else Verdict.FAIL
        if estimate.identified is Identified.NO:
            verdict = Verdict.NOT_JUDGED
        found.append(
            Printed(
                quantity=words,
                unit="kn",
                printed=number(printed),
                found=estimate.value,
                low=estimate.interval.low,
                high=estimate.interval.high,
                counted=f"{calibration.n_segments} segments",
                verdict=verdict,
                why=f"within the interval; {estimate.identified.value}",
            )
        )
    return found


def class_shares(case: str, analysis: Analysis) -> list[Printed]:
    """Return Table 1 of one rolling friction beside the study's shares; empty where the paper has no such row."""
    yielding = analysis.yielding[analysis.yielding["case"] == case]
    friction = analysis.runs.loc[analysis.runs["case"] == case, "rolling_friction"].iloc[0]
    printed = next((row for value, row in paper.TABLE_1.items() if np.isclose(value, friction)), None)
    if printed is None or not len(yielding):
        return []
    kinds: list[tuple[str, tuple[int, ...], float]]
    kinds = [(f"{code} {words}", (code,), printed[code - 1]) for code, words in paper.CLASS_WORDS.items()]
    kinds.append(("2 and 4, 'consistently the majority'", (2, 4), printed[1] + printed[3]))
    found = []
    for words, classes, share in kinds:
        flags = 100.0 * yielding["buckling_class"].isin(classes)
        groups = [np.asarray(values, dtype=np.float64) for _, values in flags.groupby(yielding["run"])]
        mean, larger = mean_and_error([group[None, :] for group in groups])
        error = float(larger.larger[0])
        known = float(mean[0]), error if np.isfinite(error) else None
        by_run = np.array([group.mean() for group in groups])
        row = _one_print(words, "%", f"{share:.1f}", share, by_run, SHARE_FLOOR, known)
        found.append(
            replace(
                row,
                low=None if row.low is None else max(row.low, 0.0),
                high=None if row.high is None else min(row.high, 100.0),
                counted=f"{int((flags > 0).sum())} of {len(flags)}",
            )
        )
    return [*found, _sliding(case, analysis)]


def _sliding(case: str, analysis: Analysis) -> Printed:
    """Share of segments that buckle by sliding inside the chain: printed as an upper bound, for every friction."""
    classes = analysis.classes[(analysis.classes["case"] == case) & (analysis.classes["class"] == "slides first")]
    share, error, n = (classes.iloc[0][name] for name in ("percent", "percent_se", "of"))
    runs = int(analysis.yielding.loc[analysis.yielding["case"] == case, "run"].nunique())
    standard_error = float(error) if np.isfinite(error) else None
    low, high = over_packings(float(share), standard_error, runs)
    tolerance, source = tolerance_for_a_mean(0.0, standard_error)
    return Printed(
        quantity="buckle by sliding inside the chain",
        unit="%",
        printed=f"< {SLIDING:g}",
        found=float(share),
        low=None if low is None else max(low, 0.0),
        high=high,
        counted=f"{classes.iloc[0]['segments']} of {n}",
        verdict=judge(float(share), SLIDING, tolerance, standard_error, upper_bound=True),
        why=f"+ {number(tolerance, 2)} ({source})",
    )
