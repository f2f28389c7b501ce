"""forcechain reference: every printed number of the paper beside a study's, as a page of Markdown with pictures."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from harness.analysing.analysis import analyse
from harness.commands.analyse import tell_left_out
from harness.comparing.comparison import calibrated_ratios
from harness.errors import EXIT_GOOD
from harness.reference.page import write_reference
from harness.reference.variations import keep_variations
from harness.study import RunSettings, study_in

HELP = "write the reference page: every printed number of the paper beside the study's, with intervals and verdicts"
EXAMPLE = "forcechain reference reference/paper --output docs/reference.md"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, whole or reduced")
    parser.add_argument("--output", metavar="FILE", type=Path, help="where to write it (default: DIR/reference.md)")
    parser.add_argument(
        "--images", metavar="FOLDER", type=Path, help="for the pictures (default: images/NAME beside FILE)"
    )
    parser.add_argument(
        "--with",
        dest="others",
        metavar="OTHER",
        type=Path,
        nargs="+",
        default=[],
        help="studies that change one thing, to be held against it; the table is kept in DIR for later pages",
    )
    parser.add_argument("--json", action="store_true", help="print the files as JSON")


def execute(args: argparse.Namespace) -> int:
    """Write the page and say where it is; its verdicts are findings and leave the exit status alone."""
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    status = tell_left_out(analysis.left_out)
    if args.others:
        others = {}
        for directory in args.others:
            other = analyse(directory)
            status = tell_left_out(other.left_out) or status
            others[other.name] = other
        keep_variations(analysis, others)
    output = args.output or args.directory / "reference.md"
    images = args.images or output.parent / "images" / output.stem
    settings = study.run if study is not None else RunSettings()
    files = write_reference(analysis, ratios, settings, output, images)
    print(json.dumps({"files": [str(path) for path in files]}) if args.json else f"written: {output}")
    return status or EXIT_GOOD
