"""Does a run keep its promises: repeatable, whole, spaced as asked, confined as asked, honest about failure?"""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from yade_run_files import BIAXIAL, ROOT, SMALL, RunScript, history_of, manifest_of, snapshot_of

from yade_scripts import export_format, parameters

pytestmark = pytest.mark.yade


def files_of(run: Path) -> dict[str, bytes]:
    """Products of a run, and the packing it began with."""
    manifest = manifest_of(run)
    content = {name: (run / name).read_bytes() for name in manifest["products"]["files"]}
    packings = (run if run.parent.name != "runs" else run.parent.parent) / "packings"
    content["packing"] = (packings / manifest["preparation"]["packing"]).read_bytes()
    return content


def test_the_same_seed_gives_the_same_bytes(rough: Path, make_run: Callable[..., Path], tmp_path: Path) -> None:
    again = make_run(tmp_path / "runs" / "again")
    assert files_of(again) == files_of(rough)


def test_the_yade_command_gives_the_same_bytes(rough: Path, make_run: Callable[..., Path], tmp_path: Path) -> None:
    short = make_run(tmp_path / "runs" / "short", by_command=True, final_axial_strain=0.003)
    made, expected = files_of(short), files_of(rough)
    history = made.pop(export_format.HISTORY).splitlines()
    assert history == expected.pop(export_format.HISTORY).splitlines()[: len(history)]
    assert len(made) == 5  # four snapshots and the packing
    assert made == {name: expected[name] for name in made}


def test_another_seed_gives_another_run(rough: Path, make_run: Callable[..., Path], tmp_path: Path) -> None:
    other = make_run(tmp_path / "other", seed=8, final_axial_strain=0.001)
    assert (other / "packings" / manifest_of(other)["preparation"]["packing"]).is_file()
    ours, theirs = snapshot_of(rough, 0), snapshot_of(other, 0)
    assert not np.array_equal(ours["particle_x"], theirs["particle_x"])


def test_products_are_whole(rough: Path) -> None:
    manifest = manifest_of(rough)
    assert manifest["status"] == "done"
    assert set(manifest["parameters"]) == set(parameters.check({}))
    products = manifest["products"]
    for name, entry in products["files"].items():
        content = (rough / name).read_bytes()
        assert (len(content), hashlib.sha256(content).hexdigest()) == (entry["bytes"], entry["sha256"])
    found = sorted(path.name for path in (rough / export_format.SNAPSHOTS).iterdir())
    assert found == [f"{export_format.snapshot_name(index)}.npz" for index in range(len(products["snapshots"]))]
    assert products["history_rows"] == len(history_of(rough)) == 301
    assert [entry["index"] for entry in products["snapshots"]] == list(range(31))
    names = ["axial_strain", "time", "iteration"]
    names += [f"particle_{column.name}" for column in export_format.PARTICLE_COLUMNS]
    names += [f"contact_{column.name}" for column in export_format.CONTACT_COLUMNS]
    snapshot = snapshot_of(rough, 30)
    assert sorted(snapshot) == sorted(names)
    assert all(np.isfinite(values).all() for values in snapshot.values())
    np.testing.assert_array_equal(snapshot["particle_id"], np.arange(200))
    assert (history_of(rough).dtype.names or ()) == tuple(export_format.names(export_format.HISTORY_COLUMNS))
    assert not [path for path in rough.rglob(".*") if path.is_file()], "temporary files left"


def test_strains_are_equally_spaced(rough: Path) -> None:
    strains = [entry["axial_strain"] for entry in manifest_of(rough)["products"]["snapshots"]]
    np.testing.assert_allclose(strains, 1e-3 * np.arange(31), atol=1e-12)
    np.testing.assert_allclose(history_of(rough)["axial_strain"], 1e-4 * np.arange(301), atol=1e-12)


