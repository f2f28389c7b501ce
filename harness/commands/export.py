"""forcechain export: runs as files that other tools read, or a study's results in a few megabytes."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from harness.analysing.analysis import analyse, reduce
from harness.analysing.analysis_options import read_options
from harness.commands.analyse import tell_left_out
from harness.errors import EXIT_GOOD, RunError
from harness.exchange.to_csv import write_csv_run
from harness.exchange.to_vtk import write_vtk_run
from harness.reading.exports import read_run, run_folders
from harness.study import study_in

HELP = "write runs as CSV tables or ParaView's files, or a study's results reduced to a few megabytes"
EXAMPLE = "forcechain export results/demo --to vtk"
FOLDER = "export"
FORMATS = ("csv", "vtk", "reduced")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument(
        "--to",
        choices=FORMATS,
        required=True,
        help="csv: tables of format 1, every digit; vtk: .vtp and .pvd files; reduced: all that compare, calibrate, "
        "check, report and reference need, without the snapshots",
    )
    parser.add_argument(
        "--out", metavar="FOLDER", type=Path, help="where to (default: DIR/export/FORMAT); a folder a run"
    )
    parser.add_argument("--json", action="store_true", help="print the folders as JSON")


def execute(args: argparse.Namespace) -> int:
    """Write every run that can be read, each into a folder of its name, and say where they are."""
    if args.to == "reduced":
        return write_results(args)
    study = study_in(args.directory)
    options, _ = read_options(study.analysis if study else {}, str(study.source if study else args.directory))
    out = args.out if args.out is not None else args.directory / FOLDER / args.to
    written, left_out = [], {}
    for folder in run_folders(args.directory):
        try:
            run = read_run(folder)
        except RunError as error:
            left_out[folder.name] = str(error)
            continue
        target = out / run.name
        written.append(write_csv_run(run, target) if args.to == "csv" else write_vtk_run(run, target, options))
    if args.json:
        print(json.dumps({"folders": [str(folder) for folder in written], "left_out": left_out}))
    else:
        for folder in written:
            print(f"written: {folder}")
    return tell_left_out(left_out)


def write_results(args: argparse.Namespace) -> int:
    """Write the reduced results of a whole study, or nothing: with runs left out they are not the study's."""
    analysis = analyse(args.directory)
    status = tell_left_out(analysis.left_out)
    if status != EXIT_GOOD:
        return status
    folder = reduce(analysis, args.out if args.out is not None else args.directory / FOLDER / args.to)
    print(json.dumps({"folders": [str(folder)], "left_out": {}}) if args.json else f"written: {folder}")
    return EXIT_GOOD
