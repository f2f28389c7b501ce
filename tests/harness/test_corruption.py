"""Damage of every kind, through the command line: refused in one line, read as the same, or read as the file now says.

A text without a checksum can be changed into another good text; then what is read must be what a plain reader of the
damaged file finds, not a number of anybody's making. Arrays damaged one by one are in test_damaged_tables.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import pickle
import shutil
import zipfile
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from buckling_study import write_buckling_run
from hypothesis import given, settings
from hypothesis import strategies as st
from run_folders import snapshot_arrays, write_manifest, write_run

from forcechain.observe.snapshot import Snapshot
from harness import cli
from harness.errors import HarnessError
from harness.reading import tables
from harness.reading.exports import read_run
from yade_scripts import export_format

NPZ = Path("snapshots") / "000001.npz"
FILES = ("snapshots/000001.particles.csv", "snapshots/000001.contacts.csv", "snapshots/snapshots.csv", "history.csv")
HOSTILE = ("", " ", "x", "nan", "inf", "-inf", "1e400", "-1", "0", "1e300", "-1e-300", "9" * 400, "0.5", "None", "1,2")
HOSTILE += ("1e2147483648", "0x10", "1_000", "٣", "\x00", '"', "__import__('os')", "2**8", "é", "9223372036854775808")
TEXT_DAMAGE = (
    "row gone",
    "row twice",
    "rows swapped",
    "column gone",
    "column twice",
    "columns swapped",
    "cell",
    "cells",
)
TEXT_DAMAGE += ("header", "cut", "flip", "insert", "empty", "other bytes")
MANY = settings(max_examples=250, deadline=None, derandomize=True, database=None)
SOME = settings(MANY, max_examples=120)


def snapshots_equal(one: Snapshot, other: Snapshot) -> bool:
    return all(np.array_equal(getattr(one, item.name), getattr(other, item.name)) for item in fields(Snapshot))


def same_run(one: list[Snapshot], other: list[Snapshot]) -> bool:
    return len(one) == len(other) and all(map(snapshots_equal, one, other))


def read(folder: Path) -> list[Snapshot]:
    return list(read_run(folder).snapshots())


def refusal(folder: Path, command: str = "export") -> str:
    """Run a command on the folder: '' when it did its work, else the one line, after its exit status was checked."""
    out = folder.parent / "out"
    told, error = io.StringIO(), io.StringIO()
    words = {"export": ["export", str(folder), "--to", "csv", "--out", str(out)], "analyse": ["analyse", str(folder)]}
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(error):
        status = cli.main(words[command])
    shutil.rmtree(out, ignore_errors=True)
    if status == 0:
        return ""
    lines = error.getvalue().splitlines()
    assert status in (2, 3), f"exit status {status}: {error.getvalue()}"
    assert len(lines) == 1, error.getvalue()
    assert lines[0].startswith("forcechain: ")
    assert folder.name in lines[0]
    return lines[0]


def refused_or_same(folder: Path, good: list[Snapshot]) -> str:
    """Return the refusal; without one what is read equals `good`."""
    told = refusal(folder)
    if not told:
        assert same_run(read(folder), good)
    return told


@pytest.fixture(scope="module")
def csv_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run as CSV tables, without a manifest."""
    home = tmp_path_factory.mktemp("csv")
    made = write_run(home / "made")
    assert cli.main(["export", str(made), "--to", "csv", "--out", str(home / "tables")]) == 0
    return home / "tables" / "made"


@pytest.fixture(scope="module")
def npz_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("npz") / "seed1")


def plain_table(content: bytes) -> dict[str, list[float]]:
    """The file as a plain reader finds it; whatever it trips over is raised."""
    header, *rows = [row for row in csv.reader(io.StringIO(content.decode("utf-8-sig"))) if row]
    return {name.strip(): [float(row[place]) for row in rows] for place, name in enumerate(header)}


