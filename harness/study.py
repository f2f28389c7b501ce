"""Study files (TOML): what to run, checked to the last name before anything starts."""

from __future__ import annotations

import difflib
import itertools
import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

from harness.errors import InputError
from yade_scripts import batch_table
from yade_scripts import parameters as run_parameters
from yade_scripts.run_id import run_id

STUDY_COPY = "study.toml"
PLAN = "plan.json"  # the runs as they were planned when they were launched
RUNS = "runs"
PACKINGS = "packings"
BIAXIAL = "biaxial"
SEED = "seed"
MOST_RUNS = 100_000  # a grid past this is a slip of the pen
Scalar = bool | int | float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How to run and when to call a run valid; the table [run] of a study file.

    Attributes:
        jobs: runs side by side; None: one a core.
        time_limit_s: a run that takes longer is stopped and counts as failed [s]; None: no limit.
        retries: how often a failed run is tried again within one `forcechain run`.
        servo_bound: largest admissible departure of the confining stress from its target, as a part of it.
        unbalanced_force_bound: largest admissible mean resultant force on a disc over the mean contact force.
        inertial_number_bound: largest admissible inertial number; below 1e-3 dense flow is quasi-static (GDR MiDi,
            Eur. Phys. J. E 14, 2004).
        kinetic_over_elastic_bound: largest admissible kinetic over elastic energy.
        overlap_bound: largest admissible overlap over the mean radius.
        solid_fraction_low, solid_fraction_high: admissible solid fraction of the preparation.
    """

    jobs: int | None = None
    time_limit_s: float | None = None
    retries: int = 0
    servo_bound: float = 0.02
    unbalanced_force_bound: float = 0.05
    inertial_number_bound: float = 1e-3
    kinetic_over_elastic_bound: float = 0.05
    overlap_bound: float = 0.5
    solid_fraction_low: float = 0.83
    solid_fraction_high: float = 0.87


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedRun:
    """One run of a study: its id and every parameter it has, defaults included."""

    run_id: str
    parameters: Mapping[str, Scalar]


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study: a script, its parameters, the grid of those that vary, seeds, and the options of later steps.

    Attributes:
        name: also the name of its folder of results.
        script: "biaxial", "punch", or the absolute path of a script of the user's own (in a run's id its name counts).
        seeds: one run for each, at every point of the grid.
        parameters: those that do not vary.
        grid: name to values; every combination is run.
        table: the rows of a table of yade-batch, in place of a grid; None without one.
        table_file: the table they were read from.
        run: how to run.
        analysis, compare: options as the file has them; the steps that take them check them.
        source: the file it was read from.
    """

    name: str
    script: str
    seeds: tuple[int, ...]
    parameters: Mapping[str, Scalar]
    grid: Mapping[str, tuple[Scalar, ...]]
    table: tuple[batch_table.Row, ...] | None
    table_file: Path | None
    run: RunSettings
    analysis: Mapping[str, Any]
    compare: Mapping[str, Any]
    source: Path

    def planned_runs(self) -> tuple[PlannedRun, ...]:
        """Return every run: grid or table outermost, seeds innermost. InputError when two would be the same."""
        planned = []
        for point, varied in self._points():
            for seed in (point[SEED],) if SEED in point else self.seeds:
                given = {**self.parameters, **point, SEED: seed}
                complete = _checked_parameters(given, self.script, self.source)
                identity = (
                    complete if self.script in run_parameters.TESTS else {**complete, "script": Path(self.script).name}
                )
                planned.append(
                    PlannedRun(run_id=run_id(varied, complete[SEED], identity), parameters=MappingProxyType(complete))
                )
        most, n_runs = Counter(run.run_id for run in planned).most_common(1)[0]
        if n_runs > 1:
            raise InputError(f"{self.source}: two runs have the same parameters ({most}); name every value once")
        return tuple(planned)

    def _points(self) -> Iterator[tuple[Mapping[str, Scalar], Mapping[str, Scalar]]]:
        """Yield the parameters of each point, and those of them that its ids tell."""
        for row in self.table or ():
            yield row.values, row.varied
        if self.table is None:
            for values in itertools.product(*self.grid.values()):
                point = dict(zip(self.grid, values, strict=True))
                yield point, point


