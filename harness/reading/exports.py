"""The only reader of run folders (format 1): from files to a run's history and checked, lazily read snapshots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from forcechain.arrays import FloatArray, IntArray, freeze
from forcechain.observe.snapshot import Snapshot
from harness.errors import InputError, RunError
from harness.reading import snapshot_files, tables
from harness.reading.manifest import REDUCED, file_disagreement, parameter_values, read_manifest
from harness.reading.snapshot_files import CONTACTS_CSV, ITERATION, NPZ, PARTICLES_CSV
from harness.study import RUNS, STUDY_COPY, planned_in, read_study
from yade_scripts import export_format
from yade_scripts.export_format import HISTORY_COLUMNS, SNAPSHOT_INDEX_COLUMNS, Column

STRAIN_TOLERANCE = 1e-6  # between an index's strain and its snapshot's: room for an index written with few digits


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run as its folder tells it. Snapshots are read, and checked, when they are asked for.

    Attributes:
        folder: the run's folder.
        name: the folder's name, the run's id in a study.
        manifest: what run.json says, or None for tables of other origin.
        parameters: name to value, empty without a manifest.
        history: one row a sample, columns of `export_format.HISTORY_COLUMNS` as far as the folder has them (with a
            manifest: all), or None when the folder has no history.
        snapshot_index: (n_snapshots,) numbers of the snapshots, increasing.
        axial_strain: (n_snapshots,) axial strain of each, compression positive.
    """

    folder: Path
    name: str
    manifest: Mapping[str, Any] | None
    parameters: Mapping[str, Any]
    history: pd.DataFrame | None
    snapshot_index: IntArray
    axial_strain: FloatArray
    _time: FloatArray = field(repr=False)
    _iteration: IntArray = field(repr=False)

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self.snapshot_index, self.axial_strain, self._time, self._iteration)

    @property
    def n_snapshots(self) -> int:
        """Number of snapshots."""
        return len(self.snapshot_index)

    @property
    def reduced(self) -> bool:
        """Whether the folder keeps only some of the run's files."""
        return self.manifest is not None and REDUCED in self.manifest

    def has_snapshot(self, row: int) -> bool:
        """Whether the snapshot of row `row` is there: always, but for reduced results."""
        return snapshot_files.find_file(self.folder, int(self.snapshot_index[row])) is not None

    def snapshot(self, row: int) -> Snapshot:
        """Return the snapshot of row `row` of the index (not its number: rows count from 0 without gaps).

        InputError in one line when its files are missing, broken, changed since the run, or hold inadmissible numbers.
        """
        if not 0 <= row < self.n_snapshots:
            raise InputError(
                f"run {self.name}: expected a snapshot's row from 0 to {self.n_snapshots - 1}, found {row}"
            )
        index = int(self.snapshot_index[row])
        where = f"run {self.name}"
        path = snapshot_files.find_file(self.folder, index)
        if path is None and self.reduced:
            raise InputError(
                f"{where}: snapshot {index} is not part of these reduced results; "
                f"run their study for it: forcechain run {STUDY_COPY}"
            )
        if path is None:
            stem = export_format.snapshot_name(index)
            raise InputError(
                f"{where}: snapshot {index} is missing: expected {stem}{NPZ}, or {stem}{PARTICLES_CSV} and "
                f"{stem}{CONTACTS_CSV}, in {export_format.SNAPSHOTS}/; run the study again or export it anew"
            )
        contents = snapshot_files.read_contents(path, where)
        scalars = {"time": self._time[row], "iteration": self._iteration[row], "axial_strain": self.axial_strain[row]}
        snapshot = snapshot_files.build(path, contents, scalars, where)
        if abs(snapshot.axial_strain - self.axial_strain[row]) > STRAIN_TOLERANCE:
            raise InputError(
                f"{where}: {path.name}: expected axial strain {self.axial_strain[row]:.9g}, as the index of snapshots "
                f"says, found {snapshot.axial_strain:.9g}; export both at one step"
            )
        self._agree_with_manifest(contents)
        return snapshot

    def snapshots(self) -> Iterator[Snapshot]:
        """Yield every snapshot in the order of the index, one in memory at a time."""
        for row in range(self.n_snapshots):
            yield self.snapshot(row)

    def _agree_with_manifest(self, contents: Mapping[Path, bytes]) -> None:
        # After the numbers' own check, whose message says more about what is wrong
        if self.manifest is None:
            return
        files = self.manifest["products"]["files"]
        for path, content in contents.items():
            name = path.relative_to(self.folder).as_posix()
            difference = file_disagreement(self.folder, name, files.get(name, {}), content)
            if difference is not None:
                raise InputError(
                    f"run {self.name}: {difference}, against {export_format.MANIFEST}; run the study again, or remove "
                    f"{export_format.MANIFEST} to read changed tables as your own"
                )


