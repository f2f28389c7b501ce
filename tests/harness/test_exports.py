"""Reading run folders: what is good comes through unchanged, what is broken ends in one line that says where."""

from __future__ import annotations

import csv
import json
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness.errors import InputError, RunError
from harness.reading.exports import is_run, read_run, read_snapshot, run_folders
from yade_scripts import export_format

Rewrite = Callable[..., None]
FN = np.full(24, 0.1)


def message(folder: Path, kind: type[Exception] = InputError) -> str:
    with pytest.raises(kind) as caught:
        for _ in read_run(folder).snapshots():
            pass
    text = str(caught.value)
    assert "\n" not in text
    assert folder.name in text
    return text


def to_csv(folder: Path) -> Path:
    """Turn a run's snapshots into CSV tables of other origin, at the folder's top."""
    index = []
    for path in sorted(folder.glob("snapshots/*.npz")):
        with np.load(path) as archive:
            for prefix in ("particle", "contact"):
                names = [name for name in archive.files if name.startswith(prefix + "_")]
                with (folder / f"{path.stem}.{prefix}s.csv").open("w", newline="") as file:
                    writer = csv.writer(file)
                    writer.writerow([name.removeprefix(prefix + "_") for name in names])
                    writer.writerows(zip(*(archive[name].tolist() for name in names), strict=True))
            index.append((int(path.stem), float(archive["axial_strain"]), float(archive["time"])))
    with (folder / "snapshots.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("index", "axial_strain", "time"), *index])
    shutil.rmtree(folder / "snapshots")
    (folder / "run.json").unlink()
    return folder


def edit_csv(path: Path, row: int, column: str, value: str) -> None:
    rows = list(csv.reader(path.read_text().splitlines()))
    rows[row + 1][rows[0].index(column)] = value
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)


def test_reads_a_run_as_it_was_written(run_folder: Path) -> None:
    run = read_run(run_folder)
    assert run.name == run_folder.name
    assert run.parameters["rolling_friction"] == 0.2
    assert run.n_snapshots == 3
    np.testing.assert_array_equal(run.snapshot_index, [0, 1, 2])
    np.testing.assert_allclose(run.axial_strain, [0, 0.001, 0.002])
    assert run.history is not None
    assert list(run.history.columns) == export_format.names(export_format.HISTORY_COLUMNS)
    assert run.history["iteration"].dtype == np.int64
    snapshot = run.snapshot(2)
    assert (snapshot.n_particles, snapshot.n_contacts, snapshot.iteration) == (9, 24, 20)
    with np.load(run_folder / "snapshots" / "000002.npz") as archive:
        for attribute, name in (
            ("radius", "particle_radius"),
            ("normal_force", "contact_fn"),
            ("tangential_force", "contact_ft"),
            ("rolling_limit", "contact_rolling_limit"),
        ):
            np.testing.assert_array_equal(getattr(snapshot, attribute), archive[name])
        np.testing.assert_array_equal(snapshot.position[:, 1], archive["particle_y"])
        np.testing.assert_array_equal(snapshot.contact_ids[:, 1], archive["contact_id2"])
    with pytest.raises(ValueError, match="read-only"):
        run.axial_strain[0] = 1


def test_tables_of_other_origin_read_the_same(run_folder: Path, tmp_path: Path) -> None:
    tables = to_csv(Path(shutil.copytree(run_folder, tmp_path / "own")))
    ours, theirs = read_run(run_folder), read_run(tables)
    assert theirs.manifest is None
    assert dict(theirs.parameters) == {}
    for one, other in zip(ours.snapshots(), theirs.snapshots(), strict=True):
        for name in ("axial_strain", "time", "position", "contact_ids", "contact_normal", "normal_force", "kr"):
            if hasattr(one, name):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    single = read_snapshot(tables / "000001.particles.csv")
    assert single.axial_strain == 0.001


def test_npz_without_manifest_needs_no_index_and_no_history(run_folder: Path) -> None:
    (run_folder / "run.json").unlink()
    (run_folder / "history.csv").unlink()
    run = read_run(run_folder)
    assert run.history is None
    np.testing.assert_allclose(run.axial_strain, [0, 0.001, 0.002])
    assert run.snapshot(1).iteration == 10


