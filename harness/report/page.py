"""`report.html`: one self-contained page of a study: verdicts first, then figures, counts, parameters, provenance."""

from __future__ import annotations

import base64
import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

import forcechain
from harness.analysing.buckling_data import Analysis
from harness.comparing.comparison import ModelCurves
from harness.comparing.verdicts import Row, Verdict
from harness.figures.packing import CLASS_NAMES
from harness.progress import watched
from harness.reading.exports import Run
from harness.reading.tested import WORDS
from harness.report.explorer import explorer_view, page_data, script_json
from harness.report.pictures import (
    Picture,
    behaviour_picture,
    buckling_picture,
    packing_pictures,
    summary_picture,
)
from harness.report.scenes import Scene, busiest_drops, busiest_scene, scene_of
from harness.report.tables import (
    Table,
    average_table,
    cell,
    class_table,
    frame_table,
    model_table,
    parameter_table,
    provenance_tables,
    segment_table,
    validity_table,
    verdict_table,
)
from harness.study import RunSettings
from yade_scripts.run_folder import write

FURTHER_DROPS = 500_000  # characters of explorable drops beside the busiest of each case
VERDICT_WORDS = (
    "A row passes when data and reference differ by no more than the tolerance: two standard errors, or twice the "
    "spread of packings where the paper prints a single simulation, never less than the stated floor. It is undecided "
    "within one standard error of the tolerance. Standard errors are the larger of that over segments and that over "
    "runs; n.r.m.s. is the root mean square difference over the drop, over the model's mean."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """A drop of the explorer: its element on the page, its name in the list, its data, its table."""

    id: str
    label: str
    json: Markup
    table: Table


def write_report(
    analysis: Analysis,
    rows: Sequence[Row],
    curves: Mapping[str, ModelCurves],
    settings: RunSettings,
    runs: Mapping[str, Run],
    path: Path,
) -> dict[str, list[Picture]]:
    """Write the page to `path`, whole or not at all, and return its pictures by section.

    `runs` are those of the analysis, by name.
    """
    scenes = {case: busiest_scene(analysis, runs, case) for case in analysis.cases}
    pictures = study_pictures(analysis, curves, runs, scenes)
    views = explorable_drops(analysis, curves, runs, scenes)
    environment = Environment(loader=PackageLoader("harness.report"), autoescape=True, undefined=StrictUndefined)
    context = _context(analysis, rows, curves, settings, runs) | {"pictures": pictures, "views": views}
    context["missing"] = _missing(scenes, analysis, runs)
    for name, source in (("style", "page.css"), ("script", "explorer.js")):
        text, _, _ = environment.loader.get_source(environment, source)  # type: ignore[union-attr]
        context |= {name: Markup(text), f"{name}_hash": Markup(_source_hash(text))}
    page = environment.get_template("report.html.j2").render(context)
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path.parent, path.name, page.encode())
    return pictures