def is_run(folder: Path) -> bool:
    """Whether `folder` holds what a run leaves: a manifest, its parameters, or tables of snapshots."""
    marks = (export_format.MANIFEST, export_format.PARAMETERS, export_format.SNAPSHOT_INDEX, export_format.SNAPSHOTS)
    return any((folder / mark).exists() for mark in marks) or bool(snapshot_files.numbered_files(folder))


def run_folders(directory: Path) -> tuple[Path, ...]:
    """Return the folders of the runs in `directory`: itself, those under its `runs` folder, or its own subfolders.

    Of a study's folder only the runs the study plans: one left from an earlier version of the study is not among them.
    InputError when there is no such directory, or no run in it.
    """
    if not directory.is_dir():
        what = "a file" if directory.exists() else "nothing of that name"
        raise InputError(f"{directory}: expected the folder of a run or of a study, found {what}")
    if is_run(directory):
        return (directory,)
    parent = directory / RUNS if (directory / RUNS).is_dir() else directory
    found = tuple(sorted(folder for folder in parent.iterdir() if folder.is_dir() and is_run(folder)))
    if (directory / STUDY_COPY).is_file():
        study = read_study(directory / STUDY_COPY, script_needed=False)
        planned = [run.run_id for run in planned_in(directory, study)]
        there = {folder.name: folder for folder in found}
        found = tuple(there[run_id] for run_id in planned if run_id in there)
    if not found:
        raise InputError(
            f"{directory}: no run in it: expected {export_format.MANIFEST} or tables of snapshots in it, in its "
            "subfolders or under runs/; make some with: forcechain run STUDY.toml"
        )
    return found


def read_run(folder: Path) -> Run:
    """Read the run in `folder`: one this harness made (with run.json), or tables of other origin (without).

    Raises InputError for tables that cannot be used, RunError for a run that failed or has not ended.
    """
    folder = folder.resolve()
    where = f"run {folder.name}"
    manifest: Mapping[str, Any] | None = None
    if (folder / export_format.MANIFEST).exists():
        manifest = read_manifest(folder)
        if manifest["status"] == export_format.STATUS_FAILED:
            reason = manifest.get("failure") or "it does not say why"
            raise RunError(f"{where}: failed: {reason}; see {export_format.LOG} in its folder")
        index = _index_of_manifest(folder, manifest, where)
    elif (folder / export_format.PARAMETERS).exists() or (folder / export_format.PROGRESS).exists():
        raise RunError(f"{where}: it has not ended: {export_format.MANIFEST} is missing; run the study (again)")
    else:
        index = _index_of_tables(folder, where)
    order = np.argsort(index["index"], kind="stable")
    index = {name: values[order] for name, values in index.items()}
    repeated = index["index"][1:] == index["index"][:-1]
    if repeated.any():
        raise InputError(f"{where}: snapshot {index['index'][int(np.argmax(repeated))]} is there twice in the index")
    if not len(order):
        raise InputError(f"{where}: it has no snapshot")
    return Run(
        folder=folder,
        name=folder.name,
        manifest=manifest,
        parameters=MappingProxyType({} if manifest is None else parameter_values(manifest)),
        history=_read_history(folder, where, manifest),
        snapshot_index=index["index"].astype(np.int64),
        axial_strain=index["axial_strain"],
        _time=index["time"],
        _iteration=index["iteration"].astype(np.int64),
    )


def read_snapshot(path: Path) -> Snapshot:
    """Read one snapshot by itself: an npz, or a `.particles.csv` with its `.contacts.csv` (strain from the index).

    Raises InputError in one line when the files are missing or broken or hold inadmissible numbers.
    """
    path = path.resolve()
    folder = path.parent.parent if path.parent.name == export_format.SNAPSHOTS else path.parent
    where = f"run {folder.name}"
    scalars: dict[str, Any] = {}
    if path.suffix != NPZ:
        index = _index_of_tables(folder, where)
        stem = path.name.split(".")[0]
        rows = np.flatnonzero([export_format.snapshot_name(int(number)) == stem for number in index["index"]])
        if not len(rows):
            raise InputError(f"{where}: {export_format.SNAPSHOT_INDEX} has no row for {path.name}")
        scalars = {name: index[name][rows[0]] for name in export_format.SNAPSHOT_SCALARS}
    return snapshot_files.build(path, snapshot_files.read_contents(path, where), scalars, where)