def test_rows_in_another_order_of_id_are_sorted(run_folder: Path, rewrite: Rewrite) -> None:
    with np.load(run_folder / "snapshots" / "000001.npz") as archive:
        turned = {name: archive[name][::-1] for name in archive.files if name.startswith("particle_")}
    expected = read_run(run_folder).snapshot(1)
    rewrite(run_folder, **turned)
    np.testing.assert_array_equal(read_run(run_folder).snapshot(1).position, expected.position)


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({"contact_fn": None}, "contacts: column 'contact_fn' [N] (normal force"),
        ({"particle_radius": None, "particle_radios": np.ones(9)}, "did you mean it by 'particle_radios'?"),
        ({"contact_fn": FN[:-1]}, "contacts: expected 24 rows in column 'fn', as in 'id1', found 23"),
        ({"contact_fn": FN.reshape(6, 4)}, "column fn: expected an array of shape (any,), found (6, 4)"),
        ({"contact_fn": np.where(np.arange(24) == 7, np.nan, FN)}, "contacts row 7, column 'fn': expected a finite"),
        ({"particle_x": np.where(np.arange(9) == 2, np.inf, 0.0)}, "particles row 2, column 'x': expected a finite"),
        ({"contact_fn": np.full(24, "0.1")}, "column 'fn': expected numbers, found <U3"),
        ({"contact_id2": np.full(24, 4071)}, "contacts row 0: id2=4071 is not a particle or a wall (9 particles)"),
        ({"contact_id1": np.full(24, -1)}, "contacts row 0: id1=-1 is not a particle (9 particles)"),
        ({"contact_id1": np.full(24, 0.5)}, "contacts row 0, column 'id1': expected a whole number, found 0.5"),
        ({"contact_id1": np.zeros(24, int), "contact_id2": np.ones(24, int)}, "contact of 0 and 1 is there twice"),
        ({"particle_id": np.array([0, 1, 2, 3, 4, 5, 6, 7, 7])}, "particles row 8, column 'id': 7 is there twice"),
        ({"particle_id": np.arange(1, 10)}, "particles row 8, column 'id': expected 0 to 8 (9 particles), found 9"),
        ({"contact_nx": np.full(24, 2.0)}, "expected a unit normal"),
        ({"particle_radius": np.zeros(9)}, "expected a positive radius, found 0"),
        ({"axial_strain": None}, "axial_strain: expected one number, found nothing"),
        ({"axial_strain": np.zeros(3)}, "axial_strain: expected one number, found float64 of shape (3,)"),
        ({"axial_strain": 0.5}, "expected axial strain 0.001, as the index of snapshots says, found 0.5"),
        ({"contact_fn": np.array([object()] * 24)}, "expected an npz archive of plain numbers"),
    ],
)
def test_a_broken_snapshot_is_named(run_folder: Path, rewrite: Rewrite, arrays: dict[str, Any], expected: str) -> None:
    rewrite(run_folder, **arrays)
    text = message(run_folder)
    assert expected in text
    assert "000001" in text


def test_a_truncated_npz_is_named(run_folder: Path) -> None:
    path = run_folder / "snapshots" / "000001.npz"
    path.write_bytes(path.read_bytes()[:-1000])
    assert "000001.npz: expected an npz archive, found a broken one" in message(run_folder)


@pytest.mark.parametrize("content", [b"", pickle.dumps([1, 2]), b"\x93NUMPY broken"])
def test_a_foreign_file_is_not_read(run_folder: Path, content: bytes) -> None:
    (run_folder / "snapshots" / "000001.npz").write_bytes(content)
    assert "000001.npz: expected an npz archive" in message(run_folder)


def test_a_changed_snapshot_disagrees_with_the_manifest(run_folder: Path, rewrite: Rewrite) -> None:
    rewrite(run_folder, vouched=False, contact_fn=FN * 2)
    assert "000001.npz: its content has changed since the run (sha256 differs), against run.json" in message(run_folder)
    (run_folder / "run.json").unlink()
    assert read_run(run_folder).snapshot(1).normal_force[0] == 0.2


def test_a_missing_snapshot_is_named(run_folder: Path) -> None:
    (run_folder / "snapshots" / "000001.npz").unlink()
    assert "snapshot 1 is missing: expected 000001.npz" in message(run_folder)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"format": 2}, "expected format 1, found 2"),
        ({"format": None}, "expected format 1, found None"),
        ({"status": "fine"}, "expected status 'done' or 'failed', found 'fine'"),
        ({"parameters": 3}, "expected 'parameters' to be of kind dict, found 3"),
        ({"products": {}}, "expected 'files' to be of kind dict, found nothing"),
        ({"products": {"files": {}, "snapshots": [{"index": 0}]}}, "entry 0: expected an index and an axial_strain"),
        ({"products": {"files": {}, "snapshots": []}}, "it has no snapshot"),
    ],
)
def test_a_broken_manifest_is_named(run_folder: Path, changes: dict[str, Any], expected: str) -> None:
    path = run_folder / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    assert expected in message(run_folder)


