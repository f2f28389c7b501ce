"""`forcechain demo`: the main job, small: a real YADE study, post-processed, compared, reported."""

from __future__ import annotations

import argparse
from pathlib import Path

from harness import cli
from harness.bundled import bundled_study
from harness.commands.run import RESULTS, launch, positive
from harness.commands.status import exit_status, print_states
from harness.errors import EXIT_GOOD, EXIT_VERDICT
from harness.study import read_study

HELP = "a small real study in YADE: run, analysed, compared, reported"
EXAMPLE = "forcechain demo"
NAME = "demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's arguments to `parser`."""
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (default: results/demo)")
    parser.add_argument("--jobs", type=positive, metavar="N", help="runs side by side (default: one a core)")


def execute(options: argparse.Namespace) -> int:
    """Run the command: the exit status of the first step that cannot be done, else that of the comparison."""
    study = read_study(bundled_study(NAME))
    directory = options.out or RESULTS / study.name
    states = launch(study, directory, options.jobs)
    print_states(states)
    status = exit_status(states)
    if status != EXIT_GOOD:
        return status
    for step in ("compare", "report"):  # as a user would type them, with the defaults of their arguments
        status = max(status, cli.main([step, str(directory)]))
        if status > EXIT_VERDICT:
            break
    return status
