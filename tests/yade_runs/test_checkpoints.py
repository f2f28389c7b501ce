"""Does a killed run go on from where it last saved its state, and say so?"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mechanics import unbalanced
from yade_run_files import BIAXIAL, SMALL, RunScript, history_of, manifest_of, snapshot_of

from harness import cli
from harness.study import read_study
from yade_scripts import export_format

pytestmark = pytest.mark.yade


def test_a_killed_run_goes_on(
    rough: Path, killed_at_checkpoint: Callable[..., None], run_script: RunScript, tmp_path: Path
) -> None:
    file = tmp_path / "p.json"
    file.write_text(json.dumps(SMALL))
    killed_at_checkpoint(file)
    assert not (tmp_path / export_format.MANIFEST).exists()
    done = run_script(BIAXIAL, file)
    assert done.returncode == 0, done.stderr

    manifest = manifest_of(tmp_path)
    (mark,) = manifest["continued"]
    assert 0 < mark["axial_strain"] < 0.03
    assert not list(tmp_path.glob("*checkpoint*"))
    kept, whole = manifest["products"], manifest_of(rough)["products"]
    assert manifest_of(rough)["continued"] == []
    assert kept["files"].keys() == whole["files"].keys()
    before = [entry["index"] for entry in kept["snapshots"] if entry["axial_strain"] < mark["axial_strain"]]
    for index in before:
        name = f"snapshots/{export_format.snapshot_name(index)}.npz"
        assert kept["files"][name] == whole["files"][name]
    # The rest is the same test, if not the same bits: soon after the break it is the same to many digits.
    again, once = history_of(tmp_path), history_of(rough)
    np.testing.assert_allclose(again["axial_strain"], once["axial_strain"], atol=1e-12)
    after = int(mark["axial_strain"] / 1e-4) + 2
    for name in ("stress_ratio", "solid_fraction", "elastic_energy"):
        np.testing.assert_allclose(again[name][:after], once[name][:after], rtol=1e-6, atol=1e-9, err_msg=name)
    assert again["stress_ratio"][-1] == pytest.approx(once["stress_ratio"][-1], abs=0.01)
    force, moment = unbalanced(snapshot_of(tmp_path, 30))
    assert max(force, moment) < 0.01


def test_a_study_goes_on_where_its_runs_were_killed(
    rough: Path, killed_at_checkpoint: Callable[..., None], tmp_path: Path
) -> None:
    study = tmp_path / "study.toml"
    asked = "\n".join(f"{name} = {value}" for name, value in SMALL.items() if name != "seed")
    study.write_text(f"name = 'one'\nseeds = [{SMALL['seed']}]\n[parameters]\n{asked}\n")
    (run,) = read_study(study).planned_runs()
    results = tmp_path / "results"
    folder = results / "runs" / run.run_id
    folder.mkdir(parents=True)
    file = folder / export_format.PARAMETERS
    file.write_text(json.dumps(dict(run.parameters)))
    killed_at_checkpoint(file)
    (folder / export_format.LOG).write_text("killed")
    (folder / export_format.MANIFEST).write_text(
        json.dumps({"format": 1, "status": "failed", "failure": "was killed", "parameters": {}})
    )
    assert cli.main(["run", str(study), "--out", str(results)]) == 0
    assert len(manifest_of(folder)["continued"]) == 1
    kept = {path.name for path in (results / "failed" / f"{run.run_id}.1").iterdir()}
    assert kept == {export_format.LOG, export_format.MANIFEST}
    ours, whole = manifest_of(folder)["products"], manifest_of(rough)["products"]
    assert ours["files"].keys() == whole["files"].keys()


def test_a_checkpoint_of_another_run_is_not_used(
    killed_at_checkpoint: Callable[..., None], run_script: RunScript, tmp_path: Path
) -> None:
    file = tmp_path / "p.json"
    file.write_text(json.dumps(SMALL))
    killed_at_checkpoint(file)
    file.write_text(json.dumps(SMALL | {"friction": 0.5, "final_axial_strain": 0.001}))
    done = run_script(BIAXIAL, file)
    assert done.returncode == 0, done.stderr
    manifest = manifest_of(tmp_path)
    assert manifest["continued"] == []
    assert sorted(path.name for path in (tmp_path / "snapshots").iterdir()) == ["000000.npz", "000001.npz"]
    assert snapshot_of(tmp_path, 1)["contact_friction"].max() == pytest.approx(0.5)