def test_snapshots_can_be_denser(make_run: Callable[..., Path], rough: Path) -> None:
    run = make_run(
        rough.parent / "dense",
        final_axial_strain=0.004,
        dense_strain_intervals="0.001:0.002",
        dense_snapshot_interval=2.5e-4,
    )
    strains = [entry["axial_strain"] for entry in manifest_of(run)["products"]["snapshots"]]
    np.testing.assert_allclose(strains, [0, 1e-3, 1.25e-3, 1.5e-3, 1.75e-3, 2e-3, 3e-3, 4e-3], atol=1e-12)


def test_preparation_and_confining_stress_are_within_bounds(rough: Path, smooth: Path) -> None:
    for run in (rough, smooth):
        manifest = manifest_of(run)
        preparation, validity = manifest["preparation"], manifest["validity"]
        assert preparation["settled"]
        assert 0.83 < preparation["solid_fraction"] < 0.87
        assert 3.5 < preparation["coordination"] < 4.5
        assert preparation["unbalanced_force"] <= 1e-4
        assert validity["servo_error_max"] < 0.02
        assert validity["escaped_discs"] == 0
        assert validity["inertial_number"] == pytest.approx(1e-4, rel=0.02)
        history = history_of(run)
        np.testing.assert_allclose(history["lateral_stress"].mean(), 700, rtol=1e-3)
        assert np.abs(history["servo_error"][1:]).max() == validity["servo_error_max"]
        assert np.abs(history["lateral_stress"][1:] / 700 - 1).max() == pytest.approx(
            validity["servo_error_instant_max"]
        )
        # The first row is the packing at rest: nothing has moved yet.
        assert history["unbalanced_force"][0] < 1e-3
        assert history["kinetic_energy"][0] == 0


def test_one_packing_serves_both_frictions(rough: Path, smooth: Path) -> None:
    packings = [manifest_of(run)["preparation"]["packing"] for run in (rough, smooth)]
    assert packings[0] == packings[1]
    for name in ("particle_x", "particle_y", "contact_fn"):
        np.testing.assert_array_equal(snapshot_of(rough, 0)[name], snapshot_of(smooth, 0)[name])


def test_packing_alone_is_the_same(rough: Path, run_script: RunScript, tmp_path: Path) -> None:
    file = tmp_path / "p.json"
    file.write_text(json.dumps(SMALL))
    done = run_script(ROOT / "yade_scripts" / "packing.py", file, "--packings", tmp_path / "kept")
    assert done.returncode == 0, done.stderr
    (made,) = (tmp_path / "kept").iterdir()
    assert made.read_bytes() == (rough.parent.parent / "packings" / made.name).read_bytes()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ('{"roling_friction": 0.1}', "did you mean 'rolling_friction'?"),
        ('{"friction": -1}', "friction: expected a number from 0"),
        ('{"dense_strain_intervals": "0.2-0.3"}', "expected BEGIN:END"),
        ("[1]", "expected one JSON object"),
        ("{", "expected JSON"),
    ],
)
def test_bad_parameters_are_one_line_and_status_2(
    run_script: RunScript, tmp_path: Path, content: str, told: str
) -> None:
    file = tmp_path / "p.json"
    file.write_text(content)
    done = run_script(BIAXIAL, file)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == [file]


def test_a_failed_run_says_so(run_script: RunScript, tmp_path: Path) -> None:
    file = tmp_path / "p.json"
    file.write_text(json.dumps(SMALL))
    (tmp_path / "packings").write_text("in the way")
    done = run_script(BIAXIAL, file)
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    manifest = manifest_of(tmp_path)
    assert manifest["status"] == "failed"
    assert len(manifest["failure"].splitlines()) == 1
    assert "Error" in manifest["failure"]
    assert manifest["parameters"]["seed"] == {"value": 7, "unit": "-"}


def test_help_needs_no_yade(yade, tmp_path: Path) -> None:
    done = subprocess.run(
        [*(yade.python or ("python3",)), str(BIAXIAL), "--help"],
        env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "PARAMETERS.json" in done.stdout