def test_a_manifest_cut_short_is_named(run_folder: Path) -> None:
    path = run_folder / "run.json"
    path.write_text(path.read_text()[:-100])
    assert "run.json is not JSON" in message(run_folder)


def test_snapshots_there_twice_are_named(run_folder: Path) -> None:
    path = run_folder / "run.json"
    manifest = json.loads(path.read_text())
    manifest["products"]["snapshots"].append({"index": 1, "axial_strain": 0.001})
    path.write_text(json.dumps(manifest))
    assert "snapshot 1 is there twice" in message(run_folder)


def test_a_failed_run_and_an_unfinished_one_are_not_read(run_folder: Path) -> None:
    path = run_folder / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"status": "failed", "failure": "the servo was lost"}))
    assert "failed: the servo was lost; see yade.log" in message(run_folder, RunError)
    path.unlink()
    (run_folder / "parameters.json").write_text("{}")
    assert "it has not ended: run.json is missing" in message(run_folder, RunError)


@pytest.mark.parametrize(
    ("row", "column", "value", "expected"),
    [
        (1, "stress_ratio", "", "history row 1, column 'stress_ratio': expected a number, found ''"),
        (1, "stress_ratio", "nan", "history row 1, column 'stress_ratio': expected a finite number, found nan"),
        (2, "stress_ratio", "high", "history row 2, column 'stress_ratio': expected a number, found 'high'"),
        (0, "iteration", "0.5", "history row 0, column 'iteration': expected a whole number, found 0.5"),
        (0, "time", "12", "history.csv: expected"),
    ],
)
def test_a_broken_history_is_named(run_folder: Path, row: int, column: str, value: str, expected: str) -> None:
    edit_csv(run_folder / "history.csv", row, column, value)
    assert expected in message(run_folder)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "history.csv: the table is empty"),
        (b"axial_strain,axial_strain\n0,0\n", "column 'axial_strain' is there twice"),
        (
            b"strain\n0\n",
            "history: column 'axial_strain' (engineering strain along y,",
        ),
        (b"axial_strain,time\n0,0\n0,0,0\n", "history.csv: row 1: expected 2 values as in the header, found 3"),
        (b"axial_strain,time\n0,0\n0\n", "history.csv: row 1: expected 2 values as in the header, found 1"),
        (b"\xff\xfe\x00", "history.csv: expected CSV text in UTF-8"),
    ],
)
def test_a_history_of_other_origin_is_checked_too(run_folder: Path, content: bytes, expected: str) -> None:
    to_csv(run_folder)
    (run_folder / "history.csv").write_bytes(content)
    assert expected in message(run_folder)


def test_broken_csv_snapshots_are_named(run_folder: Path) -> None:
    to_csv(run_folder)
    edit_csv(run_folder / "000001.contacts.csv", 5, "id2", "99")
    assert "000001: contacts row 5: id2=99 is not a particle or a wall" in message(run_folder)
    edit_csv(run_folder / "000001.contacts.csv", 5, "fn", "strong")
    assert "000001.contacts.csv: contacts row 5, column 'fn': expected a number, found 'strong'" in message(run_folder)
    (run_folder / "000001.contacts.csv").unlink()
    assert "000001.contacts.csv: no such file" in message(run_folder)


def test_csv_snapshots_need_their_strain(run_folder: Path) -> None:
    to_csv(run_folder)
    index = run_folder / "snapshots.csv"
    lines = index.read_text().splitlines()
    index.write_text("\n".join(lines[:-1]))
    assert "there are tables of snapshot 000002 but no row for them" in message(run_folder)
    index.unlink()
    assert "expected snapshots.csv with the columns index, axial_strain, time" in message(run_folder)


def test_runs_are_found_in_a_run_a_study_and_a_folder_of_runs(run_folder: Path, tmp_path: Path) -> None:
    assert is_run(run_folder)
    assert run_folders(run_folder) == (run_folder,)
    assert run_folders(tmp_path) == (run_folder,)
    study = tmp_path / "study" / "runs"
    study.mkdir(parents=True)
    moved = Path(shutil.move(run_folder, study))
    assert run_folders(study.parent) == (moved,)


def test_no_run_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no run in it"):
        run_folders(tmp_path)
    with pytest.raises(InputError, match="expected the folder of a run or of a study, found nothing of that name"):
        run_folders(tmp_path / "none")
