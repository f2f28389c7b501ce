"""Calibration of a study: every case and both columns, from its analysis to `analysis/parameters.toml`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

import forcechain
from forcechain.arrays import FloatArray
from forcechain.calibration import CONFIDENCE, Calibration, Column, Estimate, Interval, SegmentHistories, calibrate
from harness.analysing.averages import histories
from harness.analysing.buckling_data import Analysis
from harness.comparing.comparison import model_parameters
from harness.errors import InputError
from harness.progress import watched
from harness.toml_text import dumps
from yade_scripts.run_folder import write

PARAMETERS = "parameters.toml"
FEWEST_SEGMENTS = 5  # a mean over fewer has no standard error worth weighing by
COLUMNS = {  # of segments.csv, and whether it is in degrees
    "buckling_angle": ("buckling_angle_deg", True),
    "axial_force": ("axial_force_N", False),
    "normal_displacement_over_R": ("normal_displacement_over_R", False),
    "axial_displacement_over_R": ("axial_displacement_over_R", False),
    "rotation": ("rotation_deg", True),
    "lateral_force": ("lateral_force_N", False),
}
METHOD = (
    "weighted least squares of axial force, normal and axial displacement and rotation at the mean buckling angles; "
    "lateral_strength measured as mean lateral force over R; bound (30) with overlaps of 0.1 R; stiffnesses and "
    "strength over the normal stiffness"
)
INTERVALS = (
    f"{CONFIDENCE:.0%}; the wider of that over segments (bootstrap) and that over runs (leave one out, Student's t)"
)


def segment_histories(segments: pd.DataFrame) -> list[SegmentHistories]:
    """Return the buckled segments of one case, one set a run, in SI units and radians."""
    by_measure: dict[str, list[FloatArray]] = {}
    for name, (column, degrees) in COLUMNS.items():
        groups = histories(segments, column)
        by_measure[name] = [np.radians(group) for group in groups] if degrees else groups
    n_runs = len(by_measure["buckling_angle"])
    return [SegmentHistories(**{name: groups[i] for name, groups in by_measure.items()}) for i in range(n_runs)]


def calibrate_study(
    analysis: Analysis,
    reference: Mapping[str, float],
    *,
    columns: tuple[Column, ...] = tuple(Column),
    samples: int = 400,
    profile_points: int = 41,
) -> tuple[dict[str, dict[Column, Calibration]], dict[str, str]]:
    """Calibrate every case of a study; return the calibrations, and case -> why for those that have none.

    `reference` has the ratios the fit is compared with, where the study gives them; else they are the paper's;
    `samples` and `profile_points` as in `calibrate`. Raises
    InputError for segments that cannot be used.
    """
    found: dict[str, dict[Column, Calibration]] = {}
    without = {}
    for case in watched(analysis.cases, "cases calibrated", len(analysis.cases)):
        segments = analysis.segments[analysis.segments["case"] == case]
        facts = analysis.runs[analysis.runs["case"] == case]
        count = int((segments["increment"] == 0).sum()) if len(segments) else 0
        if count < FEWEST_SEGMENTS:
            without[case] = f"too few buckled segments: {count}, expected at least {FEWEST_SEGMENTS}"
            continue
        given = model_parameters(facts, reference)
        try:
            runs = segment_histories(segments)
            found[case] = {
                column: calibrate(runs, given, column=column, samples=samples, profile_points=profile_points)
                for column in columns
            }
        except ValueError as error:
            raise InputError(f"case {case}: cannot be calibrated: {error}") from None
    return found, without


def write_parameters(
    analysis: Analysis,
    found: Mapping[str, Mapping[Column, Calibration]],
    without: Mapping[str, str],
    stretches: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> Path:
    """Write `parameters.toml` among the tables of the analysis, whole or not at all, and return its path.

    `stretches` are the plain values of longer columns by case, where they were fitted.
    """
    content = {
        "study": analysis.name,
        "method": METHOD,
        "intervals": INTERVALS,
        "provenance": {
            "package_version": forcechain.__version__,
            "runs": [str(run) for run in analysis.runs["run"]],
            "options": {name: entry["value"] for name, entry in analysis.options.items()},
        },
        "not_calibrated": dict(without) or None,
        "cases": [
            {"name": case}
            | {column.value: as_plain(found[case][column]) for column in found[case]}
            | {"stretches": stretches.get(case)}
            for case in found
        ],
    }
    write(analysis.folder, PARAMETERS, dumps(content).encode())
    return analysis.folder / PARAMETERS


def as_plain(calibration: Calibration) -> dict[str, Any]:
    """Return a calibration as plain values, for TOML and JSON; what is not a number is left out (None)."""
    return {
        "segments": calibration.n_segments,
        "runs": calibration.n_runs,
        "increments_left_out": calibration.left_out,
        "imperfection_deg": math.degrees(float(np.asarray(calibration.parameters.imperfection))),
        "sum_of_squares": calibration.sum_of_squares,
        "bound": calibration.bound,
        "correlation_of": [estimate.name for estimate in calibration.estimates],
        "correlation": [[_finite(value, 0.0) for value in row] for row in calibration.correlation.tolist()],
        "parameters": {estimate.name: _estimate(estimate) for estimate in calibration.estimates},
        "goodness_of_fit": {
            goodness.measure: {
                "normalised_rms_calibrated": _finite(goodness.calibrated),
                "interval_calibrated": _pair(goodness.calibrated_interval),
                "normalised_rms_reference": _finite(goodness.reference),
                "interval_reference": _pair(goodness.reference_interval),
                "sum_of_squares": goodness.sum_of_squares,
            }
            for goodness in calibration.goodness
        },
    }


def _estimate(estimate: Estimate) -> dict[str, Any]:
    return {
        "value": estimate.value,
        "unit": "normal_stiffness",
        "interval": _pair(estimate.interval),
        "interval_over_segments": _pair(estimate.by_segments),
        "interval_over_runs": None if estimate.by_runs is None else _pair(estimate.by_runs),
        "standard_error": estimate.standard_error,
        "identified": estimate.identified.value,
        "meaning": estimate.identified.meaning,
        "determined_by": dict(estimate.determined_by) or None,
        "profile_value": estimate.profile_value.tolist() or None,
        "profile_sum_of_squares": estimate.profile_sum.tolist() or None,
    }


def _pair(interval: Interval) -> list[float] | None:
    ends = list(asdict(interval).values())
    return ends if all(math.isfinite(end) for end in ends) else None


def _finite(value: float, otherwise: float | None = None) -> float | None:
    return value if math.isfinite(value) else otherwise
