"""Where every run of a study stands, told by its folder alone: manifest, products, progress."""

from __future__ import annotations

import enum
import json
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from harness.errors import InputError
from harness.reading import exports, validity
from harness.reading.manifest import parameter_values, products_disagreement, read_manifest
from harness.study import RUNS, PlannedRun, RunSettings, Study, planned_in, study_in
from yade_scripts import export_format

STALE_AFTER_S = 60.0  # a run writes its progress every second


class State(enum.Enum):
    """What has become of a run."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    INVALID = "invalid"
    FAILED = "failed"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunState:
    """One run's state.

    Attributes:
        run_id: the run's id, its folder's name.
        folder: where it is, or will be.
        state: what has become of it.
        reason: why it failed or is invalid, or None.
        progress: what a running one last told (axial_strain, target_strain, steps_per_second, seconds_left, ...).
        figures: the figures its validity was judged by.
    """

    run_id: str
    folder: Path
    state: State
    reason: str | None = None
    progress: Mapping[str, Any] | None = None
    figures: tuple[validity.Figure, ...] = ()


def state_of(
    folder: Path, settings: RunSettings, planned: PlannedRun | None = None, *, thorough: bool = False
) -> RunState:
    """Return the state of the run in `folder`.

    A run is done when its manifest says so, vouches for products that exist with the sizes it names (`thorough`: and
    the checksums), has the planned parameters, and every figure of its validity is within bounds.
    """
    run_id = folder.name

    def result(state: State, reason: str | None = None, **more: Any) -> RunState:
        return RunState(run_id=run_id, folder=folder, state=state, reason=reason, **more)

    if not (folder / export_format.MANIFEST).exists():
        progress = read_progress(folder)
        if progress is not None and _alive(progress):
            return result(State.RUNNING, progress=progress)
        if planned is None and not (folder / export_format.PARAMETERS).exists() and exports.is_run(folder):
            return result(State.DONE)  # tables of other origin
        return result(State.WAITING)
    try:
        manifest = read_manifest(folder)
    except InputError as error:
        return result(State.FAILED, str(error))
    if manifest["status"] == export_format.STATUS_FAILED:
        return result(State.FAILED, str(manifest.get("failure") or f"it does not say why; see {export_format.LOG}"))
    if planned is not None:
        found = parameter_values(manifest)
        for name, value in planned.parameters.items():
            if found.get(name) != value:
                return result(State.FAILED, f"its manifest has {name} = {found.get(name)!r}, the study {value!r}")
    difference = products_disagreement(folder, manifest, thorough=thorough)
    if difference is not None:
        return result(State.FAILED, f"its manifest says done, but {difference}")
    figures = validity.judge(manifest, settings)
    faults = validity.faults(figures)
    return result(State.INVALID if faults else State.DONE, faults, figures=figures)


def states_of_study(study: Study, directory: Path, *, thorough: bool = False) -> tuple[RunState, ...]:
    """Return the state of every run that `study` plans, its results being in `directory`."""
    return tuple(
        state_of(directory / RUNS / run.run_id, study.run, run, thorough=thorough) for run in study.planned_runs()
    )


def states_in(directory: Path) -> tuple[RunState, ...]:
    """Return the state of every run of `directory`: those its study plans, or without a study those that are there.

    InputError when there is no such directory, or neither a study nor a run in it.
    """
    study = study_in(directory)
    if study is not None and not exports.is_run(directory):
        return tuple(state_of(directory / RUNS / run.run_id, study.run, run) for run in planned_in(directory, study))
    settings = study.run if study else RunSettings()
    return tuple(state_of(folder, settings) for folder in exports.run_folders(directory))


def read_progress(folder: Path) -> dict[str, Any] | None:
    """Return what a run last told of itself, or None. It appears by rename, so that it is whole or not there."""
    try:
        progress = json.loads((folder / export_format.PROGRESS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return progress if isinstance(progress, dict) else None


def _alive(progress: Mapping[str, Any]) -> bool:
    try:
        age = (datetime.now(UTC) - datetime.fromisoformat(str(progress.get("time")))).total_seconds()
    except (ValueError, TypeError):
        return False
    if age > STALE_AFTER_S:
        return False
    pid = progress.get("pid")
    here = progress.get("host", platform.node()) == platform.node()
    return not (here and isinstance(pid, int)) or _lives(pid)


def _lives(pid: int) -> bool:
    """Whether a process of this machine goes on; one that has ended counts as gone before its parent has seen it."""
    try:
        os.kill(pid, 0)  # asks only whether it is there
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return not Path("/proc/self/stat").exists()  # gone in between, or a system without /proc
