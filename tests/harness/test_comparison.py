"""Every comparator passes where it should and fails on both sides where it should."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from buckling_study import LATERAL, write_buckling_study

from forcechain.theory.parameters import TABLE_3
from forcechain.theory.three_particle import loading
from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.cli import main
from harness.commands.compare import summary
from harness.comparing import paper
from harness.comparing.comparison import calibrated_ratios, compare
from harness.comparing.verdicts import Row, Verdict, failed, judge, tolerance_for_a_mean, tolerance_for_one_print
from harness.errors import InputError


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Analysis:
    return analyse(write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", (1, 2, 3)), jobs=1)


def as_the_paper(analysis: Analysis, **facts: float) -> Analysis:
    """The same data, said to come from runs under the paper's conditions."""
    return replace(analysis, runs=analysis.runs.assign(**(dict(paper.CONDITIONS) | facts)))


def row_of(analysis: Analysis, quantity: str) -> Row:
    rows, _ = compare(analysis, {})
    (row,) = [row for row in rows if row.quantity == quantity]
    return row


def scaled(analysis: Analysis, column: str, factor: float, shift: float = 0.0) -> Analysis:
    """The same analysis with one measure changed, in the segments and in their averages."""
    return replace(
        analysis,
        segments=analysis.segments.assign(**{column: analysis.segments[column] * factor + shift}),
        averages=analysis.averages.assign(**{column: analysis.averages[column] * factor + shift}),
    )


def test_the_model_is_evaluated_at_the_angles_of_the_data(found: Analysis) -> None:
    _, curves = compare(as_the_paper(found), {})
    (model,) = curves.values()
    expected = loading(TABLE_3, np.radians(found.averages["buckling_angle_deg"].to_numpy()))
    assert model.at_data.axial_force == pytest.approx(expected.axial_force, rel=1e-9)
    assert model.shift == pytest.approx(expected.axial_displacement_over_R[0], rel=1e-9)


@pytest.mark.parametrize(
    ("quantity", "column", "shift_to_model"),
    [
        ("axial force, mean over the drop", "axial_force_N", False),
        ("normal displacement/R, mean over the drop", "normal_displacement_over_R", False),
        ("axial displacement/R, mean over the drop", "axial_displacement_over_R", True),
        ("lateral force, mean over the drop", "lateral_force_N", False),
    ],
)
def test_model_rows_pass_on_the_model_and_fail_on_both_sides(
    found: Analysis, quantity: str, column: str, shift_to_model: bool
) -> None:
    found = as_the_paper(found)
    row = row_of(found, quantity)
    assert row.model is not None
    assert row.data is not None
    if shift_to_model:
        exact = scaled(found, column, 1.0, row.model - row.data)
        assert row_of(exact, quantity).verdict is Verdict.PASS
        for side in (-1, 1):
            off = scaled(found, column, 1.0, row.model * (1 + 0.3 * side) - row.data)
            assert row_of(off, quantity).verdict is Verdict.FAIL
    else:
        for factor, verdict in ((1.0, Verdict.PASS), (0.7, Verdict.FAIL), (1.3, Verdict.FAIL)):
            changed = scaled(found, column, factor * row.model / row.data)
            assert row_of(changed, quantity).verdict is verdict


def test_normalised_rms_vanishes_on_the_model(found: Analysis) -> None:
    found = as_the_paper(found)
    _, curves = compare(found, {})
    (model,) = curves.values()
    exact = replace(found, averages=found.averages.assign(axial_force_N=model.at_data.axial_force))
    assert row_of(exact, "axial force, mean over the drop").normalised_rms == pytest.approx(0, abs=1e-12)
    assert row_of(found, "axial force, mean over the drop").normalised_rms > 0.01  # type: ignore[operator]


PAPER_ROWS = [reference for reference in paper.PRINTED if not reference.upper_bound]


