"""Launching the real YADE: what it leaves is read back, a killed run starts afresh and comes out the same."""

from __future__ import annotations

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
