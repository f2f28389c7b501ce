"""The tables of the report: verdicts, validity, classes, averages, counts, parameters, provenance, as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from harness.analysing.averages import MEASURES
from harness.analysing.buckling_data import Analysis
from harness.comparing import paper
from harness.comparing.comparison import ModelCurves
from harness.comparing.verdicts import Row, Verdict
from harness.reading import validity
from harness.reading.exports import Run
from harness.reading.tested import BIAXIAL
from harness.report.scenes import Scene
from harness.study import RunSettings
from harness.text_table import number, with_error


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of the page: caption, header, rows of text, and the columns that hold numbers."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: frozenset[int]


def size_note(particle_count: int, test: str = BIAXIAL) -> str:
    """Say that the paper's sample was of another size, or that its numbers are not of this test."""
    if test != BIAXIAL:
        return f" {particle_count} discs; the paper's numbers are printed for its biaxial test and not held against it."
    if particle_count == paper.PARTICLE_COUNT:
        return ""
    return f" {particle_count} discs; the paper's numbers are printed for {paper.PARTICLE_COUNT}."


def verdict_table(case: str, rows: Sequence[Row], particle_count: int, test: str = BIAXIAL) -> Table:
    """Every row of the comparison of one case, with its verdict and what there is to say about it."""
    return Table(
        caption=f"Model, data and paper, {case}." + size_note(particle_count, test),
        header=["quantity", "verdict", "data ± 2 s.e.", "model", "paper", "unit", "n", "tolerance", "n.r.m.s.", "note"],
        rows=[
            [
                row.quantity,
                row.verdict.value,
                with_error(row.data, row.standard_error),
                number(row.model),
                number(row.paper),
                row.unit,
                row.counted,
                "-" if row.tolerance is None else f"{number(row.tolerance, 2)} ({row.tolerance_source})",
                number(row.normalised_rms, 2),
                row.note,
            ]
            for row in rows
            if row.case == case
        ],
        numeric=frozenset({2, 3, 4, 8}),
    )


def validity_table(analysis: Analysis, settings: RunSettings, runs: Mapping[str, Run]) -> Table:
    """What every run was judged by, and the runs that were left out."""
    rows = [
        [name, figure.meaning, number(figure.value), number(figure.lower), number(figure.upper), _pass(figure.passed)]
        for name, run in runs.items()
        if run.manifest is not None
        for figure in validity.judge(run.manifest, settings)
    ]
    rows += [[name, reason, "-", "-", "-", "FAIL"] for name, reason in analysis.left_out.items()]
    return Table(
        caption=f"Was each run valid? {_count_valid(analysis)}. Only valid runs are compared.",
        header=["run", "figure", "value", "at least", "at most", "verdict"],
        rows=rows,
        numeric=frozenset({2, 3, 4}),
    )


def _count_valid(analysis: Analysis) -> str:
    runs, out = len(analysis.runs), len(analysis.left_out)
    return f"{runs} are, {out} left out" if out else f"All {runs} are" if runs > 1 else "It is"


def _pass(passed: bool) -> str:
    return (Verdict.PASS if passed else Verdict.FAIL).value


def class_table(case: str, analysis: Analysis) -> Table:
    """Order of yielding of one case, beside the print where it is a biaxial test as the paper's."""
    biaxial = analysis.test(case) == BIAXIAL
    shares = analysis.classes[analysis.classes["case"] == case]
    friction = analysis.runs.loc[analysis.runs["case"] == case, "rolling_friction"].iloc[0]
    printed = next((row for value, row in paper.TABLE_1.items() if np.isclose(value, friction)), None)
    rows = []
    for record in shares.to_dict("records"):
        key = str(record["class"])
        words = (
            paper.CLASS_WORDS[int(key)] if key.isdigit() else "a contact of the chain slides before its moment yields"
        )
        reference = "< 5" if not key.isdigit() else number(printed[int(key) - 1]) if printed else "-"
        reference = reference if biaxial else "-"
        share = with_error(record["percent"], record["percent_se"])
        rows.append([key, words, f"{record['segments']} of {record['of']}", share, reference])
    return Table(
        caption=f"Order of yielding among buckled segments, {case} (the paper's Table 1; shown, not judged: it moves "
        "with the length of an increment and the reach of the ring of neighbours). "
        + (
            "The paper calls classes 2 and 4 together 'consistently the majority'; its own numbers add up to 48.8 % at "
            "a rolling friction of 0.2."
            if biaxial
            else "The paper counts it for its biaxial test alone."
        ),
        header=["class", "meaning", "segments", "% ± 2 s.e.", "paper %"],
        rows=rows,
        numeric=frozenset({2, 3, 4}),
    )


def average_table(case: str, analysis: Analysis) -> Table:
    """Averages of one case by increment."""
    averages = analysis.averages[analysis.averages["case"] == case]
    rows = [
        [str(record["increment"]), number(record["strain_since_start"]), str(record["segments"])]
        + [with_error(record[name], record[f"{name}_se"]) for name in MEASURES]
        for record in averages.to_dict("records")
    ]
    header = ["increment", "strain since start", "segments", *[name.replace("_", " ") for name in MEASURES]]
    return Table(
        caption=f"Averages by increment with two standard errors, {case}.",
        header=header,
        rows=rows,
        numeric=frozenset(range(len(header))),
    )