@pytest.mark.parametrize("reference", PAPER_ROWS, ids=lambda reference: reference.quantity)
def test_paper_rows_pass_on_the_print_and_fail_on_both_sides(found: Analysis, reference: paper.Reference) -> None:
    def with_value(value: float) -> Analysis:
        analysis = as_the_paper(found)
        if reference.quantity in analysis.runs.columns:
            return replace(analysis, runs=analysis.runs.assign(**{reference.quantity: value}))
        segments = analysis.segments.copy()
        if reference.quantity == "initial_buckling_angle_deg":
            segments["buckling_angle_deg"] = value
        elif reference.quantity == "buckling_angle_growth_deg":
            segments["buckling_angle_deg"] = 14.0 + value * segments["increment"] / segments["increment"].max()
        else:
            segments[reference.quantity] = value
        return replace(analysis, segments=segments)

    exact = row_of(with_value(reference.value), reference.words)
    assert exact.verdict is Verdict.PASS
    assert exact.tolerance == pytest.approx(reference.floor)
    for side in (-1, 1):
        assert (
            row_of(with_value(reference.value + side * 0.9 * reference.floor), reference.words).verdict is Verdict.PASS
        )
        assert (
            row_of(with_value(reference.value + side * 1.1 * reference.floor), reference.words).verdict is Verdict.FAIL
        )


def test_the_share_that_slides_has_an_upper_bound_alone(found: Analysis) -> None:
    words = next(reference.words for reference in paper.PRINTED if reference.upper_bound)
    none = replace(as_the_paper(found), yielding=found.yielding.assign(slides_first=False))
    every = replace(as_the_paper(found), yielding=found.yielding.assign(slides_first=True))
    assert row_of(none, words).verdict is Verdict.PASS
    assert row_of(every, words).verdict is Verdict.FAIL


def test_the_spread_of_packings_widens_the_tolerance(found: Analysis) -> None:
    spread = as_the_paper(found)
    spread = replace(spread, runs=spread.runs.assign(peak_stress_ratio=[0.56, 0.76, 0.96]))
    row = row_of(spread, "peak stress ratio")
    assert row.tolerance == pytest.approx(2 * 0.2 * np.sqrt(4 / 3))
    assert row.tolerance_source == "spread of 3 packings"
    assert row.standard_error == pytest.approx(0.2 / np.sqrt(3))


def test_lateral_force_that_changes_fails_on_both_sides(found: Analysis) -> None:
    quantity = "lateral force, change over the drop"
    assert row_of(found, quantity).verdict is Verdict.PASS
    share = found.segments["increment"] / found.segments["increment"].max()
    for change in (-0.5, 0.5):
        segments = found.segments.assign(lateral_force_N=LATERAL * (1 + change * share))
        assert row_of(replace(found, segments=segments), quantity).verdict is Verdict.FAIL


def test_rotation_that_does_not_grow_fails(found: Analysis) -> None:
    quantity = "rotation at the end of the drop, above 0"
    assert row_of(found, quantity).verdict is Verdict.PASS
    assert row_of(replace(found, segments=found.segments.assign(rotation_deg=0.0)), quantity).verdict is Verdict.FAIL
    noise = np.random.default_rng(1).normal(0, 1, len(found.segments))
    assert row_of(replace(found, segments=found.segments.assign(rotation_deg=noise)), quantity).verdict is Verdict.FAIL


def test_other_conditions_are_not_judged_and_named(found: Analysis) -> None:
    row = row_of(as_the_paper(found, rolling_friction=0.05), "peak stress ratio")
    assert row.verdict is Verdict.NOT_JUDGED
    assert "rolling_friction 0.05, the paper 0.2" in row.note


def test_without_segments_the_rows_on_segments_are_not_judged(found: Analysis) -> None:
    empty = replace(
        as_the_paper(found), segments=found.segments[:0], averages=found.averages[:0], yielding=found.yielding[:0]
    )
    rows, curves = compare(empty, {})
    assert not curves
    by_quantity = {row.quantity: row for row in rows}
    assert by_quantity["initial buckling angle, mean"].verdict is Verdict.NOT_JUDGED
    assert by_quantity["initial buckling angle, mean"].note == "no buckled segments"
    assert by_quantity["solid fraction, prepared"].verdict is Verdict.PASS


@pytest.mark.parametrize("found_value", [float("nan"), float("inf"), -float("inf")])
def test_a_number_that_is_none_never_passes(found_value: float) -> None:
    assert judge(found_value, 1.0, 10.0) is Verdict.FAIL
    assert judge(found_value, 1.0, 10.0, upper_bound=True) is Verdict.FAIL


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(
    ("distance", "verdict"),
    [(0.89, Verdict.PASS), (0.91, Verdict.UNDECIDED), (1.09, Verdict.UNDECIDED), (1.11, Verdict.FAIL)],
)
def test_within_a_standard_error_of_the_tolerance_it_is_undecided(side: int, distance: float, verdict: Verdict) -> None:
    assert judge(5 + side * distance, 5.0, 1.0, 0.1) is verdict
    assert judge(5 + distance, 5.0, 1.0, 0.1, upper_bound=True) is verdict
    assert judge(5 - distance, 5.0, 1.0, 0.1, upper_bound=True) is Verdict.PASS
    # What is known exactly, or to no error at all, is decided
    assert judge(5 + side * distance, 5.0, 1.0, 0.0) is (Verdict.PASS if distance <= 1 else Verdict.FAIL)
    assert judge(5 + side * distance, 5.0, 1.0) is (Verdict.PASS if distance <= 1 else Verdict.FAIL)


