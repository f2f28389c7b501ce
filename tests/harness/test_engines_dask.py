"""Runs on Dask's workers: the same results as here, whatever happens to a worker, the scheduler or the harness."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import gone, heed_signals, wait_for

from harness import cli
from harness.running import dask_engine

ROOT = Path(__file__).parents[2]
DASK = [sys.executable, "-c", "from dask.__main__ import main; main()"]
WriteStudy = Callable[..., Path]
FakeYade = Any  # of conftest.py


class Cluster:
    """A scheduler and workers of one slot each, as processes of this machine."""

    def __init__(self, home: Path) -> None:
        home.mkdir()
        self.home = home
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.file = home / "scheduler.json"

    def start(self, name: str, *arguments: str) -> None:
        environment = {**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
        with (self.home / f"{name}.log").open("wb") as log:
            self.processes[name] = subprocess.Popen(
                [*DASK, *arguments, "--no-dashboard"],
                cwd=ROOT,
                env=environment,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def start_scheduler(self) -> None:
        self.start("scheduler", "scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self.file))
        wait_for(self.file.exists)

    def start_worker(self, name: str, *more: str) -> None:
        folder = str(self.home / name)
        options = ("--nthreads", "1", "--name", name, "--local-directory", folder, *more)
        self.start(name, "worker", "--scheduler-file", str(self.file), *options)

    def kill(self, name: str, number: int = signal.SIGKILL) -> None:
        self.processes[name].send_signal(number)

    def close(self) -> None:
        for process in self.processes.values():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # a worker's nanny and the worker
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path / "cluster")
    try:
        made.start_scheduler()
        yield made
    finally:
        made.close()


def command(study: Path, out: Path, cluster: Cluster) -> list[str]:
    options = ["--engine", "dask", "--scheduler", str(cluster.file)]
    return [sys.executable, "-m", "harness", "run", str(study), "--out", str(out), *options]


def start(study: Path, out: Path, cluster: Cluster) -> subprocess.Popen[str]:
    return subprocess.Popen(
        command(study, out, cluster),
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heed_signals,
    )


def products(results: Path) -> dict[str, str]:
    """Checksum of every file of every run, but for those that tell when and where it was made."""
    return {
        path.relative_to(results).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(results.glob("runs/*/**/*"))
        if path.is_file() and path.name not in ("run.json", "progress.json", "yade.log")
    }


def worker_at(pid: int) -> str:
    """Name of the worker whose run is process `pid`: by the command lines of its ancestors."""
    while pid > 1:
        words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
        if "--name" in words:
            return words[words.index("--name") + 1]
        pid = int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
    raise AssertionError("no worker's run")


def test_a_killed_worker_s_runs_go_to_another(
    fake_yade: FakeYade, write_study: WriteStudy, cluster: Cluster, tmp_path: Path
) -> None:
    study = write_study([1, 2, 3, 4])
    assert cli.main(["run", str(study), "--out", str(tmp_path / "here")]) == 0
    fake_yade.behave({1: ["good", "hang", "good"]})
    cluster.start_worker("first")
    cluster.start_worker("second", "--no-nanny")
    harness = start(study, tmp_path / "there", cluster)
    wait_for(lambda: len(fake_yade.processes()) == 2)  # the first run hangs on one of the two
    cluster.kill(worker_at(fake_yade.processes()[0]))
    _, told = harness.communicate(timeout=300)
    assert harness.returncode == 0, told
    wait_for(lambda: all(gone(pid) for pid in fake_yade.processes()), 5)
    assert "4 runs, 0 of them complete" in told
    assert fake_yade.calls().count("biaxial.py 1") == 3  # here, on the lost worker, on the other
    assert products(tmp_path / "there") == products(tmp_path / "here")
    logs = list((tmp_path / "there").glob("runs/*/yade.log"))
    assert len(logs) == 4
    assert all(log.stat().st_mode & 0o777 == 0o600 for log in logs)


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_an_ended_harness_leaves_nothing_running(
    fake_yade: FakeYade, write_study: WriteStudy, cluster: Cluster, tmp_path: Path, number: int, status: int
) -> None:
    fake_yade.behave({1: ["hang", "good"]})
    study = write_study([1])
    cluster.start_worker("worker", "--no-nanny")
    harness = start(study, tmp_path / "results", cluster)
    wait_for(lambda: len(fake_yade.processes()) == 2)
    harness.send_signal(number)
    _, told = harness.communicate(timeout=120)
    assert harness.returncode == status
    assert "Traceback" not in told
    if number != signal.SIGKILL:
        assert told.splitlines()[-1].startswith("forcechain: ")
        assert all(gone(pid) for pid in fake_yade.processes())  # already: it has waited for that
    wait_for(lambda: all(gone(pid) for pid in fake_yade.processes()), 15)
    assert cluster.processes["worker"].poll() is None
    again = subprocess.run(command(study, tmp_path / "results", cluster), cwd=ROOT, capture_output=True, check=False)
    assert again.returncode == 0


def test_a_lost_scheduler_is_one_line_and_the_runs_end(
    fake_yade: FakeYade, write_study: WriteStudy, cluster: Cluster, tmp_path: Path
) -> None:
    fake_yade.behave({1: ["hang", "good"]})
    study = write_study([1])
    cluster.start_worker("worker")
    harness = start(study, tmp_path / "results", cluster)
    wait_for(lambda: len(fake_yade.processes()) == 2)
    cluster.kill("scheduler")
    _, told = harness.communicate(timeout=120)
    assert harness.returncode == 3
    assert "Traceback" not in told
    assert told.splitlines()[-1].startswith("forcechain: the scheduler is lost")
    wait_for(lambda: all(gone(pid) for pid in fake_yade.processes()))
    assert cli.main(["run", str(study), "--out", str(tmp_path / "results")]) == 0


def test_workers_may_come_later_and_a_hang_meets_its_time_limit(
    fake_yade: FakeYade, write_study: WriteStudy, cluster: Cluster, tmp_path: Path
) -> None:
    fake_yade.behave({1: "hang", 2: "crash", 3: "good"})
    study = write_study([1, 2, 3], run={"time_limit_s": 5})
    harness = start(study, tmp_path / "results", cluster)
    wait_for((tmp_path / "results" / "plan.json").exists)
    cluster.start_worker("late", "--no-nanny")
    _, told = harness.communicate(timeout=300)
    assert harness.returncode == 3
    assert re.search(r"scheduler \S+: 0 slots, waiting for workers", told)
    assert re.search(r"seed1-\w+: failed after \d s: was stopped at its time limit of 5 s", told)
    assert re.search(r"seed2-\w+: failed after .*the interaction has no physics", told)
    assert re.search(r"seed3-\w+: done after", told)
    assert all(gone(pid) for pid in fake_yade.processes())


def test_a_run_that_loses_every_worker_is_failed(
    fake_yade: FakeYade, write_study: WriteStudy, cluster: Cluster, tmp_path: Path
) -> None:
    fake_yade.behave({1: "hang"})
    harness = start(write_study([1]), tmp_path / "results", cluster)
    for number in (1, 2):  # one loss more than the scheduler allows here
        cluster.start_worker(f"worker{number}", "--no-nanny")
        wait_for(lambda number=number: len(fake_yade.processes()) == 2 * number)
        cluster.kill(f"worker{number}")
    _, told = harness.communicate(timeout=120)
    assert harness.returncode == 3
    assert re.search(r"seed1-\w+: failed after 0 s: lost its worker again and again, the last one at tcp://", told)
    wait_for(lambda: all(gone(pid) for pid in fake_yade.processes()))


def test_what_a_lost_worker_had_finished_is_not_run_again(tmp_path: Path) -> None:
    from harness.running.attendant import FINISHED_ALREADY, attend, task_in, task_line
    from harness.running.engines import Task, locked

    task = Task(
        name="one",
        command=[sys.executable, "-c", "open('product', 'w')"],
        environment={},
        folder=tmp_path,
        log=tmp_path / "log",
        lock=tmp_path / "locks" / "one",
        product=tmp_path / "product",
        time_limit_s=60.0,
    )
    assert task_in(task_line(task)) == task
    reading, writing = os.pipe()
    try:
        first = attend(task, reading)
        assert (first.exit_status, first.stopped) == (0, None)
        assert attend(task, reading).stopped == FINISHED_ALREADY
        with locked(task.lock):
            os.close(writing)  # the worker lets go while its attendant waits for the lock
            ended = attend(task, reading)
        assert ended.stopped == "was ended with its worker, or on request"
    finally:
        os.close(reading)


def test_a_scheduler_has_to_be_named_and_to_answer(
    write_study: WriteStudy,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dask_engine, "CONNECT_TIMEOUT_S", 1.0)
    study = write_study([1])
    no_file = tmp_path / "scheduler.json"
    other_file = tmp_path / "other.json"
    other_file.write_text("[]")
    for arguments, status, said in (
        (["--engine", "dask"], 2, "no scheduler is named"),
        (["--scheduler", "tcp://127.0.0.1:1"], 2, "the local engine has none"),
        (["--engine", "dask", "--scheduler", "tcp://127.0.0.1:1"], 3, "tcp://127.0.0.1:1: no scheduler answers"),
        (["--engine", "dask", "--scheduler", "nonsense"], 3, "nonsense: no scheduler answers"),
        (["--engine", "dask", "--scheduler", str(no_file)], 3, "no such scheduler file"),
        (["--engine", "dask", "--scheduler", str(other_file)], 3, "not a scheduler file"),
    ):
        assert cli.main(["run", str(study), "--out", str(tmp_path / "results"), *arguments]) == status
        told = capsys.readouterr().err.splitlines()
        assert len(told) == 1
        assert said in told[0]
    assert not (tmp_path / "results").exists()


def test_without_dask_it_says_how_to_get_it(
    write_study: WriteStudy, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "harness.running.dask_engine", None)
    monkeypatch.delattr("harness.running.dask_engine")
    assert cli.main(["run", str(write_study([1])), "--engine", "dask", "--scheduler", "tcp://127.0.0.1:8786"]) == 2
    told = capsys.readouterr().err
    assert "pip install distributed" in told
    assert len(told.splitlines()) == 1


STUDY = """
name = "small"
seeds = [1]
[parameters]
particle_count = 200
final_axial_strain = 0.005
[grid]
rolling_friction = [0.2, 0.05, 0.02]
[run]
solid_fraction_low = 0.75
servo_bound = 0.2
unbalanced_force_bound = 0.5
kinetic_over_elastic_bound = 1
"""


@pytest.mark.yade
def test_two_workers_one_killed_midway_give_the_same_bytes(cluster: Cluster, tmp_path: Path) -> None:
    study = tmp_path / "small.toml"
    study.write_text(STUDY)
    there = tmp_path / "there"
    cluster.start_worker("first")
    cluster.start_worker("second")
    harness = start(study, there, cluster)

    def loading() -> list[int]:
        told = [json.loads(path.read_text()) for path in there.glob("runs/*/progress.json")]
        return [int(entry["pid"]) for entry in told if entry["stage"] == "loading"]

    wait_for(lambda: loading() and worker_at(loading()[0]))
    pid = loading()[0]
    cluster.kill(worker_at(pid))  # its nanny: the worker and the run have to end by themselves
    _, told = harness.communicate(timeout=300)
    assert gone(pid)
    assert harness.returncode == 0, told

    here = tmp_path / "here"
    assert cli.main(["run", str(study), "--out", str(here)]) == 0
    assert len(products(here)) > 3 * 10
    assert products(there) == products(here)
    packings = [sorted((path.name, path.read_bytes()) for path in out.glob("packings/*.npz")) for out in (here, there)]
    assert packings[0] == packings[1]
    continued = [json.loads(path.read_text())["continued"] for path in there.glob("runs/*/run.json")]
    assert continued == [[]] * 3
