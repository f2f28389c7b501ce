"""The analysis of a study: made from its complete and valid runs, kept under `analysis/`, and read back unchanged."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

import forcechain
import harness
from harness.analysing.analysis_options import describe_options, read_options
from harness.analysing.averages import average, class_shares
from harness.analysing.buckling_data import FOLDER, LEDGER, OPTIONS, TABLES, Analysis
from harness.analysing.pipeline import RunAnalysis, analyse_runs, cases_of
from harness.analysing.reduced import is_reduced, read_reduced, write_reduced
from harness.errors import InputError, RunError
from harness.reading import validity
from harness.reading.exports import Run, read_run, run_folders
from harness.reading.manifest import products_disagreement
from harness.study import STUDY_COPY, RunSettings, Study, planned_in, study_in
from yade_scripts import export_format
from yade_scripts.run_folder import write, write_json


def usable_runs(directory: Path, settings: RunSettings) -> tuple[list[Run], dict[str, str]]:
    """Return the runs of `directory` that are complete and valid, and why each other one is left out.

    Raises InputError when the directory or a run's tables cannot be read.
    """
    runs, left_out = [], {}
    for folder in run_folders(directory):
        try:
            run = read_run(folder)
        except RunError as error:
            left_out[folder.name] = str(error)
            continue
        if run.manifest is not None:
            difference = products_disagreement(run.folder, run.manifest, thorough=False)
            if difference is not None:  # also where this analysis would not read the file
                raise InputError(f"run {run.name}: {difference}, against run.json; run the study again or restore it")
        fault = None if run.manifest is None else validity.faults(validity.judge(run.manifest, settings))
        if fault is None:
            runs.append(run)
        else:
            left_out[run.name] = f"run {run.name}: invalid: {fault}"
    return runs, left_out


def missing_runs(study: Study | None, directory: Path) -> dict[str, str]:
    """Return the planned runs of a study that have no folder yet."""
    if study is None or not (directory / STUDY_COPY).is_file():
        return {}
    there = {folder.name for folder in run_folders(directory)}
    return {
        run.run_id: f"run {run.run_id}: not started; forcechain run {study.source} makes it"
        for run in planned_in(directory, study)
        if run.run_id not in there
    }


def analyse(directory: Path, *, jobs: int | None = None) -> Analysis:
    """Analyse the study or run in `directory`, or read the analysis back if nothing it was made from has changed.

    Reduced results are read as they are. Raises InputError for input that cannot be used, RunError when no run is left
    to analyse.
    """
    study = study_in(directory)
    settings = study.run if study is not None else RunSettings()
    options, intervals = read_options(study.analysis if study else {}, str(study.source if study else directory))
    runs, left_out = usable_runs(directory, settings)
    left_out |= missing_runs(study, directory)
    if not runs:
        raise RunError(f"{directory}: no complete and valid run to analyse: " + "; ".join(left_out.values()))
    described = describe_options(options) | _given(intervals)
    name = study.name if study is not None else directory.resolve().name
    folder = directory / FOLDER
    if is_reduced(directory):
        return _reduced(directory, name, {key: described[key] for key in (study.analysis if study else {})}, left_out)
    source = _source(runs, described)
    if _stored_source(folder) == source:
        return _read(directory, name, described, left_out)
    for run in runs:
        if run.manifest is None:  # nothing vouches for these tables: read them all once, not the drops' alone
            for _ in run.snapshots():
                pass
    found = analyse_runs(list(zip(runs, cases_of(runs), strict=True)), options, intervals, jobs or os.cpu_count() or 1)
    tables, ledger = _tables(found)
    (folder / OPTIONS).unlink(missing_ok=True)
    for table in TABLES:
        write(folder, f"{table}.csv", tables[table].to_csv(index=False).encode())
    write_json(folder, LEDGER, list(ledger))
    write_json(folder, OPTIONS, {"options": described, "package_version": forcechain.__version__, "source": source})
    return Analysis(
        directory=directory, name=name, options=described, **tables, ledger=ledger, left_out=left_out, reused=False
    )


def reduce(analysis: Analysis, target: Path) -> Path:
    """Write the reduced results of a whole study to `target` and return it; errors as `write_reduced`."""
    source = {"package_version": forcechain.__version__, "code": _code_digest()}
    return write_reduced(analysis, TABLES, source, target)


def _reduced(directory: Path, name: str, asked: Mapping[str, Any], left_out: Mapping[str, str]) -> Analysis:
    """Read reduced results; InputError where the study asks for another analysis than the one that was kept."""
    tables, ledger, described = read_reduced(directory, FOLDER, TABLES)
    other = [
        f"{option} {described.get(option, {}).get('value')}, asked for {entry['value']}"
        for option, entry in asked.items()
        if described.get(option, {}).get("value") != entry["value"]
    ]
    if left_out:
        other += [f"without {run}" for run in left_out]
    if other:
        raise InputError(
            f"{directory}: these reduced results were made with {'; '.join(other)}, and cannot be analysed anew; "
            f"restore {STUDY_COPY}, or run it for whole results"
        )
    return Analysis(
        directory=directory, name=name, options=described, **tables, ledger=ledger, left_out=left_out, reused=True
    )


def _given(intervals: Sequence[tuple[float, float]] | None) -> dict[str, dict[str, Any]]:
    if intervals is None:
        return {}
    meaning = "axial strains at which the given drops start and end"
    return {"drops": {"value": [list(pair) for pair in intervals], "unit": "-", "meaning": meaning}}


def _source(runs: Sequence[Run], described: Mapping[str, Any]) -> dict[str, str]:
    """Say what an analysis is made from: the code, the options, and the state of every run's folder."""
    source = {"code": _code_digest(), "options": _digest(json.dumps(described, sort_keys=True))}
    for run in runs:
        manifest = run.folder / export_format.MANIFEST
        if manifest.exists():  # it vouches for every file of the run
            source[run.name] = _digest(manifest.read_text(encoding="utf-8"))
        else:
            files = sorted(path for path in run.folder.rglob("*") if path.is_file() and FOLDER not in path.parts)
            stats = [(path.relative_to(run.folder).as_posix(), path.stat()) for path in files]
            source[run.name] = _digest(str([(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]))
    return source


def _code_digest() -> str:
    """Checksum of the two packages, so that an analysis is made anew after any change of the code that made it."""
    packages = [Path(str(package.__file__)).parent for package in (forcechain, harness)]
    files = [path for package in packages for path in sorted(package.rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _stored_source(folder: Path) -> Any:
    if not all((folder / f"{table}.csv").exists() for table in TABLES):
        return None
    try:
        stored = json.loads((folder / OPTIONS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None  # no finished analysis: make it
    return stored.get("source") if isinstance(stored, dict) else None


def _tables(found: Sequence[RunAnalysis]) -> tuple[dict[str, pd.DataFrame], tuple[Any, ...]]:
    tables = {"runs": pd.DataFrame([analysis.facts for analysis in found])}
    for name in ("drops", "segments", "yielding", "chains", "members", "macroscopic"):
        parts = [getattr(analysis, name) for analysis in found]
        filled = [part for part in parts if len(part)]
        tables[name] = pd.concat(filled, ignore_index=True) if filled else parts[0]
    tables["averages"] = average(tables["segments"])
    tables["classes"] = class_shares(tables["yielding"])
    return tables, tuple(record for analysis in found for record in analysis.ledger)


def _read(directory: Path, name: str, described: Mapping[str, Any], left_out: Mapping[str, str]) -> Analysis:
    folder = directory / FOLDER
    tables = {}
    for table in TABLES:
        path = folder / f"{table}.csv"
        try:
            tables[table] = pd.read_csv(path)
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: cannot be read back ({error}); remove {folder} and analyse again") from None
    try:
        ledger = json.loads((folder / LEDGER).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{folder / LEDGER}: cannot be read back ({error}); remove {folder} and analyse again"
        ) from None
    return Analysis(
        directory=directory, name=name, options=described, **tables, ledger=ledger, left_out=left_out, reused=True
    )
