"""Whatever happens to a study, run again it ends complete, and what was done is untouched."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from processes import gone, heed_signals, wait_for

from harness import cli
from harness.running.engines import locked

ROOT = Path(__file__).parents[2]
HARNESS = [sys.executable, "-m", "harness"]
WriteStudy = Callable[..., Path]
FakeYade = Any  # of conftest.py
Content = dict[str, tuple[bytes, int]]


class Campaign:
    """A study and its results, launched by a process of its own as a user would."""

    def __init__(self, study: Path) -> None:
        self.study = study
        self.results = study.parent / "results"
        self.harness: subprocess.Popen[str] | None = None

    def start(self, largest_file: int | None = None) -> None:
        def prepare() -> None:
            heed_signals()
            if largest_file:
                resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

        command = [*HARNESS, "run", str(self.study), "--out", str(self.results), "--jobs", "4"]
        self.harness = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=prepare
        )

    def end(self) -> tuple[int, str]:
        assert self.harness is not None
        _, told = self.harness.communicate(timeout=300)
        assert "Traceback" not in told
        return self.harness.returncode, told

    def signal(self, number: int) -> None:
        assert self.harness is not None
        self.harness.send_signal(number)

    def close(self) -> None:
        if self.harness is not None and self.harness.poll() is None:
            self.harness.kill()
            self.harness.communicate()

    def launch(self) -> tuple[int, str]:
        self.start()
        return self.end()

    def states(self) -> dict[int, tuple[str, str]]:
        told = subprocess.run(
            [*HARNESS, "status", str(self.results), "--json"], cwd=ROOT, capture_output=True, text=True, check=False
        )
        entries = json.loads(told.stdout)["runs"]
        states = {int(entry["run"].split("-")[0][4:]): (entry["state"], entry["reason"] or "") for entry in entries}
        assert told.returncode == (0 if {state for state, _ in states.values()} == {"done"} else 3)
        return states

    def folder(self, seed: int) -> Path:
        return next((self.results / "runs").glob(f"seed{seed}-*"))

    def process_of(self, seed: int) -> int:
        """Wait until the run of `seed` tells that it is loading, and lives; return its process."""
        found = []

        def lives() -> bool:
            for path in (self.results / "runs").glob(f"seed{seed}-*/progress.json"):
                with contextlib.suppress(FileNotFoundError):  # that of an attempt before, just being removed
                    told = json.loads(path.read_text())
                    found[:] = [int(told["pid"])] if told["stage"] == "loading" else []
            return bool(found) and not gone(found[0])

        wait_for(lives)
        return found[0]

    def content(self) -> dict[int, Content]:
        """Every file of the complete runs, with the time it was written."""
        done = [seed for seed, (state, _) in self.states().items() if state == "done"]
        return {
            seed: {
                str(path.relative_to(self.results)): (path.read_bytes(), path.stat().st_mtime_ns)
                for path in sorted(self.folder(seed).rglob("*"))
                if path.is_file()
            }
            for seed in done
        }


@pytest.fixture
def campaign_of() -> Iterator[Callable[[Path], Campaign]]:
    made: list[Campaign] = []

    def make(study: Path) -> Campaign:
        made.append(Campaign(study))
        return made[-1]

    yield make
    for campaign in made:
        campaign.close()


def unchanged(before: dict[int, Content], after: dict[int, Content]) -> bool:
    return all(after[seed] == content for seed, content in before.items())


def test_twelve_runs_survive_everything(
    fake_yade: FakeYade, write_study: WriteStudy, campaign_of: Callable[[Path], Campaign]
) -> None:
    fake_yade.behave(
        {
            2: ["hang", "hang", "hang", "hang", "good"],
            3: ["crash", "good"],
            4: ["truncate", "good"],
            5: ["no room", "good"],
            6: ["hang", "good"],
        }
    )
    seeds = list(range(1, 13))
    campaign = campaign_of(write_study(seeds, run={"time_limit_s": 10}))

    # A run is killed, one raises an exception, one is cut short, one finds the disk full, one hangs to its time limit
    campaign.start()
    os.kill(campaign.process_of(2), signal.SIGKILL)
    status, told = campaign.end()
    assert status == 3
    assert told.count(": done after") == 7
    states = campaign.states()
    for seed, reason in {
        2: "was ended by signal SIGKILL",
        3: "RuntimeError: the interaction has no physics",
        4: "its manifest says done, but snapshots/000001.npz: expected",
        5: "[Errno 28] No space left on device",
        6: "was stopped at its time limit of 10 s",
    }.items():
        assert states[seed][0] == "failed"
        assert reason in states[seed][1]
    complete = campaign.content()
    assert sorted(complete) == [1, 7, 8, 9, 10, 11, 12]

    write_study(seeds)  # from here on nothing is stopped but by us
    # The harness is ended in three ways while a run hangs; the others come to their end in the first of them
    for number, exit_status in ((signal.SIGTERM, 143), (signal.SIGKILL, -9), (signal.SIGINT, 130)):
        campaign.start()
        run = campaign.process_of(2)
        wait_for(lambda: len(list(campaign.results.glob("runs/*/run.json"))) == 11)
        assert campaign.states()[2] == ("running", "")
        campaign.signal(number)
        assert campaign.end()[0] == exit_status
        wait_for(lambda run=run: gone(run), 5)
        assert campaign.states()[2][0] == "waiting"
        assert unchanged(complete, campaign.content())
        complete = campaign.content()

    # A product of a complete run is deleted, another's is cut short
    (campaign.folder(7) / "history.csv").unlink()
    snapshot = campaign.folder(8) / "snapshots" / "000002.npz"
    snapshot.write_bytes(snapshot.read_bytes()[:1000])
    states = campaign.states()
    assert states[7] == ("failed", "its manifest says done, but history.csv is missing")
    assert "000002.npz: expected" in states[8][1]
    del complete[7], complete[8]

    status, told = campaign.launch()
    assert status == 0
    assert "12 runs, 9 of them complete" in told
    assert {state for state, _ in campaign.states().values()} == {"done"}
    assert unchanged(complete, campaign.content())
    # Every attempt that ended is kept with its log; those that were broken off left nothing to keep
    kept = sorted(path.name.split("-")[0] for path in (campaign.results / "failed").iterdir())
    assert kept == ["seed2", "seed3", "seed4", "seed5", "seed6", "seed7", "seed8"]
    assert all((path / "yade.log").stat().st_size for path in (campaign.results / "failed").iterdir())
    calls = fake_yade.calls()
    assert {seed: calls.count(f"biaxial.py {seed}") for seed in range(1, 13)} == {
        **dict.fromkeys((1, 9, 10, 11, 12), 1),
        **dict.fromkeys((3, 4, 5, 6, 7, 8), 2),
        2: 5,
    }
    assert sum(call.startswith("packing.py") for call in calls) == 12
    for pid in fake_yade.processes():
        if not gone(pid):
            os.kill(pid, signal.SIGKILL)  # what a run had started when its harness was killed

    assert campaign.launch()[0] == 0  # and once more: nothing is left to do
    assert fake_yade.calls() == calls


def small_disk(folder: Path) -> list[str]:
    """Return the words before a shell script that sees a disk of 300 kB at `folder`; none where that is not allowed."""
    mount = f'mount -t tmpfs -o size=300k none "{folder}" && exec sh -c "$1"'
    for words in (["unshare", "--mount"], ["unshare", "--user", "--map-root-user", "--mount"]):
        command = [*words, "sh", "-c", mount, "sh"]
        try:
            if subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0:
                return command
        except OSError:
            continue
    return []


def test_a_full_disk_stops_the_study_in_one_line_and_room_lets_it_go_on(
    fake_yade: FakeYade, write_study: WriteStudy, tmp_path: Path
) -> None:
    study = write_study(list(range(1, 13)))
    results = tmp_path / "results"
    results.mkdir()
    disk = small_disk(results)
    run = f"{sys.executable} -m harness run {study} --out {results} --jobs 2"
    list_files = f"find {results}/runs -type f -exec stat -c '%n %s %y' {{}} +"
    script = f"""
        {run} 2>{tmp_path}/told; echo $?
        grep -l '"done"' {results}/runs/*/run.json | xargs -n1 dirname >{tmp_path}/done
        {list_files} | grep -F -f {tmp_path}/done | sort >{tmp_path}/before
        mount -o remount,size=50m {results}; {run}; echo $?
        {list_files} | grep -F -f {tmp_path}/done | sort >{tmp_path}/after
    """
    if not disk:  # the kernel's word is the same wherever it comes from
        fake_yade.behave({seed: ["no room", "good"] for seed in (3, 4, 5)})
        script = script.replace("mount -o remount", ": mount -o remount")
    command = [*disk, script] if disk else ["sh", "-c", script]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    statuses = [line for line in ended.stdout.splitlines() if line in ("0", "3")]
    assert statuses == ["3", "0"], ended.stdout + ended.stderr
    told = (tmp_path / "told").read_text()
    assert "No space left on device" in told
    assert "Traceback" not in told
    done = (tmp_path / "done").read_text().splitlines()
    assert 0 < len(done) < 12
    assert (tmp_path / "before").read_text()
    assert (tmp_path / "after").read_text() == (tmp_path / "before").read_text()


@pytest.mark.usefixtures("fake_yade")
def test_a_run_that_another_process_still_writes_is_left_to_it(
    write_study: WriteStudy, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("harness.running.launch.LOCK_PATIENCE_S", 0.2)
    study = write_study([1, 2])
    results = study.parent / "results"
    assert cli.main(["run", str(study), "--out", str(results)]) == 0
    folder = next((results / "runs").glob("seed1-*"))
    for run in (results / "runs").iterdir():
        (run / "run.json").unlink()
    with locked(results / ".locks" / folder.name):
        assert cli.main(["run", str(study), "--out", str(results)]) == 3
        assert "a process of an earlier launch is still at work in" in capsys.readouterr().err
        assert not (folder / "run.json").exists()
        assert (folder / "history.csv").exists()
    assert len(list((results / "runs").glob("seed2-*/run.json"))) == 1
    assert cli.main(["run", str(study), "--out", str(results)]) == 0


