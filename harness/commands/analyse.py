"""forcechain analyse: exports to buckling data."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.analysing.sensitivity import write_sensitivity
from harness.errors import EXIT_GOOD, EXIT_RUN
from harness.text_table import render

HELP = "turn exports into buckling data: chains, buckled segments, averages, classes, the ledger of counts"
EXAMPLE = "forcechain analyse results/demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument("--jobs", type=int, metavar="N", help="runs analysed side by side (default: one a core)")
    parser.add_argument(
        "--sensitivity",
        action="store_true",
        help="also analyse again with one choice changed at a time: a table and a figure of what each choice moves",
    )
    parser.add_argument("--json", action="store_true", help="print the ledger and the files as JSON")


def tell_left_out(left_out: Mapping[str, str]) -> int:
    """Name every run that was left out on standard error, a line each; return the exit status that follows."""
    for reason in left_out.values():
        print(f"forcechain: {reason}", file=sys.stderr)
    return EXIT_RUN if left_out else EXIT_GOOD


def ledger_table(analysis: Analysis) -> str:
    """Counts of what each filter left, a line a drop."""
    if not analysis.ledger:
        return "no drops of the stress ratio were found: no buckling data"
    table = pd.DataFrame(list(analysis.ledger)).drop(columns="case").astype(str)
    return render([name.replace("_", " ") for name in table.columns], table.to_numpy().tolist(), right=range(1, 20))


def execute(args: argparse.Namespace) -> int:
    """Analyse and print the ledger."""
    analysis = analyse(args.directory, jobs=args.jobs)
    swept = write_sensitivity(args.directory, jobs=args.jobs)[1] if args.sensitivity else ()
    if args.json:
        told = {"folder": str(analysis.folder), "ledger": list(analysis.ledger), "left_out": dict(analysis.left_out)}
        if swept:
            told["sensitivity"] = [str(file) for file in swept]
        print(json.dumps(told))
    else:
        print(ledger_table(analysis))
        print(f"{'unchanged' if analysis.reused else 'written'}: {analysis.folder}")
        for file in swept:
            print(f"written: {file}")
    return tell_left_out(analysis.left_out)
