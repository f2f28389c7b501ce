"""forcechain check: the regression gate."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from harness.analysing.analysis import analyse
from harness.commands.analyse import tell_left_out
from harness.comparing.comparison import calibrated_ratios
from harness.errors import EXIT_GOOD, EXIT_VERDICT
from harness.gate.baseline import read_baseline
from harness.gate.junit import write_junit
from harness.gate.measured import measure
from harness.gate.regression import Check, Line, Outcome, check
from harness.study import study_in
from harness.text_table import number, render

HELP = "hold a study against approved results: a line a number, pass, drifted or not comparable"
EXAMPLE = "forcechain check results/demo --baseline baselines/demo.toml --junit check.xml"
HEADER = ("quantity", "unit", "baseline", "found", "tolerance", "of it", "outcome", "why")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument("--baseline", metavar="FILE", type=Path, required=True, help="made by forcechain approve")
    parser.add_argument("--junit", metavar="FILE", type=Path, help="write the lines as JUnit XML as well")
    parser.add_argument("--json", action="store_true", help="print every line as JSON")


def cells(line: Line) -> tuple[str, ...]:
    """Text of one line, in the order of `HEADER`."""
    return (
        line.quantity,
        line.unit,
        number(line.baseline, 4),
        number(line.found, 4),
        "-" if line.tolerance is None else f"{number(line.tolerance, 2)} ({line.tolerance_source})",
        "-" if line.drift is None else f"{line.drift:.0%}" if line.drift < 100 else "> 100 times",
        line.outcome.value,
        line.why,
    )


def summary(result: Check) -> str:
    """Count the outcomes, and say what differs in the making."""
    counts = ", ".join(
        f"{sum(line.outcome is outcome for line in result.lines)} {outcome.value}" for outcome in Outcome
    )
    differs = "; ".join(result.differs) or "nothing that is recorded"
    verdict = "" if result.passed else "\nthe check fails: a number that drifted or could not be compared is no pass"
    return f"{len(result.lines)} lines: {counts}\ndiffers from the baseline: {differs}{verdict}"


def execute(args: argparse.Namespace) -> int:
    """Check and print the lines; a run that is left out outranks a line that fails."""
    baseline = read_baseline(args.baseline)
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    result = check(baseline, measure(analysis, ratios))
    if args.junit is not None:
        write_junit(args.junit, analysis.name, result.lines)
    if args.json:
        document = {
            "passed": result.passed,
            "differs": list(result.differs),
            "lines": [line.as_dict() for line in result.lines],
            "left_out": dict(analysis.left_out),
        }
        print(json.dumps(document, indent=1, allow_nan=False))
    else:
        for case in dict.fromkeys(line.case for line in result.lines):
            print(f"{analysis.name}: {case}" if case else f"{analysis.name} against {args.baseline}")
            print(render(HEADER, [cells(line) for line in result.lines if line.case == case], right=(2, 3, 5)))
            print()
        print(summary(result))
    return tell_left_out(analysis.left_out) or (EXIT_GOOD if result.passed else EXIT_VERDICT)