def read_study(path: Path, *, script_needed: bool = True) -> Study:
    """Read and check the study file `path`; a script of the user's own has to be there only where it is needed.

    InputError in one line (file, name, expected, found, what to do) for an unknown key or parameter, a value of the
    wrong kind or outside its limits.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such study file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not TOML: {error}") from None
    known = {"name", "script", "seeds", "table", "parameters", "grid", "analysis", "run", "compare"}
    _refuse_unknown(content, known, path, "")
    tables = {}
    for name in ("parameters", "grid", "analysis", "run", "compare"):
        tables[name] = content.get(name, {})
        if not isinstance(tables[name], dict):
            raise InputError(f"{path}: {name}: expected a table [{name}], found {tables[name]!r}")
    name = content.get("name", path.stem)
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][\w.-]*", name):
        raise InputError(f"{path}: name: expected letters, digits, '.', '_' and '-', found {name!r}")
    study = Study(
        name=name,
        script=_script(content.get("script", BIAXIAL), path, script_needed),
        seeds=_seeds(content.get("seeds", [1]), path),
        parameters=MappingProxyType(tables["parameters"]),
        grid=MappingProxyType(_grid(tables["grid"], path)),
        table=_table(content, path) if "table" in content else None,
        table_file=path.parent / content["table"] if "table" in content else None,
        run=_run_settings(tables["run"], path),
        analysis=MappingProxyType(tables["analysis"]),
        compare=MappingProxyType(tables["compare"]),
        source=path,
    )
    for where in ("parameters", "grid"):
        if "seed" in tables[where]:
            raise InputError(f"{path}: [{where}] has a seed; list the seeds at the top: seeds = [1, 2]")
    for twice in tables["parameters"].keys() & tables["grid"].keys():
        raise InputError(f"{path}: {twice!r} stands in [parameters] and in [grid]; keep one")
    study.planned_runs()  # checks every parameter of every run
    return study


def plan_text(study: Study) -> str:
    """Write down the planned runs of `study`, to be kept with its results.

    A later version of this package may know more parameters and so give the same study other run ids; the results
    stay readable by the plan they were made from.
    """
    runs = [{"run_id": run.run_id, "parameters": dict(run.parameters)} for run in study.planned_runs()]
    return json.dumps({"runs": runs}, indent=1) + "\n"


def planned_in(directory: Path, study: Study) -> tuple[PlannedRun, ...]:
    """Return the runs whose results `directory` is for: those of its plan, or what `study` plans where it has none."""
    path = directory / PLAN
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return tuple(
            PlannedRun(run_id=str(run["run_id"]), parameters=MappingProxyType(dict(run["parameters"])))
            for run in content["runs"]
        )
    except FileNotFoundError:
        return study.planned_runs()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not the plan of a study ({error!r}); remove it and run the study again") from None


def study_in(directory: Path) -> Study | None:
    """Return the study a folder of results belongs to: its own, or that of the study two folders above a run."""
    for folder in (directory, directory.resolve().parent.parent):
        if (folder / STUDY_COPY).is_file():
            return read_study(folder / STUDY_COPY, script_needed=False)
    return None


def _refuse_unknown(given: Mapping[str, Any], known: set[str], path: Path, table: str) -> None:
    for name in given:
        if name in known:
            continue
        place = f"[{table}] " if table else ""
        if not table and name in {parameter.name for test in run_parameters.TESTS.values() for parameter in test}:
            hint = "it is a parameter: put it under [parameters] or [grid]"
        else:
            close = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]!r}?" if close else "known: " + ", ".join(sorted(known))
        raise InputError(f"{path}: {place}unknown key {name!r}; {hint}")


def _script(value: Any, path: Path, needed: bool) -> str:
    tests = ", ".join(repr(test) for test in run_parameters.TESTS)
    if not isinstance(value, str):
        raise InputError(f"{path}: script: expected {tests} or the path of a script, found {value!r}")
    if value in run_parameters.TESTS:
        return value
    script = (path.parent / value).resolve()
    if needed and not script.is_file():
        raise InputError(f"{path}: script: expected {tests} or the path of a script, found no file {script}")
    return str(script)


def _seeds(value: Any, path: Path) -> tuple[int, ...]:
    seeds = value if isinstance(value, list) else [value]
    if not seeds or any(not isinstance(seed, int) or isinstance(seed, bool) or seed < 0 for seed in seeds):
        raise InputError(f"{path}: seeds: expected whole numbers from 0, as in [1, 2], found {value!r}")
    return tuple(seeds)


def _grid(table: Mapping[str, Any], path: Path) -> dict[str, tuple[Scalar, ...]]:
    grid = {}
    n_runs = 1
    for name, values in table.items():
        if not isinstance(values, list) or not values:
            raise InputError(f"{path}: [grid] {name}: expected a list of values, found {values!r}")
        grid[name] = tuple(values)
        n_runs *= len(values)
    if n_runs > MOST_RUNS:
        raise InputError(f"{path}: [grid] makes {n_runs} combinations; expected at most {MOST_RUNS}")
    return grid


def _table(content: Mapping[str, Any], path: Path) -> tuple[batch_table.Row, ...]:
    name = content["table"]
    if not isinstance(name, str) or Path(name).name != name:
        raise InputError(f"{path}: table: expected the name of a table beside this file, found {name!r}")
    if "grid" in content:
        raise InputError(f"{path}: table and [grid]: each says what varies; keep one")
    try:
        rows = batch_table.read(path.parent / name)
    except batch_table.TableError as error:
        raise InputError(str(error)) from None
    for row in rows:
        twice = sorted(row.values.keys() & content.get("parameters", {}).keys())
        twice += [SEED] if "seeds" in content and SEED in row.values else []
        if twice:
            raise InputError(f"{path}: {twice[0]!r} stands in {name} as well; keep one")
    return tuple(rows)


def _run_settings(table: Mapping[str, Any], path: Path) -> RunSettings:
    _refuse_unknown(table, {item.name for item in fields(RunSettings)}, path, "run")
    for name, value in table.items():
        whole = name in ("jobs", "retries")
        lowest_is_in = name == "retries"
        good = isinstance(value, int if whole else (int, float)) and not isinstance(value, bool)
        if not good or value < 0 or (value == 0 and not lowest_is_in) or value != value:
            kind = "whole number" if whole else "number"
            limit = "from 0" if lowest_is_in else "above 0"
            raise InputError(f"{path}: [run] {name}: expected a {kind} {limit}, found {value!r}")
    return RunSettings(**table)


def _checked_parameters(given: Mapping[str, Any], script: str, path: Path) -> dict[str, Scalar]:
    if script in run_parameters.TESTS:
        try:
            return run_parameters.check(given, run_parameters.TESTS[script])
        except run_parameters.ParameterError as error:
            raise InputError(f"{path}: {error}") from None
    for name, value in given.items():  # a script of the user's own checks its own parameters
        if not isinstance(value, bool | int | float | str):
            raise InputError(f"{path}: {name}: expected a number, a string, true or false, found {value!r}")
    return dict(given)