def says_the_same(snapshot: Snapshot, particles: dict[str, list[float]], contacts: dict[str, list[float]]) -> bool:
    order = np.argsort(particles["id"], kind="stable")
    found = {
        "radius": snapshot.radius,
        "x": snapshot.position[:, 0],
        "y": snapshot.position[:, 1],
        "rotation": snapshot.rotation,
        "vx": snapshot.velocity[:, 0],
        "vy": snapshot.velocity[:, 1],
        "spin": snapshot.spin,
    }
    good = all(np.array_equal(np.array(particles[name])[order], values) for name, values in found.items())
    found = {
        "id1": snapshot.contact_ids[:, 0],
        "id2": snapshot.contact_ids[:, 1],
        "x": snapshot.contact_point[:, 0],
        "y": snapshot.contact_point[:, 1],
        "nx": snapshot.contact_normal[:, 0],
        "ny": snapshot.contact_normal[:, 1],
        "overlap": snapshot.overlap,
        "fn": snapshot.normal_force,
        "ft": snapshot.tangential_force,
        "moment": snapshot.moment,
        "kn": snapshot.normal_stiffness,
        "kt": snapshot.tangential_stiffness,
        "kr": snapshot.rolling_stiffness,
        "friction": snapshot.friction,
        "rolling_limit": snapshot.rolling_limit,
    }
    return good and all(np.array_equal(contacts[name], values) for name, values in found.items())


@st.composite
def damaged_text(draw: st.DrawFn, content: bytes) -> bytes:
    """A table with rows, columns, cells or bytes damaged."""
    kind = draw(st.sampled_from(TEXT_DAMAGE))
    rows = [line.split(",") for line in content.decode().splitlines()]
    height, width = len(rows), len(rows[0])
    one, other = draw(st.integers(0, height - 1)), draw(st.integers(0, height - 1))
    left, right = draw(st.integers(0, width - 1)), draw(st.integers(0, width - 1))
    place = draw(st.integers(0, len(content) - 1))
    if kind == "row gone":
        del rows[one]
    elif kind == "row twice":
        rows.insert(other, list(rows[one]))
    elif kind == "rows swapped":
        rows[one], rows[other] = rows[other], rows[one]
    elif kind == "column gone":
        rows = [row[:left] + row[left + 1 :] for row in rows]
    elif kind == "column twice":
        rows = [[*row, row[left]] for row in rows]
    elif kind == "columns swapped":
        for row in rows if draw(st.booleans()) else rows[:1]:
            row[left], row[right] = row[right], row[left]
    elif kind == "cell":
        rows[one][left] = draw(st.sampled_from(HOSTILE))
    elif kind == "cells":
        value = draw(st.sampled_from(HOSTILE))
        for row in rows[1:]:
            row[left] = value
    elif kind == "header":
        rows[0][left] = draw(st.sampled_from([*HOSTILE, rows[0][right].upper(), rows[0][left] + "s"]))
    else:
        return {
            "cut": content[:place],
            "flip": content[:place] + bytes([content[place] ^ (1 << draw(st.integers(0, 7)))]) + content[place + 1 :],
            "insert": content[:place] + draw(st.binary(min_size=1, max_size=8)) + content[place:],
            "empty": draw(st.sampled_from([b"", b"\n", b"\n\n\n", b"\xef\xbb\xbf"])),
            "other bytes": draw(st.sampled_from([pickle.dumps([1]), b"PK\x03\x04" * 9, b"\xff" * 99, bytes(99)])),
        }[kind]
    return ("\n".join(",".join(row) for row in rows) + "\n").encode()


@MANY
@given(data=st.data())
def test_damaged_csv_is_refused_or_read_as_it_stands(csv_run: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(FILES[:2]))
    path = csv_run / name
    content = path.read_bytes()
    try:
        path.write_bytes(data.draw(damaged_text(content)))
        if not refusal(csv_run):
            particles, contacts = (plain_table((csv_run / file).read_bytes()) for file in FILES[:2])
            assert says_the_same(read(csv_run)[1], particles, contacts)
    finally:
        path.write_bytes(content)


@SOME
@given(data=st.data())
def test_a_damaged_index_or_history_is_refused_or_read_as_it_stands(csv_run: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(FILES[2:]))
    path = csv_run / name
    content, good = path.read_bytes(), read(csv_run)
    try:
        path.write_bytes(data.draw(damaged_text(content)))
        if not refusal(csv_run):
            table = plain_table(path.read_bytes())
            run = read_run(csv_run)
            if name == "history.csv":
                assert run.history is not None
                found = {column: run.history[column].tolist() for column in run.history}
                assert found == {column: table[column] for column in found}
                assert same_run(list(run.snapshots()), good)
            else:
                # the last snapshots may be gone from the index only with their tables; here they are there
                assert sorted(table["index"]) == [0, 1, 2]
                order = np.argsort(table["index"])
                np.testing.assert_array_equal(run.axial_strain, np.array(table["axial_strain"])[order])
    finally:
        path.write_bytes(content)


