"""From run folders to buckling data, on a study whose every number is known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from buckling_study import (
    FORCE,
    GROWTH_DEG,
    LATERAL,
    LENGTH,
    N_COLUMNS,
    RADIUS,
    ROTATION_DEG,
    STIFFNESS,
    first_angle_deg,
    write_buckling_run,
    write_buckling_study,
)

from harness.analysing.analysis import analyse
from harness.analysing.averages import average, histories
from harness.analysing.buckling_data import Analysis
from harness.cli import main
from harness.errors import InputError, RunError

SEEDS = (1, 2, 3)
SEGMENTS = N_COLUMNS * (LENGTH - 2)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", SEEDS)


@pytest.fixture(scope="module")
def found(study: Path) -> Analysis:
    return analyse(study, jobs=1)


def test_every_segment_buckles_and_is_counted(found: Analysis) -> None:
    assert [record["buckled_segments"] for record in found.ledger] == [SEGMENTS] * len(SEEDS)
    assert [record["in_chains"] for record in found.ledger] == [N_COLUMNS * LENGTH] * len(SEEDS)
    assert len(found.drops) == len(SEEDS)
    assert len(found.chains) == N_COLUMNS * len(SEEDS)
    assert set(found.chains["length"]) == {LENGTH}
    assert len(found.members) == N_COLUMNS * LENGTH * len(SEEDS)


def test_averages_are_the_known_numbers(found: Analysis) -> None:
    averages = found.averages
    first, last = averages.iloc[0], averages.iloc[-1]
    angle = np.mean([first_angle_deg(seed) for seed in SEEDS])
    assert first["buckling_angle_deg"] == pytest.approx(angle, abs=1e-9)
    assert last["buckling_angle_deg"] == pytest.approx(angle + GROWTH_DEG, abs=1e-9)
    assert first["normal_displacement_over_R"] == pytest.approx(FORCE[0] / STIFFNESS / RADIUS, rel=1e-9)
    assert last["normal_displacement_over_R"] == pytest.approx(FORCE[1] / STIFFNESS / RADIUS, rel=1e-9)
    assert averages["lateral_force_N"].to_numpy() == pytest.approx(LATERAL, rel=1e-9)
    assert last["rotation_deg"] == pytest.approx(ROTATION_DEG, rel=1e-9)
    shortening = [
        4 * (np.cos(np.radians(first_angle_deg(s))) - np.cos(np.radians(first_angle_deg(s) + GROWTH_DEG)))
        for s in SEEDS
    ]
    assert last["axial_displacement_over_R"] == pytest.approx(np.mean(shortening), rel=1e-9)
    assert list(averages["segments"].unique()) == [SEGMENTS * len(SEEDS)]
    assert list(averages["runs"].unique()) == [len(SEEDS)]


def test_macroscopic_facts_of_a_drop(found: Analysis) -> None:
    facts = found.macroscopic
    n_weak = N_COLUMNS * (LENGTH - 2)
    n_all = N_COLUMNS * LENGTH + n_weak
    contacts = (
        N_COLUMNS * (2 * (LENGTH - 1) + 2) + 2 * n_weak
    )  # ends of the contacts of the columns and of the weak discs
    assert facts["coordination_start"].to_numpy() == pytest.approx(contacts / n_all)
    assert facts["rattler_share_start"].to_numpy() == pytest.approx(n_weak / n_all)
    assert facts["coordination_without_rattlers_start"].to_numpy() == pytest.approx(2.0)
    assert facts["near_buckled_particle_share"].to_numpy() == pytest.approx(1.0)
    assert facts["solid_fraction_start"].isna().all()  # no side walls: the box is unknown
    assert facts["dissipated_sliding_J"].to_numpy() == pytest.approx(0.0)  # no tangential force does work
    assert (facts["area_of_half_the_shear"] < 0.5).all()


def test_error_over_runs_is_the_larger_where_segments_of_a_run_agree(found: Analysis) -> None:
    first = found.averages.iloc[0]
    assert first["buckling_angle_deg_se"] == first["buckling_angle_deg_se_runs"]
    assert first["buckling_angle_deg_se_runs"] > 2 * first["buckling_angle_deg_se_segments"]
    # three runs one degree apart: standard deviation 1, so 1/sqrt(3), within the noise of resampling
    assert first["buckling_angle_deg_se_runs"] == pytest.approx(1 / np.sqrt(3), rel=0.05)


def test_a_second_analysis_reads_the_first_back(study: Path, found: Analysis) -> None:
    again = analyse(study)
    assert again.reused
    for name in ("runs", "drops", "segments", "yielding", "chains", "members", "macroscopic", "averages", "classes"):
        pd.testing.assert_frame_equal(getattr(again, name), getattr(found, name), check_dtype=False)
    assert list(again.ledger) == list(found.ledger)


def test_the_result_does_not_depend_on_the_number_of_processes(found: Analysis, tmp_path: Path) -> None:
    write_buckling_study(tmp_path / "zigzag", SEEDS)
    other = analyse(tmp_path / "zigzag", jobs=2)
    assert not other.reused
    pd.testing.assert_frame_equal(other.segments, found.segments)


def test_an_option_makes_the_analysis_anew(tmp_path: Path) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1,))
    assert not analyse(directory).reused
    run = next((directory / "runs").iterdir())
    run.rename(directory / "runs" / "seed9")
    assert not analyse(directory).reused


def test_given_drops_replace_found_ones(tmp_path: Path) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1,))
    planned = directory / "runs" / "seed1"
    text = 'name = "zigzag"\nseeds = [1]\n[parameters]\nsmallest_radius = 1.14e-3\nlargest_radius = 1.14e-3\n'
    text += "[analysis]\ndrops = [[0.005, 0.007]]\nincrements = 8\n"
    (directory / "study.toml").write_text(text)
    from harness.study import read_study

    planned.rename(planned.with_name(read_study(directory / "study.toml").planned_runs()[0].run_id))
    analysis = analyse(directory)
    assert analysis.drops[["start", "end"]].to_numpy().tolist() == [[0.005, 0.007]]
    assert analysis.averages["buckling_angle_deg"].iloc[-1] == pytest.approx(first_angle_deg(1) + GROWTH_DEG / 2)
    assert analysis.options["drops"]["value"] == [[0.005, 0.007]]


def test_an_invalid_run_is_left_out_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1, 2))
    validity = {"servo_error_max": 0.031, "unbalanced_force_max": 0.01, "overlap_max": 0.05, "escaped_discs": 0}
    write_buckling_run(directory / "runs" / "seed3", 3, validity=validity | {"settled": True})
    assert main(["analyse", str(directory)]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "seed3" in error
    assert "0.031" in error
    assert set(analyse(directory).runs["run"]) == {"seed1", "seed2"}


def test_a_truncated_snapshot_is_met_even_outside_the_drops(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = write_buckling_run(tmp_path / "seed1", 1)
    first = run / "snapshots" / "000001.npz"
    first.write_bytes(first.read_bytes()[:1000])
    assert main(["analyse", str(run)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "run seed1: snapshots/000001.npz: expected" in error
    assert "found 1000" in error


def test_tables_of_other_origin_are_checked_outside_the_drops_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = write_buckling_run(tmp_path / "bare", 1)
    (run / "run.json").unlink()
    first = run / "snapshots" / "000001.npz"
    with np.load(first) as archive:
        tables = dict(archive)
    tables["contact_fn"][3] = np.nan
    np.savez(first, **tables)
    assert main(["analyse", str(run)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "run bare: 000001.npz: contacts row 3, column 'fn'" in error


def test_without_a_valid_run_there_is_nothing_to_analyse(tmp_path: Path) -> None:
    write_buckling_run(tmp_path / "runs" / "seed1", 1, status="failed", failure="it broke")
    with pytest.raises(RunError, match="it broke"):
        analyse(tmp_path)


def test_tables_without_history_say_what_is_missing(tmp_path: Path) -> None:
    run = write_buckling_run(tmp_path / "bare", 1)
    (run / "run.json").unlink()
    (run / "history.csv").unlink()
    with pytest.raises(InputError, match=r"bare: expected a history\.csv"):
        analyse(run)


def test_tables_of_other_origin_are_analysed_without_a_manifest(tmp_path: Path) -> None:
    run = write_buckling_run(tmp_path / "bare", 1)
    (run / "run.json").unlink()
    analysis = analyse(run)
    assert analysis.cases == ["bare"]
    facts = analysis.runs.iloc[0]
    assert facts["rolling_friction"] == pytest.approx(0.2)
    assert facts["rolling_stiffness_ratio"] == pytest.approx(0.5)
    assert sum(record["buckled_segments"] for record in analysis.ledger) == SEGMENTS


def test_analyse_prints_the_ledger_as_json(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["analyse", str(study), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert [record["buckled_segments"] for record in document["ledger"]] == [SEGMENTS] * len(SEEDS)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("aligment_angle_deg = 45", "did you mean 'alignment_angle_deg'"),
        ('segment_rule = "evry"', "expected one of 'best', 'every'"),
        ("drops = [[0.1, 0.05]]", "0.1-0.05"),
        ("drops = 3", "pairs of axial strains"),
    ],
)
def test_a_wrong_option_ends_in_one_line(
    tmp_path: Path, options: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1,))
    (directory / "study.toml").write_text(f"[analysis]\n{options}\n")
    from harness.study import read_study

    planned = read_study(directory / "study.toml").planned_runs()[0].run_id
    (directory / "runs" / "seed1").rename(directory / "runs" / planned)
    assert main(["analyse", str(directory)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error


def test_averages_keep_runs_apart() -> None:
    rows = [
        {"case": "c", "run": run, "drop": 1, "segment": segment, "increment": i, "axial_strain": 0.1 + 0.01 * i}
        | dict.fromkeys(
            (
                "buckling_angle_deg",
                "axial_force_N",
                "axial_displacement_over_R",
                "normal_displacement_over_R",
                "rotation_deg",
                "lateral_force_N",
            ),
            value + i,
        )
        for run, values in (("a", (1.0, 3.0)), ("b", (8.0,)))
        for segment, value in enumerate(values)
        for i in range(2)
    ]
    table = average(pd.DataFrame(rows))
    assert table["axial_force_N"].tolist() == [4.0, 5.0]
    assert table["strain_since_start"].tolist() == pytest.approx([0.0, 0.01])
    assert [group.shape for group in histories(pd.DataFrame(rows), "axial_force_N")] == [(2, 2), (2, 1)]


def test_results_stay_readable_when_the_same_study_would_get_other_ids(tmp_path: Path) -> None:
    directory = write_buckling_study(tmp_path / "zigzag", (1, 2))
    (directory / "study.toml").write_text("seeds = [1, 2]\n")
    with pytest.raises(InputError, match="no run in it"):
        analyse(directory)
    runs = [{"run_id": f"seed{seed}", "parameters": {"seed": seed}} for seed in (1, 2, 3)]
    (directory / "plan.json").write_text(json.dumps({"runs": runs}))
    analysis = analyse(directory)
    assert set(analysis.runs["run"]) == {"seed1", "seed2"}
    assert list(analysis.left_out) == ["seed3"]
    (directory / "plan.json").write_text("{}")
    with pytest.raises(InputError, match="not the plan of a study"):
        analyse(directory)
