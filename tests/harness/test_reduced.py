"""Reduced results: they say the same as the whole study, refuse what they cannot do, and tell what is missing."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from buckling_study import write_buckling_study

from harness.analysing.analysis import analyse, reduce
from harness.analysing.reduced import MARK, made_by
from harness.cli import main
from harness.errors import InputError
from harness.gate.measured import measure
from harness.reading.exports import read_run
from harness.reading.stored import read_stored
from harness.study import PLAN, STUDY_COPY
from yade_scripts import export_format

SEEDS = (1, 2, 3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = write_buckling_study(tmp_path_factory.mktemp("whole") / "zigzag", SEEDS)
    (directory / STUDY_COPY).write_text(f'name = "zigzag"\nseeds = {list(SEEDS)}\n')
    runs = [{"run_id": f"seed{seed}", "parameters": {}} for seed in SEEDS]
    (directory / PLAN).write_text(json.dumps({"runs": runs}))
    analyse(directory, jobs=1)
    return directory


@pytest.fixture(scope="module")
def kept(whole: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return reduce(analyse(whole, jobs=1), tmp_path_factory.mktemp("kept") / "zigzag")


@pytest.fixture
def reduced(kept: Path, tmp_path: Path) -> Path:
    """Reduced results, free to be broken."""
    return Path(shutil.copytree(kept, tmp_path / "zigzag"))


@pytest.fixture
def output(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = main([str(word) for word in arguments])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run


def test_they_say_what_the_whole_study_says(
    whole: Path, reduced: Path, output: Callable[..., tuple[int, str, str]]
) -> None:
    expected, found = (output("compare", directory, "--json") for directory in (whole, reduced))
    assert found[0] == expected[0]
    for ours, theirs in zip(*(json.loads(told[1])["rows"] for told in (found, expected)), strict=True):
        assert ours == {
            name: pytest.approx(value, rel=1e-5, abs=1e-9) if isinstance(value, float) else value
            for name, value in theirs.items()
        }
    expected, found = (output("status", directory) for directory in (whole, reduced))
    assert found[:2] == (expected[0], expected[1].replace(str(whole), str(reduced)))
    kept, made = analyse(reduced), analyse(whole, jobs=1)
    pd.testing.assert_frame_equal(kept.yielding, made.yielding)
    pd.testing.assert_frame_equal(kept.segments, made.segments, rtol=1e-6)
    assert read_run(reduced / "runs" / "seed2").history.equals(read_run(whole / "runs" / "seed2").history)
    assert made_by(reduced).keys() == {"package_version", "code"}


def test_the_gate_holds_them_for_the_same_tables(
    whole: Path, reduced: Path, tmp_path: Path, output: Callable[..., tuple[int, str, str]]
) -> None:
    baseline = tmp_path / "zigzag.toml"
    assert output("approve", whole, "--baseline", baseline, "--reason", "by hand")[0] == 0
    status, told, _ = output("check", reduced, "--baseline", baseline, "--json")
    assert status == 0
    lines = json.loads(told)["lines"]
    assert {line["outcome"] for line in lines} == {"pass"}
    assert any("same tables" in line["tolerance_source"] for line in lines)
    whole_case, kept_case = (measure(analyse(place, jobs=1), {}).cases[0] for place in (whole, reduced))
    assert kept_case.tables == whole_case.tables
    assert kept_case.consistency == whole_case.consistency


def test_they_are_the_same_bytes_every_time_and_leave_remarks_alone(whole: Path, reduced: Path) -> None:
    def contents() -> dict[str, bytes]:
        return {
            path.relative_to(reduced).as_posix(): path.read_bytes() for path in reduced.rglob("*") if path.is_file()
        }

    (reduced / "remarks.md").write_text("ours")
    (reduced / "runs" / "left").mkdir()
    before = contents()
    assert reduce(analyse(whole, jobs=1), reduced) == reduced
    assert contents() == before
    assert not (reduced / "runs" / "left").exists()


def test_what_needs_snapshots_says_so_in_one_line(
    reduced: Path, tmp_path: Path, output: Callable[..., tuple[int, str, str]]
) -> None:
    for arguments in (
        ("analyse", reduced, "--sensitivity"),
        ("export", reduced, "--to", "csv", "--out", tmp_path / "csv"),
    ):
        status, _, error = output(*arguments)
        assert status == 2
        assert "is not part of these reduced results; run their study" in error
        assert error.count("\n") == 1
    run = read_run(reduced / "runs" / "seed1")
    there = [row for row in range(run.n_snapshots) if run.has_snapshot(row)]
    assert run.reduced
    assert len(there) == 2 < run.n_snapshots
    assert run.snapshot(there[0]).n_particles > 0
    assert not any(read_run(reduced / "runs" / "seed2").has_snapshot(row) for row in range(run.n_snapshots))
    status, _, error = output("export", reduced, "--to", "reduced", "--out", tmp_path / "again")
    assert status == 2
    assert "already reduced" in error


def test_the_report_leaves_out_what_it_cannot_draw(
    reduced: Path, tmp_path: Path, output: Callable[..., tuple[int, str, str]]
) -> None:
    assert output("report", reduced, "--output", tmp_path / "report.html")[0] == 0
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "These are reduced results" in page
    assert '"steps":[0,28]' in page  # the explorer knows the two snapshots that were kept
    shutil.rmtree(reduced / "runs" / "seed1" / "snapshots")
    status, _, error = output("report", reduced, "--output", tmp_path / "again.html")
    assert status == 2  # those it vouches for are missed
    assert "snapshots" in error


@pytest.mark.parametrize("name", ["analysis/segments.csv.xz", "analysis/runs.csv", "runs/seed2/run.json", "plan.json"])
def test_a_changed_file_is_refused_and_named(
    reduced: Path, name: str, output: Callable[..., tuple[int, str, str]]
) -> None:
    path = reduced / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    status, _, error = output("compare", reduced)
    assert status == 2
    assert name.removesuffix(".xz").rsplit("/", 1)[-1] in error
    assert error.count("\n") == 1
    path.unlink()
    assert output("compare", reduced)[0] in (2, 3)


def test_a_damaged_history_is_refused(reduced: Path) -> None:
    path = reduced / "runs" / "seed2" / f"{export_format.HISTORY}.xz"
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(OSError, match="no whole xz file"):
        read_stored(path.with_name(export_format.HISTORY))
    with pytest.raises(InputError, match="seed2"):
        analyse(reduced)


def test_another_analysis_cannot_be_asked_of_them(reduced: Path, output: Callable[..., tuple[int, str, str]]) -> None:
    mark = json.loads((reduced / MARK).read_text())
    study = reduced / STUDY_COPY
    for option, status in (("alignment_angle_deg = 45.0", 0), ("alignment_angle_deg = 30.0", 2)):
        study.write_text(f'name = "zigzag"\nseeds = {list(SEEDS)}\n[analysis]\n{option}\n')
        del mark["files"][STUDY_COPY]
        (reduced / MARK).write_text(json.dumps(mark))
        mark["files"][STUDY_COPY] = {}
        found, _, error = output("analyse", reduced)
        assert found == status, error
        if status:
            assert "alignment_angle_deg 45.0, asked for 30.0" in error


def test_only_a_whole_study_of_ours_is_reduced(whole: Path, tmp_path: Path) -> None:
    found = analyse(whole, jobs=1)
    with pytest.raises(InputError, match="their own place"):
        reduce(found, whole)
    other = tmp_path / "other"
    (other / "runs").mkdir(parents=True)
    with pytest.raises(InputError, match="whole results"):
        reduce(found, other)
    sweep = whole / "analysis" / "sensitivity.csv"
    sweep.write_text(f"case,in_use,segments\n{found.cases[0]},True,{len(found.yielding) + 1}\n")
    try:
        with pytest.raises(InputError, match="make it anew"):
            reduce(found, tmp_path / "new")
        sweep.write_text(f"case,in_use,segments\n{found.cases[0]},True,{len(found.yielding)}\n")
        assert (reduce(found, tmp_path / "new") / "analysis" / "sensitivity.csv").read_bytes() == sweep.read_bytes()
    finally:
        sweep.unlink()
    alone = write_buckling_study(tmp_path / "alone", (1,))
    with pytest.raises(InputError, match=r"expected a study's folder with study\.toml"):
        reduce(analyse(alone, jobs=1), tmp_path / "none")
