"""Reduced results: what a study amounts to in a few megabytes, so that all works on it but to analyse it anew.

Kept are the study, its plan, every run's manifest and history, the tables of the analysis, and two snapshots for
pictures. `reduced.json` vouches for every file.
"""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from harness.analysing.buckling_data import Analysis
from harness.errors import InputError
from harness.reading.consistency import run_consistency
from harness.reading.exports import Run, read_run, run_folders
from harness.reading.manifest import REDUCED, file_disagreement, read_json, tables_digest
from harness.reading.stored import PACKED, pack, read_stored
from harness.study import PLAN, RUNS, STUDY_COPY
from harness.text_table import number
from yade_scripts import export_format
from yade_scripts.run_folder import Product, write

MARK = "reduced.json"  # written last
FORMAT = 1
DIGITS = 7  # of a measure of a segment: a mean over segments moves by less than one part in a million
PACKED_TABLES = ("segments", "yielding", "chains", "members")  # the long ones
STRAIN_DECIMALS = 9  # of the index of snapshots, within what a snapshot's own strain may differ by
SENSITIVITY = "sensitivity.csv"


def is_reduced(directory: Path) -> bool:
    """Whether `directory` holds the reduced results of a study."""
    return (directory / MARK).is_file()


def made_by(directory: Path) -> dict[str, str]:
    """Return what made the analysis of reduced results: package version and checksum of the code."""
    return {name: str(value) for name, value in _mark(directory)["made_by"].items()}


def read_reduced(
    directory: Path, folder: str, names: Sequence[str]
) -> tuple[dict[str, pd.DataFrame], Any, dict[str, Any]]:
    """Return the tables `names` of an analysis in `folder`, its ledger and its options, as they were reduced.

    InputError for a file that has changed since or a table that an earlier version did not have.
    """
    for name, entry in _mark(directory)["files"].items():
        difference = file_disagreement(directory, name, entry)
        if difference is not None:
            raise InputError(f"{directory}: {difference}, against {MARK}; restore it, or export the results anew")
    tables = {}
    for name in names:
        path = directory / folder / f"{name}.csv"
        try:
            tables[name] = pd.read_csv(io.BytesIO(read_stored(path)))
        except FileNotFoundError:
            raise InputError(
                f"{path}: these reduced results are of a version without this table; export them anew"
            ) from None
    where = str(directory)
    ledger = json.loads((directory / folder / "ledger.json").read_text(encoding="utf-8"))
    return tables, ledger, read_json(directory / folder / "options.json", where)["options"]


def _mark(directory: Path) -> dict[str, Any]:
    mark = read_json(directory / MARK, str(directory))
    if mark.get("format") != FORMAT or not isinstance(mark.get("files"), dict) or "made_by" not in mark:
        raise InputError(f"{directory / MARK}: expected reduced results of format {FORMAT}; export them anew")
    return mark


def write_reduced(analysis: Analysis, names: Sequence[str], source: Mapping[str, str], target: Path) -> Path:
    """Write the reduced results of a whole study to `target`, a new folder or one of reduced results, and return it.

    `names` are those of the tables, `source` says what made them. Two runs of this write the same bytes. What is in
    `target` of another origin (remarks, say) stays. InputError for a study without study file or manifests, a sweep
    that is of another analysis, or a folder that holds something else.
    """
    directory = analysis.directory
    _refuse(analysis, target)
    runs = [read_run(folder) for folder in run_folders(directory)]
    for run in runs:
        if run.manifest is None or run.reduced:
            found = "already reduced ones" if run.reduced else "tables without run.json"
            raise InputError(f"run {run.name}: expected a run of this harness with its snapshots, found {found}")
    tables = _contents_of_tables(analysis, names)
    if is_reduced(target):
        (target / MARK).unlink()
        shutil.rmtree(target / RUNS, ignore_errors=True)
        shutil.rmtree(target / analysis.folder.name, ignore_errors=True)
    files = [_copy(directory, name, target) for name in (STUDY_COPY, PLAN) if (directory / name).is_file()]
    kept = pictured_snapshots(analysis)
    for run in runs:
        files += _write_run(run, target, kept.get(run.name, ()))
    files += [write(target, f"{analysis.folder.name}/{name}", content) for name, content in tables.items()]
    entries = {product.name: {"bytes": product.size, "sha256": product.sha256} for product in files}
    mark = {"format": FORMAT, "made_by": dict(source), "digits": DIGITS, "files": entries}
    write(target, MARK, (json.dumps(mark, indent=1) + "\n").encode())
    return target


