"""A thousand ways to damage a run's tables: each is refused in one line, or changes nothing that was read."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from run_folders import snapshot_arrays, write_run

from forcechain.observe.snapshot import Snapshot
from harness.errors import HarnessError
from harness.reading.exports import read_run
from yade_scripts import export_format

PARTICLE = [f"particle_{name}" for name in export_format.names(export_format.PARTICLE_COLUMNS)]
CONTACT = [f"contact_{name}" for name in export_format.names(export_format.CONTACT_COLUMNS)]
COLUMNS = PARTICLE + CONTACT
IDS = ["particle_id", "contact_id1", "contact_id2"]
SNAPSHOT = f"{export_format.SNAPSHOTS}/{export_format.snapshot_name(1)}.npz"
MANY = settings(
    max_examples=350, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def canonical(snapshot: Snapshot) -> dict[str, Any]:
    """What the snapshot says, without the order of its contacts."""
    order = np.lexsort(snapshot.contact_ids.T)
    values = {item.name: getattr(snapshot, item.name) for item in fields(Snapshot)}
    return {
        name: value[order] if np.ndim(value) and len(value) == snapshot.n_contacts and name != "radius" else value
        for name, value in values.items()
    }


def outcome(folder: Path) -> tuple[str, list[dict[str, Any]]]:
    """The one line of the refusal, or what was read."""
    try:
        run = read_run(folder)
        return "", [canonical(snapshot) for snapshot in run.snapshots()]
    except HarnessError as error:
        text = str(error)
        assert text, "a refusal says why"
        assert "\n" not in text
        assert folder.name in text
        return text, []


def same(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> bool:
    return len(one) == len(other) and all(
        np.array_equal(first[name], second[name]) for first, second in zip(one, other, strict=True) for name in first
    )


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    return outcome(write_run(tmp_path_factory.mktemp("good") / "seed1"))[1]


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run without a manifest: nothing but the numbers themselves can tell of damage."""
    folder = write_run(tmp_path_factory.mktemp("bare") / "seed1")
    (folder / export_format.MANIFEST).unlink()
    (folder / export_format.HISTORY).unlink()
    return folder


@st.composite
def damage(draw: st.DrawFn) -> tuple[str, dict[str, Any]]:
    """A kind of damage that must be refused, and the arrays it leaves."""
    arrays = snapshot_arrays(0.001, 10)
    name = draw(st.sampled_from(COLUMNS))
    values = np.array(arrays[name])
    row = draw(st.integers(0, len(values) - 1))
    table = PARTICLE if name in PARTICLE else CONTACT
    kind = draw(
        st.sampled_from(
            ["no column", "one value less", "one value more", "not finite", "text", "objects", "complex", "two axes",
             "row twice", "id", "fraction", "particle gone", "scalar", "cut bytes"]
        )
    )  # fmt: skip
    if kind == "no column":
        del arrays[name]
    elif kind == "one value less":
        arrays[name] = np.delete(values, row)
    elif kind == "one value more":
        arrays[name] = np.insert(values, row, values[row])
    elif kind == "not finite":
        arrays[name] = values.astype(float)
        arrays[name][row] = draw(st.sampled_from([np.nan, np.inf, -np.inf]))
    elif kind == "text":
        arrays[name] = values.astype(str)
        arrays[name][row] = draw(st.sampled_from(["", "x", "1,5", "nan"]))
    elif kind == "objects":
        arrays[name] = np.array([*values[:-1], None], dtype=object)
    elif kind == "complex":
        arrays[name] = values + 1j
    elif kind == "two axes":
        arrays[name] = values[:, None]
    elif kind == "row twice":
        for column in table:
            arrays[column] = np.insert(arrays[column], row, arrays[column][row])
    elif kind == "id":
        name = draw(st.sampled_from(IDS))
        arrays[name] = np.array(arrays[name])
        row %= len(arrays[name])
        arrays[name][row] = draw(st.sampled_from([-6, -7, 9, 10, 1000, 2**40, -(2**40)]))
    elif kind == "fraction":
        name = draw(st.sampled_from(IDS))
        arrays[name] = np.array(arrays[name], float)
        arrays[name][row % len(arrays[name])] += draw(st.sampled_from([0.5, 1e-3, -0.25]))
    elif kind == "particle gone":
        row = draw(st.integers(0, 8))
        for column in PARTICLE:
            arrays[column] = np.delete(arrays[column], row)
    elif kind == "scalar":
        name = draw(st.sampled_from(list(export_format.SNAPSHOT_SCALARS)))
        if draw(st.booleans()):
            del arrays[name]
        else:
            wrong = [np.nan, np.inf, "a", [0.001], None]
            arrays[name] = draw(st.sampled_from([*wrong, 1e300, -0.25] if name == "iteration" else wrong))
    return kind, arrays


@MANY
@given(damaged=damage(), share=st.floats(0, 0.999))
def test_damage_is_refused_without_a_manifest(bare: Path, damaged: tuple[str, dict[str, Any]], share: float) -> None:
    kind, arrays = damaged
    np.savez(bare / SNAPSHOT, **arrays)
    if kind == "cut bytes":
        content = (bare / SNAPSHOT).read_bytes()
        (bare / SNAPSHOT).write_bytes(content[: int(share * len(content))])
    assert outcome(bare)[0], f"{kind} was read"


@MANY
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_rows_and_columns_is_harmless(bare: Path, good: list[dict[str, Any]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    arrays = snapshot_arrays(0.001, 10)
    for table in (PARTICLE, CONTACT):
        order = rng.permutation(len(arrays[table[0]]))
        arrays |= {name: np.asarray(arrays[name])[order] for name in table}
    names = list(arrays)
    np.savez(bare / SNAPSHOT, **{names[k]: arrays[names[k]] for k in rng.permutation(len(names))})
    told, read = outcome(bare)
    assert not told
    assert same(read, good)


@MANY
@given(data=st.data())
def test_no_damaged_byte_goes_unnoticed(
    tmp_path_factory: pytest.TempPathFactory, good: list[dict[str, Any]], data: st.DataObject
) -> None:
    """Under a manifest: bytes changed, lost, added or exchanged between files."""
    folder = _vouched(tmp_path_factory)
    names = [SNAPSHOT, SNAPSHOT.replace("1.npz", "2.npz"), export_format.HISTORY, export_format.MANIFEST]
    target = folder / data.draw(st.sampled_from(names))
    content = target.read_bytes()
    place = data.draw(st.integers(0, len(content) - 1))
    kind = data.draw(st.sampled_from(["flip", "cut", "insert", "zero", "other file"]))
    changed = {
        "flip": content[:place] + bytes([content[place] ^ (1 << place % 8)]) + content[place + 1 :],
        "cut": content[:place],
        "insert": content[:place] + b"7" + content[place:],
        "zero": content[:place] + bytes(len(content) - place),
        "other file": (folder / SNAPSHOT.replace("1.npz", "0.npz")).read_bytes(),
    }[kind]
    if changed == content:
        return
    try:
        target.write_bytes(changed)
        told, read = outcome(folder)
        assert told or same(read, good), f"{kind} at byte {place} of {target.name} was read as something else"
        if target.name.endswith(".npz"):
            assert told, f"{kind} at byte {place} of {target.name} was read"
    finally:
        target.write_bytes(content)


_FOLDERS: list[Path] = []


def _vouched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if not _FOLDERS:
        _FOLDERS.append(write_run(tmp_path_factory.mktemp("vouched") / "seed1"))
    return _FOLDERS[0]
