"""forcechain report: one self-contained page, its figures as files, an animation."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path

from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.commands.analyse import tell_left_out
from harness.commands.run import positive
from harness.comparing.comparison import calibrated_ratios, compare
from harness.errors import InputError
from harness.reading.exports import Run, read_run, run_folders
from harness.report.animation import animation_format, write_animation
from harness.report.page import write_report
from harness.report.pictures import network_picture
from harness.report.scenes import busiest_drops
from harness.study import RunSettings, study_in
from yade_scripts.run_folder import write

HELP = "write one self-contained report.html: verdicts, figures, counts, parameters, provenance"
EXAMPLE = "forcechain report results/demo --figures slides --format svg --strain 0.05"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument("--output", metavar="FILE", type=Path, help="where to write it (default: DIR/report.html)")
    parser.add_argument(
        "--figures", metavar="FOLDER", type=Path, help="write every figure as a file of its own as well"
    )
    parser.add_argument("--format", choices=("png", "svg", "pdf"), default="png", help="of --figures (default: png)")
    parser.add_argument("--width-mm", metavar="MM", type=_length, help="of --figures (default: as on the page)")
    parser.add_argument("--dark", action="store_true", help="--figures and --animate on a dark ground")
    parser.add_argument(
        "--strain",
        metavar="E",
        type=float,
        help="with --figures: the chains at this axial strain too, of --run or of a run of each case",
    )
    parser.add_argument("--animate", metavar="FILE", type=Path, help="write a drop as an animation: FILE.gif or .mp4")
    parser.add_argument("--run", metavar="ID", help="for --animate and --strain (default: that with most buckling)")
    parser.add_argument("--drop", metavar="N", type=positive, help="for --animate: 1 is the run's first drop")
    parser.add_argument("--json", action="store_true", help="print the paths as JSON")


def _length(text: str) -> float:
    value = float(text)  # argparse reports a ValueError
    if not 120 <= value <= 2000:  # the letters keep their size: narrower, panels leave them no room
        raise argparse.ArgumentTypeError(f"expected 120 to 2000 mm, found {text}")
    return value


def execute(args: argparse.Namespace) -> int:
    """Write the page, and what else was asked for, and say where it is."""
    _check(args)
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    runs = _runs(analysis)
    if args.run is not None and args.run not in runs:
        raise InputError(f"--run: expected one of {', '.join(runs)}, found {args.run!r}")
    rows, curves = compare(analysis, ratios)
    networks = []
    if args.strain is not None:
        names = [args.run] if args.run else _a_run_of_each_case(analysis)
        networks = [network_picture(analysis, runs[name], args.strain) for name in names]
    written = {"report": args.output or args.directory / "report.html"}
    if args.animate is not None:
        written["animation"] = write_animation(
            analysis, runs, curves, args.animate, run=args.run, drop=args.drop, dark=args.dark
        )
    settings = study.run if study is not None else RunSettings()
    pictures = write_report(analysis, rows, curves, settings, runs, written["report"])
    if args.figures is not None:
        for picture in [picture for section in pictures.values() for picture in section] + networks:
            content = picture.render(args.format, dark=args.dark, width_mm=args.width_mm, dpi=300)
            write(args.figures, f"{picture.name}.{args.format}", content)
        written["figures"] = args.figures
    if args.json:
        print(json.dumps({name: str(path) for name, path in written.items()}))
    else:
        print("\n".join(f"{name}: {path}" for name, path in written.items()))
    return tell_left_out(analysis.left_out)


def _check(args: argparse.Namespace) -> None:
    """Refuse what would have no effect, before anything is done."""
    if args.animate is not None:
        animation_format(args.animate)
    for name, needs in (("strain", ("figures",)), ("width_mm", ("figures",)), ("drop", ("animate",))):
        if getattr(args, name) is not None and all(getattr(args, other) is None for other in needs):
            raise InputError(f"--{name.replace('_', '-')} is of --{needs[0]}: give that too")
    if args.run is not None and args.animate is None and args.strain is None:
        raise InputError("--run is of --animate and --strain: give one of them too")
    if args.drop is not None and args.run is None:
        raise InputError("--drop counts the drops of one run: give --run ID too")


def _runs(analysis: Analysis) -> dict[str, Run]:
    analysed = set(analysis.runs["run"])
    return {folder.name: read_run(folder) for folder in run_folders(analysis.directory) if folder.name in analysed}


def _a_run_of_each_case(analysis: Analysis) -> list[str]:
    """Return the run with the busiest drop of each case, or its first where it has none."""
    names: Mapping[str, str] = dict(zip(analysis.runs["case"][::-1], analysis.runs["run"][::-1], strict=True))
    return [next((run for run, _ in busiest_drops(analysis, case)), names[case]) for case in analysis.cases]
