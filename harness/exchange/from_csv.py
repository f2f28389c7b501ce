"""Tables in format 1 of any origin, CSV or npz: checked to the last number, then kept as a run of this package."""

from __future__ import annotations

from pathlib import Path

from harness.errors import InputError
from harness.exchange.new_folder import new_folder
from harness.exchange.snapshot_tables import write_run
from harness.reading.exports import read_run


def import_csv(source: Path, folder: Path) -> int:
    """Read the tables in the folder `source`, check all of them, write a run into `folder`; return its snapshots.

    Raises InputError in one line for anything that is missing, inconsistent or not a number.
    """
    if not source.is_dir():
        raise InputError(f"{source}: expected a folder with tables in format 1, found {_what(source)}")
    run = read_run(source)
    origin = {"source": source.resolve().name, "source_format": "csv", "parameters": dict(run.parameters)}
    with new_folder(folder) as making:
        return write_run(making, run.snapshots(), run.history, origin)


def _what(path: Path) -> str:
    return "a file" if path.exists() else "nothing of that name"