def test_every_row_knows_how_near_its_tolerance_it_is(found: Analysis) -> None:
    """Spread each measure so that its own standard error reaches over its tolerance; the rows then say so."""
    spread = as_the_paper(found)
    spread = replace(spread, runs=spread.runs.assign(peak_stress_ratio=[0.8, 0.9, 1.0]))  # tolerance 0.23, error 0.058
    assert row_of(spread, "peak stress ratio").verdict is Verdict.UNDECIDED
    by_run = spread.segments["run"].map(dict(zip(spread.runs["run"], (0.0, 1.0, 2.0), strict=True)))
    model = row_of(spread, "axial force, mean over the drop").model
    assert model is not None
    for factor, verdict in ((1.1, Verdict.PASS), (1.6, Verdict.UNDECIDED), (3.5, Verdict.FAIL)):
        force = model * (factor + 0.4 * (by_run - 1))
        apart = replace(
            spread,
            segments=spread.segments.assign(axial_force_N=force),
            averages=spread.averages.assign(axial_force_N=model * factor),
        )
        assert row_of(apart, "axial force, mean over the drop").verdict is verdict
    for turn, verdict in ((0.0, Verdict.FAIL), (1.5, Verdict.UNDECIDED), (9.0, Verdict.PASS)):
        turned = replace(spread, segments=spread.segments.assign(rotation_deg=by_run - 1 + turn))
        assert row_of(turned, "rotation at the end of the drop, above 0").verdict is verdict
    share = spread.segments["increment"] / spread.segments["increment"].max()
    for change, verdict in ((0.0, Verdict.PASS), (1.5, Verdict.UNDECIDED), (9.0, Verdict.FAIL)):
        moved = spread.segments.assign(lateral_force_N=0.1 + share * (change + by_run - 1))
        assert row_of(replace(spread, segments=moved), "lateral force, change over the drop").verdict is verdict


def test_undecided_is_counted_and_no_failure(found: Analysis) -> None:
    row = replace(row_of(found, "lateral force, change over the drop"), verdict=Verdict.UNDECIDED)
    assert failed([row]) == 0
    assert "1 rows: 0 pass, 0 FAIL, 1 undecided, 0 not judged; undecided: within a standard error" in summary([row])


def test_a_reference_that_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="finite reference"):
        judge(1.0, float("nan"), 1.0)
    with pytest.raises(ValueError, match="finite reference"):
        judge(1.0, 1.0, -0.1)


def test_tolerances_never_fall_below_their_floor() -> None:
    assert tolerance_for_one_print(0.5, 0.01, 5) == (0.5, "floor")
    assert tolerance_for_a_mean(0.5, 0.1) == (0.5, "floor")
    assert tolerance_for_a_mean(0.1, 0.5) == (1.0, "2 s.e.")


def test_calibrated_parameters_of_a_study_reach_the_model(found: Analysis) -> None:
    ratios = calibrated_ratios({"lateral_strength": 0.04}, "study.toml")
    _, curves = compare(as_the_paper(found), ratios)
    (model,) = curves.values()
    assert float(np.asarray(model.parameters.lateral_strength)) == pytest.approx(0.04 * 1.05e5)
    with pytest.raises(InputError, match="did you mean 'lateral_strength'"):
        calibrated_ratios({"lateral_strenght": 0.04}, "study.toml")
    with pytest.raises(InputError, match="at least 0"):
        calibrated_ratios({"lateral_strength": -1}, "study.toml")


def test_compare_exits_with_1_when_a_verdict_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1, 2))
    assert main(["compare", str(directory), "--json"]) == 1  # the lateral force of this study is half the model's
    document = json.loads(capsys.readouterr().out)
    verdicts = {row["quantity"]: row["verdict"] for row in document["rows"]}
    assert verdicts["lateral force, mean over the drop"] == "FAIL"
    assert verdicts["lateral force, change over the drop"] == "pass"
    assert main(["compare", str(directory)]) == 1
    table = capsys.readouterr().out
    assert "FAIL" in table
    assert "verdict" in table
