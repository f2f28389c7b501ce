"""The command line that every script of a test has, and what becomes of its run when something goes wrong."""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from yade_scripts import batch_table, checkpoint, export_format, parameters, recorder, run_folder
from yade_scripts.run_id import run_id

try:
    import yade
except ImportError:
    yade = None

# Parameter values, the run's folder, the folder of packings, seconds between checkpoints.
Run = Callable[[Mapping[str, Any], Path, Path, float], None]

DONE, FAILED, BAD_INPUT = 0, 1, 2
RUNS = "runs"


def main(
    script: Path, about: str | None, table: tuple[parameters.Parameter, ...], run: Run, arguments: Sequence[str]
) -> int:
    """Run the test that `arguments` ask for; return the exit status: 0 done, 1 failed, 2 bad input."""
    parser = argparse.ArgumentParser(
        prog=script.name,
        description=(about or "").split("\n\n", maxsplit=1)[0],
        epilog="parameters: " + ", ".join(parameter.name for parameter in table),
    )
    parser.add_argument(
        "parameters",
        type=Path,
        nargs="?",
        metavar="PARAMETERS.json",
        help="one JSON object of names and values; under yade-batch, a line of its table instead",
    )
    parser.add_argument(
        "--folder", type=Path, help="the run's folder (default: that of PARAMETERS.json; TABLE's name/runs/RUN-ID)"
    )
    parser.add_argument("--packings", type=Path, help="prepared packings (default: `packings` beside `runs`)")
    parser.add_argument(
        "--checkpoint-every",
        type=float,
        default=120.0,
        metavar="SECONDS",
        help="save the state this often; a killed run goes on from there (default: %(default)g)",
    )
    options = parser.parse_args(arguments)
    try:
        values, folder = _asked_for(options.parameters, options.folder, table)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return BAD_INPUT
    beside = folder.parent.parent if folder.parent.name == RUNS else folder
    packings = (options.packings or beside / "packings").resolve()
    if yade is None:
        print(run_folder.NO_YADE, file=sys.stderr)
        return BAD_INPUT
    started = run_folder.now()
    if options.parameters is None:
        run_folder.write_json(folder, export_format.PARAMETERS, values)
    (folder / export_format.MANIFEST).unlink(missing_ok=True)  # whatever happens now, the old one is no longer true
    try:
        run(values, folder, packings, options.checkpoint_every)
    except Exception as error:
        traceback.print_exc()
        if not isinstance(error, OSError):  # what is wrong with the run itself would be wrong again
            checkpoint.clear(folder)
        manifest = recorder.heading(export_format.STATUS_FAILED, script, values, table, started)
        manifest["failure"] = " ".join(f"{type(error).__name__}: {error}".split())
        run_folder.write_json(folder, export_format.MANIFEST, manifest, durable=True)
        return FAILED
    return DONE


def _asked_for(
    file: Path | None, folder: Path | None, table: tuple[parameters.Parameter, ...]
) -> tuple[dict[str, Any], Path]:
    """Parameters and folder of the run: of a parameter file, or of the line that yade-batch has started."""
    if file is not None:
        try:
            return run_folder.read_parameters(file, table), (folder or file.parent).resolve()
        except (OSError, ValueError) as error:
            raise ValueError(f"{file}: {error}") from None
    asked = batch_table.asked_for()
    if asked is None:
        raise ValueError("expected PARAMETERS.json, or a line of a table from yade-batch; --help tells more")
    path, line = asked
    rows = {row.line: row for row in batch_table.runs(path, table)}
    if line not in rows:
        raise ValueError(f"{path}:{line}: expected the line of a run, one of {', '.join(map(str, rows))}")
    values = parameters.check(rows[line].values, table)
    name = run_id(rows[line].varied, values["seed"], values)
    return values, (folder or path.parent / path.stem / RUNS / name).resolve()
