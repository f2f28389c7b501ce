"""Tables of yade-batch: read as they are, never evaluated, and what a study makes of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.errors import InputError
from harness.study import read_study
from yade_scripts import batch_table, parameters

TABLE = """
# names first
rolling_friction  seed friction! size_distribution description !THREADS # and a comment

0.2    1   0.5   'uniform'     first   1
=      2   =     =             second  =
   # nothing here
0.05   =   .6    *             third   2
"""


def write(folder: Path, text: str, name: str = "some.table") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_table_is_read_as_yade_batch_reads_it(tmp_path: Path) -> None:
    rows = batch_table.read(write(tmp_path, TABLE))
    first = {"rolling_friction": 0.2, "friction": 0.5, "size_distribution": "uniform"}
    assert [(row.line, row.values) for row in rows] == [
        (5, first | {"seed": 1}),
        (6, first | {"seed": 2}),
        (8, {"rolling_friction": 0.05, "seed": 2, "friction": 0.6}),
    ]
    assert rows[1].varied == first
    assert batch_table.read(write(tmp_path, "friction seed\n0.2 1\n= 2"))[1].varied == {}


@pytest.mark.parametrize(
    ("text", "value"),
    [("3", 3), ("-2", -2), ("1e-4", 1e-4), ("True", True), ("False", False), ("'a:b,c'", "a:b,c"), ('"a"', "a")],
)
def test_values(tmp_path: Path, text: str, value: object) -> None:
    (row,) = batch_table.read(write(tmp_path, f"x\n{text}"))
    assert row.values["x"] == value
    assert type(row.values["x"]) is type(value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", ": expected a line of column names and at least one run, found 0 lines"),
        ("friction # 0.2", ": expected a line of column names and at least one run, found 1 lines"),
        ("friction seed\n0.2 1 3", ":2: expected 2 values, one a column, found 3"),
        ("friction seed\n0.2 1\n\n0.2", ":4: expected 2 values, one a column, found 1"),
        ("friction seed\n0.2 =", ":2: '=' is the value of the line before, and this is the first"),
        ("friction friction!\n0.2 0.2", ":1: column 'friction' stands there twice"),
        ("friction\npi/4", ":2: friction: expected a number, 'text' in quotes, True or False, found pi/4"),
        ("friction\n__import__('os')", "a table is read, not evaluated"),
        ("friction\n'a\\'", "a table is read, not evaluated"),
        ("roling_friction\n0.2", ":2: unknown parameter 'roling_friction'; did you mean 'rolling_friction'?"),
        ("friction\n0.2\n-1", ":3: friction: expected a number from 0 up to 10, found -1"),
        ("friction\nnan", ":2: friction: expected a number from 0 up to 10, found nan"),
        ("size_distribution\n'round'", ":2: size_distribution: expected one of 'bidisperse', 'uniform'"),
    ],
)
def test_a_malformed_table_ends_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(batch_table.TableError) as caught:
        batch_table.runs(path, parameters.BIAXIAL)
    assert str(caught.value).startswith(str(path))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("path", ["absent.table", "."])
def test_a_table_that_is_none(tmp_path: Path, path: str) -> None:
    with pytest.raises(batch_table.TableError, match="cannot be read"):
        batch_table.read(tmp_path / path)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "some.table"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(batch_table.TableError, match="cannot be read"):
        batch_table.read(path)


def test_what_yade_batch_asks_for() -> None:
    assert batch_table.asked_for({}) is None
    assert batch_table.asked_for({"YADE_BATCH": ""}) is None
    assert batch_table.asked_for({"YADE_BATCH": "/a/b:c.table:12"}) == (Path("/a/b:c.table"), 12)
    for text in ("table", "table:", ":3", "table:x"):
        with pytest.raises(batch_table.TableError, match="expected TABLE:LINE"):
            batch_table.asked_for({"YADE_BATCH": text})


def test_a_study_of_a_table(tmp_path: Path) -> None:
    write(tmp_path, TABLE)
    study = read_study(write(tmp_path, "table = 'some.table'\n[parameters]\nparticle_count = 100\n", "trial.toml"))
    found = [(run.parameters["rolling_friction"], run.parameters["seed"]) for run in study.planned_runs()]
    assert found == [(0.2, 1), (0.2, 2), (0.05, 2)]
    assert [run.parameters["size_distribution"] for run in study.planned_runs()] == ["uniform", "uniform", "bidisperse"]
    assert all(run.parameters["particle_count"] == 100 for run in study.planned_runs())
    assert study.planned_runs()[0].run_id.startswith("mu_r0.2-mu0.5-uniform-seed1-")


def test_a_table_without_seeds_is_run_with_those_of_the_study(tmp_path: Path) -> None:
    write(tmp_path, "rolling_friction\n0.2\n0.05\n")
    study = read_study(write(tmp_path, "table = 'some.table'\nseeds = [3, 4]\n", "trial.toml"))
    found = [(run.parameters["rolling_friction"], run.parameters["seed"]) for run in study.planned_runs()]
    assert found == [(0.2, 3), (0.2, 4), (0.05, 3), (0.05, 4)]


@pytest.mark.parametrize(
    ("table", "study", "told"),
    [
        ("friction\n0.2", "table = 'other.table'", "other.table: expected a table of yade-batch, which cannot be read"),
        ("friction\n0.2", "table = '../some.table'", "expected the name of a table beside this file"),
        ("friction\n0.2", "table = 3", "expected the name of a table beside this file, found 3"),
        ("friction\n0.2", "table = 'some.table'\n[grid]\nseed = [1]", "table and [grid]: each says what varies"),
        ("friction\n0.2", "table = 'some.table'\n[parameters]\nfriction = 0.1", "'friction' stands in some.table"),
        ("seed\n2", "table = 'some.table'\nseeds = [1]", "'seed' stands in some.table as well"),
        ("friction\n0.2\n0.2", "table = 'some.table'", "two runs have the same parameters"),
        ("friction\n-2", "table = 'some.table'", "friction: expected a number from 0"),
        ("friction\n1+1", "table = 'some.table'", "some.table:2: friction: expected a number"),
    ],
)
def test_a_study_with_a_bad_table_ends_in_one_line(tmp_path: Path, table: str, study: str, told: str) -> None:
    write(tmp_path, table)
    with pytest.raises(InputError) as caught:
        read_study(write(tmp_path, study, "trial.toml"))
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
