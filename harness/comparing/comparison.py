"""The comparison: model against data, data against the paper, a row and a verdict each."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from forcechain.arrays import FloatArray
from forcechain.observe.averages import bootstrap_error
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import ChainState, Status
from forcechain.theory.three_particle import loading
from harness.analysing.averages import histories, mean_and_error
from harness.analysing.buckling_data import Analysis
from harness.comparing import paper
from harness.comparing.verdicts import Row, Verdict, decide, judge, tolerance_for_a_mean, tolerance_for_one_print
from harness.errors import InputError
from harness.reading.tested import BIAXIAL

MODEL_FLOOR = 0.25  # of the model's own value: the paper calls its agreement reasonable and prints no measure of it
CALIBRATED = ("chain_tangential_stiffness", "lateral_stiffness", "lateral_strength")


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCurves:
    """The model beside the averaged data of one case.

    Attributes:
        parameters: of the model: radius, kn, kr and mu_r of the simulation, the rest the paper's calibration.
        at_data: the model's state at the mean angle of each increment, (n_increments + 1,).
        shift: the model's D/R at the mean initial angle, where the averaged displacement starts.
    """

    parameters: ChainParameters
    at_data: ChainState
    shift: float


def model_parameters(facts: pd.DataFrame, calibrated: Mapping[str, float]) -> ChainParameters:
    """Parameters of the model for runs of one case: their own contacts, and `calibrated` ratios to kn.

    Raises InputError where the model does not admit them.
    """
    first = facts.iloc[0]
    try:
        return ChainParameters.from_ratios(
            radius=float(facts["mean_radius"].mean()),
            normal_stiffness=float(first["normal_stiffness"]),
            rolling_stiffness=float(first["rolling_stiffness_ratio"]),
            rolling_friction=float(first["rolling_friction"]),
            **calibrated,
        )
    except ValueError as error:
        raise InputError(f"case {first['case']}: the model does not admit its parameters: {error}") from None


def calibrated_ratios(given: Mapping[str, Any], where: str) -> dict[str, float]:
    """Check a study's table [compare]: the calibrated parameters of the model, as ratios to the normal stiffness."""
    for name, value in given.items():
        if name not in CALIBRATED:
            close = difflib.get_close_matches(name, CALIBRATED, 1)
            hint = f"did you mean {close[0]!r}?" if close else "known: " + ", ".join(CALIBRATED)
            raise InputError(f"{where}: [compare] unknown key {name!r}; {hint}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not value >= 0:
            raise InputError(f"{where}: [compare] {name}: expected a number of at least 0 (over kn), found {value!r}")
    return {name: float(value) for name, value in given.items()}


def model_at_data(averages: pd.DataFrame, parameters: ChainParameters) -> ModelCurves | None:
    """Return the model at the mean angles of one case's averages; None if they have none or leave its range."""
    angle = np.radians(averages["buckling_angle_deg"].to_numpy(dtype=np.float64))
    if len(angle) == 0 or not np.isfinite(angle).all():
        return None
    state = loading(parameters, angle)
    if (state.status > Status.BEYOND_FOLD).any():
        return None
    return ModelCurves(parameters=parameters, at_data=state, shift=float(state.axial_displacement_over_R[0]))


def compare(analysis: Analysis, calibrated: Mapping[str, float]) -> tuple[list[Row], dict[str, ModelCurves]]:
    """Return every row of the comparison, and the model's curves of each case that has buckled segments."""
    rows: list[Row] = []
    curves = {}
    for case in analysis.cases:
        facts = analysis.runs[analysis.runs["case"] == case]
        segments = analysis.segments[analysis.segments["case"] == case]
        averages = analysis.averages[analysis.averages["case"] == case]
        biaxial = analysis.test(case) == BIAXIAL
        if len(segments):
            model = model_at_data(averages, model_parameters(facts, calibrated))
            if model is not None:
                curves[case] = model
                of_model = _model_rows(case, segments, averages, model)
                rows += of_model if biaxial or calibrated else [_calibrated_elsewhere(row) for row in of_model]
            if biaxial:
                rows += [_constant_lateral_force(case, segments), _growing_rotation(case, segments)]
        rows += _paper_rows(case, facts, segments, analysis) if biaxial else [_nothing_printed(case)]
    return rows, curves


def _calibrated_elsewhere(row: Row) -> Row:
    """Leave a row of the model unjudged: what confines a chain, which the calibration holds, is another thing here."""
    note = "the model's parameters are calibrated on the biaxial test; calibrate here, and name them in [compare]"
    return replace(row, verdict=Verdict.NOT_JUDGED, note=note)


def _nothing_printed(case: str) -> Row:
    """Say why no row holds a test that is not biaxial against the paper."""
    return Row(
        case=case,
        quantity="the paper's numbers",
        unit="-",
        data=None,
        standard_error=None,
        count=0,
        count_of="runs",
        verdict=Verdict.NOT_JUDGED,
        note="printed for its biaxial test; of the punch the paper shows pictures alone, Fig. 1(d)-(f)",
    )


def _model_rows(case: str, segments: pd.DataFrame, averages: pd.DataFrame, model: ModelCurves) -> list[Row]:
    """Model against data: means over the window of force, displacements and lateral force."""
    state = model.at_data
    compared = (
        ("axial_force_N", "axial force, mean over the drop", "N", state.axial_force, 0.0),
        (
            "normal_displacement_over_R",
            "normal displacement/R, mean over the drop",
            "-",
            state.normal_displacement_over_R,
            0.0,
        ),
        (
            "axial_displacement_over_R",
            "axial displacement/R, mean over the drop",
            "-",
            state.axial_displacement_over_R,
            model.shift,
        ),
        ("lateral_force_N", "lateral force, mean over the drop", "N", state.lateral_force, 0.0),
    )
    rows = []
    for name, words, unit, curve, shift in compared:
        data = averages[name].to_numpy(dtype=np.float64) + shift
        means = [run.mean(axis=0, keepdims=True) for run in histories(segments, name)]
        error = float(bootstrap_error(means).larger[0])
        expected = float(curve.mean())
        tolerance, source = tolerance_for_a_mean(MODEL_FLOOR * abs(expected), _number(error))
        if source == "floor":
            source = f"{MODEL_FLOOR:.0%} of the model"
        found = float(data.mean())
        rows.append(
            Row(
                case=case,
                quantity=words,
                unit=unit,
                data=found,
                standard_error=_number(error),
                count=sum(run.shape[1] for run in means),
                count_of="segments",
                model=expected,
                tolerance=tolerance,
                tolerance_source=source,
                normalised_rms=float(np.sqrt(((data - curve) ** 2).mean()) / np.abs(curve).mean()),
                verdict=judge(found, expected, tolerance, _number(error)),
                note="model at the data's mean angles" + (", its own value at the first added" if shift else ""),
            )
        )
    return rows


def _constant_lateral_force(case: str, segments: pd.DataFrame) -> Row:
    """Hold the change of the lateral force over the drop against the paper's "essentially constant"."""
    groups = histories(segments, "lateral_force_N")
    changes = [(run[-1:] - run[:1]) for run in groups]
    change, error = mean_and_error(changes)
    level = float(np.concatenate([run.ravel() for run in groups]).mean())
    tolerance, source = tolerance_for_a_mean(MODEL_FLOOR * abs(level), _number(float(error.larger[0])))
    return Row(
        case=case,
        quantity="lateral force, change over the drop",
        unit="N",
        data=float(change[0]),
        standard_error=_number(float(error.larger[0])),
        count=sum(run.shape[1] for run in changes),
        count_of="segments",
        paper=0.0,
        tolerance=tolerance,
        tolerance_source=f"{MODEL_FLOOR:.0%} of the mean" if source == "floor" else source,
        verdict=judge(float(change[0]), 0.0, tolerance, _number(float(error.larger[0]))),
        note="printed as 'essentially constant'; the model's is constant once the support has yielded",
    )


def _growing_rotation(case: str, segments: pd.DataFrame) -> Row:
    """Judge that the rotation grows with the angle by more than its uncertainty, which is what the paper claims."""
    ends = [run[-1:] for run in histories(segments, "rotation_deg")]
    growth, error = mean_and_error(ends)
    standard_error = _number(float(error.larger[0]))
    found = float(growth[0])
    verdict = Verdict.NOT_JUDGED
    if standard_error is not None:  # no rotation at all is no growth, however well it is known
        verdict = decide(2 * standard_error - found, standard_error) if found > 0 else Verdict.FAIL
    return Row(
        case=case,
        quantity="rotation at the end of the drop, above 0",
        unit="deg",
        data=found,
        standard_error=standard_error,
        count=sum(run.shape[1] for run in ends),
        count_of="segments",
        tolerance=2 * standard_error if standard_error is not None else None,
        tolerance_source="" if standard_error is None else "2 s.e.",
        verdict=verdict,
        note="the paper claims growth alone: the model's rotation only begins when the moment yields",
    )


def _paper_rows(case: str, facts: pd.DataFrame, segments: pd.DataFrame, analysis: Analysis) -> list[Row]:
    """Hold the data against the printed numbers, where the runs are under the conditions these were printed for."""
    departures = paper.departures({str(name): value for name, value in facts.iloc[0].items()})
    rows = []
    for reference in paper.PRINTED:
        groups = _values_by_run(reference.quantity, facts, segments, analysis, case)
        values = np.concatenate(groups) if groups else np.zeros(0)
        found = float(values.mean()) if len(values) else None
        means = np.array([group.mean() for group in groups])
        spread = float(means.std(ddof=1)) if len(means) > 1 else None
        error = float(bootstrap_error([group[None, :] for group in groups]).larger[0]) if len(values) else np.nan
        if len(groups) == len(values) and spread is not None:  # one value a run: the exact standard error
            error = spread / np.sqrt(len(groups))
        standard_error = _number(error)
        if reference.upper_bound:
            tolerance, source = tolerance_for_a_mean(reference.floor, standard_error)
        else:
            tolerance, source = tolerance_for_one_print(reference.floor, spread, len(groups))
            if standard_error is not None and 2 * standard_error > tolerance:
                tolerance, source = 2 * standard_error, "2 s.e."
        verdict = judge(found, reference.value, tolerance, standard_error, upper_bound=reference.upper_bound)
        note = reference.floor_reason if source == "floor" else ""
        if departures:
            verdict, note = Verdict.NOT_JUDGED, "printed for other conditions: " + "; ".join(departures)
        elif found is None:
            note = "no buckled segments"
        rows.append(
            Row(
                case=case,
                quantity=reference.words,
                unit=reference.unit,
                data=found,
                standard_error=standard_error,
                count=len(values),
                count_of="runs" if reference.quantity in facts.columns else "segments",
                paper=reference.value,
                tolerance=tolerance,
                tolerance_source=source,
                verdict=verdict,
                note=note,
            )
        )
    return rows


def _values_by_run(
    quantity: str, facts: pd.DataFrame, segments: pd.DataFrame, analysis: Analysis, case: str
) -> list[FloatArray]:
    """Return the values behind a quantity, an array a run: one value a run, or one a buckled segment."""
    if quantity in facts.columns:
        known = pd.to_numeric(facts[quantity], errors="coerce").dropna()
        return [np.array([value]) for value in known]
    if not len(segments):
        return []
    if quantity == "initial_buckling_angle_deg":
        return [run[0] for run in histories(segments, "buckling_angle_deg")]
    if quantity == "buckling_angle_growth_deg":
        return [run[-1] - run[0] for run in histories(segments, "buckling_angle_deg")]
    if quantity == "lateral_force_N":
        return [run.mean(axis=0) for run in histories(segments, "lateral_force_N")]
    if quantity == "sliding_share_percent":
        of_case = analysis.yielding[analysis.yielding["case"] == case]
        flags = of_case["slides_first"].astype(float) * 100.0
        return [np.asarray(group, dtype=np.float64) for _, group in flags.groupby(of_case["run"])]
    raise KeyError(quantity)


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
