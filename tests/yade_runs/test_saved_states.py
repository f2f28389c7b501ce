"""States that YADE saved, read through YADE: the same tables as our export wrote while the simulation stood there."""

from __future__ import annotations

import json
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from yade_run_files import ROOT, RunScript

from forcechain.observe.snapshot import Snapshot
from harness import cli
from harness.reading.exports import read_run

pytestmark = pytest.mark.yade


@pytest.fixture(scope="session")
def saved(run_script: RunScript, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A folder with three saved states and the snapshots of the same instants, and the walls' bodies."""
    out = tmp_path_factory.mktemp("saved")
    script = Path(__file__).with_name("save_states.py")
    ended = run_script(script, ROOT, tmp_path_factory.mktemp("packings"), out)
    assert ended.returncode == 0, ended.stderr
    return out, ended.stdout.split()[-4:]


def line(capsys: pytest.CaptureFixture[str]) -> str:
    told = capsys.readouterr().err.strip()
    assert "\n" not in told
    return told


def differences(one: Snapshot, other: Snapshot, tolerance: float) -> list[str]:
    found = []
    for item in fields(Snapshot):
        if item.name == "axial_strain":
            continue
        a, b = np.asarray(getattr(one, item.name)), np.asarray(getattr(other, item.name))
        if a.shape != b.shape or not np.allclose(a, b, rtol=tolerance, atol=tolerance * 1e-6):
            found.append(item.name)
    return found


def test_saved_states_give_what_the_export_gave(saved: tuple[Path, list[str]], tmp_path: Path) -> None:
    out, walls = saved
    assert cli.main(["import", str(out / "states"), "--from", "yade", "--out", str(tmp_path / "new")]) == 0
    ours, theirs = read_run(out), read_run(tmp_path / "new")
    assert theirs.n_snapshots == 3
    for one, other in zip(ours.snapshots(), theirs.snapshots(), strict=True):
        assert differences(one, other, 1e-12) == []
    assert differences(one, ours.snapshot(0), 1e-12) != []  # the comparison can fail
    # since the first state, not since the start; from the contacts, not from the walls' places
    expected = 1 - (1 - ours.axial_strain) / (1 - ours.axial_strain[0])
    assert expected[2] > 5e-3
    np.testing.assert_allclose(theirs.axial_strain, expected, atol=1e-4)
    assert theirs.history is not None
    np.testing.assert_array_equal(theirs.history["axial_strain"], theirs.axial_strain)
    assert (theirs.history["stress_ratio"] > 0.1).all()
    origin = json.loads((tmp_path / "new" / "origin.json").read_text())
    assert origin["source"] == ["state0.xml", "state1.yade.bz2", "state2.yade"]
    assert origin["yade_version"]
    found = {part.split()[2]: part.split()[1] for part in origin["notes"][1].removeprefix("walls: ").split(", ")}
    assert found == dict(wall.split("=") for wall in walls)


def test_one_state_and_named_walls(saved: tuple[Path, list[str]], tmp_path: Path) -> None:
    out, walls = saved
    named = [part for wall in walls for part in ("--wall", wall)]
    source = str(out / "states" / "state1.yade.bz2")
    assert cli.main(["import", source, "--from", "yade", "--out", str(tmp_path / "new"), *named]) == 0
    run = read_run(tmp_path / "new")
    assert run.axial_strain.tolist() == [0.0]
    assert differences(run.snapshot(0), read_run(out).snapshot(1), 1e-12) == []


def test_what_does_not_load_is_said_in_one_line(
    saved: tuple[Path, list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, walls = saved
    broken = tmp_path / "broken.xml"
    broken.write_bytes((out / "states" / "state0.xml").read_bytes()[:2000])
    foreign = tmp_path / "foreign.xml"
    foreign.write_text("<?xml version='1.0'?><nothing/>")
    place = ["--from", "yade", "--out", str(tmp_path / "new")]
    for path in (broken, foreign):
        assert cli.main(["import", str(path), *place]) == 2
        assert path.name in line(capsys)
    assert cli.main(["import", str(out / "with-a-stray-body.xml"), *place]) == 2
    assert "touches a disc and is no known wall; name it by --wall" in line(capsys)
    assert cli.main(["import", str(out / "states"), *place, "--wall", "ceiling=3"]) == 2
    assert "--wall ceiling=3: expected one of left, right, bottom, top, punch" in line(capsys)
    assert cli.main(["import", str(out / "states"), *place, "--wall", walls[0]]) == 2
    assert "is no known wall" in line(capsys)
    (tmp_path / "empty").mkdir()
    assert cli.main(["import", str(tmp_path / "empty"), *place]) == 2
    assert "expected states saved by YADE" in line(capsys)
    assert not (tmp_path / "new").exists()


def test_without_yade_the_remedy_is_told(
    saved: tuple[Path, list[str]], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("YADE_COMMAND", raising=False)
    monkeypatch.setenv("PATH", "")
    assert shutil.which("yade") is None
    assert cli.main(["import", str(saved[0] / "states"), "--from", "yade", "--out", str(tmp_path / "new")]) == 3
    assert "YADE is not found; install it" in line(capsys)
