"""The regression gate: passes on what was approved and on new seeds, fails on what differs, and names it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from buckling_study import write_buckling_run, write_buckling_study

from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.cli import main
from harness.errors import InputError
from harness.gate.baseline import Baseline, approve, read_baseline, tolerance_for
from harness.gate.headlines import Headline, headlines
from harness.gate.junit import write_junit
from harness.gate.measured import Measured, measure
from harness.gate.regression import CONSISTENT, Check, Line, Outcome, check
from harness.reading.consistency import run_consistency
from harness.reading.exports import read_run
from yade_scripts import export_format

SEEDS = (1, 2, 3, 4)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", SEEDS)


@pytest.fixture(scope="module")
def found(study: Path) -> Analysis:
    return analyse(study, jobs=1)


@pytest.fixture(scope="module")
def measured(found: Analysis) -> Measured:
    return measure(found, {})


def baseline_of(measured: Measured) -> Baseline:
    return Baseline(measured=measured, history=())


def line_of(result: Check, quantity: str) -> Line:
    (line,) = [line for line in result.lines if line.quantity == quantity]
    return line


def with_case(measured: Measured, **changes: Any) -> Measured:
    (case,) = measured.cases
    return replace(measured, cases=(replace(case, **changes),))


def fresh(measured: Measured, **changes: Any) -> Measured:
    """The same study said to have been made of other seeds: other tables."""
    return with_case(measured, **({"seeds": (5, 6, 7, 8), "tables": {"seed5": "0"}} | changes))


def scaled(measured: Measured, quantity: str, factor: float) -> Measured:
    (case,) = measured.cases
    numbers = [
        replace(one, value=one.value * factor) if one.quantity == quantity and one.value is not None else one
        for one in case.headlines
    ]
    return with_case(measured, headlines=tuple(numbers))


def noisy(analysis: Analysis, rng: np.random.Generator, shift: float = 0.0) -> Analysis:
    """The study as other seeds could have given it: runs differ by a tenth, segments by a third, classes by chance."""
    segments = analysis.segments.copy()
    runs = list(analysis.runs["run"])
    by_segment = pd.MultiIndex.from_frame(segments[["run", "drop", "segment"]])
    for name, level in (
        ("buckling_angle_deg", 14.0),
        ("axial_force_N", 10.0),
        ("normal_displacement_over_R", 0.08),
        ("axial_displacement_over_R", 0.05),
        ("rotation_deg", 8.0),
        ("lateral_force_N", 2.0),
    ):
        of_run = pd.Series(rng.normal(0, 0.1, len(runs)), runs)
        each = pd.Series(rng.normal(0, 0.3, len(by_segment.unique())), by_segment.unique())
        segments[name] = level * (1 + shift + of_run.loc[segments["run"]].to_numpy() + each.loc[by_segment].to_numpy())
        segments[name] *= 1 + 0.1 * segments["increment"] / segments["increment"].max()
    facts = analysis.runs.copy()
    for name, level in (("solid_fraction", 0.85), ("coordination", 4.1), ("peak_stress_ratio", 0.7)):
        facts[name] = level * (1 + rng.normal(0, 0.02, len(facts)))
    facts["drops"] = rng.integers(1, 4, len(facts))
    yielding = analysis.yielding.copy()
    yielding["buckling_class"] = rng.choice([1, 2, 3, 4], len(yielding), p=[0.03, 0.15, 0.6, 0.22])
    yielding["slides_first"] = rng.random(len(yielding)) < 0.05
    return replace(analysis, segments=segments, runs=facts, yielding=yielding)


def drawn(measured: Measured, analysis: Analysis, rng: np.random.Generator, shift: float = 0.0) -> Measured:
    return fresh(measured, headlines=tuple(headlines(noisy(analysis, rng, shift), {})))


def test_a_study_passes_against_itself_and_the_file_reads_back(measured: Measured, tmp_path: Path) -> None:
    path = tmp_path / "baselines" / "zigzag.toml"
    approve(measured, path, "made by hand")
    again = read_baseline(path)
    assert again.measured == measured
    result = check(again, measured)
    assert result.passed
    assert result.differs == ()
    assert {line.outcome for line in result.lines} == {Outcome.PASS}
    quantities = [line.quantity for line in result.lines]
    for words in ("peak stress ratio", "class 3, share", "calibrated lateral strength", "number of drops"):
        assert words in quantities


def test_same_tables_must_repeat_every_number(measured: Measured) -> None:
    (case,) = measured.cases
    for one in case.headlines:
        if one.judged and one.value:
            for factor in (0.95, 1.05):
                result = check(baseline_of(measured), scaled(measured, one.quantity, factor))
                assert [line.quantity for line in result.lines if line.outcome is Outcome.DRIFTED] == [one.quantity]
                assert not result.passed


def test_other_seeds_pass_within_the_spread_and_drift_beyond_it(measured: Measured) -> None:
    quantity = "initial buckling angle, mean"
    result = check(baseline_of(measured), fresh(measured))
    assert result.passed
    limit = line_of(result, quantity).tolerance
    value = line_of(result, quantity).baseline
    assert limit is not None
    assert value is not None
    for side in (-1, 1):
        near = check(baseline_of(measured), scaled(fresh(measured), quantity, 1 + side * 0.99 * limit / value))
        far = check(baseline_of(measured), scaled(fresh(measured), quantity, 1 + side * 1.01 * limit / value))
        assert line_of(near, quantity).outcome is Outcome.PASS
        line = line_of(far, quantity)
        assert line.outcome is Outcome.DRIFTED
        assert line.drift == pytest.approx(1.01)
        assert "1 times the tolerance" in line.why
        assert "standard errors" in line.why
        assert "seeds 1 to 4 -> 5 to 8" in line.why


def test_at_most_one_of_twenty_studies_of_new_seeds_fails(measured: Measured, found: Analysis) -> None:
    rng = np.random.default_rng(11)
    reference = baseline_of(with_case(drawn(measured, found, rng), tables={}))
    results = [check(reference, drawn(measured, found, rng)) for _ in range(20)]
    assert sum(not result.passed for result in results) <= 1
    assert {line.outcome for result in results for line in result.lines} <= {Outcome.PASS, Outcome.DRIFTED}
    # and the same gate sees a change of all forces and angles by the spread of ten runs
    shifted = [check(reference, drawn(measured, found, rng, shift=1.0)) for _ in range(5)]
    assert not any(result.passed for result in shifted)


@pytest.mark.parametrize(
    ("name", "before", "now"),
    [("friction", 0.7, 0.56), ("rolling_friction", 0.2, 0.0), ("normal_stiffness", 1.05e5, 1.155e5)],
)
def test_another_parameter_is_named_and_nothing_passes_for_it(
    measured: Measured, name: str, before: float, now: float
) -> None:
    (case,) = measured.cases
    assert case.parameters[name] == before
    words = f"{name} {before:g} -> {now:g}"
    by_parameter = fresh(measured, parameters={**case.parameters, name: now})
    by_tables = fresh(measured, contacts={**case.contacts, name: (now,)})  # told by the tables alone
    one_run = fresh(measured, contacts={**case.contacts, name: (before, now)})
    for other, line, told in (
        (by_parameter, "parameters", words),
        (by_tables, "contacts of the tables", words),
        (one_run, "contacts of the tables", f"{name} {before:g} -> {before:g}, {now:g}"),
    ):
        result = check(baseline_of(measured), other)
        assert not result.passed
        assert line_of(result, line).outcome is Outcome.NOT_COMPARABLE
        assert told in line_of(result, line).why
        assert told in result.differs
        assert line_of(result, "peak stress ratio").outcome is Outcome.NOT_COMPARABLE
        assert told in line_of(result, "peak stress ratio").why


def test_another_option_of_the_analysis_is_named(measured: Measured) -> None:
    other = replace(measured, options={**measured.options, "minimum_angle_growth_deg": 2.0})
    result = check(baseline_of(measured), other)
    assert not result.passed
    line = line_of(result, "options of the analysis")
    assert line.outcome is Outcome.NOT_COMPARABLE
    assert "minimum_angle_growth_deg 1 -> 2" in line.why
    assert "minimum_angle_growth_deg 1 -> 2" in line_of(result, "lateral force, mean over the drop").why


@pytest.mark.parametrize("what", ["yade", "script", "package"])
def test_a_drift_is_put_down_to_the_version_that_differs(measured: Measured, what: str) -> None:
    # the same seeds: what differs is the version alone, and the tables that it gave
    other = replace(with_case(measured, tables={"seed1": "0"}), versions={**measured.versions, what: ("2025.1",)})
    assert check(baseline_of(measured), other).passed  # another YADE is welcome as long as the numbers stand
    line = line_of(
        check(baseline_of(measured), scaled(other, "solid fraction, prepared", 1.2)), "solid fraction, prepared"
    )
    assert line.outcome is Outcome.DRIFTED
    cause = line.why.partition("differs: ")[2]
    assert cause.startswith(f"{what} ")
    assert "-> 2025.1" in cause
    assert not any(f"{name} " in cause for name in {"yade", "script", "package", "seeds"} - {what})


def test_a_drift_is_put_down_to_the_seeds_or_to_nothing_that_is_recorded(measured: Measured) -> None:
    def cause(other: Measured) -> str:
        quantity = "solid fraction, prepared"
        return line_of(check(baseline_of(measured), scaled(other, quantity, 1.2)), quantity).why.partition("differs: ")[
            2
        ]

    assert cause(fresh(measured)) == "seeds 1 to 4 -> 5 to 8"
    assert cause(measured).startswith("nothing that is recorded")
    assert cause(with_case(measured, tables={"seed1": "0"})).endswith("tables, of the same seeds")


def test_too_little_to_compare_is_no_pass(measured: Measured) -> None:
    (case,) = measured.cases
    few = tuple(replace(one, count=4) if one.count_of == "segments" else one for one in case.headlines)
    result = check(baseline_of(measured), fresh(measured, headlines=few))
    line = line_of(result, "axial force, mean over the drop")
    assert line.outcome is Outcome.NOT_COMPARABLE
    assert "too few segments: 4" in line.why
    alone = tuple(replace(one, runs=1, standard_error=None) for one in case.headlines)
    result = check(baseline_of(with_case(measured, headlines=alone)), fresh(measured, headlines=alone))
    assert not result.passed
    assert "too few seeds: 1 in the baseline, 1 here" in line_of(result, "peak stress ratio").why
    assert line_of(check(baseline_of(measured), fresh(measured, headlines=alone)), "peak stress ratio").outcome is (
        Outcome.PASS
    )  # one seed against four: the spread is known from the four
    assert not check(baseline_of(measured), fresh(measured, headlines=())).passed
    assert not check(baseline_of(measured), replace(measured, cases=())).passed


def test_a_number_that_comes_or_goes_is_no_pass(measured: Measured) -> None:
    (case,) = measured.cases
    fewer = fresh(measured, headlines=case.headlines[1:])
    gone = check(baseline_of(measured), fewer)
    assert line_of(gone, case.headlines[0].quantity).why == "not in the study"
    come = check(baseline_of(fewer), fresh(measured))
    assert "approve it anew" in line_of(come, case.headlines[0].quantity).why
    assert not gone.passed
    assert not come.passed


def test_cases_are_paired_by_name_and_a_missing_one_is_told(measured: Measured) -> None:
    (case,) = measured.cases
    two = replace(measured, cases=(case, replace(case, name="other")))
    result = check(baseline_of(two), measured)
    assert not result.passed
    assert "only in the baseline" in line_of(result, "case").why


def test_a_parameter_that_was_never_identified_is_shown_and_not_judged(measured: Measured) -> None:
    (case,) = measured.cases
    one = Headline(
        case=case.name,
        quantity="calibrated lateral stiffness",
        unit="kn",
        value=0.05,
        standard_error=0.001,
        runs=4,
        count=48,
        count_of="segments",
        told="bounded below",
    )

    def against(before: Headline, now: Headline) -> Line:
        reference = baseline_of(with_case(measured, headlines=(case.headlines[0], before)))
        result = check(reference, fresh(measured, headlines=(case.headlines[0], now)))
        return line_of(result, one.quantity)

    unjudged = against(one, replace(one, value=0.09))
    assert unjudged.outcome is Outcome.PASS
    assert unjudged.why == "not judged: bounded below when it was approved"
    known = replace(one, told="")
    assert against(known, replace(one, told="at bound")).outcome is Outcome.PASS  # the value is what counts
    assert against(known, replace(one, told="at bound", value=0.09)).outcome is Outcome.DRIFTED
    assert against(known, replace(one, told="not identified", value=None)).outcome is Outcome.NOT_COMPARABLE


def test_tolerance_has_a_floor_and_grows_as_seeds_get_fewer() -> None:
    def one(runs: int, error: float | None, unit: str = "N", count: int = 20) -> Headline:
        return Headline(
            case="",
            quantity="",
            unit=unit,
            value=10.0,
            standard_error=error,
            runs=runs,
            count=count,
            count_of="segments",
        )

    exact = tolerance_for(one(4, 0.0), one(4, 0.0), 20)
    assert exact is not None
    assert (exact.value, exact.source) == (0.1, "floor")
    share = tolerance_for(one(4, 0.0, "%", 100), one(4, 0.0, "%", 30), 20)
    assert share is not None
    assert (share.value, share.source) == (10.0, "3 segments")
    each = [one(n, 1.0 / np.sqrt(n)) for n in (2, 4, 8)]
    values = [tolerance.value for tolerance in (tolerance_for(a, a, 20) for a in each) if tolerance is not None]
    assert len(values) == 3
    assert values == sorted(values, reverse=True)
    assert tolerance_for(one(1, None), one(1, None), 20) is None


def test_approval_asks_for_a_reason_and_keeps_its_history(measured: Measured, tmp_path: Path) -> None:
    path = tmp_path / "zigzag.toml"
    with pytest.raises(InputError, match="expected a reason"):
        approve(measured, path, "  ")
    assert not path.exists()
    approve(measured, path, "first")
    approve(scaled(measured, "peak stress ratio", 1.1), path, 'second, with "quotes"')
    history = read_baseline(path).history
    assert [entry["reason"] for entry in history] == ["first", 'second, with "quotes"']
    assert len(history[1]["moved"]) == 1
    assert "peak stress ratio" in history[1]["moved"][0]
    with pytest.raises(InputError, match="sha256"):
        approve(replace(measured, broken={"seed1": "history.csv: sha256 differs"}), path, "third")
    (case,) = measured.cases
    alone = tuple(replace(one, runs=1, standard_error=None) for one in case.headlines)
    with pytest.raises(InputError, match="at least 2 seeds"):
        approve(with_case(measured, headlines=alone), path, "third")
    assert len(read_baseline(path).history) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [("format = 2", "format 1"), ("no toml", "not TOML"), ("format = 1\nstudy = 'x'", "not a whole baseline")],
)
def test_a_broken_baseline_is_one_line(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    path = tmp_path / "broken.toml"
    path.write_text(text)
    assert main(["check", str(study), "--baseline", str(path)]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert main(["check", str(study), "--baseline", str(tmp_path / "none.toml")]) == 2
    assert "forcechain approve" in capsys.readouterr().err


def test_the_commands_approve_check_and_fail_on_changed_tables(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = Path(shutil.copytree(study, tmp_path / "zigzag"))
    baseline, junit = tmp_path / "zigzag.toml", tmp_path / "check.xml"
    gate = ["check", str(directory), "--baseline", str(baseline)]
    assert main(["approve", str(directory), "--baseline", str(baseline), "--reason", " "]) == 2
    assert main(["approve", str(directory), "--baseline", str(baseline), "--reason", "by hand"]) == 0
    assert "from 4 seeds: one new seed drifts where it lies" in capsys.readouterr().out
    assert main([*gate, "--junit", str(junit)]) == 0
    assert "0 DRIFTED, 0 NOT COMPARABLE" in capsys.readouterr().out
    suite = ElementTree.fromstring(junit.read_bytes()).find("testsuite")
    assert suite is not None
    assert suite.get("failures") == "0"
    assert int(suite.get("tests", "0")) == len(suite.findall("testcase")) > 25

    # a table of the analysis perturbed by 5 %
    table = directory / "analysis" / "segments.csv"
    whole = table.read_bytes()
    segments = pd.read_csv(table)
    segments.assign(axial_force_N=1.05 * segments["axial_force_N"]).to_csv(table, index=False)
    assert main([*gate, "--json", "--junit", str(junit)]) == 1
    document = json.loads(capsys.readouterr().out)
    drifted = [line["quantity"] for line in document["lines"] if line["outcome"] == "DRIFTED"]
    assert "axial force, mean over the drop" in drifted
    assert "peak stress ratio" not in drifted
    failed = ElementTree.fromstring(junit.read_bytes()).findall(".//failure")
    assert [case.get("type") for case in failed].count("DRIFTED") == len(drifted)
    table.write_bytes(whole)

    # one byte of an export, its size kept
    export = directory / "runs" / "seed2" / export_format.SNAPSHOTS / f"{export_format.snapshot_name(7)}.npz"
    content = bytearray(export.read_bytes())
    content[len(content) // 2] ^= 1
    export.write_bytes(content)
    assert main(gate) == 1
    told = capsys.readouterr().out
    assert "seed2" in told
    assert "000007.npz" in told


def test_another_parameter_in_the_manifests_fails_the_command(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    baseline = tmp_path / "zigzag.toml"
    assert main(["approve", str(study), "--baseline", str(baseline), "--reason", "by hand"]) == 0
    other = Path(shutil.copytree(study, tmp_path / "other"))
    for path in other.glob("runs/*/run.json"):
        manifest = json.loads(path.read_text())
        manifest["parameters"]["friction"]["value"] = 0.56
        path.write_text(json.dumps(manifest))
    capsys.readouterr()
    assert main(["check", str(other), "--baseline", str(baseline)]) == 1
    assert "friction 0.7 -> 0.56" in capsys.readouterr().out


def test_a_run_left_out_outranks_the_lines_and_bars_approval(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1, 2))
    baseline = tmp_path / "zigzag.toml"
    assert main(["approve", str(directory), "--baseline", str(baseline), "--reason", "by hand"]) == 0
    write_buckling_run(directory / "runs" / "seed3", 3, status="failed", failure="it broke")
    assert main(["check", str(directory), "--baseline", str(baseline)]) == 3
    assert main(["approve", str(directory), "--baseline", str(baseline), "--reason", "again"]) == 3
    assert "it broke" in capsys.readouterr().err
    assert len(read_baseline(baseline).history) == 1


@pytest.mark.parametrize("column", ["fn", "kn", "overlap", "ft", "moment", "friction", "rolling_limit"])
def test_one_column_changed_by_5_percent_contradicts_the_others(
    run_folder: Path, rewrite: Callable[..., None], column: str
) -> None:
    from run_folders import snapshot_arrays

    arrays = snapshot_arrays(0.001, 10)
    loaded = {
        "contact_ft": arrays["contact_friction"] * arrays["contact_fn"],
        "contact_moment": arrays["contact_rolling_limit"] * arrays["contact_fn"],
    }
    rewrite(run_folder, **loaded)
    consistent = run_consistency(read_run(run_folder))
    assert max(consistent.values()) < 1e-9
    key, factor = f"contact_{column}", 0.95 if column in ("fn", "friction", "rolling_limit") else 1.05
    rewrite(run_folder, **(loaded | {key: factor * (loaded | arrays if key not in loaded else loaded)[key]}))
    assert max(run_consistency(read_run(run_folder)).values()) > 20 * CONSISTENT


def test_positions_that_do_not_fit_the_overlaps_are_seen(run_folder: Path, rewrite: Callable[..., None]) -> None:
    from run_folders import snapshot_arrays

    arrays = snapshot_arrays(0.001, 10)
    rewrite(run_folder, particle_x=1.05 * arrays["particle_x"], contact_x=1.05 * arrays["contact_x"])
    assert run_consistency(read_run(run_folder))["geometry"] > 20 * CONSISTENT


def test_tables_that_contradict_themselves_fail_the_gate(measured: Measured) -> None:
    (case,) = measured.cases
    worse = fresh(measured, consistency={**case.consistency, "normal_law": case.consistency["normal_law"] + 0.05})
    result = check(baseline_of(measured), worse)
    assert not result.passed
    assert "contradict" in line_of(result, "tables agree: normal law").why


def test_junit_stays_well_formed_whatever_the_words(tmp_path: Path) -> None:
    line = Line(case='a & b <"c">', quantity="odd \x00\x1b words", outcome=Outcome.DRIFTED, why="5 < 6 & more \x07")
    path = write_junit(tmp_path / "deep" / "check.xml", "study", [line])
    (failure,) = ElementTree.fromstring(path.read_bytes()).findall(".//failure")
    assert failure.get("message") == "5 < 6 & more ?"
    assert "odd ?? words" in str(failure.text)


def test_the_approved_demo_is_whole_and_can_judge() -> None:
    baseline = read_baseline(Path(__file__).parents[2] / "baselines" / "demo.toml")
    (case,) = baseline.measured.cases
    assert len(case.seeds) >= 4
    judged = [one for one in case.headlines if one.judged]
    assert len(judged) > 15
    assert all(tolerance_for(one, one, len(judged)) is not None for one in judged)
    assert all(entry["reason"] for entry in baseline.history)
    assert check(baseline, baseline.measured).passed
    assert max(case.consistency.values()) < 1e-9
