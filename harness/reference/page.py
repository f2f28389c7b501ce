"""The reference page: a study's results as Markdown, and its pictures, the same bytes every time."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from forcechain.calibration import Calibration, Column
from harness.analysing.buckling_data import Analysis
from harness.analysing.reduced import SENSITIVITY
from harness.comparing.calibrations import calibrate_study
from harness.comparing.comparison import compare
from harness.comparing.verdicts import Row, Verdict
from harness.errors import InputError
from harness.reading import validity
from harness.reading.exports import Run, read_run, run_folders
from harness.reference.pictures import Image, case_figures, first_figures, model_figures, sweep_figure
from harness.reference.printed import CALIBRATED, Printed, class_shares, printed_case, printed_numbers, rounded
from harness.report.tables import cell
from harness.study import RunSettings
from harness.text_table import number, with_error
from yade_scripts.run_folder import write

REMARKS = "remarks.md"  # beside the results: what people say of them
VARIATIONS = "variations.json"  # beside the results: other studies held against them
MEASURES = {
    "axial_force": "axial force F",
    "normal_displacement_over_R": "normal displacement Dn/R",
    "axial_displacement_over_R": "axial displacement D/R",
    "rotation": "rotation w",
}
CLASSES = (1, 2, 3, 4)


def write_reference(
    analysis: Analysis, ratios: Mapping[str, float], settings: RunSettings, output: Path, images: Path
) -> list[Path]:
    """Write the page to `output` and its pictures into `images`; return the files, the page first."""
    sweep, variations, remarks = _sweep(analysis), _variations(analysis.directory), _remarks(analysis.directory)
    rows, curves = compare(analysis, ratios)
    calibrations, without = calibrate_study(analysis, ratios)
    runs = {folder.name: read_run(folder) for folder in run_folders(analysis.directory)}
    main = printed_case(analysis) or analysis.cases[0]
    pictures = {
        "first": first_figures(main, analysis, runs),
        "cases": [
            image
            for place, case in enumerate(analysis.cases)
            for image in case_figures(case, place, analysis, runs, curves)
        ],
        "choices": [] if sweep is None else [sweep_figure(main, sweep)],
        "model": model_figures(),
    }
    printed = printed_numbers(main, analysis, rows, curves, calibrations)
    context = {
        "name": analysis.name,
        "summary": _summary(printed),
        "main": main,
        "facts": _facts(analysis, runs),
        "run_table": _run_table(analysis, runs),
        "validity_table": _validity_table(runs, settings),
        "printed_table": _printed_table(printed),
        "class_tables": {case: _printed_table(class_shares(case, analysis)) for case in analysis.cases},
        "sweep_table": None if sweep is None else _sweep_table(main, sweep),
        "model_table": _model_table(rows),
        "parameter_table": _parameter_table(calibrations),
        "fit_table": _fit_table(calibrations),
        "without": without,
        "variations": variations,
        "remarks": remarks,
        "pictures": {part: [_markdown(image, images, output) for image in of] for part, of in pictures.items()},
        "option_table": table(
            ("option", "value", "unit", "meaning"),
            [(f"`{k}`", cell(v["value"]), v["unit"], v["meaning"]) for k, v in analysis.options.items()],
        ),
    }
    environment = Environment(
        loader=PackageLoader("harness.reference"),
        autoescape=False,  # Markdown, not HTML
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    text = environment.get_template("reference.md.j2").render(context)
    output.parent.mkdir(parents=True, exist_ok=True)
    for image in (image for part in pictures.values() for image in part):
        write(images, image.name, image.content)
    write(output.parent, output.name, text.encode())
    return [output, *(images / image.name for part in pictures.values() for image in part)]


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a table in Markdown.

    >>> print(table(("a", "b"), [("1", "x|y")]))
    | a | b |
    |---|---|
    | 1 | x\\|y |
    """
    lines = [list(header), ["---"] * len(header), *[[text.replace("|", "\\|") for text in row] for row in rows]]
    return "\n".join(
        "|" + "|".join(line) + "|" if place == 1 else "| " + " | ".join(line) + " |" for place, line in enumerate(lines)
    )


