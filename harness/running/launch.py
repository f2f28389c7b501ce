"""Run what a study still lacks: packings first, then runs, each judged by its manifest and products alone."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import platform
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from harness.errors import RunError
from harness.running.engines import Engine, HeldError, Outcome, Task, ending_signals, locked
from harness.running.run_state import RunState, State, state_of, states_of_study
from harness.running.yade_environment import Yade
from harness.study import PACKINGS, PLAN, RUNS, STUDY_COPY, PlannedRun, Study, plan_text
from yade_scripts import checkpoint, export_format, packing, parameters

SCRIPTS = Path(export_format.__file__).resolve().parent
FAILED = "failed"  # earlier attempts of runs that were tried again, kept with their logs
LOCK = ".lock"
RUN_LOCKS = ".locks"  # one for each run and packing, held by the process that makes it
LOCK_PATIENCE_S = 5.0  # a killed harness's runs are ended by the kernel, which takes a moment
LOG_TAIL = 2000  # bytes
OWNER_FOLDER = 0o700  # a YADE that is run by its command writes the cookie of its prompt


class Display(Protocol):
    """Whoever watches a launch."""

    def begin(self, total: int, complete: int) -> None:
        """Runs of the study, and how many are complete already."""

    def watch(self, running: Mapping[str, float]) -> None:
        """Names of the running tasks and their running times [s]; called some times a second."""

    def ended(self, name: str, state: State, reason: str | None, seconds: float) -> None:
        """One run has ended and has been judged."""

    def close(self) -> None:
        """Nothing runs any more."""


def run_study(
    study: Study, directory: Path, *, yade: Yade, engine: Engine, jobs: int | None, display: Display
) -> tuple[RunState, ...]:
    """Launch every run of `study` that is not complete in `directory`, and return the state of all.

    Complete runs are left alone. A run without a manifest starts afresh in a clean folder; what a failed attempt left
    is kept under `failed`. A run that fails does not stop the others. RunError when another harness is at work on the
    same directory, or when nothing can be written there.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        directory = directory.resolve()  # the runs have working directories of their own
        with _locked(directory), ending_signals():
            _keep_study(study, directory)
            states = {state.run_id: state for state in states_of_study(study, directory, thorough=True)}
            n_complete = sum(_ended_well(state) for state in states.values())
            display.begin(len(states), n_complete)
            try:
                for _ in range(study.run.retries + 1):
                    todo = [run for run in study.planned_runs() if not _ended_well(states[run.run_id])]
                    if not todo:
                        break
                    for state in _attempt(study, directory, todo, yade, engine, jobs, display):
                        states[state.run_id] = state
            finally:
                display.close()
            return tuple(states.values())
    except OSError as error:
        raise RunError(f"{error.filename or directory}: {error.strerror}; make room or choose another --out") from None


def _ended_well(state: RunState) -> bool:
    return state.state in (State.DONE, State.INVALID)  # tried again, an invalid run would come out the same


def _attempt(
    study: Study,
    directory: Path,
    todo: list[PlannedRun],
    yade: Yade,
    engine: Engine,
    jobs: int | None,
    display: Display,
) -> list[RunState]:
    """Try every run of `todo` once; return what has become of each."""
    states = []
    free = []
    for run in todo:
        folder = directory / RUNS / run.run_id
        try:
            with locked(directory / RUN_LOCKS / run.run_id, LOCK_PATIENCE_S):
                _clean(directory, run)
                _write(folder / export_format.PARAMETERS, json.dumps(dict(run.parameters), indent=1) + "\n")
        except HeldError:
            reason = f"a process of an earlier launch is still at work in {folder}; end it, or wait for it"
            states.append(RunState(run_id=run.run_id, folder=folder, state=State.FAILED, reason=reason))
            display.ended(run.run_id, State.FAILED, reason, 0.0)
        else:
            free.append(run)
    without_packing: dict[str, str] = {}
    if study.script in parameters.TESTS:
        without_packing = _make_packings(study, directory, free, yade, engine, jobs, display)
    tasks = []
    for run in free:
        name = packing.file_name(run.parameters) if study.script in parameters.TESTS else ""
        if name in without_packing:
            reason = f"its packing could not be made: {without_packing[name]}"
            folder = directory / RUNS / run.run_id
            _record_failure(study, folder, run, reason)
            states.append(state_of(folder, study.run, run))
            display.ended(run.run_id, State.FAILED, reason, 0.0)
        else:
            tasks.append(_run_task(study, directory, run, yade))
    by_id = {run.run_id: run for run in todo}
    with contextlib.closing(engine(tasks, jobs, display.watch)) as outcomes:
        for outcome in outcomes:
            state = _judge(study, outcome, by_id[outcome.task.name])
            states.append(state)
            display.ended(state.run_id, state.state, state.reason, outcome.seconds)
    return states


