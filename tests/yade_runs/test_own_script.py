"""Can a script of one's own write runs that the harness reads, judges and analyses?"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mechanics import unbalanced
from yade_run_files import ROOT, history_of, manifest_of, snapshot_of

from harness import cli
from harness.reading.exports import read_run, run_folders
from yade_scripts import measures

pytestmark = pytest.mark.yade


@pytest.mark.usefixtures("yade")
def test_the_example_in_a_study(tmp_path: Path) -> None:
    script = ROOT / "docs" / "examples" / "oedometer.py"
    study = tmp_path / "study.toml"
    study.write_text(f"name = 'lid'\nscript = '{script}'\nseeds = [3]\n[parameters]\nfriction = 0.3\n")
    results = tmp_path / "results"
    assert cli.main(["run", str(study), "--out", str(results)]) == 0
    (folder,) = run_folders(results)
    run = read_run(folder)
    assert run.parameters["friction"] == 0.3
    assert run.history is not None
    strain, stress = run.history["axial_strain"].to_numpy(), run.history["axial_stress"].to_numpy()
    np.testing.assert_allclose(strain, 0.01 * np.arange(21), atol=1e-3)
    assert stress[0] == 0
    assert (np.diff(stress[-5:]) > 0).all()  # the loose lattice has collapsed, and the lid meets resistance
    for snapshot in run.snapshots():
        assert snapshot.n_particles == 64
    last = snapshot_of(folder, 20)
    assert np.abs(last["contact_ft"]).max() > 0
    assert (np.abs(last["contact_ft"]) <= 0.3 * last["contact_fn"] * (1 + 1e-9)).all()
    assert unbalanced(last)[0] == pytest.approx(run.history["unbalanced_force"].iloc[-1], rel=1e-9)


@pytest.mark.parametrize("index", [0, 10, 30])
def test_a_row_from_the_tables_is_the_row_of_our_own_run(rough: Path, index: int) -> None:
    history, derived = history_of(rough), manifest_of(rough)["derived"]
    expected = history[10 * index]
    snapshot = snapshot_of(rough, index)
    particles = {name.removeprefix("particle_"): values for name, values in snapshot.items() if "particle_" in name}
    contacts = {name.removeprefix("contact_"): values for name, values in snapshot.items() if "contact_" in name}
    start = (0, derived["initial_width"]["value"], 0, derived["initial_height"]["value"])
    faces = (0, start[1] * (1 - expected["lateral_strain"]), 0, start[3] * (1 - expected["axial_strain"]))
    masses = np.full(200, derived["mean_mass"]["value"])
    inertias = masses * particles["radius"] ** 2 / 2
    row = measures.history_row(
        particles, contacts, faces, start, masses, inertias, snapshot["time"], snapshot["iteration"], 700.0
    )
    assert list(row) == list(history.dtype.names or ())
    for name, value in row.items():
        if name != "servo_error":  # ours is a mean since the row before
            assert value == pytest.approx(expected[name], rel=1e-8, abs=1e-12), name
    assert row["servo_error"] == pytest.approx(expected["lateral_stress"] / 700 - 1, abs=1e-9)
