"""forcechain report: one self-contained page."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from harness.analysing.analysis import analyse
from harness.commands.analyse import tell_left_out
from harness.comparing.comparison import calibrated_ratios, compare
from harness.report.page import write_report
from harness.study import RunSettings, study_in

HELP = "write one self-contained report.html: verdicts, figures, counts, parameters, provenance"
EXAMPLE = "forcechain report results/demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument("--output", metavar="FILE", type=Path, help="where to write it (default: DIR/report.html)")
    parser.add_argument(
        "--figures", metavar="FOLDER", type=Path, help="write every figure as a file of its own as well"
    )
    parser.add_argument("--format", choices=("png", "svg", "pdf"), default="png", help="of --figures (default: png)")
    parser.add_argument("--json", action="store_true", help="print the path as JSON")


def execute(args: argparse.Namespace) -> int:
    """Write the page and say where it is."""
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    rows, curves = compare(analysis, ratios)
    settings = study.run if study is not None else RunSettings()
    figures = (args.figures, args.format) if args.figures is not None else None
    path = write_report(analysis, rows, curves, settings, args.output or args.directory / "report.html", figures)
    print(json.dumps({"report": str(path)}) if args.json else f"report: {path}")
    return tell_left_out(analysis.left_out)
