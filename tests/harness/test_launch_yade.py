"""Launching the real YADE: what it leaves is read back, a killed run starts afresh and comes out the same."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from harness import cli
from harness.reading.exports import read_run, run_folders
from harness.running.yade_environment import find_yade

pytestmark = pytest.mark.yade

ROOT = Path(__file__).parents[2]
# Between walls so near each other a packing of a hundred discs is less dense than the bounds for a large one
STUDY = """
name = "small"
seeds = [1]
[parameters]
particle_count = 100
final_axial_strain = 0.004
[grid]
rolling_friction = [0.2, 0.02]
[run]
jobs = 2
solid_fraction_low = 0.75
servo_bound = 0.2
unbalanced_force_bound = 0.5
"""


@pytest.fixture
def yade_command() -> str:
    found = find_yade()
    assert found is not None
    return found.command


def listening_ports(pid: int) -> list[str]:
    """Local addresses on which process `pid` listens, as the kernel tells it."""
    sockets = set()
    for entry in Path(f"/proc/{pid}/fd").iterdir():
        try:
            sockets.add(os.readlink(entry))  # noqa: PTH115  no path: socket:[number]
        except OSError:
            continue
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                found.append(fields[1])
    return found


def runs_loading(folder: Path) -> list[int]:
    """Processes of the runs that tell that they are loading."""
    told = [json.loads(path.read_text()) for path in folder.glob("runs/*/progress.json")]
    return [int(entry["pid"]) for entry in told if entry["stage"] == "loading"]


def progress_of(folder: Path) -> dict[str, object]:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        for path in folder.glob("runs/*/progress.json"):
            told: dict[str, object] = json.loads(path.read_text())
            if told["stage"] == "loading":
                return told
        time.sleep(0.02)
    raise AssertionError("no run tells its progress")


def test_a_small_study_on_the_real_yade(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = tmp_path / "small.toml"
    study.write_text(STUDY)
    results = tmp_path / "results"
    command = [sys.executable, "-m", "harness", "run", str(study), "--out", str(results)]
    harness = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    told = progress_of(results)
    pid = int(str(told["pid"]))
    ports = listening_ports(pid)
    os.kill(pid, signal.SIGKILL)
    _, lines = harness.communicate(timeout=120)
    assert ports == []
    assert harness.returncode == 3
    assert "was ended by signal SIGKILL" in lines
    done = {folder.name: folder for folder in run_folders(results)}
    before = {name: (folder / "run.json").read_bytes() for name, folder in done.items()}

    assert cli.main(["run", str(study), "--out", str(results), "--json"]) == 0
    states = json.loads(capsys.readouterr().out)["runs"]
    assert [state["state"] for state in states] == ["done", "done"]
    after = {name: (folder / "run.json").read_bytes() for name, folder in done.items()}
    assert sum(before[name] != after[name] for name in done) == 1  # the one that was complete was left alone

    for folder in run_folders(results):
        assert (folder / "yade.log").stat().st_mode & 0o777 == 0o600
        run = read_run(folder)
        assert run.parameters["particle_count"] == 100
        assert run.history is not None
        assert run.history["axial_strain"].iloc[-1] == pytest.approx(0.004, rel=1e-3)
        for snapshot in run.snapshots():
            assert snapshot.n_particles == 100
        np.testing.assert_allclose(run.axial_strain[-1], 0.004, rtol=1e-3)
    assert len(list((results / "packings").glob("*.npz"))) == 1

    again = tmp_path / "again"
    assert cli.main(["run", str(study), "--out", str(again)]) == 0
    for first, second in zip(run_folders(results), run_folders(again), strict=True):
        one, other = (json.loads((folder / "run.json").read_text())["products"]["files"] for folder in (first, second))
        assert one == other  # every file, to its last byte


MANY = 6


@pytest.mark.parametrize("by_command", [False, True])
def test_many_runs_at_once_never_fight_over_ports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, yade_command: str, by_command: bool
) -> None:
    """Runs started by YADE's Python listen nowhere; those of its command each on ports of their own, logs private."""
    if by_command:  # a command that does not tell where its Python is
        wrapper = tmp_path / "yade"
        wrapper.write_text(f'#!/bin/sh\nexec {yade_command} "$@"\n')
        wrapper.chmod(0o755)
        monkeypatch.setenv("YADE_COMMAND", str(wrapper))
    study, results = tmp_path / "many.toml", tmp_path / "results"
    many = STUDY.replace("seeds = [1]", f"seeds = {list(range(1, MANY + 1))}").replace("[0.2, 0.02]", "[0.2]")
    study.write_text(many.replace("jobs = 2", f"jobs = {MANY}").replace("0.004", "0.03"))
    command = [sys.executable, "-m", "harness", "run", str(study), "--out", str(results)]
    harness = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    ports: dict[int, list[str]] = {}
    at_once = 0
    try:
        while harness.poll() is None:
            loading = {}
            for pid in runs_loading(results):
                with contextlib.suppress(OSError):  # it has just ended
                    loading[pid] = listening_ports(pid)
            at_once = max(at_once, len(loading))
            ports = {pid: ports.get(pid) or found for pid, found in loading.items()} | {
                pid: found for pid, found in ports.items() if pid not in loading
            }
            time.sleep(0.02)
        _, told = harness.communicate(timeout=300)
    finally:
        harness.kill()
    assert harness.returncode == 0, told
    assert told.count(": done after") == MANY
    assert len(ports) == MANY
    assert at_once > 1
    # Two for each: the prompt, and the information for other programs
    assert {len(set(of_one)) for of_one in ports.values()} == ({2} if by_command else {0})
    for log in results.glob("runs/*/yade.log"):
        assert log.stat().st_mode & 0o777 == 0o600
        assert log.parent.stat().st_mode & 0o777 == 0o700