def pictured_snapshots(analysis: Analysis) -> dict[str, tuple[int, int]]:
    """Return run -> rows of the first and last snapshot of the first case's drop with the most buckled segments."""
    counted = [record for record in analysis.ledger if record["case"] == analysis.cases[0]]
    if not counted:
        return {}
    record = max(counted, key=lambda entry: entry["buckled_segments"])
    drops = analysis.drops
    drop = drops[(drops["run"] == record["run"]) & (drops["drop"] == record["drop"])].iloc[0]
    return {record["run"]: (int(drop["first_snapshot"]), int(drop["last_snapshot"]))}


def _refuse(analysis: Analysis, target: Path) -> None:
    directory = analysis.directory
    if not (directory / STUDY_COPY).is_file():
        raise InputError(f"{directory}: expected a study's folder with {STUDY_COPY}, found none")
    if target.resolve() == directory.resolve():
        raise InputError(f"{target}: the results cannot be reduced in their own place; name another folder")
    if target.exists() and not target.is_dir():
        raise InputError(f"{target}: expected a folder, found a file")
    if target.exists() and not is_reduced(target) and (target / RUNS).exists():
        raise InputError(f"{target}: it holds a study's whole results; name another folder")


def _copy(directory: Path, name: str, target: Path) -> Product:
    return write(target, name, (directory / name).read_bytes())


def _write_run(run: Run, target: Path, rows: Sequence[int]) -> list[Product]:
    """Write manifest, history and the snapshots of `rows`; the manifest vouches for what the run wrote, unpacked."""
    manifest = dict(run.manifest or {})
    products = manifest["products"]
    files = products["files"]
    stems = [export_format.snapshot_name(int(run.snapshot_index[row])) for row in rows]
    kept = [name for name in files if Path(name).name.split(".")[0] in stems]
    index = zip(run.snapshot_index.tolist(), run.axial_strain.tolist(), strict=True)
    manifest[REDUCED] = {
        "files": len(files),
        "bytes": sum(int(entry["bytes"]) for entry in files.values()),
        "tables": tables_digest(manifest),
        "consistency": run_consistency(run),
    }
    manifest["products"] = products | {
        "files": {name: files[name] for name in (export_format.HISTORY, *kept)},
        "snapshots": [{"index": i, "axial_strain": round(strain, STRAIN_DECIMALS)} for i, strain in index],
    }
    inside = f"{RUNS}/{run.name}/"
    history = pack((run.folder / export_format.HISTORY).read_bytes())
    written = [write(target, inside + export_format.HISTORY + PACKED, history)]
    written += [write(target, inside + name, (run.folder / name).read_bytes()) for name in kept]
    text = json.dumps(manifest, separators=(",", ":"), allow_nan=False).replace('},"', '},\n"')
    return [*written, write(target, inside + export_format.MANIFEST, (text + "\n").encode())]


def _contents_of_tables(analysis: Analysis, names: Sequence[str]) -> dict[str, bytes]:
    folder = analysis.folder
    contents = {f"{name}.csv": (folder / f"{name}.csv").read_bytes() for name in names}
    contents["segments.csv"] = _rounded(analysis.segments)
    sweep = folder / SENSITIVITY
    if sweep.is_file():
        _check_sweep(pd.read_csv(sweep), analysis, sweep)
        contents[SENSITIVITY] = sweep.read_bytes()
    for name in ("ledger.json", "options.json"):
        contents[name] = (folder / name).read_bytes()
    for name in PACKED_TABLES:
        contents[f"{name}.csv{PACKED}"] = pack(contents.pop(f"{name}.csv"))
    return contents


def _rounded(segments: pd.DataFrame) -> bytes:
    measures = [name for name in segments if pd.api.types.is_float_dtype(segments[name]) and name != "axial_strain"]
    table = segments.copy()
    for name in measures:
        table[name] = [float(f"{value:.{DIGITS}g}") for value in segments[name].to_numpy(dtype=np.float64)]
    table["axial_strain"] = segments["axial_strain"].round(STRAIN_DECIMALS)
    return table.to_csv(index=False).encode()


def _check_sweep(sweep: pd.DataFrame, analysis: Analysis, path: Path) -> None:
    """Refuse a sweep whose first row is not this analysis: it was made of other runs or with other options."""
    in_use = sweep[sweep["in_use"].astype(bool)].set_index("case")
    for case in analysis.cases:
        found = int((analysis.yielding["case"] == case).sum())
        told = in_use["segments"].get(case)
        if told is None or int(told) != found:
            raise InputError(
                f"{path}: {case}: expected {found} segments with the options in use, as analysed, found "
                f"{number(told)}; make it anew: forcechain analyse {analysis.directory} --sensitivity"
            )
