"""forcechain approve: the only writer of baselines."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from harness.analysing.analysis import analyse
from harness.commands.analyse import tell_left_out
from harness.comparing.comparison import calibrated_ratios
from harness.errors import EXIT_GOOD
from harness.gate.baseline import approve, power_words
from harness.gate.measured import measure
from harness.study import study_in

HELP = "make the results of a study the baseline that later ones are held to; asks for a reason"
EXAMPLE = 'forcechain approve results/demo --baseline baselines/demo.toml --reason "YADE 2024.02a: checked by hand"'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder")
    parser.add_argument("--baseline", metavar="FILE", type=Path, required=True, help="the file to write")
    parser.add_argument("--reason", metavar="TEXT", required=True, help="why these results are right; kept in the file")
    parser.add_argument("--json", action="store_true", help="print what moved as JSON")


def execute(args: argparse.Namespace) -> int:
    """Approve a whole study, or nothing: with runs left out its numbers are not the study's."""
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    status = tell_left_out(analysis.left_out)
    if status != EXIT_GOOD:
        return status
    baseline = approve(measure(analysis, ratios), args.baseline, args.reason)
    moved = baseline.history[-1]["moved"]
    if args.json:
        print(
            json.dumps({"baseline": str(args.baseline), "approvals": len(baseline.history), "moved": moved}, indent=1)
        )
    else:
        print("\n".join(moved) if moved else "no number moved")
        print(power_words(baseline.measured))
        print(f"approved: {args.baseline} (approval {len(baseline.history)})")
    return EXIT_GOOD
