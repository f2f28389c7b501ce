"""Dumps that LAMMPS wrote, and dumps made by hand: forces and torques add up to those the code felt."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from forcechain.observe.macroscopic import unbalanced_forces
from forcechain.observe.snapshot import Snapshot
from harness import cli
from harness.exchange.dumps import find_frames
from harness.reading.exports import read_run

DATA = Path(__file__).parents[1] / "data" / "lammps"  # written by LAMMPS 22 July 2025 from biaxial.in, there
DRAG = 0.02  # N s/m, fix viscous of that input
DENSITY = 2650.0  # kg/m^3
STEPS = (5000, 7500, 10000, 12500)
TIME_STEP = 2e-7
SETTINGS = {
    "normal_stiffness": 1.05e5,
    "tangential_stiffness": 5.25e4,
    "friction": 0.7,
    "rolling_stiffness": 5.25e4,
    "rolling_friction": 0.4,
}
Import = Callable[..., int]


def arguments(settings: dict[str, float]) -> list[str]:
    return [part for name, value in settings.items() for part in ("--set", f"{name}={value}")]


@pytest.fixture
def dumps(tmp_path: Path) -> Path:
    return Path(shutil.copytree(DATA, tmp_path / "dumps"))


@pytest.fixture
def bring(dumps: Path, tmp_path: Path) -> Import:
    """Import `dumps` into `out` beside them."""

    def run(*extra: str, dialect: str = "lammps", settings: dict[str, float] = SETTINGS) -> int:
        out = str(tmp_path / "out")
        return cli.main(["import", str(dumps), "--from", dialect, "--out", out, *arguments(settings), *extra])

    return run


def line(capsys: pytest.CaptureFixture[str]) -> str:
    told = capsys.readouterr().err.strip()
    assert "\n" not in told
    return told


def dumped(step: int, *names: str) -> np.ndarray:
    """Columns of the dump of atoms, in the order of their ids, read without the package."""
    lines = (DATA / f"atoms.{step:06d}.dump").read_text().splitlines()
    start = next(number for number, text in enumerate(lines) if text.startswith("ITEM: ATOMS"))
    columns = lines[start].split()[2:]
    rows = np.array([text.split() for text in lines[start + 1 :]], dtype=float)
    return rows[np.argsort(rows[:, 0])][:, [columns.index(name) for name in names]]


def imported(tmp_path: Path) -> list[Snapshot]:
    return list(read_run(tmp_path / "out").snapshots())


def test_forces_and_torques_are_those_that_lammps_felt(bring: Import, tmp_path: Path) -> None:
    assert bring() == 0
    for step, snapshot in zip(STEPS, imported(tmp_path), strict=True):
        assert snapshot.iteration == step
        force, moment = unbalanced_forces(snapshot)
        total = dumped(step, "fx", "fy")
        mass = DENSITY * 4 / 3 * np.pi * dumped(step, "radius") ** 3
        # the drag was felt half a time step before the velocity that is dumped
        expected = total + DRAG * (dumped(step, "vx", "vy") - total / mass * TIME_STEP / 2)
        # so was the damping at the contacts, of which the dump of pairs has the later value
        np.testing.assert_allclose(force, expected, atol=1e-4)
        torque = dumped(step, "tqz")[:, 0]
        np.testing.assert_allclose(moment, torque, atol=1e-7)
        # the same without the moments of the contacts fails: the comparison sees them
        without = moment - np.bincount(snapshot.contact_ids[:, 0], -snapshot.moment, snapshot.n_particles)
        assert np.abs(without - torque).max() > 1e-5


def test_the_contact_law_is_the_one_of_the_input(bring: Import, tmp_path: Path) -> None:
    assert bring() == 0
    for snapshot in imported(tmp_path):
        inside = snapshot.contact_ids[:, 1] >= 0
        elastic = snapshot.normal_stiffness * snapshot.overlap
        damping = np.abs(snapshot.normal_force - elastic)[inside]
        assert damping.max() < 0.3 * elastic.max()
        assert (np.abs(snapshot.tangential_force) <= snapshot.friction * snapshot.normal_force + 1e-9)[inside].all()
        limit = snapshot.rolling_limit * snapshot.normal_force
        assert (np.abs(snapshot.moment) <= limit * (1 + 1e-6) + 1e-12)[inside].all()
    radii = snapshot.radius[snapshot.contact_ids[inside]]
    effective = radii.prod(axis=1) / radii.sum(axis=1)
    np.testing.assert_allclose(snapshot.rolling_limit[inside], 0.4 * effective)
    np.testing.assert_allclose(snapshot.rolling_stiffness[inside], 5.25e4 * effective**2)


def test_the_walls_and_what_follows_from_them(bring: Import, tmp_path: Path) -> None:
    assert bring() == 0
    run = read_run(tmp_path / "out")
    times = TIME_STEP * np.array(STEPS)
    first_height = 0.00925 - 0.2 * times[0]  # the lid of biaxial.in
    np.testing.assert_allclose(run.axial_strain, 0.2 * (times - times[0]) / first_height, atol=1e-6)
    snapshot = run.snapshot(3)
    for wall, name, axis, sign in (
        (-1, "left", "x", -1),
        (-2, "right", "x", 1),
        (-3, "bottom", "y", -1),
        (-4, "top", "y", 1),
    ):
        at_wall = snapshot.contact_ids[:, 1] == wall
        force = dumped(12500, f"{name}_f{axis}")[:, 0]
        np.testing.assert_array_equal(snapshot.contact_ids[at_wall, 0], np.flatnonzero(force))
        np.testing.assert_allclose(snapshot.normal_force[at_wall], -sign * force[force != 0])
    np.testing.assert_allclose(snapshot.rotation, np.trapezoid([s.spin for s in run.snapshots()], times, axis=0))
    assert run.history is not None
    np.testing.assert_allclose(run.history["time"], times)
    assert run.history["stress_ratio"].is_monotonic_increasing  # it is compressed along y
    origin = json.loads((tmp_path / "out" / "origin.json").read_text())
    assert origin["source_format"] == "lammps"
    assert origin["settings"]["friction"] == 0.7
    assert any(note.startswith("rotations: integral of omegaz") for note in origin["notes"])


def test_ids_and_rows_in_any_order(dumps: Path, bring: Import, tmp_path: Path) -> None:
    assert bring() == 0
    before = imported(tmp_path)
    shutil.rmtree(tmp_path / "out")
    for path in dumps.glob("*.dump"):
        lines = path.read_text().splitlines()
        start = next(number for number, text in enumerate(lines) if text.startswith(("ITEM: ATOMS", "ITEM: ENTRIES")))
        ids = 1 if "ATOMS" in lines[start] else 2
        rows = [text.split() for text in lines[start + 1 :]]
        rows = [[*(str(100 + 7 * int(value)) for value in row[:ids]), *row[ids:]] for row in rows]
        path.write_text("\n".join([*lines[: start + 1], *(" ".join(row) for row in reversed(rows))]) + "\n")
    assert bring() == 0
    for one, other in zip(before, imported(tmp_path), strict=True):
        np.testing.assert_array_equal(one.position, other.position)
        np.testing.assert_array_equal(unbalanced_forces(one)[0].round(12), unbalanced_forces(other)[0].round(12))
    ids = (tmp_path / "out" / "ids.csv").read_text().splitlines()
    assert ids[:3] == ["id,atom", "0,107", "1,114"]


def test_many_frames_in_one_file(dumps: Path, bring: Import, tmp_path: Path) -> None:
    for kind in ("atoms", "pairs"):
        parts = sorted(dumps.glob(f"{kind}.*.dump"))
        (dumps / f"all.{kind}").write_text("".join(part.read_text() for part in parts))
        for part in parts:
            part.unlink()
    assert bring() == 0
    assert [snapshot.iteration for snapshot in imported(tmp_path)] == list(STEPS)


def as_liggghts(dumps: Path) -> None:
    """Rewrite the dumps as LIGGGHTS writes them: no time, unnamed columns, the whole force, a flag for periodicity."""
    for path in dumps.glob("pairs.*.dump"):
        lines = path.read_text().splitlines()
        start = next(number for number, text in enumerate(lines) if text.startswith("ITEM: ENTRIES"))
        rows = [[float(value) for value in text.split()] for text in lines[start + 1 :]]
        whole = [f"{a:.0f} {b:.0f} 0 {fx + tx!r} {fy + ty!r} 0" for a, b, fx, fy, tx, ty, *_ in rows]
        names = " ".join(f"c_pair[{number}]" for number in range(1, 7))
        path.write_text("\n".join([*lines[2:start], f"ITEM: ENTRIES {names}", *whole]) + "\n")
    for path in dumps.glob("atoms.*.dump"):
        path.write_text("\n".join(path.read_text().splitlines()[2:]) + "\n")


def test_liggghts_gives_the_whole_force_and_no_time(
    dumps: Path, bring: Import, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bring() == 0
    before = imported(tmp_path)
    shutil.rmtree(tmp_path / "out")
    as_liggghts(dumps)
    columns = ("--pair-columns", "id1,id2,periodic,fx,fy,fz")
    assert bring(*columns, dialect="liggghts") == 2
    assert "no ITEM: TIME in it: give --set time_step=SECONDS" in line(capsys)
    assert bring(*columns, dialect="liggghts", settings=SETTINGS | {"time_step": TIME_STEP}) == 0
    for one, other in zip(before, imported(tmp_path), strict=True):
        np.testing.assert_allclose(one.normal_force, other.normal_force, atol=1e-12)
        np.testing.assert_allclose(one.tangential_force, other.tangential_force, atol=1e-12)
        np.testing.assert_allclose(one.time, other.time)
        assert not other.moment.any()
    origin = json.loads((tmp_path / "out" / "origin.json").read_text())
    assert "no rolling resistance in the dump of pairs: moments are 0" in origin["notes"]


def test_the_strain_comes_from_the_rate_or_from_the_box(
    dumps: Path, bring: Import, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bring("--set", "strain_rate=20") == 0
    np.testing.assert_allclose(read_run(tmp_path / "out").axial_strain, [0, 0.01, 0.02, 0.03])
    shutil.rmtree(tmp_path / "out")
    for path in dumps.glob("atoms.*.dump"):
        lines = path.read_text().splitlines()
        header = next(number for number, text in enumerate(lines) if text.startswith("ITEM: ATOMS"))
        lines[header] = lines[header].replace("top_f", "lid_f")
        path.write_text("\n".join(lines) + "\n")
    assert bring() == 2
    assert "the axial strain is unknown" in line(capsys)
    for number, path in enumerate(sorted(dumps.glob("atoms.*.dump"))):
        lines = path.read_text().splitlines()
        row = next(number for number, text in enumerate(lines) if text.startswith("ITEM: BOX BOUNDS")) + 2
        lines[row] = f"0 {0.01 * (1 - 0.001 * number)}"
        path.write_text("\n".join(lines) + "\n")
    assert bring() == 0
    np.testing.assert_allclose(read_run(tmp_path / "out").axial_strain, [0, 0.001, 0.002, 0.003], atol=1e-12)


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("file", "old", "new", "expected"),
    [
        ("atoms.007500.dump", "ITEM: ATOMS id", "ITEM: ATOMS it", "atoms: column 'id' (number of the atom) is missing"),
        ("atoms.007500.dump", "\n16 1 ", "\n15 1 ", "atom 15 is there twice"),
        ("atoms.007500.dump", "\n16 1 ", "\n17 1 ", "its atoms are not those of the first frame"),
        ("atoms.007500.dump", "\n16 1 ", "\n16.5 1 ", "column 'id': expected a whole number, found 16.5"),
        ("atoms.007500.dump", "\n16 1 ", "\n16 1 nan ", "expected 19 values, found 20"),
        ("atoms.007500.dump", "radius", "width", "column 'radius' [m] (radius) is missing"),
        ("atoms.007500.dump", "ATOMS\n16", "ATOMS\n17", "expected 17 rows, found fewer; the dump was cut short"),
        ("atoms.007500.dump", "ATOMS\n16", "ATOMS\n9e9", "expected a number below 'ITEM: NUMBER OF', found '9e9'"),
        ("atoms.007500.dump", "ATOMS\n16", "ATOMS\n-1", "expected a number of rows from 0 to 100000000, found -1"),
        ("atoms.007500.dump", "ATOMS\n16", "ATOMS\n15", "expected a line with ITEM:, found '16 1"),
        ("atoms.007500.dump", "STEP\n7500", "STEP\n7501", "the other dump has no such time step"),
        ("atoms.007500.dump", "STEP\n7500", "STEP\n5000", "this time step is in atoms.005000.dump as well"),
        ("atoms.007500.dump", "ITEM: TIME\n", "ITEM: UNITS\nlj\nITEM: TIME\n", "expected a dump in SI units"),
        ("atoms.007500.dump", "vx vy omegaz", "vx z omegaz", "expected centres in one plane z"),
        ("atoms.007500.dump", "x y radius vx", "x y vx radius", "expected a positive radius, found -"),
        ("pairs.007500.dump", "STEP\n7500", "STEP\n7501", "the other dump has no such time step"),
        ("atoms.007500.dump", "BOUNDS ff", "BOUNDS xy xz yz ff", "expected a rectangular box"),
        ("atoms.007500.dump", "BOUNDS ff ff pp\n0.0", "BOUNDS ff ff pp\nx.0", "expected the bounds of the box"),
        (
            "pairs.007500.dump",
            "ENTRIES id1 id2 fx",
            "ENTRIES id1 id2 force",
            "pairs: column 'fx' [N] (force on the fir",
        ),
        ("pairs.007500.dump", " tx ", " px ", "column 'tx' [N] (tangential force on the first"),
        ("pairs.007500.dump", "\n1 2 ", "\n1 99 ", "id2=99 is not an atom of this time step (16 atoms)"),
        ("pairs.007500.dump", "\n1 2 ", "\n1 16 ", "contacts across a periodic boundary are not read"),
        ("pairs.007500.dump", "\n1 2 ", "\n1 1 ", "atoms 1 and 1 are 0 m apart"),
        ("pairs.007500.dump", "\n1 2 ", "\n1 2 x", "column 'fx': expected a number, found 'x-"),
        ("pairs.007500.dump", "\n1 2 ", "\n1 5 ", "the contact of"),
    ],
)
def test_a_broken_dump_is_named(
    dumps: Path,
    bring: Import,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    file: str,
    old: str,
    new: str,
    expected: str,
) -> None:
    edit(dumps / file, old, new)
    assert bring() == 2
    told = line(capsys)
    assert expected in told
    assert file.removeprefix("pairs.").removeprefix("atoms.").removesuffix(".dump").lstrip("0") in told
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dumps"]


def test_a_dump_cut_anywhere_is_refused_or_whole(dumps: Path, bring: Import, tmp_path: Path) -> None:
    """Bytes lost at the end: of the last value some digits may go unnoticed, for a text without a checksum; no more."""
    path = dumps / "pairs.012500.dump"
    content = path.read_bytes()
    last_value = content.rstrip().rfind(b" ") + 1
    for keep in range(0, len(content), 37):
        path.write_bytes(content[:keep])
        status = bring()
        assert status == 2 or keep > last_value, keep
        shutil.rmtree(tmp_path / "out", ignore_errors=True)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (["--set", "friction=0.5"], "normal_stiffness=N/m is needed"),
        (["--set", "normal_stifness=1"], "did you mean normal_stiffness?"),
        (["--set", "normal_stiffness"], "expected NAME=VALUE"),
        (["--set", "normal_stiffness=much"], "expected a finite number, found 'much'"),
        (["--set", "normal_stiffness=inf"], "expected a finite number, found 'inf'"),
        (["--set", "normal_stiffness=0"], "expected a value above 0, found 0"),
        (["--set", "normal_stiffness=1", "--set", "friction=-1"], "expected a value of at least 0, found -1"),
        (["--set", "normal_stiffness=1", "--set", "normal_stiffness=2"], "given twice"),
        (["--set", "normal_stiffness=1", "--pair-columns", "id1,id2"], "expected 9 names of columns"),
        (["--set", "normal_stiffness=1", "--pair-columns", "id1,id2,fx,fx,a,b,c,d,e"], "'fx' is there twice"),
    ],
)
def test_settings_are_checked(
    bring: Import, capsys: pytest.CaptureFixture[str], given: list[str], expected: str
) -> None:
    assert bring(*given, settings={}) == 2
    assert expected in line(capsys)


def test_a_folder_without_dumps_is_named(
    tmp_path: Path, dumps: Path, bring: Import, capsys: pytest.CaptureFixture[str]
) -> None:
    for path in dumps.glob("pairs.*"):
        path.unlink()
    assert bring() == 2
    assert "expected text dumps of pairs ('ITEM: ENTRIES' in their header), found none" in line(capsys)
    atoms, _ = find_frames(DATA)
    assert sorted(atoms) == list(STEPS)
    assert not (tmp_path / "out").exists()


def test_a_frame_without_contacts_is_read_and_one_without_atoms_is_not(
    dumps: Path, bring: Import, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def empty(path: Path, section: str) -> None:
        lines = path.read_text().splitlines()
        start = next(number for number, text in enumerate(lines) if text.startswith(section))
        lines[next(number for number, text in enumerate(lines) if "NUMBER OF" in text) + 1] = "0"
        path.write_text("\n".join(lines[: start + 1]) + "\n")

    empty(dumps / "pairs.005000.dump", "ITEM: ENTRIES")
    assert bring() == 0
    assert (imported(tmp_path)[0].contact_ids[:, 1] < 0).all()
    shutil.rmtree(tmp_path / "out")
    empty(dumps / "atoms.005000.dump", "ITEM: ATOMS")
    assert bring() == 2
    assert "expected atoms, found none" in line(capsys)