def parameter_table(runs: Mapping[str, Run]) -> Table:
    """Every parameter of the simulations, all its values."""
    names = list(dict.fromkeys(name for run in runs.values() for name in run.parameters))
    rows = []
    for name in names:
        values = list(dict.fromkeys(cell(run.parameters.get(name)) for run in runs.values()))
        entry: Any = next(
            (run.manifest["parameters"].get(name) for run in runs.values() if run.manifest is not None), None
        )
        unit = entry.get("unit", "") if isinstance(entry, Mapping) else ""
        rows.append([name, ", ".join(values), unit])
    return Table(
        caption="Parameters of the simulations.", header=["parameter", "value", "unit"], rows=rows, numeric=frozenset()
    )


def model_table(curves: Mapping[str, ModelCurves]) -> Table:
    """The model's parameters, a column a case."""
    names: list[str] = []
    columns = []
    for model in curves.values():
        ratios = model.parameters.ratios()
        names = list(ratios)
        columns.append([number(float(np.asarray(value))) for value in ratios.values()])
    rows = [[name, *[column[i] for column in columns]] for i, name in enumerate(names)]
    return Table(
        caption="Parameters of the model: radius [m], normal stiffness [N/m], the other stiffnesses and the lateral "
        "strength over the normal stiffness, rolling friction, imperfection [deg].",
        header=["parameter", *curves],
        rows=rows,
        numeric=frozenset(range(1, len(curves) + 1)),
    )


def provenance_tables(runs: Mapping[str, Run]) -> list[Table]:
    """What made the runs (versions, seed, host, dates): first what they share, then a row a run with the rest."""
    told: dict[str, Mapping[str, Any]] = {
        name: (run.manifest or {}).get("provenance", {"origin": "tables without a manifest"})
        for name, run in runs.items()
    }
    names = list(dict.fromkeys(key for facts in told.values() for key in facts))
    values = {key: [cell(facts.get(key)) for facts in told.values()] for key in names}
    shared = [key for key in names if len(set(values[key])) == 1]
    differing = [key for key in names if key not in shared]
    tables = [
        Table(
            caption="Where the runs come from: what all share.",
            header=["what", "value"],
            rows=[[key.replace("_", " "), values[key][0]] for key in shared],
            numeric=frozenset(),
        ),
        Table(
            caption="Where the runs come from: what differs.",
            header=["run", *[key.replace("_", " ") for key in differing]],
            rows=[[name, *[values[key][i] for key in differing]] for i, name in enumerate(told)],
            numeric=frozenset(),
        ),
    ]
    return [table for table, keys in zip(tables, (shared, differing), strict=True) if keys]


def segment_table(scene: Scene, view: Mapping[str, Any]) -> Table:
    """The buckled segments of one drop at its start and its end, from the explorer's data."""
    measures = view["measures"]
    columns = (
        ("buckling angle [deg]", "buckling_angle_deg"),
        ("axial force [N]", "axial_force_N"),
        ("lateral force [N]", "lateral_force_N"),
        ("normal displacement/R", "normal_displacement_over_R"),
    )
    ends = (
        ("axial displacement/R at the end", "axial_displacement_over_R"),
        ("rotation at the end [deg]", "rotation_deg"),
    )
    rows = []
    for place, segment in enumerate(view["segments"]):
        changes = [f"{number(measures[name][0][place])} to {number(measures[name][-1][place])}" for _, name in columns]
        rows.append(
            [
                str(segment["segment"]),
                ", ".join(str(particle) for particle in segment["particles"]),
                f"{segment['class']} {segment['order']}" if segment["class"] else segment["order"],
                f"{segment['chain']} ({segment['chain_length']} discs)",
                *changes,
                *[number(measures[name][-1][place]) for _, name in ends],
            ]
        )
    header = ["segment", "discs", "class", "chain", *[words for words, _ in columns], *[words for words, _ in ends]]
    return Table(
        caption=f"Buckled segments of {scene.where}, from the start to the end of the drop.",
        header=header,
        rows=rows,
        numeric=frozenset(range(4, len(header))),
    )


def frame_table(caption: str, frame: pd.DataFrame) -> Table:
    """Any table of the analysis as text."""
    numeric = frozenset(i for i, name in enumerate(frame.columns) if pd.api.types.is_numeric_dtype(frame[name]))
    return Table(
        caption=caption,
        header=[str(name).replace("_", " ") for name in frame.columns],
        rows=[[cell(value) for value in row] for row in frame.to_numpy(dtype=object).tolist()],
        numeric=numeric,
    )


def cell(value: Any) -> str:
    """Text of one value."""
    if isinstance(value, float):
        return number(value, 5)
    if isinstance(value, list | tuple):
        return ", ".join(cell(item) for item in value)
    return "-" if value is None else str(value)