@MANY
@given(data=st.data())
def test_damaged_bytes_of_an_archive_are_refused_or_harmless(npz_run: Path, data: st.DataObject) -> None:
    """Checksums of the manifest brought up to date, or no manifest: the archive's own checks have to tell."""
    content, manifest = (npz_run / NPZ).read_bytes(), (npz_run / "run.json").read_bytes()
    good = read(npz_run)
    place = data.draw(st.integers(0, len(content) - 1))
    flipped = bytes([content[place] ^ (1 << data.draw(st.integers(0, 7)))])
    other = data.draw(st.integers(0, len(content)))
    changed = data.draw(
        st.sampled_from(
            [
                content[:place],
                content[place:],
                content[:place] + flipped + content[place + 1 :],
                content[: min(place, other)] + content[max(place, other) :],
                content[:place] + content[min(place, other) : max(place, other)] + content[place:],
                content[:place] + bytes(32) + content[place + 32 :],
            ]
        )
    )
    try:
        (npz_run / NPZ).write_bytes(changed)
        if data.draw(st.booleans()):
            write_manifest(npz_run)
        else:
            (npz_run / "run.json").unlink()
        refused_or_same(npz_run, good)
    finally:
        (npz_run / NPZ).write_bytes(content)
        (npz_run / "run.json").write_bytes(manifest)


VALUES = st.one_of(
    st.sampled_from(
        [None, True, False, 0, -1, 10**30, 1e308, -0.5, "", "x", "../../x", "a\0b", [], {}, [[]], {"a": 1}]
    ),
    st.sampled_from([float("nan"), float("inf"), "é", "0" * 64, [None], {"value": None}, {"value": {"unit": 1}}]),
)


