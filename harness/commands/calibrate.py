"""forcechain calibrate: kFC, ks and ls of the model, from the buckling data of a study."""

from __future__ import annotations

import argparse
import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from forcechain.calibration import Calibration, Column, Estimate, Identified
from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.commands.analyse import tell_left_out
from harness.comparing import stretches
from harness.comparing.calibrations import as_plain, calibrate_study, write_parameters
from harness.comparing.comparison import calibrated_ratios, model_parameters
from harness.errors import EXIT_GOOD
from harness.figures.calibration import calibration_figure
from harness.figures.style import style
from harness.study import study_in
from harness.text_table import number, render
from yade_scripts.run_folder import write

HELP = "fit the model's kFC, ks and ls to the buckling data; parameters.toml with intervals"
EXAMPLE = "forcechain calibrate results/demo"
HEADER = ("column", "parameter / kn", "value", "95 % over segments", "95 % over runs", "determined by", "status")
FIT_HEADER = ("column", "measure", "n.r.m.s. calibrated", "95 % interval", "n.r.m.s. reference", "95 % interval")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("directory", metavar="DIR", type=Path, help="a study's folder, or a single run's")
    parser.add_argument(
        "--longer",
        action="store_true",
        help="also fit columns of 3, 4 and 5 particles to stretches of a chain of that length (some 20 s a case)",
    )
    parser.add_argument(
        "--figures", metavar="FOLDER", type=Path, help="also draw each case: data, curves, profiles (SVG)"
    )
    parser.add_argument("--json", action="store_true", help="print everything as JSON")


def parameter_cells(column: Column, estimate: Estimate) -> tuple[str, ...]:
    """Text of one parameter, in the order of `HEADER`."""
    shares = sorted(estimate.determined_by.items(), key=lambda item: -item[1])
    sources = ", ".join(f"{name.removesuffix('_over_R').replace('_', ' ')} {share:.0%}" for name, share in shares[:2])
    value = number(estimate.value)
    if estimate.identified is Identified.BOUNDED_BELOW:
        value = f">= {number(estimate.interval.low)}"
    elif estimate.identified is Identified.NO:
        value = "-"
    return (
        column.value,
        estimate.name,
        value,
        f"{number(estimate.by_segments.low)} to {number(estimate.by_segments.high)}",
        "-" if estimate.by_runs is None else f"{number(estimate.by_runs.low)} to {number(estimate.by_runs.high)}",
        sources or "nothing",
        estimate.identified.value,
    )


def tables(calibrations: dict[Column, Calibration]) -> str:
    """Parameters, goodness of fit, and what each status means."""
    parameters = [parameter_cells(column, e) for column, found in calibrations.items() for e in found.estimates]
    fits = [
        (
            column.value,
            goodness.measure,
            number(goodness.calibrated, 2),
            f"{number(goodness.calibrated_interval.low, 2)} to {number(goodness.calibrated_interval.high, 2)}",
            number(goodness.reference, 2),
            f"{number(goodness.reference_interval.low, 2)} to {number(goodness.reference_interval.high, 2)}",
        )
        for column, found in calibrations.items()
        for goodness in found.goodness
    ]
    told = dict.fromkeys(e.identified for found in calibrations.values() for e in found.estimates)
    notes = ["quote the wider of both intervals; the status follows it"]
    notes += [f"{status.value}: {status.meaning}" for status in told if status is not Identified.YES]
    for column, found in calibrations.items():
        correlation = float(np.asarray(found.correlation)[0, 1])
        told_of = "no correlation, one never moves" if np.isnan(correlation) else f"correlation {correlation:.2f}"
        notes.append(
            f"{column.value} column: sum of squares {number(found.sum_of_squares)} (about 4 if the model is right), "
            f"kFC with ks {told_of}"
        )
    return "\n\n".join(
        (render(HEADER, parameters, right=(2,)), render(FIT_HEADER, fits, right=(2, 3, 4, 5)), "\n".join(notes))
    )


def execute(args: argparse.Namespace) -> int:
    """Calibrate, write the parameters and print them."""
    study = study_in(args.directory)
    ratios = calibrated_ratios(study.compare, str(study.source)) if study else {}
    analysis = analyse(args.directory)
    found, without = calibrate_study(analysis, ratios)
    longer = stretches.calibrate_stretches(analysis, found) if args.longer else {}
    plain = {case: stretches.as_plain(fits) for case, fits in longer.items()}
    path = write_parameters(analysis, found, without, plain)
    drawn = _draw(args.figures, analysis, found, longer, ratios) if args.figures is not None else []
    if args.json:
        cases = {case: {c.value: as_plain(one) for c, one in both.items()} for case, both in found.items()}
        document = {"parameters": str(path), "cases": cases, "stretches": plain, "not_calibrated": without}
        print(json.dumps(document | {"left_out": dict(analysis.left_out)}, indent=1, allow_nan=False))
    else:
        for case, both in found.items():
            first = next(iter(both.values()))
            print(f"{analysis.name}: {case}. {first.n_segments} segments of {first.n_runs} runs.")
            print(tables(both))
            if case in longer:
                print(f"\n{stretches.text(longer[case])}")
            print()
        for case, why in without.items():
            print(f"{analysis.name}: {case}: not calibrated: {why}")
        print(f"written: {', '.join(str(one) for one in (path, *drawn))}")
    return tell_left_out(analysis.left_out) or EXIT_GOOD


def _draw(
    folder: Path,
    analysis: Analysis,
    found: Mapping[str, Mapping[Column, Calibration]],
    longer: Mapping[str, stretches.StretchFits],
    ratios: Mapping[str, float],
) -> list[Path]:
    """Write a figure a case and return their paths."""
    written = []
    for index, (case, both) in enumerate(found.items(), start=1):
        reference = model_parameters(analysis.runs[analysis.runs["case"] == case], ratios)
        averages = analysis.averages[analysis.averages["case"] == case]
        columns = longer[case].fitted if case in longer else None
        content = io.BytesIO()
        with style():
            figure = calibration_figure(averages, both[Column.PERFECT], reference, columns)
            figure.suptitle(f"{analysis.name}, {case}", fontsize=9)
            figure.savefig(content, format="svg", metadata={"Date": None})
        name = f"calibration-{index}.svg"
        write(folder, name, content.getvalue())
        written.append(folder / name)
    return written
