"""`report.html`: one self-contained page of a study: verdicts first, then figures, counts, parameters, provenance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

import forcechain
from harness.analysis import Analysis
from harness.comparison import ModelCurves
from harness.exports import Run, read_run, run_folders
from harness.figure_style import style
from harness.report_pictures import behaviour_picture, buckling_picture, packing_pictures
from harness.report_tables import (
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
from harness.verdicts import Row, Verdict, failed

VERDICT_WORDS = (
    "A row passes when data and reference differ by no more than the tolerance: two standard errors, or twice the "
    "spread of packings where the paper prints a single simulation, never less than the stated floor. Standard "
    "errors are the larger of that over segments and that over runs."
)


def write_report(
    analysis: Analysis, rows: Sequence[Row], curves: Mapping[str, ModelCurves], settings: RunSettings, path: Path
) -> Path:
    """Write the page to `path`, whole or not at all, and return it."""
    runs = {
        name: read_run(folder)
        for folder in run_folders(analysis.directory)
        if (name := folder.name) in set(analysis.runs["run"])
    }
    environment = Environment(
        loader=PackageLoader("harness"), autoescape=True, undefined=StrictUndefined, trim_blocks=False
    )
    with style():
        page = environment.get_template("report.html.j2").render(_context(analysis, rows, curves, settings, runs))
    temporary = path.with_suffix(".tmp")
    temporary.write_text(page, encoding="utf-8")
    temporary.replace(path)
    return path


def _context(
    analysis: Analysis,
    rows: Sequence[Row],
    curves: Mapping[str, ModelCurves],
    settings: RunSettings,
    runs: Mapping[str, Run],
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
        "behaviour_figures": [behaviour_picture(case, analysis, runs) for case in analysis.cases],
        "drop_table": frame_table("The drops of the stress ratio.", analysis.drops.drop(columns="case")),
        "packing_figures": [figure for case in analysis.cases for figure in packing_pictures(case, analysis, runs)],
        "class_tables": [class_table(case, analysis) for case in analysis.cases],
        "buckling_figures": [
            buckling_picture(case, analysis, curves[case]) for case in analysis.cases if case in curves
        ],
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
