"""`report.html`: one self-contained page of a study: verdicts first, then figures, counts, parameters, provenance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

import forcechain
from harness.analysing.analysis import Analysis
from harness.comparing.comparison import ModelCurves
from harness.comparing.verdicts import Row, Verdict, failed
from harness.reading.exports import Run, read_run, run_folders
from harness.report.pictures import (
    Picture,
    behaviour_picture,
    buckling_picture,
    busiest_drop,
    packing_pictures,
    summary_picture,
)
from harness.report.tables import (
    Table,
    average_table,
    cell,
    class_table,
    frame_table,
    model_table,
    parameter_table,
    provenance_table,
    validity_table,
    verdict_table,
)
from harness.study import RunSettings
from yade_scripts.run_folder import write

VERDICT_WORDS = (
    "A row passes when data and reference differ by no more than the tolerance: two standard errors, or twice the "
    "spread of packings where the paper prints a single simulation, never less than the stated floor. Standard "
    "errors are the larger of that over segments and that over runs; n.r.m.s. is the root mean square difference "
    "over the drop, over the model's mean."
)


def write_report(
    analysis: Analysis,
    rows: Sequence[Row],
    curves: Mapping[str, ModelCurves],
    settings: RunSettings,
    path: Path,
    figures: tuple[Path, str] | None = None,
) -> Path:
    """Write the page to `path`, whole or not at all, and return it.

    `figures` is a folder and a format ("png", "svg" or "pdf") in which every figure is written as well.
    """
    analysed = set(analysis.runs["run"])
    runs = {folder.name: read_run(folder) for folder in run_folders(analysis.directory) if folder.name in analysed}
    pictures = study_pictures(analysis, curves, runs)
    environment = Environment(loader=PackageLoader("harness.report"), autoescape=True, undefined=StrictUndefined)
    context = _context(analysis, rows, curves, settings, runs, pictures)
    page = environment.get_template("report.html.j2").render(context)
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path.parent, path.name, page.encode())
    if figures is not None:
        folder, kind = figures
        for picture in (picture for section in pictures.values() for picture in section):
            write(folder, f"{picture.name}.{kind}", picture.render(kind))
    return path


def study_pictures(
    analysis: Analysis, curves: Mapping[str, ModelCurves], runs: Mapping[str, Run]
) -> dict[str, list[Picture]]:
    """Return the pictures of a study by section of the page: summary, behaviour, packing, buckling."""
    pictures: dict[str, list[Picture]] = {"summary": [], "behaviour": [], "packing": [], "buckling": []}
    for case in analysis.cases:
        scene = busiest_drop(case, analysis, runs)
        pictures["behaviour"].append(behaviour_picture(case, analysis, runs))
        if scene is not None:
            pictures["packing"] += packing_pictures(case, analysis, scene)
        if case in curves:
            pictures["buckling"].append(buckling_picture(case, analysis, curves[case]))
        if scene is not None and case in curves and not pictures["summary"]:
            pictures["summary"].append(summary_picture(case, analysis, scene, curves[case]))
    return pictures


def _context(
    analysis: Analysis,
    rows: Sequence[Row],
    curves: Mapping[str, ModelCurves],
    settings: RunSettings,
    runs: Mapping[str, Run],
    pictures: Mapping[str, list[Picture]],
) -> dict[str, Any]:
    n_failed = failed(list(rows))
    return {
        "title": analysis.name,
        "subtitle": _subtitle(analysis),
        "good": n_failed == 0 and not analysis.left_out,
        "summary": _summary(rows, analysis),
        "verdict_tables": [verdict_table(case, rows, analysis.particle_count(case)) for case in analysis.cases],
        "verdict_words": VERDICT_WORDS,
        "validity_table": validity_table(analysis, settings, runs),
        "pictures": pictures,
        "macroscopic_table": frame_table(
            "State at the start of each drop, and what it dissipates and where it deforms up to its end.",
            analysis.macroscopic.drop(columns="case"),
        ),
        "drop_table": frame_table("The drops of the stress ratio.", analysis.drops.drop(columns="case")),
        "class_tables": [class_table(case, analysis) for case in analysis.cases],
        "average_tables": [average_table(case, analysis) for case in curves],
        "ledger_table": frame_table(
            "What each step left, at the start of each drop.", pd.DataFrame(list(analysis.ledger)).drop(columns="case")
        )
        if analysis.ledger
        else Table(caption="No drop was found.", header=[], rows=[], numeric=frozenset()),
        "parameter_table": parameter_table(runs),
        "model_table": model_table(curves),
        "option_table": Table(
            caption="Options of the analysis.",
            header=["option", "value", "unit", "meaning"],
            rows=[[k, cell(v["value"]), v["unit"], v["meaning"]] for k, v in analysis.options.items()],
            numeric=frozenset(),
        ),
        "provenance_table": provenance_table(runs),
        "footer": f"forcechain {forcechain.__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC. "
        "Model and printed numbers: Tordesillas and Muthuswamy, J. Mech. Phys. Solids 57 (2009) 706-727.",
    }


def _subtitle(analysis: Analysis) -> str:
    sizes = sorted({int(count) for count in analysis.runs["particle_count"]})
    buckled = sum(int(record["buckled_segments"]) for record in analysis.ledger)
    return (
        f"{len(analysis.runs)} runs of {' and '.join(str(size) for size in sizes)} discs, {len(analysis.drops)} drops "
        f"of the stress ratio, {buckled} buckled three-particle segments."
    )


def _summary(rows: Sequence[Row], analysis: Analysis) -> str:
    counts = {verdict: sum(row.verdict is verdict for row in rows) for verdict in Verdict}
    sentence = f"{counts[Verdict.PASS]} of {len(rows)} rows pass, {counts[Verdict.FAIL]} fail"
    if counts[Verdict.NOT_JUDGED]:
        sentence += f", {counts[Verdict.NOT_JUDGED]} are not judged"
    names = [row.quantity for row in rows if row.verdict is Verdict.FAIL]
    sentence += ": " + "; ".join(names) + "." if names else "."
    if analysis.left_out:
        sentence += f" Left out: {'; '.join(analysis.left_out.values())}."
    return sentence
