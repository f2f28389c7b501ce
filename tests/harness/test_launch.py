"""Launching studies on a YADE that misbehaves: nothing is lost, nothing is believed, nothing is left running."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from processes import gone, heed_signals, wait_for

from harness import cli
from harness.running import launch

WriteStudy = Callable[..., Path]
FakeYade = Any  # of conftest.py
ROOT = Path(__file__).parents[2]


def run(study: Path, *arguments: str) -> int:
    return cli.main(["run", str(study), "--out", str(results(study)), *arguments])


def results(study: Path) -> Path:
    return study.parent / "results"


def states(study: Path, capsys: pytest.CaptureFixture[str]) -> dict[int, tuple[str, str]]:
    capsys.readouterr()
    cli.main(["status", str(results(study)), "--json"])
    return by_seed(capsys.readouterr().out)


def by_seed(told: str) -> dict[int, tuple[str, str]]:
    entries = json.loads(told)["runs"]
    return {int(entry["run"].split("-")[0][4:]): (entry["state"], entry["reason"]) for entry in entries}


def start(study: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "harness", "run", str(study), "--out", str(results(study)), "--jobs", "2"]
    return subprocess.Popen(
        command,
        cwd=ROOT,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        preexec_fn=heed_signals,
    )


def content_of(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {
        path.relative_to(folder).as_posix(): (path.read_bytes(), path.stat().st_mtime_ns)
        for path in folder.rglob("*")
        if path.is_file()
    }


BEHAVIOUR = {
    2: "crash",
    3: "silent",
    4: "killed",
    5: "fail",
    6: "truncate",
    7: "flip",
    8: "lie",
    9: "empty",
    10: "other",
    11: "broken manifest",
    12: "servo",
    13: "good but exit 1",
}
REASONS = {
    1: ("done", None),
    2: ("failed", "RuntimeError: the interaction has no physics"),
    3: ("failed", "ended with exit status 0; the last line of yade.log"),
    4: ("failed", "was ended by signal SIGKILL"),
    5: ("failed", "the servo was lost at strain 0.03"),
    6: ("failed", "its manifest says done, but snapshots/000001.npz: expected"),
    7: ("failed", "its manifest says done, but snapshots/000001.npz: its content has changed since the run"),
    8: ("failed", "its manifest says done, but snapshots/000001.npz is missing"),
    9: ("failed", "its manifest says done, but its manifest names no snapshot"),
    10: ("failed", "its manifest has friction = 0.123, the study 0.7"),
    11: ("failed", "run.json is not JSON"),
    12: ("invalid", "largest error of the confining stress (servo_error_max) is 0.031, expected at most 0.02"),
    13: ("done", None),
}


def test_what_is_left_decides_and_the_next_launch_mends(
    fake_yade: FakeYade, write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_yade.behave({seed: [what, "servo" if what == "servo" else "good"] for seed, what in BEHAVIOUR.items()})
    study = write_study(list(REASONS))
    assert run(study, "--jobs", "4", "--json") == 3
    found = by_seed(capsys.readouterr().out)
    for seed, (state, reason) in REASONS.items():
        assert found[seed][0] == state, found[seed]
        assert (reason or "") in (found[seed][1] or ""), found[seed]
    assert len(fake_yade.calls()) == 2 * len(REASONS)  # one packing and one run for each seed
    folders = {int(path.name.split("-")[0][4:]): path for path in (results(study) / "runs").iterdir()}
    for folder in folders.values():
        assert (folder / "yade.log").stat().st_mode & 0o777 == 0o600
    kept = {seed: content_of(folders[seed]) for seed in (1, 12, 13)}

    assert run(study) == 3  # the invalid one is what it is
    found = states(study, capsys)
    assert {seed for seed, (state, _) in found.items() if state != "done"} == {12}
    assert {seed: content_of(folders[seed]) for seed in kept} == kept
    again = fake_yade.calls()[2 * len(REASONS) :]
    assert sorted(again) == sorted(f"biaxial.py {seed}" for seed in (2, 3, 4, 5, 6, 7, 8, 9, 10, 11))
    attempts = sorted(path.name for path in (results(study) / "failed").iterdir())
    assert len(attempts) == 10
    assert all((results(study) / "failed" / name / "yade.log").exists() for name in attempts)

    assert run(study) == 3
    assert len(fake_yade.calls()) == 2 * len(REASONS) + 10


def test_all_good_is_exit_status_0(
    fake_yade: FakeYade, write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write_study([1, 2])
    assert run(study, "--json") == 0
    captured = capsys.readouterr()
    entries = json.loads(captured.out)["runs"]
    assert [entry["state"] for entry in entries] == ["done", "done"]
    assert all(figure["passed"] for entry in entries for figure in entry["validity"])
    assert "2 runs, 0 of them complete" in captured.err
    log = next((results(study) / "runs").glob("seed1-*")) / "yade.log"
    environment = json.loads(log.read_text().splitlines()[1])
    assert environment["PYTHONPATH"] == str(fake_yade.home / "py")
    assert environment["OMP_NUM_THREADS"] == "1"
    assert environment["HOME"]
    assert environment["DISPLAY"] is None


@pytest.mark.usefixtures("fake_yade")
def test_results_lie_under_the_current_directory(
    write_study: WriteStudy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_study([1])
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "trial.toml"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "results/trial"
    assert len(list((tmp_path / "results" / "trial" / "runs").glob("seed1-*/run.json"))) == 1


def test_one_packing_serves_all_frictions(fake_yade: FakeYade, write_study: WriteStudy) -> None:
    study = write_study([1, 2], text="[grid]\nrolling_friction = [0.2, 0.05, 0.02]")
    assert run(study) == 0
    assert sorted(fake_yade.calls()) == sorted(
        ["packing.py 1", "packing.py 2"] + ["biaxial.py 1"] * 3 + ["biaxial.py 2"] * 3
    )


def test_a_failed_packing_fails_its_runs(
    fake_yade: FakeYade, write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_yade.behave({"packing": "fail"})
    study = write_study([1])
    assert run(study) == 3
    state, reason = states(study, capsys)[1]
    assert state == "failed"
    assert "its packing could not be made: ended with exit status 1" in reason
    assert "no space between the discs" in reason
    assert fake_yade.calls() == ["packing.py 1"]


def test_a_failed_run_is_retried_as_the_study_says(fake_yade: FakeYade, write_study: WriteStudy) -> None:
    fake_yade.behave({1: ["crash", "killed", "good"], 2: ["crash", "crash", "crash", "good"]})
    study = write_study([1, 2], run={"retries": 2})
    assert run(study) == 3
    assert fake_yade.calls().count("biaxial.py 1") == 3
    assert fake_yade.calls().count("biaxial.py 2") == 3
    assert run(study) == 0


@pytest.mark.parametrize("what", ["hang", "good then hang"])
def test_the_time_limit_ends_a_run_and_all_it_started(
    fake_yade: FakeYade, write_study: WriteStudy, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    fake_yade.behave({1: what})
    study = write_study([1, 2], run={"time_limit_s": 4})
    assert run(study) == 3
    found = states(study, capsys)
    assert "was stopped at its time limit of 4 s" in found[1][1]
    assert found[2] == ("done", None)
    assert len(fake_yade.processes()) == 2
    assert all(gone(pid) for pid in fake_yade.processes())


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_ends_everything_at_once(
    fake_yade: FakeYade, write_study: WriteStudy, number: int, status: int, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_yade.behave({1: ["hang", "good"]})
    study = write_study([1, 2])
    process = start(study)
    wait_for(lambda: len(fake_yade.processes()) == 2 and "biaxial.py 2" in fake_yade.calls())
    assert states(study, capsys)[1][0] == "running"
    time.sleep(1.0)
    process.send_signal(number)
    _, told = process.communicate(timeout=10)
    assert process.returncode == status
    assert "Traceback" not in told
    assert told.strip().splitlines()[-1].startswith("forcechain: ")
    wait_for(lambda: all(gone(pid) for pid in fake_yade.processes()), 2)
    assert states(study, capsys)[1] == ("waiting", None)
    assert run(study) == 0


def test_a_killed_harness_takes_its_runs_along_and_the_next_resumes(
    fake_yade: FakeYade, write_study: WriteStudy
) -> None:
    fake_yade.behave({2: ["hang", "good"]})
    study = write_study([1, 2])
    process = start(study)
    wait_for(lambda: len(fake_yade.processes()) == 2 and any((results(study) / "runs").glob("seed1-*/run.json")))
    before = content_of(next((results(study) / "runs").glob("seed1-*")))
    process.kill()
    process.communicate(timeout=10)
    run_pid, started_by_it = fake_yade.processes()
    wait_for(lambda: gone(run_pid), 5)
    os.kill(started_by_it, signal.SIGKILL)  # the kernel ends the run itself, not what it may have started
    assert run(study) == 0
    assert content_of(next((results(study) / "runs").glob("seed1-*"))) == before


def test_a_second_harness_on_the_same_study_says_so_and_leaves(
    fake_yade: FakeYade, write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_yade.behave({1: "hang"})
    study = write_study([1])
    process = start(study)
    try:
        wait_for(lambda: len(fake_yade.processes()) == 2)
        assert run(study) == 3
        told = capsys.readouterr().err
        assert f"process {process.pid} on" in told
        assert "is at work on this study; wait for it, or end it first" in told
        assert not gone(fake_yade.processes()[0])
        cli.main(["status", str(results(study))])
        assert "running  strain 0.0250 of 0.1, 2900 steps/s, 1 min 15 s left" in capsys.readouterr().out
    finally:
        process.terminate()
        process.communicate(timeout=10)


@pytest.mark.usefixtures("fake_yade")
def test_a_run_of_yesterday_is_not_taken_for_running(
    write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write_study([1])
    assert run(study) == 0
    folder = next((results(study) / "runs").iterdir())
    (folder / "run.json").unlink()
    told = {"pid": os.getpid(), "time": "2020-01-01T00:00:00Z", "axial_strain": 0.05}
    (folder / "progress.json").write_text(json.dumps(told))
    assert states(study, capsys)[1] == ("waiting", None)


@pytest.mark.usefixtures("fake_yade")
def test_a_run_whose_process_has_ended_unseen_by_its_parent_is_not_running(
    write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write_study([1])
    assert run(study) == 0
    folder = next((results(study) / "runs").iterdir())
    (folder / "run.json").unlink()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        told = {"pid": process.pid, "time": datetime.now(UTC).isoformat(), "axial_strain": 0.05, "target_strain": 0.1}
        (folder / "progress.json").write_text(json.dumps(told))
        assert states(study, capsys)[1][0] == "running"
        process.kill()
        wait_for(lambda: gone(process.pid))  # a zombie: nobody has asked for its exit status yet
        assert states(study, capsys)[1] == ("waiting", None)


def test_a_changed_study_runs_what_changed(fake_yade: FakeYade, write_study: WriteStudy) -> None:
    assert run(write_study([1, 2])) == 0
    study = write_study([2, 3])
    assert run(study) == 0
    assert [call for call in fake_yade.calls() if call.startswith("biaxial")].count("biaxial.py 2") == 1
    assert "biaxial.py 3" in fake_yade.calls()
    assert (results(study) / "study.toml").read_text() == study.read_text()


@pytest.mark.usefixtures("fake_yade")
def test_a_deleted_product_is_made_again(write_study: WriteStudy) -> None:
    study = write_study([1, 2])
    assert run(study) == 0
    folder = next((results(study) / "runs").glob("seed1-*"))
    (folder / "history.csv").unlink()
    assert cli.main(["status", str(results(study))]) == 3
    assert run(study) == 0
    assert (folder / "history.csv").exists()


@pytest.mark.usefixtures("fake_yade")
def test_a_full_disk_is_one_line_and_nothing_is_lost(
    write_study: WriteStudy,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = write_study([1, 2])
    written = launch._write
    calls: list[Path] = []

    def full(path: Path, text: str) -> Path:
        calls.append(path)
        if len(calls) > 2:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return written(path, text)

    monkeypatch.setattr(launch, "_write", full)
    assert run(study) == 3
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert told.startswith("forcechain: ")
    assert "No space left on device; make room or choose another --out" in told
    monkeypatch.setattr(launch, "_write", written)
    assert run(study) == 0


def test_without_yade_it_says_how_to_get_it(
    write_study: WriteStudy, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("YADE_COMMAND", raising=False)
    monkeypatch.setenv("PATH", "")
    study = write_study([1])
    assert run(study) == 3
    assert "apt-get install --no-install-recommends yade" in capsys.readouterr().err
    monkeypatch.setenv("YADE_COMMAND", "nowhere/yade")
    assert run(study) == 3
    assert "YADE_COMMAND=nowhere/yade: expected a command, found none" in capsys.readouterr().err


def test_options_of_later_steps_are_checked_before_anything_runs(
    fake_yade: FakeYade, write_study: WriteStudy, capsys: pytest.CaptureFixture[str]
) -> None:
    for table, said in (("analysis", "unknown option 'no_such_option'"), ("compare", "no_such_option")):
        study = write_study([1], text=f"[{table}]\nno_such_option = 1")
        assert run(study) == 2
        assert said in capsys.readouterr().err
    assert fake_yade.calls() == []


def test_a_yade_that_does_not_tell_its_python_is_run_by_its_command(
    fake_yade: FakeYade, write_study: WriteStudy
) -> None:
    stand_in = fake_yade.home / "python-of-yade"
    # the command's own options stand before the script
    fake_yade.command.write_text(
        '#!/bin/sh\n[ "$1" = --version ] && { echo "Yade version: 2025.2.0"; exit; }\n'
        f'[ "$1$2$3" = -n-x-j1 ] || exit 9\nshift 3\nexec {stand_in} "$@"\n'
    )
    assert run(write_study([1])) == 0
    assert fake_yade.calls() == ["packing.py 1", "biaxial.py 1"]


def test_a_script_of_the_users_own_gets_its_parameters_and_our_export(fake_yade: FakeYade, tmp_path: Path) -> None:
    shutil.copy(ROOT / "studies" / "demo.toml", tmp_path / "mine.py")
    study = tmp_path / "own.toml"
    study.write_text("script = 'mine.py'\n[grid]\nfriction = [0.5, 0.6]\n")
    assert run(study) == 0
    assert fake_yade.calls() == ["mine.py 1"] * 2
    folder = next((results(study) / "runs").glob("mu0.5-seed1-*"))
    assert json.loads((folder / "parameters.json").read_text()) == {"friction": 0.5, "seed": 1}
    environment = json.loads((folder / "yade.log").read_text().splitlines()[1])
    assert environment["PYTHONPATH"] == str(fake_yade.home / "py")  # nothing of ours before YADE's own packages


def test_bars_are_drawn_on_a_terminal(
    fake_yade: FakeYade, write_study: WriteStudy, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fake_yade.behave({1: "hang"})
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    study = write_study([1, 2], run={"time_limit_s": 4})
    assert run(study) == 3
    drawn: Any = capsys.readouterr().err
    assert re.search(r" 25%\|\S+ +\| seed1-\w+: strain 0.0250 of 0.1, 2900 steps/s, 1 min 15 s left", drawn)
    assert "failed after" in drawn
