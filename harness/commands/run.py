"""`forcechain run`: launch what a study still lacks."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

from harness.analysing.analysis_options import read_options
from harness.commands.status import exit_status, print_json, print_states
from harness.errors import InputError
from harness.running.display import display_for
from harness.running.engines import Engine, run_local
from harness.running.launch import run_study
from harness.running.run_state import RunState
from harness.running.yade_environment import need_yade
from harness.study import Study, read_study

HELP = "launch the runs of a study that are not done yet; run it again to resume"
EXAMPLE = "forcechain run studies/demo.toml --jobs 2"
RESULTS = Path("results")
LOCAL, DASK = "local", "dask"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's arguments to `parser`."""
    parser.add_argument("study", type=Path, metavar="STUDY.toml", help="what to run")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/<name>)")
    parser.add_argument(
        "--jobs", type=positive, metavar="N", help="runs side by side (default: one a core; with Dask: one a slot)"
    )
    parser.add_argument(
        "--engine",
        choices=(LOCAL, DASK),
        default=LOCAL,
        help="where they run: this machine, or Dask's workers (%(default)s)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of Dask's scheduler, as tcp://host:8786, or its scheduler file (default: as Dask is configured)",
    )
    parser.add_argument("--json", action="store_true", help="the state of every run, for machines")


def positive(text: str) -> int:
    """Return `text` as a whole number from 1; argparse reports the ValueError."""
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def execute(options: argparse.Namespace) -> int:
    """Run the command: exit status 0 when every run is done and valid, else 3."""
    study = read_study(options.study)
    directory = options.out or RESULTS / study.name
    with _engine(options.engine, options.scheduler) as engine:
        states = launch(study, directory, options.jobs, engine)
    if options.json:
        print_json(states)
    else:
        print_states(states)
        print(directory)
    return exit_status(states)


@contextlib.contextmanager
def _engine(name: str, scheduler: str | None) -> Iterator[Engine]:
    if name == LOCAL:
        if scheduler:
            raise InputError(
                f"--scheduler {scheduler}: the local engine has none; add --engine {DASK}, or leave it out"
            )
        yield run_local
        return
    try:
        from harness.running import dask_engine  # an optional extra: imported only when asked for
    except ModuleNotFoundError as error:
        raise InputError(f"--engine {DASK}: {error}; type: {sys.executable} -m pip install distributed") from None
    with dask_engine.connected(scheduler) as engine:
        yield engine


def launch(study: Study, directory: Path, jobs: int | None, engine: Engine = run_local) -> tuple[RunState, ...]:
    """Run `study` into `directory` with a display on standard error, and return the state of all its runs.

    Options of the later steps are checked now: a slip in them shows before hours of running, not after.
    """
    from harness.comparing.comparison import calibrated_ratios  # not at the top: it brings the whole analysis along

    read_options(study.analysis, str(study.source))
    calibrated_ratios(study.compare, str(study.source))
    if directory.exists() and not directory.is_dir():
        raise InputError(f"{directory}: expected a folder for the results, found a file")
    return run_study(
        study,
        directory,
        yade=need_yade(),
        engine=engine,
        jobs=jobs or study.run.jobs,
        display=display_for(directory),
    )