def _summary(rows: Sequence[Printed]) -> str:
    counts = {verdict: sum(row.verdict is verdict for row in rows) for verdict in Verdict}
    missed = [row.quantity for row in rows if row.verdict is Verdict.FAIL]
    text = f"Of {len(rows)} printed numbers {counts[Verdict.PASS]} pass, {counts[Verdict.FAIL]} fail"
    for verdict in (Verdict.UNDECIDED, Verdict.NOT_JUDGED):
        if counts[verdict]:
            text += f", {counts[verdict]} {'is' if counts[verdict] == 1 else 'are'} {verdict.value}"
    return text + (f". What fails: {'; '.join(missed)}." if missed else ".")


def _facts(analysis: Analysis, runs: Mapping[str, Run]) -> dict[str, str]:
    told = [(run.manifest or {}).get("provenance", {}) for run in runs.values()]
    discs = sorted({str(int(count)) for count in analysis.runs["particle_count"]})
    return {
        "runs": str(len(analysis.runs)),
        "discs": " and ".join(discs),
        "packings": str(analysis.runs["seed"].nunique()),
        "yade": ", ".join(sorted({str(one.get("yade_version", "unknown")) for one in told})),
        "package": ", ".join(sorted({str(one.get("package_version", "unknown")) for one in told})),
        "segments": str(len(analysis.yielding)),
        "drops": str(len(analysis.drops)),
        "left_out": "; ".join(analysis.left_out.values()),
    }


def _run_table(analysis: Analysis, runs: Mapping[str, Run]) -> str:
    rows = []
    for case in analysis.cases:
        of_case = analysis.runs[analysis.runs["case"] == case]
        minutes = [_minutes(runs[name]) for name in of_case["run"]]
        known = [value for value in minutes if value is not None]
        yielding = analysis.yielding[analysis.yielding["case"] == case]
        rows.append(
            (
                case,
                ", ".join(str(int(seed)) for seed in of_case["seed"].dropna()),
                str(int(of_case["drops"].sum())),
                str(len(yielding)),
                f"{np.median(known):.1f} ({min(known):.1f} to {max(known):.1f})" if known else "-",
            )
        )
    return table(("case", "packings", "drops", "buckled segments", "wall time of a run, median [min]"), rows)


def _minutes(run: Run) -> float | None:
    timings: Any = (run.manifest or {}).get("timings", {})
    seconds = timings.get("loading_s")
    return None if seconds is None else float(seconds) / 60


def _validity_table(runs: Mapping[str, Run], settings: RunSettings) -> str:
    worst: dict[str, validity.Figure] = {}
    counts: dict[str, int] = {}
    for run in runs.values():
        for figure in validity.judge(run.manifest or {}, settings) if run.manifest is not None else ():
            counts[figure.name] = counts.get(figure.name, 0) + figure.passed
            before = worst.get(figure.name)
            lower = figure.upper is None  # the only bound is from below: the smallest is the worst
            if before is None or (figure.value < before.value if lower else figure.value > before.value):
                worst[figure.name] = figure
    rows = [
        (
            figure.meaning,
            number(figure.value),
            " and ".join(
                words
                for words, bound in (
                    (f"at least {number(figure.lower)}", figure.lower),
                    (f"at most {number(figure.upper)}", figure.upper),
                )
                if bound is not None
            ),
            f"{counts[name]} of {len(runs)}",
        )
        for name, figure in worst.items()
    ]
    return table(("figure", "worst of all runs", "admissible", "runs that pass"), rows)


def _printed_table(rows: Sequence[Printed]) -> str:
    header = ("quantity", "unit", "printed", "found", "95 % interval", "of", "how far the print may lie", "verdict")
    return table(
        header,
        [
            (
                row.quantity,
                row.unit,
                row.printed,
                row.found_text,
                row.interval_text,
                row.counted,
                row.why,
                _bold(row.verdict),
            )
            for row in rows
        ],
    )


def _bold(verdict: Verdict) -> str:
    return f"**{verdict.value}**" if verdict is Verdict.FAIL else verdict.value


def _sweep(analysis: Analysis) -> pd.DataFrame | None:
    path = analysis.folder / SENSITIVITY
    if not path.is_file():
        return None
    try:
        return pd.read_csv(path, dtype={"fault": object})  # words, also where there is none
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


