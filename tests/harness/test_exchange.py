"""Export and import of format 1's CSV form and of ParaView's files: nothing is lost, nothing is invented."""

from __future__ import annotations

import base64
import json
from dataclasses import fields
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from buckling_study import write_buckling_run

from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.snapshot import Snapshot
from harness import cli
from harness.analysing.pipeline import analyse_run
from harness.reading.exports import read_run, read_snapshot
from yade_scripts import export_format

COUNTS = {"particles": ("NumberOfVerts", 1), "contacts": ("NumberOfLines", 2)}


@pytest.fixture(scope="module")
def buckling(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_buckling_run(tmp_path_factory.mktemp("study") / "runs" / "seed1", 1)


def same(one: Snapshot, other: Snapshot) -> bool:
    pairs = [(np.asarray(getattr(one, item.name)), np.asarray(getattr(other, item.name))) for item in fields(Snapshot)]
    return all(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in pairs)


def awkward(folder: Path) -> None:
    """Numbers that a careless writer rounds: denormal, negative zero, the last bit of a third, huge."""
    path = folder / "snapshots" / "000001.npz"
    with np.load(path) as archive:
        arrays = dict(archive)
    n = len(arrays["particle_vx"])
    arrays["particle_vx"] = np.resize([5e-324, -0.0, 1 / 3, 9.999999999999999e49, -1e-17], n)
    arrays["contact_ft"] = np.nextafter(arrays["contact_fn"] / 3, 1)
    np.savez(path, **arrays)
    (folder / "run.json").unlink()


def line(capsys: pytest.CaptureFixture[str]) -> str:
    told = capsys.readouterr().err.strip()
    assert "\n" not in told
    assert told.startswith("forcechain: ")
    return told


def test_csv_gives_back_every_bit(run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    awkward(run_folder)
    assert cli.main(["export", str(run_folder), "--to", "csv", "--out", str(tmp_path / "out")]) == 0
    told = tmp_path / "out" / run_folder.name
    assert capsys.readouterr().out == f"written: {told}\n"
    ours, theirs = read_run(run_folder), read_run(told)
    assert theirs.manifest is None
    np.testing.assert_array_equal(theirs.snapshot_index, ours.snapshot_index)
    np.testing.assert_array_equal(theirs.axial_strain, ours.axial_strain)
    assert all(same(one, other) for one, other in zip(ours.snapshots(), theirs.snapshots(), strict=True))
    assert ours.history is not None
    assert theirs.history is not None
    assert ours.history.equals(theirs.history)
    first = read_snapshot(told / "snapshots" / "000001.particles.csv")
    assert same(first, ours.snapshot(1))
    assert not same(first, ours.snapshot(2))  # the comparison can fail


def test_csv_and_back_is_the_same_run_to_the_analysis(buckling: Path, tmp_path: Path) -> None:
    study = buckling.parents[1]
    assert cli.main(["export", str(study), "--to", "csv"]) == 0
    tables = study / "export" / "csv" / "seed1"
    assert json.loads((tables / "origin.json").read_text())["parameters"]["seed"] == 1
    back = tmp_path / "back"
    assert cli.main(["import", str(tables), "--from", "csv", "--out", str(back), "--json"]) == 0
    assert (back / "snapshots" / "000044.npz").is_file()
    found = [analyse_run(read_run(folder), "one", AnalysisOptions()) for folder in (buckling, tables, back)]
    assert len(found[0].segments)
    for other in found[1:]:
        for name in ("segments", "yielding", "chains", "members"):
            one, two = (getattr(analysis, name).drop(columns="run") for analysis in (found[0], other))
            assert one.equals(two), name


def test_csv_import_makes_a_history_where_there_is_none(run_folder: Path, tmp_path: Path) -> None:
    for name in ("run.json", "history.csv"):
        (run_folder / name).unlink()
    assert cli.main(["import", str(run_folder), "--from", "csv", "--out", str(tmp_path / "new")]) == 0
    history = read_run(tmp_path / "new").history
    assert history is not None
    assert history["axial_strain"].tolist() == [0, 0.001, 0.002]
    # a square of 3 x 3 discs whose every contact bears 0.1 N: isotropic, coordination 4, 3 x 0.1 N over the side
    np.testing.assert_allclose(history["stress_ratio"], 0, atol=1e-12)
    np.testing.assert_allclose(history["coordination"], 4)
    np.testing.assert_allclose(history["axial_stress"], 0.3 / (6e-3 - 4e-6), rtol=1e-3)


def test_import_refuses_what_is_damaged_and_leaves_nothing(
    run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (run_folder / "run.json").unlink()
    path = run_folder / "snapshots" / "000002.npz"
    path.write_bytes(path.read_bytes()[:-500])
    assert cli.main(["import", str(run_folder), "--from", "csv", "--out", str(tmp_path / "new")]) == 2
    assert "000002.npz: expected an npz archive, found a broken one" in line(capsys)
    assert sorted(item.name for item in tmp_path.iterdir()) == [run_folder.name]


@pytest.mark.parametrize(
    ("arguments", "status", "expected"),
    [
        (["export", "{run}", "--to", "csv", "--out", "{taken}"], 2, "expected a new folder, found one with files"),
        (["export", "{nothing}", "--to", "csv"], 2, "found nothing of that name"),
        (["import", "{run}", "--from", "csv", "--out", "{run}"], 2, "expected a new folder, found one with files"),
        (["import", "{run}", "--from", "csv", "--out", "{file}"], 2, "expected a new folder, found a file"),
        (["import", "{nothing}", "--from", "csv"], 2, "expected a folder with tables in format 1"),
        (["import", "{run}", "--from", "csv", "--set", "friction=1"], 2, "no such setting; known: none with this"),
        (["import", "{run}", "--from", "csv", "--wall", "left=0"], 2, "--wall has no meaning with --from csv"),
        (["import", "{run}", "--from", "csv", "--pair-columns", "id1"], 2, "--pair-columns has no meaning"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(
    run_folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    expected: str,
) -> None:
    taken = tmp_path / "taken" / run_folder.name
    taken.mkdir(parents=True)
    (taken / "precious.txt").write_text("keep")
    file = tmp_path / "file"
    file.write_text("")
    places = {"run": run_folder, "taken": tmp_path / "taken", "nothing": tmp_path / "nothing", "file": file}
    assert cli.main([argument.format(**places) for argument in arguments]) == status
    assert expected in line(capsys)
    assert (taken / "precious.txt").read_text() == "keep"


def test_a_run_that_failed_is_left_out(run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = json.loads((run_folder / "run.json").read_text())
    (run_folder / "run.json").write_text(json.dumps(manifest | {"status": "failed", "failure": "it burst"}))
    assert cli.main(["export", str(run_folder), "--to", "vtk", "--out", str(tmp_path / "out")]) == 3
    assert "failed: it burst" in line(capsys)


def arrays_of(parent: Any) -> dict[str, np.ndarray]:
    """Decode the arrays of an element of a VTK XML file, as its documentation has it: UInt64 length, then the bytes."""
    found = {}
    for element in parent:
        payload = base64.b64decode(element.text.strip(), validate=True)
        length = int.from_bytes(payload[:8], "little")
        assert len(payload) == 8 + length
        values = np.frombuffer(payload[8:], {"Float64": "<f8", "Int64": "<i8"}[element.get("type")])
        width = int(element.get("NumberOfComponents", 1))
        found[element.get("Name")] = values.reshape(-1, width) if width > 1 else values
    return found


def read_vtp(path: Path, kind: str) -> tuple[dict[str, Any], np.ndarray]:
    root = Xml.parse(path).getroot()
    assert (root.get("type"), root.get("header_type"), root.get("byte_order")) == ("PolyData", "UInt64", "LittleEndian")
    piece = root.find("PolyData/Piece")
    assert piece is not None
    points = arrays_of(piece.find("Points"))["points"]
    assert points.shape == (int(piece.get("NumberOfPoints")), 3)
    name, size = COUNTS[kind]
    cells = arrays_of(piece.find("Verts" if kind == "particles" else "Lines"))
    n_cells = int(piece.get(name))
    np.testing.assert_array_equal(cells["offsets"], size * np.arange(1, n_cells + 1))
    np.testing.assert_array_equal(cells["connectivity"], np.arange(size * n_cells))
    data = arrays_of(piece.find("PointData" if kind == "particles" else "CellData"))
    assert {len(values) for values in data.values()} == {n_cells}
    return data | {"field": arrays_of(root.find("PolyData/FieldData"))}, points


def test_vtk_has_every_particle_and_contact(buckling: Path, tmp_path: Path) -> None:
    assert cli.main(["export", str(buckling), "--to", "vtk", "--out", str(tmp_path)]) == 0
    out, run = tmp_path / "seed1", read_run(buckling)
    for kind in COUNTS:
        series = Xml.parse(out / f"{kind}.pvd").getroot().findall("Collection/DataSet")
        assert [item.get("file") for item in series] == [f"{kind}/{number:06d}.vtp" for number in range(45)]
        np.testing.assert_array_equal([float(item.get("timestep")) for item in series], run.axial_strain)
        assert all((out / item.get("file")).is_file() for item in series)
    snapshot = run.snapshot(30)
    data, points = read_vtp(out / "particles" / "000030.vtp", "particles")
    np.testing.assert_array_equal(points[:, :2], snapshot.position)
    np.testing.assert_array_equal(data["radius"], snapshot.radius)
    np.testing.assert_array_equal(data["rotation"], snapshot.rotation)
    np.testing.assert_array_equal(data["velocity"][:, :2], snapshot.velocity)
    assert data["field"]["axial_strain"].tolist() == [snapshot.axial_strain]
    chains = find_chains(snapshot, AnalysisOptions())
    np.testing.assert_array_equal(data["chain"], chains.label)
    assert chains.n_chains == 4  # the four columns
    np.testing.assert_array_equal(np.unique(data["chain"]), [-1, 0, 1, 2, 3])
    np.testing.assert_allclose(data["major_direction"][:, 2], 0)
    assert (data["major_stress"] >= data["minor_stress"]).all()
    data, points = read_vtp(out / "contacts" / "000030.vtp", "contacts")
    np.testing.assert_array_equal(data["normal_force"], snapshot.normal_force)
    np.testing.assert_array_equal(np.column_stack((data["id1"], data["id2"])), snapshot.contact_ids)
    ends = points.reshape(-1, 2, 3)[:, :, :2]
    np.testing.assert_array_equal(ends[:, 0], snapshot.position[snapshot.contact_ids[:, 0]])
    wall = snapshot.contact_ids[:, 1] < 0
    np.testing.assert_array_equal(ends[wall, 1], snapshot.contact_point[wall])
    np.testing.assert_array_equal(ends[~wall, 1], snapshot.position[snapshot.contact_ids[~wall, 1]])
    np.testing.assert_array_equal(data["wall"], wall)


def test_vtk_takes_a_sample_without_contacts_and_times_that_stand_still(run_folder: Path, tmp_path: Path) -> None:
    (run_folder / "run.json").unlink()
    for path in run_folder.glob("snapshots/*.npz"):
        with np.load(path) as archive:
            arrays = {name: values[:0] if name.startswith("contact_") else values for name, values in archive.items()}
        np.savez(path, **arrays | {"time": 0.0})
    assert cli.main(["export", str(run_folder), "--to", "vtk", "--out", str(tmp_path / "out")]) == 0
    out = tmp_path / "out" / run_folder.name
    times = [item.get("timestep") for item in Xml.parse(out / "contacts.pvd").getroot().iter("DataSet")]
    assert times == ["0.0", "1.0", "2.0"]
    data, points = read_vtp(out / "particles" / "000000.vtp", "particles")
    assert len(points) == 9
    assert data["chain"].tolist() == [-1] * 9
    _, points = read_vtp_without_cells(out / "contacts" / "000000.vtp")
    assert points.shape == (0, 3)


def read_vtp_without_cells(path: Path) -> tuple[dict[str, Any], np.ndarray]:
    piece = Xml.parse(path).getroot().find("PolyData/Piece")
    assert piece is not None
    assert piece.get("NumberOfLines") == "0"
    return arrays_of(piece.find("CellData")), arrays_of(piece.find("Points"))["points"]


def test_the_formats_are_documented() -> None:
    text = (Path(__file__).parents[2] / "docs" / "formats.md").read_text()
    tables = (export_format.PARTICLE_COLUMNS, export_format.CONTACT_COLUMNS, export_format.HISTORY_COLUMNS)
    missing = [column.name for table in tables for column in table if f"`{column.name}`" not in text]
    assert missing == []
