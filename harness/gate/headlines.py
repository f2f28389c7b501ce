"""The headline numbers of a study, each with its standard error: what a baseline keeps and a check judges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from forcechain.arrays import FloatArray
from forcechain.calibration import Calibration, Identified
from harness.analysing.averages import histories
from harness.analysing.buckling_data import Analysis

# What a difference must exceed at least, by unit: the steps of the exports, or what nobody would call a drift.
FLOOR_BY_UNIT = {"N": 0.02, "deg": 0.1, "%": 1.0, "kn": 2e-4, "-": 5e-4}
RELATIVE_FLOOR = 0.01
SMALLEST_SHARE = 1.0  # segment added to each side of a share, so that a class nobody was in has an error too

FACTS = (
    ("solid_fraction", "solid fraction, prepared", "-"),
    ("coordination", "coordination number, prepared", "-"),
    ("peak_stress_ratio", "peak stress ratio", "-"),
    ("strain_at_peak", "axial strain at the peak", "-"),
    ("drops", "number of drops", "-"),
)
MEANS_OVER_DROP = (
    ("axial_force_N", "axial force, mean over the drop", "N"),
    ("normal_displacement_over_R", "normal displacement/R, mean over the drop", "-"),
    ("axial_displacement_over_R", "axial displacement/R since the start, mean over the drop", "-"),
    ("lateral_force_N", "lateral force, mean over the drop", "N"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Headline:
    """One number of one case: its value, standard error (the larger over segments and runs), and how many it is of.

    `standard_error` is None with one run: the packings' spread is unknown. `told` says why the value, if there is one,
    is not to be approved: a calibrated parameter that the data do not bound on both sides.
    """

    case: str
    quantity: str
    unit: str
    value: float | None
    standard_error: float | None
    runs: int
    count: int
    count_of: str
    told: str = ""

    @property
    def judged(self) -> bool:
        """Whether it is a number to hold others to, once approved."""
        return self.value is not None and not self.told

    @property
    def floor(self) -> float:
        """Smallest difference that counts as a drift."""
        return max(FLOOR_BY_UNIT[self.unit], RELATIVE_FLOOR * abs(self.value or 0.0))


def headlines(analysis: Analysis, calibrations: Mapping[str, Calibration]) -> list[Headline]:
    """Return every headline number of every case; `calibrations` of those that have one."""
    numbers = []
    for case in analysis.cases:
        facts = analysis.runs[analysis.runs["case"] == case]
        for name, words, unit in FACTS:
            known = pd.to_numeric(facts[name], errors="coerce").dropna().to_numpy(dtype=np.float64)
            if len(known):
                numbers.append(_of_runs(case, words, unit, known))
        segments = analysis.segments[analysis.segments["case"] == case]
        if len(segments):
            numbers += [_of_segments(case, words, unit, groups) for words, unit, groups in _segment_values(segments)]
            numbers += _shares(case, analysis.yielding[analysis.yielding["case"] == case])
        if case in calibrations:
            numbers += _calibrated(case, calibrations[case])
    return numbers


def _segment_values(segments: pd.DataFrame) -> list[tuple[str, str, list[FloatArray]]]:
    angle = histories(segments, "buckling_angle_deg")
    rotation = histories(segments, "rotation_deg")
    lateral = histories(segments, "lateral_force_N")
    values = [
        ("initial buckling angle, mean", "deg", [run[0] for run in angle]),
        ("growth of the buckling angle", "deg", [run[-1] - run[0] for run in angle]),
        ("rotation at the end of the drop", "deg", [run[-1] for run in rotation]),
        ("lateral force, change over the drop", "N", [run[-1] - run[0] for run in lateral]),
    ]
    values += [
        (words, unit, [run.mean(axis=0) for run in histories(segments, c)]) for c, words, unit in MEANS_OVER_DROP
    ]
    return values


def _of_runs(case: str, words: str, unit: str, values: FloatArray) -> Headline:
    n = len(values)
    error = float(values.std(ddof=1) / np.sqrt(n)) if n > 1 else None
    return Headline(
        case=case,
        quantity=words,
        unit=unit,
        value=float(values.mean()),
        standard_error=error,
        runs=n,
        count=n,
        count_of="runs",
    )


def _of_segments(
    case: str, words: str, unit: str, groups: Sequence[FloatArray], least_variance: float = 0.0
) -> Headline:
    """Mean over the segments of all runs; its error over runs counts a run by its segments (ratio estimator)."""
    filled = [group for group in groups if len(group)]
    values = np.concatenate(filled)
    n, total = len(filled), len(values)
    mean = float(values.mean())
    error = None
    if n > 1:
        parts = np.array([len(group) / total * (group.mean() - mean) for group in filled])
        over_runs = float(np.sqrt(n / (n - 1) * (parts**2).sum()))
        over_segments = float(np.sqrt(max(values.var(ddof=1), least_variance) / total))
        error = max(over_runs, over_segments)
    return Headline(
        case=case,
        quantity=words,
        unit=unit,
        value=mean,
        standard_error=error,
        runs=n,
        count=total,
        count_of="segments",
    )


def _shares(case: str, yielding: pd.DataFrame) -> list[Headline]:
    flags = {f"class {number}": yielding["buckling_class"] == number for number in (1, 2, 3, 4)}
    flags["a chain contact slides before the moment yields"] = yielding["slides_first"].astype(bool)
    rows = []
    for words, flag in flags.items():
        groups = [np.asarray(values, dtype=np.float64) for _, values in (100.0 * flag).groupby(yielding["run"])]
        p = (float(flag.sum()) + SMALLEST_SHARE) / (len(flag) + 2 * SMALLEST_SHARE)
        rows.append(_of_segments(case, f"{words}, share", "%", groups, least_variance=1e4 * p * (1 - p)))
    return rows


def _calibrated(case: str, calibration: Calibration) -> list[Headline]:
    rows = []
    for estimate in calibration.estimates:
        known = estimate.identified in (Identified.YES, Identified.MEASURED)
        rows.append(
            Headline(
                case=case,
                quantity=f"calibrated {estimate.name.replace('_', ' ')}",
                unit="kn",
                value=estimate.value if known or estimate.determined_by else None,
                standard_error=estimate.standard_error if calibration.n_runs > 1 else None,
                runs=calibration.n_runs,
                count=calibration.n_segments,
                count_of="segments",
                told="" if known else estimate.identified.value,
            )
        )
    return rows