def test_a_packing_cut_short_is_made_again(fake_yade: FakeYade, write_study: WriteStudy) -> None:
    study = write_study([1])
    results = study.parent / "results"
    assert cli.main(["run", str(study), "--out", str(results)]) == 0
    (packing,) = (results / "packings").glob("*.npz")
    whole = packing.read_bytes()
    packing.write_bytes(whole[:-20])
    next((results / "runs").iterdir()).joinpath("run.json").unlink()
    assert cli.main(["run", str(study), "--out", str(results)]) == 0
    assert packing.stat().st_size == len(whole)
    assert fake_yade.calls() == ["packing.py 1", "biaxial.py 1"] * 2


STUDY = """
name = "small"
seeds = [1, 2]
[parameters]
particle_count = 100
final_axial_strain = 0.015
[run]
solid_fraction_low = 0.75
servo_bound = 0.2
unbalanced_force_bound = 0.5
kinetic_over_elastic_bound = 1
"""
LARGEST_FILE = 12_000  # bytes: a packing of a hundred discs has 5, a snapshot 25 kB


@pytest.mark.yade
def test_real_runs_end_with_their_harness_and_come_out_the_same(
    tmp_path: Path, campaign_of: Callable[[Path], Campaign]
) -> None:
    study = tmp_path / "small.toml"
    study.write_text(STUDY)
    campaign = campaign_of(study)

    campaign.start(largest_file=LARGEST_FILE)  # as a full disk: the kernel ends a write midway
    status, told = campaign.end()
    assert status == 3
    assert told.count("OSError: [Errno 27] File too large") == 2

    campaign.start()
    runs = [campaign.process_of(seed) for seed in (1, 2)]
    os.kill(runs[0], signal.SIGKILL)
    campaign.signal(signal.SIGKILL)
    assert campaign.end()[0] == -9
    wait_for(lambda: all(gone(pid) for pid in runs), 5)
    before = campaign.content()

    status, told = campaign.launch()
    assert status == 0, told
    assert {state for state, _ in campaign.states().values()} == {"done"}
    assert unchanged(before, campaign.content())
    assert all(campaign.folder(seed).stat().st_mode & 0o777 == 0o700 for seed in (1, 2))

    undisturbed = tmp_path / "undisturbed"
    assert cli.main(["run", str(study), "--out", str(undisturbed)]) == 0
    for folder in (undisturbed / "runs").iterdir():
        ours, theirs = (
            json.loads((runs / folder.name / "run.json").read_text())["products"]["files"]
            for runs in (undisturbed / "runs", campaign.results / "runs")
        )
        assert ours == theirs  # every file, to its last byte