def _make_packings(
    study: Study,
    directory: Path,
    todo: list[PlannedRun],
    yade: Yade,
    engine: Engine,
    jobs: int | None,
    display: Display,
) -> dict[str, str]:
    """Prepare every packing that `todo` needs and that is not there; return those that failed, with the reason."""
    folder = directory / PACKINGS
    folder.mkdir(exist_ok=True)
    tasks: dict[str, Task] = {}
    for run in todo:
        name = packing.file_name(run.parameters)
        if name in tasks or zipfile.is_zipfile(folder / name):  # one cut short lacks the directory at its end
            continue
        (folder / name).unlink(missing_ok=True)
        stem = name.removesuffix(".npz")
        given = _write(folder / f"{stem}.json", json.dumps(dict(run.parameters), indent=1) + "\n")
        tasks[name] = Task(
            name=stem,
            command=yade.invocation(
                SCRIPTS / "packing.py", [str(given), "--packings", str(folder), "--test", study.script]
            ),
            environment=yade.environment(),
            folder=folder,
            log=folder / f"{stem}.log",
            lock=directory / RUN_LOCKS / stem,
            product=folder / name,
            time_limit_s=study.run.time_limit_s,
        )
    failed = {}
    with contextlib.closing(engine(list(tasks.values()), jobs, display.watch)) as outcomes:
        for outcome in outcomes:
            name = f"{outcome.task.name}.npz"
            if not zipfile.is_zipfile(folder / name):
                failed[name] = _reason(outcome, f"{PACKINGS}/{outcome.task.log.name}")
    return failed


def _run_task(study: Study, directory: Path, run: PlannedRun, yade: Yade) -> Task:
    folder = directory / RUNS / run.run_id
    arguments = [str(folder / export_format.PARAMETERS), "--folder", str(folder)]
    environment = yade.environment()
    if study.script in parameters.TESTS:
        script = SCRIPTS / f"{study.script}.py"
        arguments += ["--packings", str(directory / PACKINGS)]
    else:
        script = SCRIPTS / "own_script.py"  # through which the user's finds our export
        arguments.insert(0, study.script)
    return Task(
        name=run.run_id,
        command=yade.invocation(script, arguments),
        environment=environment,
        folder=folder,
        log=folder / export_format.LOG,
        lock=directory / RUN_LOCKS / run.run_id,
        product=folder / export_format.MANIFEST,
        time_limit_s=study.run.time_limit_s,
    )


def _judge(study: Study, outcome: Outcome, run: PlannedRun) -> RunState:
    """Judge a run that has ended: what it left decides, not how it ended; a run that left no manifest gets one."""
    folder = outcome.task.folder
    if outcome.stopped or not (folder / export_format.MANIFEST).exists():
        _record_failure(study, folder, run, _reason(outcome, export_format.LOG))
    return state_of(folder, study.run, run, thorough=True)


def _reason(outcome: Outcome, log: str) -> str:
    with contextlib.suppress(OSError):
        lines = outcome.task.log.read_bytes()[-LOG_TAIL:].decode("utf-8", "replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        if last:
            return f"{outcome}; the last line of {log}: {last[-200:]}"
    return f"{outcome}; {log} is empty"


def _record_failure(study: Study, folder: Path, run: PlannedRun, reason: str) -> None:
    units = {parameter.name: parameter.unit for parameter in parameters.TESTS.get(study.script, parameters.BIAXIAL)}
    manifest: dict[str, Any] = {
        "format": export_format.FORMAT,
        "status": export_format.STATUS_FAILED,
        "failure": reason,
        "script": Path(study.script).name,
        "parameters": {name: {"value": value, "unit": units.get(name, "")} for name, value in run.parameters.items()},
        "recorded_by": "harness",
    }
    _write(folder / export_format.MANIFEST, json.dumps(manifest, indent=1) + "\n")


def _clean(directory: Path, run: PlannedRun) -> None:
    """Make the run's folder anew; an attempt that ended (its manifest is there) is kept under `failed`.

    Where the attempt left a checkpoint the run goes on from it: its files stay, its manifest and log are kept.
    """
    folder = directory / RUNS / run.run_id
    going_on = bool(checkpoint.saved_in(folder))
    if (folder / export_format.MANIFEST).exists():
        (directory / FAILED).mkdir(exist_ok=True)
        number = 1
        while (kept := directory / FAILED / f"{run.run_id}.{number}").exists():
            number += 1
        if not going_on:
            folder.rename(kept)
        else:
            kept.mkdir()
            for name in (export_format.LOG, export_format.MANIFEST):  # the manifest last: it says the attempt ended
                with contextlib.suppress(FileNotFoundError):
                    (folder / name).rename(kept / name)
    if going_on:
        return
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(mode=OWNER_FOLDER, parents=True)


def _keep_study(study: Study, directory: Path) -> None:
    """Keep the study with its results, so that later steps know its options."""
    kept = directory / STUDY_COPY
    if not kept.exists() or not kept.samefile(study.source):
        _write(kept, study.source.read_text(encoding="utf-8"))
        if study.table_file is not None:
            _write(directory / study.table_file.name, study.table_file.read_text(encoding="utf-8"))
    _write(directory / PLAN, plan_text(study))


def _write(path: Path, text: str) -> Path:
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    return path


@contextlib.contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Keep other harnesses off `directory`. The lock is the kernel's: it goes with its process, however that ends."""
    with (directory / LOCK).open("a+", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.seek(0)
            holder = lock.read().strip() or "another process"
            raise RunError(f"{directory}: {holder} is at work on this study; wait for it, or end it first") from None
        lock.truncate(0)
        lock.write(f"process {os.getpid()} on {platform.node()}")
        lock.flush()
        try:
            yield
        finally:
            lock.truncate(0)
