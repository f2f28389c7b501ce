"""`forcechain status`: where every run of a study stands."""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from harness.errors import EXIT_GOOD, EXIT_RUN
from harness.running.display import progress_words
from harness.running.run_state import RunState, State, states_in

HELP = "every run of a study: waiting, running (strain, time left), done, invalid or failed (why)"
EXAMPLE = "forcechain status results/demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's arguments to `parser`."""
    parser.add_argument("directory", type=Path, metavar="DIR", help="a run's folder, or a study's")
    parser.add_argument("--json", action="store_true", help="for machines, with the figures of every run's validity")


def execute(options: argparse.Namespace) -> int:
    """Run the command: exit status 0 when every run is done and valid, else 3."""
    states = states_in(options.directory)
    if options.json:
        print_json(states)
    else:
        print_states(states)
    return exit_status(states)


def print_states(states: Sequence[RunState]) -> None:
    """Print a line a run and a line of counts."""
    width = max(len(state.run_id) for state in states)
    for state in states:
        words = state.reason or (progress_words(state.progress) if state.progress else "")
        print(f"{state.run_id:<{width}}  {state.state.value:<8} {' '.join(words.split())}".rstrip())
    counts = Counter(state.state for state in states)
    print(f"{len(states)} runs: " + ", ".join(f"{counts[kind]} {kind.value}" for kind in State if counts[kind]))


def print_json(states: Sequence[RunState]) -> None:
    """Print everything that is known of every run as one JSON object."""
    print(json.dumps({"runs": [_entry(state) for state in states]}, indent=1))


def exit_status(states: Sequence[RunState]) -> int:
    """Return 0 when every run is done and valid, else 3."""
    return EXIT_GOOD if all(state.state is State.DONE for state in states) else EXIT_RUN


def _entry(state: RunState) -> dict[str, Any]:
    return {
        "run": state.run_id,
        "folder": str(state.folder),
        "state": state.state.value,
        "reason": state.reason,
        "progress": dict(state.progress) if state.progress else None,
        "validity": [
            {
                "name": figure.name,
                "meaning": figure.meaning,
                "value": figure.value if math.isfinite(figure.value) else None,
                "lower": figure.lower,
                "upper": figure.upper,
                "passed": figure.passed,
            }
            for figure in state.figures
        ],
    }
