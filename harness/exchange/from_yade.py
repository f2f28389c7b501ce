"""States that YADE saved to a run in format 1: YADE itself loads them and our export writes what it sees."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from harness.errors import InputError, RunError
from harness.exchange.new_folder import new_folder
from harness.exchange.snapshot_tables import history_rows, write_history, write_origin
from harness.reading.exports import read_run
from harness.running.yade_environment import need_yade
from yade_scripts.run_folder import SCRIPTS

SCRIPT = SCRIPTS / "from_saved_state.py"
ENDINGS = (".xml", ".xml.gz", ".xml.bz2", ".yade", ".yade.gz", ".yade.bz2", ".bin", ".bin.gz")
TIMEOUT_S = 3600


def saved_states(source: Path) -> tuple[Path, ...]:
    """Return the saved states that `source` is or holds, in the order of their names; InputError if there is none."""
    if source.is_file():
        return (source.resolve(),)
    if not source.is_dir():
        raise InputError(f"{source}: expected a state saved by YADE or a folder of them, found nothing of that name")
    found = tuple(sorted(path.resolve() for path in source.iterdir() if path.name.endswith(ENDINGS)))
    if not found:
        raise InputError(f"{source}: expected states saved by YADE ({', '.join(ENDINGS)}), found none")
    return found


def import_states(source: Path, folder: Path, walls: Sequence[str] = ()) -> int:
    """Load the states in `source` with YADE, write a run into `folder`; return the number of its snapshots.

    `walls` are texts like "left=0": bodies by number; without them walls are found by their place beside the discs.
    Raises InputError for states that do not fit, RunError when there is no YADE or it ends without a word.
    """
    states = saved_states(source)
    yade = need_yade()
    with new_folder(folder) as making:
        arguments = [*map(str, states), "--folder", str(making)]
        arguments += [part for wall in walls for part in ("--wall", wall)]
        try:
            ended = subprocess.run(
                yade.invocation(SCRIPT, arguments),
                env=yade.environment(),
                capture_output=True,
                text=True,
                errors="replace",
                timeout=TIMEOUT_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise RunError(f"{source}: YADE could not load it: {error}") from None
        told = _last_object(ended.stdout)
        if ended.returncode or told is None:
            lines = ended.stderr.strip().splitlines() or [f"YADE ended with status {ended.returncode}"]
            raise InputError(
                f"{source}: {lines[-1]} (a state loads only in the version of YADE that saved it; here {yade.version})"
            )
        try:  # what was written is read as any run: nothing inadmissible gets past
            run = read_run(making)
            rows = [row for snapshot in run.snapshots() for row in history_rows(snapshot)]
        except InputError as error:
            raise InputError(str(error).replace(making.name, source.name)) from None
        if rows:
            write_history(making, pd.DataFrame(rows))
        write_origin(making, {"source": [state.name for state in states], "source_format": "yade"} | told)
        return run.n_snapshots


def _last_object(text: str) -> dict[str, Any] | None:
    for line in reversed(text.splitlines()):
        try:
            told = json.loads(line)
        except ValueError:
            continue
        if isinstance(told, dict):
            return told
    return None