def _index_of_manifest(folder: Path, manifest: Mapping[str, Any], where: str) -> dict[str, Any]:
    if any((place / export_format.SNAPSHOT_INDEX).exists() for place in snapshot_files.places(folder)):
        return _index_of_tables(folder, where)  # CSV tables leave time and step number to it
    where = f"{where}: {export_format.MANIFEST}"
    rows = manifest["products"]["snapshots"]
    for number, row in enumerate(rows):
        if not isinstance(row, dict) or any(
            type(row.get(name)) not in (int, float) for name in ("index", "axial_strain")
        ):
            raise InputError(f"{where}: products.snapshots, entry {number}: expected an index and an axial_strain")
    columns = {name: np.array([row[name] for row in rows]) for name in ("index", "axial_strain")}
    index = tables.checked(columns, SNAPSHOT_INDEX_COLUMNS[:2], "products.snapshots", where)
    listed = {export_format.snapshot_name(int(number)) for number in index["index"]}
    vouched = {Path(name).name for name in manifest["products"]["files"] if name.endswith(snapshot_files.NPZ)}
    unlisted = sorted(vouched - {stem + snapshot_files.NPZ for stem in listed})
    if unlisted:
        raise InputError(
            f"{where}: products.snapshots: expected an entry for {unlisted[0]}, one of its files, found none"
        )
    return index | dict.fromkeys(("time", "iteration"), np.zeros(len(rows)))  # each npz has its own


def _index_of_tables(folder: Path, where: str) -> dict[str, Any]:
    """Return index, axial_strain, time and iteration of every snapshot in a folder without a manifest."""
    stems = snapshot_files.numbered_files(folder)
    for place in snapshot_files.places(folder):
        path = place / export_format.SNAPSHOT_INDEX
        if not path.exists():
            continue
        where_file = f"{where}: {path.name}"
        table = tables.read_csv(tables.read_bytes(path, where_file), where_file)
        columns = SNAPSHOT_INDEX_COLUMNS + ((ITERATION,) if ITERATION.name in table else ())
        index = tables.checked(table, columns, "snapshots", where_file)
        index.setdefault(ITERATION.name, index["index"])  # tables of other origin may not count their steps
        listed = {export_format.snapshot_name(int(number)) for number in index["index"]}
        unlisted = sorted(stems.keys() - listed)
        if unlisted:
            raise InputError(f"{where_file}: there are tables of snapshot {unlisted[0]} but no row for them")
        return index
    without = sorted(stem for stem, path in stems.items() if path.suffix != NPZ)
    if without or not stems:
        need = f"the strain of {without[0]}{PARTICLES_CSV} is unknown" if without else "no snapshot was found"
        raise InputError(
            f"{where}: {need}: expected {export_format.SNAPSHOT_INDEX} with the columns "
            + ", ".join(export_format.names(SNAPSHOT_INDEX_COLUMNS))
        )
    rows = []
    for stem, path in sorted(stems.items()):
        archive = tables.read_npz(tables.read_bytes(path, f"{where}: {path.name}"), f"{where}: {path.name}")
        rows.append({"index": int(stem)} | snapshot_files.scalars_of(archive, f"{where}: {path.name}"))
    return {name: np.array([row[name] for row in rows]) for name in ("index", *export_format.SNAPSHOT_SCALARS)}


def _read_history(folder: Path, where: str, manifest: Mapping[str, Any] | None) -> pd.DataFrame | None:
    path = folder / export_format.HISTORY
    if manifest is None and not path.exists():
        return None
    where_file = f"{where}: {path.name}"
    content = tables.read_bytes(path, where_file)
    table = tables.read_csv(content, where_file)
    columns: tuple[Column, ...] = HISTORY_COLUMNS
    if manifest is None:  # tables of other origin: what they have, the strain at least
        columns = tuple(c for c in HISTORY_COLUMNS if c.name in table or c.name == "axial_strain")
    history = pd.DataFrame(tables.checked(table, columns, "history", where_file))
    if manifest is not None:
        entry = manifest["products"]["files"].get(export_format.HISTORY, {})
        difference = file_disagreement(folder, export_format.HISTORY, entry, content)
        if difference is not None:
            raise InputError(f"{where}: {difference}, against {export_format.MANIFEST}; run the study again")
    return history