def nodes(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of every value in a JSON document."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [path, *(inner for key, value in items for inner in nodes(value, (*path, key)))]


@SOME
@given(data=st.data())
def test_a_damaged_manifest_is_refused_or_harmless(npz_run: Path, data: st.DataObject) -> None:
    path = npz_run / "run.json"
    content, good = path.read_bytes(), read(npz_run)
    document = json.loads(content)
    place = data.draw(st.sampled_from(nodes(document)[1:]))
    parent = document
    for key in place[:-1]:
        parent = parent[key]
    if data.draw(st.booleans()):
        del parent[place[-1]]
    else:
        parent[place[-1]] = data.draw(VALUES)
    try:
        path.write_text(json.dumps(document))
        refused_or_same(npz_run, good)
        refusal(npz_run, "analyse")  # what follows from parameters and validity ends well or in one line
    finally:
        path.write_bytes(content)
        shutil.rmtree(npz_run / "analysis", ignore_errors=True)


@pytest.mark.parametrize(
    "content", [b"", b"{", b"[" * 100_000, b"null", b"1e999", b"\xff\xfe", b'{"format": ' + b"9" * 9999]
)
def test_a_manifest_that_is_none_is_refused(run_folder: Path, content: bytes) -> None:
    (run_folder / "run.json").write_bytes(content)
    assert "run.json" in refusal(run_folder)


def archive_with(member: bytes, name: str = "particle_radius", method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A snapshot's archive in which one array's bytes are replaced."""
    buffer = io.BytesIO()
    np.savez(buffer, **{key: values for key, values in snapshot_arrays(0.001, 10).items() if key != name})
    with zipfile.ZipFile(buffer, "a", method) as archive:
        archive.writestr(f"{name}.npy", member)
    return buffer.getvalue()


def npy(shape: str, descr: str = "<f8", payload: bytes = b"") -> bytes:
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + payload


@pytest.mark.parametrize(
    "member",
    [
        npy("(1000000000000,)"),
        npy("(9223372036854775807, 9223372036854775807)"),
        npy("(-1,)"),
        npy("(9,)", payload=bytes(8 * 8)),
        npy("(9,)", descr="|O", payload=pickle.dumps([1.0] * 9)),
        npy("(9,)", descr="<M8[ns]", payload=bytes(72)),
        npy("(9,)", descr="|V8", payload=bytes(72)),
        npy("(9,)", descr="<f8',__import__('os').getcwd(),'", payload=bytes(72)),
        npy("(9, 1000000)", payload=bytes(9)),
        b"\x93NUMPY\x09\x00" + bytes(64),
        b"\x93NUMPY\x01\x00\xff\xff",
        b"",
        pickle.dumps([1.0] * 9),
    ],
)
def test_an_array_that_claims_to_be_what_it_is_not_is_refused(run_folder: Path, member: bytes) -> None:
    (run_folder / NPZ).write_bytes(archive_with(member))
    write_manifest(run_folder)
    assert "000001.npz" in refusal(run_folder)


def test_an_archive_that_unpacks_to_more_than_any_sample_is_refused(
    run_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "LARGEST_ARCHIVE", 10_000_000)
    bomb = archive_with(npy("(5000000,)", payload=bytes(40_000_000)))
    assert len(bomb) < 100_000
    (run_folder / NPZ).write_bytes(bomb)
    write_manifest(run_folder)
    assert "unpacks to 40" in refusal(run_folder)
    assert np.inf > tables.LARGEST_ARCHIVE


def test_the_tests_comparison_can_fail(npz_run: Path, tmp_path: Path) -> None:
    changed = Path(shutil.copytree(npz_run, tmp_path / npz_run.name))
    np.savez(changed / NPZ, **snapshot_arrays(0.001, 10) | {"contact_fn": np.full(24, 0.2)})
    write_manifest(changed)
    with pytest.raises(AssertionError):
        refused_or_same(changed, read(npz_run))
    with pytest.raises(HarnessError):
        read_run(tmp_path)


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("contact_fn", 1e51, "normal_force, row 3: expected a magnitude of at most 1e+50, found 1e+51"),
        ("particle_x", -1e300, "position, row 3: expected a magnitude of at most 1e+50, found -1e+300"),
        ("particle_radius", 5e-324, "particles row 3: expected a greater (1e-50) radius"),
        ("contact_kn", 1e-51, "contacts row 3: expected a greater (1e-50) normal_stiffness, found 1e-51"),
        ("contact_kt", 1e-51, "expected a tangential_stiffness of at least 1e-50, or 0, found 1e-51"),
    ],
)
def test_numbers_whose_products_leave_the_range_are_refused(
    run_folder: Path, column: str, value: float, expected: str
) -> None:
    arrays = snapshot_arrays(0.001, 10)
    arrays[column] = np.where(np.arange(len(arrays[column])) == 3, value, arrays[column])
    np.savez(run_folder / NPZ, **arrays)
    write_manifest(run_folder)
    assert expected in refusal(run_folder)


@settings(MANY, max_examples=15)
@given(data=st.data())
def test_numbers_beyond_reason_do_not_break_the_analysis(buckling_run: Path, data: st.DataObject) -> None:
    """Finite and admissible to every check of the tables: the analysis ends well or in one line, without a warning."""
    path = buckling_run / "snapshots" / f"{data.draw(st.sampled_from([20, 28, 36])):06d}.npz"
    content = path.read_bytes()
    with np.load(path) as archive:
        arrays = dict(archive)
    columns = sorted(name for name, values in arrays.items() if values.ndim and values.dtype.kind == "f")
    name = data.draw(st.sampled_from(columns))
    rows = data.draw(st.sampled_from([slice(None), slice(3, 4), slice(None, None, 2)]))
    arrays[name][rows] = data.draw(st.sampled_from([1e300, 1e50, -1e50, 5e-324, 1e-50, 0.0, -1.0]))
    try:
        np.savez(path, **arrays)
        refusal(buckling_run, "analyse")
    finally:
        path.write_bytes(content)
        shutil.rmtree(buckling_run / "analysis", ignore_errors=True)


@pytest.fixture(scope="module")
def buckling_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_buckling_run(tmp_path_factory.mktemp("buckling") / "seed1", 1)
    (folder / export_format.MANIFEST).unlink()
    return folder