def _sweep_table(main: str, sweep: pd.DataFrame) -> str:
    """A row a choice: counts, angle and lateral force of the case `main`, and the classes of every case."""
    cases = [main, *(case for case in dict.fromkeys(sweep["case"]) if case != main)]
    rows = []
    of_main = sweep[sweep["case"] == main]
    for record in of_main.to_dict("records"):
        same = sweep[(sweep["option"] == record["option"]) & (sweep["value"].astype(str) == str(record["value"]))]
        if record["in_use"]:
            same = sweep[sweep["in_use"].astype(bool)]
        name = "as set" if record["in_use"] else f"{record['option']} = {record['value']}"
        if isinstance(record["fault"], str) and record["fault"]:
            rows.append((name, record["fault"], *[""] * (2 + len(cases))))
            continue
        rows.append(
            (
                name,
                str(int(record["segments"])),
                with_error(record["initial_angle_deg"], record["initial_angle_deg_se"]),
                with_error(record["lateral_force_N"], record["lateral_force_N_se"]),
                *(_shares(same[same["case"] == case]) for case in cases),
            )
        )
    header = ("choice", "segments", "initial angle [deg]", "lateral force [N]", *(f"classes, {case}" for case in cases))
    return table(header, rows)


def _shares(rows: pd.DataFrame) -> str:
    if not len(rows) or rows[[f"class_{k}_percent" for k in CLASSES]].isna().to_numpy().any():
        return "-"
    return " / ".join(f"{rows.iloc[0][f'class_{k}_percent']:.0f}" for k in CLASSES)


def _model_table(rows: Sequence[Row]) -> str:
    return table(
        ("case", "quantity", "unit", "model", "data ± 2 s.e.", "n.r.m.s.", "tolerance", "verdict"),
        [
            (
                row.case,
                row.quantity,
                row.unit,
                number(row.model),
                with_error(row.data, row.standard_error),
                number(row.normalised_rms, 2),
                f"{number(row.tolerance, 2)} ({row.tolerance_source})",
                _bold(row.verdict),
            )
            for row in rows
            if row.model is not None
        ],
    )


def _parameter_table(calibrations: Mapping[str, Mapping[Column, Calibration]]) -> str:
    rows = []
    for case, both in calibrations.items():
        for column, found in both.items():
            for estimate in found.estimates:
                words, printed = CALIBRATED[estimate.name]
                low, high = estimate.interval.low, estimate.interval.high
                interval = f"{rounded(low, low, high)} to {rounded(high, low, high)}"
                value = rounded(estimate.value, low, high)
                rows.append((case, column.value, words, number(printed), value, interval, estimate.identified.value))
    return table(("case", "column", "parameter / kn", "printed", "fitted", "95 % interval", "status"), rows)


def _fit_table(calibrations: Mapping[str, Mapping[Column, Calibration]]) -> str:
    rows = []
    for case, both in calibrations.items():
        for column, found in both.items():
            for one in found.goodness:
                rows.append(
                    (
                        case,
                        column.value,
                        MEASURES.get(one.measure, one.measure),
                        number(one.calibrated, 2),
                        f"{number(one.calibrated_interval.low, 2)} to {number(one.calibrated_interval.high, 2)}",
                        number(one.reference, 2),
                        f"{number(one.reference_interval.low, 2)} to {number(one.reference_interval.high, 2)}",
                    )
                )
    header = ("case", "column", "measure", "calibrated", "95 % interval", "the paper's parameters", "95 % interval")
    return table(header, rows)


def _variations(directory: Path) -> dict[str, Any] | None:
    path = directory / VARIATIONS
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {
            "table": table(content["header"], [[_plain(text) for text in row] for row in content["rows"]]),
            "changes": {str(name): "; ".join(words) for name, words in content["changes"].items()},
            "legend": _plain(content["legend"]),
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not a table of variations ({error!r}); make it anew with --with") from None


def _plain(text: str) -> str:
    """Text whose asterisks stay asterisks."""
    return text.replace("*", "\\*")


def _remarks(directory: Path) -> str:
    path = directory / REMARKS
    try:
        return path.read_text(encoding="utf-8").strip() if path.is_file() else ""
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


def _markdown(image: Image, images: Path, output: Path) -> str:
    place = Path(os.path.relpath(images / image.name, output.parent)).as_posix()
    return f"![{image.alternative}]({place})\n\n*{image.caption.replace('*', '')}*"
