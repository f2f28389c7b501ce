"""forcechain compare: model against data, data against the paper, a verdict a row; or studies against one another."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.commands.analyse import tell_left_out
from harness.comparing import variations
from harness.comparing.comparison import calibrated_ratios, compare
from harness.comparing.verdicts import Row, Verdict, failed
from harness.errors import EXIT_GOOD, EXIT_VERDICT, InputError
from harness.report.tables import size_note
from harness.study import study_in
from harness.text_table import number, render, with_error

HELP = "hold the model against the data and the data against the paper: a table, a verdict a row"
EXAMPLE = "forcechain compare results/demo"
HEADER = ("quantity", "unit", "model", "data ± 2 s.e.", "n", "paper", "tolerance", "verdict")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument(
        "--with",
        dest="others",
        metavar="OTHER",
        type=Path,
        nargs="+",
        default=[],
        help="instead, what moves from DIR to each of these studies: differences seed by seed, with intervals, no "
        "verdicts; as in: forcechain compare results/before --with results/after",
    )
    parser.add_argument("--case", metavar="NAME", help="with --with: the case of DIR to hold them against (the first)")
    parser.add_argument("--json", action="store_true", help="print every row as JSON")


def cells(row: Row) -> tuple[str, ...]:
    """Text of one row, in the order of `HEADER`."""
    return (
        row.quantity,
        row.unit,
        number(row.model),
        with_error(row.data, row.standard_error),
        row.counted,
        number(row.paper),
        "-" if row.tolerance is None else f"{number(row.tolerance, 2)} ({row.tolerance_source})",
        row.verdict.value,
    )


def summary(rows: Sequence[Row]) -> str:
    """Count the verdicts, and say what it means if one failed."""
    counts = [f"{sum(row.verdict is verdict for row in rows)} {verdict.value}" for verdict in Verdict]
    told = f"{len(rows)} rows: " + ", ".join(counts)
    if failed(list(rows)):
        told += "; FAIL says that data and reference differ by more than the tolerance (exit status 1)"
    if any(row.verdict is Verdict.UNDECIDED for row in rows):
        told += "; undecided: within a standard error of the tolerance, more packings decide"
    return told


def execute(args: argparse.Namespace) -> int:
    """Compare and print the table; a run that is left out outranks a verdict that failed."""
    if args.others:
        return _differences(args)
    if args.case is not None:
        raise InputError("--case: expected with --with OTHER, which compares one case; without it every case is")
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    rows, _ = compare(analysis, ratios)
    if args.json:
        document = {"rows": [row.as_dict() for row in rows], "left_out": dict(analysis.left_out)}
        print(json.dumps(document, indent=1, allow_nan=False))
    else:
        for case in analysis.cases:
            print(f"{analysis.name}: {case}.{size_note(analysis.particle_count(case), analysis.test(case))}")
            print(render(HEADER, [cells(row) for row in rows if row.case == case], right=(2, 3, 4, 5)))
            print()
        print(summary(rows))
    return tell_left_out(analysis.left_out) or (EXIT_VERDICT if failed(list(rows)) else EXIT_GOOD)


def _differences(args: argparse.Namespace) -> int:
    """Print what moves from one study to others; a run that is left out of any is told as everywhere."""
    base = analyse(args.directory)
    others: dict[str, Analysis] = {}
    for directory in args.others:
        other = analyse(directory)
        # The same study run again has the same name: then its place tells them apart
        others[str(directory) if other.name in {base.name, *others} else other.name] = other
    found = variations.vary(base, others, args.case)
    left_out = {**base.left_out, **{run: why for other in others.values() for run, why in other.left_out.items()}}
    if args.json:
        rows = variations.frame(found).to_dict("records")
        plain = [{name: None if value != value else value for name, value in row.items()} for row in rows]
        document = {"base": found.base, "case": found.case, "changes": found.changes, "differences": plain}
        print(json.dumps(document | {"left_out": left_out}, indent=1, allow_nan=False))
    else:
        print(variations.text(found))
    return tell_left_out(left_out) or EXIT_GOOD