def _source_hash(text: str) -> str:
    """Hash of an inline style or script, as a content security policy names it: what else is on the page is inert."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def study_pictures(
    analysis: Analysis,
    curves: Mapping[str, ModelCurves],
    runs: Mapping[str, Run],
    scenes: Mapping[str, Scene | None],
) -> dict[str, list[Picture]]:
    """Return the pictures of a study by section of the page: summary, behaviour, forces, filters, buckling."""
    pictures: dict[str, list[Picture]] = {
        name: [] for name in ("summary", "behaviour", "forces", "filters", "buckling")
    }
    for case, scene in watched(scenes.items(), "cases drawn", len(scenes)):
        pictures["behaviour"].append(behaviour_picture(case, analysis, runs))
        if scene is not None:
            filters, forces = packing_pictures(case, analysis, scene)
            pictures["filters"].append(filters)
            pictures["forces"].append(forces)
        if case in curves:
            pictures["buckling"].append(buckling_picture(case, analysis, curves[case]))
        if scene is not None and case in curves and not pictures["summary"]:
            pictures["summary"].append(summary_picture(case, analysis, scene, curves[case]))
    return pictures


def explorable_drops(
    analysis: Analysis,
    curves: Mapping[str, ModelCurves],
    runs: Mapping[str, Run],
    scenes: Mapping[str, Scene | None],
) -> list[View]:
    """Return the drops to explore: the busiest of each case, then others as long as the page stays small."""
    shown = {(scene.run, scene.drop): scene for scene in scenes.values() if scene is not None}
    views = [_view(number, scene, analysis, curves, runs) for number, scene in enumerate(shown.values())]
    room = FURTHER_DROPS
    for run, drop in busiest_drops(analysis) if views else ():
        if (run, drop) in shown or room < max(len(view.json) for view in views):
            continue
        scene = scene_of(analysis, runs, run, drop)
        if scene is not None:
            views.append(_view(len(views), scene, analysis, curves, runs))
            room -= len(views[-1].json)
    return views


def _view(
    number: int, scene: Scene, analysis: Analysis, curves: Mapping[str, ModelCurves], runs: Mapping[str, Run]
) -> View:
    start, end = scene.start.axial_strain, scene.end.axial_strain
    data = explorer_view(analysis, runs[scene.run], scene, curves.get(scene.case))
    return View(
        id=f"view-{number}",
        label=f"{scene.case} · {scene.run} · drop {scene.drop}: {start:.4f} to {end:.4f}, "
        f"{len(scene.segments)} buckled",
        json=Markup(script_json(page_data(data))),  # script_json leaves nothing that is markup
        table=segment_table(scene, data),
    )


def _missing(scenes: Mapping[str, Scene | None], analysis: Analysis, runs: Mapping[str, Run]) -> str:
    """Say which cases cannot be shown for want of snapshots."""
    reduced = {run.name for run in runs.values() if run.reduced}
    if not reduced:
        return ""
    bare = [case for case, scene in scenes.items() if scene is None and busiest_drops(analysis, case)]
    sentence = "These are reduced results: of the snapshots two are kept, so the explorer knows no step between them."
    return sentence + (f" No packing is shown of {'; '.join(bare)}." if bare else "")


def _context(
    analysis: Analysis,
    rows: Sequence[Row],
    curves: Mapping[str, ModelCurves],
    settings: RunSettings,
    runs: Mapping[str, Run],
) -> dict[str, Any]:
    return {
        "title": analysis.name,
        "subtitle": _subtitle(analysis),
        "tally": _tally(rows, analysis),
        "summary": _summary(rows, analysis),
        "classes": CLASS_NAMES.items(),
        "verdict_tables": [
            verdict_table(case, rows, analysis.particle_count(case), analysis.test(case)) for case in analysis.cases
        ],
        "verdict_words": VERDICT_WORDS,
        "validity_table": validity_table(analysis, settings, runs),
        "all_valid": not analysis.left_out,
        "macroscopic_table": frame_table(
            "State at the start of each drop, and what it dissipates and where it deforms up to its end.",
            analysis.macroscopic.drop(columns="case"),
        ),
        "drop_table": frame_table(f"The drops of the {_ratios(analysis)}.", analysis.drops.drop(columns="case")),
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
        "provenance_tables": provenance_tables(runs),
        "footer": f"forcechain {forcechain.__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC. "
        "Model and printed numbers: Tordesillas and Muthuswamy, J. Mech. Phys. Solids 57 (2009) 706-727.",
    }


def _subtitle(analysis: Analysis) -> str:
    sizes = sorted({int(count) for count in analysis.runs["particle_count"]})
    buckled = sum(int(record["buckled_segments"]) for record in analysis.ledger)
    return (
        f"{len(analysis.runs)} runs of {' and '.join(str(size) for size in sizes)} discs, {len(analysis.drops)} drops "
        f"of the {_ratios(analysis)}, {buckled} buckled three-particle segments."
    )


def _ratios(analysis: Analysis) -> str:
    """What drops, in the words of the tests of this study."""
    return " and ".join(dict.fromkeys(WORDS[analysis.test(case)].ratio for case in analysis.cases))


def _tally(rows: Sequence[Row], analysis: Analysis) -> list[tuple[int, str, str]]:
    """Count, words and kind of each outcome."""
    counts = Counter(row.verdict for row in rows)
    told = [
        (counts[Verdict.PASS], "rows pass", "good"),
        (counts[Verdict.FAIL], "rows fail", "bad" if counts[Verdict.FAIL] else ""),
        (counts[Verdict.UNDECIDED], "undecided", ""),
        (counts[Verdict.NOT_JUDGED], "not judged", ""),
        (len(analysis.left_out), "runs left out", "bad"),
    ]
    return [entry for entry in told if entry[0] or entry[1] in ("rows pass", "rows fail")]


def _summary(rows: Sequence[Row], analysis: Analysis) -> list[str]:
    """Name what fails, each quantity once, and what was left out."""
    failing = Counter(row.quantity for row in rows if row.verdict is Verdict.FAIL)
    many = len(analysis.cases) > 1
    named = [f"{name} ({count} of {len(analysis.cases)} cases)" if many else name for name, count in failing.items()]
    told = [f"What fails: {'; '.join(named)}."] if named else ["Nothing fails."]
    if analysis.left_out:
        told.append(f"Left out: {'; '.join(analysis.left_out.values())}.")
    return told
