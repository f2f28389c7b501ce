"""How the buckling data move with each choice of the analysis: one choice at a time about those in use."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, fields
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from forcechain.arrays import FloatArray
from forcechain.observe.averages import average_by_increment, bootstrap_error
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.sensitivity import VARIATIONS, Variation, variations
from forcechain.observe.snapshot import Snapshot
from forcechain.observe.transitions import snapshots_of_drop
from forcechain.observe.window import observe_drop
from harness.analysing.analysis import usable_runs
from harness.analysing.analysis_options import read_options
from harness.analysing.buckling_data import FOLDER
from harness.analysing.pipeline import cases_of, choose_drops
from harness.errors import InputError, RunError
from harness.figures.sensitivity import N_PANELS, plot_sensitivity
from harness.progress import watched
from harness.reading.exports import Run, read_run
from harness.report.pictures import Picture
from harness.study import RunSettings, study_in
from yade_scripts.run_folder import write

# What is told of each variation: name in the table, and the column of the values a segment has.
OUTCOMES = (
    "initial_angle_deg",
    "angle_growth_deg",
    "lateral_force_N",
    "initial_axial_force_N",
    "class_1_percent",
    "class_2_percent",
    "class_3_percent",
    "class_4_percent",
    "slides_first_percent",
)
COLUMNS = ["case", "option", "value", "in_use", "drops", "candidates", "segments"] + [
    name + ending for name in OUTCOMES for ending in ("", "_se")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunVariation:
    """One run seen with one choice changed: counts, and a row of values a buckled segment."""

    option: str
    value: Any
    drops: int
    candidates: int
    values: FloatArray  # (n_outcomes, n_segments)
    fault: str = ""


def sensitivity(
    runs: Sequence[tuple[Run, str]],
    options: AnalysisOptions,
    intervals: Sequence[tuple[float, float]] | None = None,
    *,
    table: Mapping[str, Sequence[Any]] = VARIATIONS,
    jobs: int = 1,
) -> pd.DataFrame:
    """Analyse runs, given with their cases, again and again, each time with one choice of `table` changed.

    Returns a row a case and variation; the first of a case, `in_use`, has the choices as they are. `option` and `value`
    have names and units of the edge (degrees). Means are over all buckled segments of all drops and runs of the case,
    `_se` the larger of the standard errors over segments and over runs. A variation that the snapshots do not allow
    (increments finer than they are) has no counts, and its reason in `fault`. Where drops are given, the choices that
    find them are not varied. Raises InputError if a run cannot be analysed as it is.
    """
    if intervals is not None:
        table = {name: values for name, values in table.items() if not name.startswith("drop_")}
    chosen = variations(options, table)
    if jobs <= 1 or len(runs) <= 1:
        found = [_vary(run, chosen, intervals) for run, _ in watched(runs, "runs varied", len(runs))]
    else:
        with ProcessPoolExecutor(min(jobs, len(runs)), get_context("spawn")) as pool:
            futures = [pool.submit(_vary_folder, run.folder, chosen, intervals) for run, _ in runs]
            for _ in watched(as_completed(futures), "runs varied", len(futures)):
                pass
            found = [future.result() for future in futures]
    rows = []
    for case in dict.fromkeys(case for _, case in runs):
        of_case = [result for result, (_, name) in zip(found, runs, strict=True) if name == case]
        for number, variation in enumerate(chosen):
            rows.append({"case": case} | _row(variation, [result[number] for result in of_case]))
    return pd.DataFrame(rows, columns=[*COLUMNS, "fault"])


def write_sensitivity(directory: Path, *, jobs: int | None = None) -> tuple[pd.DataFrame, tuple[Path, ...]]:
    """Make the table of a study or run, and a figure a case, under its `analysis`; return the table and the files.

    Raises what `harness.analysing.analysis.analyse` raises; runs that are not complete and valid are left out as there.
    """
    study = study_in(directory)
    settings = study.run if study is not None else RunSettings()
    options, intervals = read_options(study.analysis if study else {}, str(study.source if study else directory))
    runs, left_out = usable_runs(directory, settings)
    if not runs:
        raise RunError(f"{directory}: no complete and valid run to analyse: " + "; ".join(left_out.values()))
    cased = list(zip(runs, cases_of(runs), strict=True))
    table = sensitivity(cased, options, intervals, table=VARIATIONS, jobs=jobs or os.cpu_count() or 1)
    folder = directory / FOLDER
    files = [write(folder, "sensitivity.csv", table.to_csv(index=False).encode()).name]
    cases = list(dict.fromkeys(table["case"]))
    for number, case in enumerate(cases, start=1):
        of_case = table[table["case"] == case]
        name = "sensitivity.svg" if len(cases) == 1 else f"sensitivity-{number}.svg"
        files.append(write(folder, name, sensitivity_picture(of_case, case).render("svg")).name)
    return table, tuple(folder / name for name in files)


def sensitivity_picture(of_case: pd.DataFrame, case: str) -> Picture:
    """Return the figure of one case's rows: all that was varied, against what the choices in use give."""

    def draw(figure: Figure) -> None:
        plot_sensitivity(of_case, axes=list(figure.subplots(1, N_PANELS, sharey=True)))
        figure.suptitle(case)

    words = "How initial angle, lateral force, count and classes of the buckled segments move with one choice at a time"
    return Picture(
        name="sensitivity",
        caption=f"{words}; means with 2 standard errors, the band is the choices in use.",
        alternative=words,
        size=(11, 1.5 + 0.24 * len(of_case)),
        draw=draw,
    )


def edge_name(option: str) -> str:
    """Name of an option at the edge: angles in degrees.

    >>> edge_name("alignment_angle"), edge_name("segment_rule")
    ('alignment_angle_deg', 'segment_rule')
    """
    return f"{option}_deg" if _is_angle(option) else option


def edge_value(option: str, value: Any) -> str:
    """Value of an option as text: angles in degrees, several terms joined.

    >>> edge_value("alignment_angle", 0.7853981633974483), edge_value("energy_terms", ("normal", "rolling"))
    ('45', 'normal+rolling')
    """
    if isinstance(value, tuple):
        return "+".join(value)
    if isinstance(value, float):
        return f"{math.degrees(value) if _is_angle(option) else value:.10g}"
    return str(value)


def _is_angle(option: str) -> bool:
    return any(item.name == option and item.metadata["unit"] == "rad" for item in fields(AnalysisOptions))


def _vary_folder(
    folder: Path, chosen: Sequence[Variation], intervals: Sequence[tuple[float, float]] | None
) -> list[RunVariation]:
    return _vary(read_run(folder), chosen, intervals)


def _vary(run: Run, chosen: Sequence[Variation], intervals: Sequence[tuple[float, float]] | None) -> list[RunVariation]:
    read: dict[int, Snapshot] = {}  # most variations look at the same snapshots
    found = []
    for variation in chosen:
        try:
            found.append(_one(run, variation, intervals, read))
        except ValueError as error:
            if variation.is_reference:
                raise InputError(f"run {run.name}: {error}") from None
            nothing = np.zeros((len(OUTCOMES), 0))
            found.append(
                RunVariation(
                    option=variation.name,
                    value=variation.value,
                    drops=0,
                    candidates=0,
                    values=nothing,
                    fault=str(error),
                )
            )
    return found


def _one(
    run: Run,
    variation: Variation,
    intervals: Sequence[tuple[float, float]] | None,
    read: dict[int, Snapshot],
) -> RunVariation:
    options = variation.options
    drops = choose_drops(run, options, intervals)
    values, candidates = [np.zeros((len(OUTCOMES), 0))], 0
    for drop in drops:
        rows = [int(row) for row in snapshots_of_drop(run.axial_strain, drop, options)]
        for row in rows:
            if row not in read:
                read[row] = run.snapshot(row)
        observed = observe_drop([read[row] for row in rows], options)
        measures, yielding = observed.measures, observed.yielding
        candidates += observed.ledger.candidate_segments
        angle = np.degrees(measures.buckling_angle)
        values.append(
            np.stack(
                [
                    angle[0],
                    angle[-1] - angle[0],
                    measures.lateral_force.mean(axis=0),
                    measures.axial_force[0],
                    *(100.0 * (yielding.buckling_class == number) for number in (1, 2, 3, 4)),
                    100.0 * yielding.slides_first,
                ]
            )
        )
    return RunVariation(
        option=variation.name,
        value=variation.value,
        drops=len(drops),
        candidates=candidates,
        values=np.concatenate(values, axis=1),
    )


def _row(variation: Variation, found: Sequence[RunVariation]) -> dict[str, Any]:
    fault = next((result.fault for result in found if result.fault), "")
    row: dict[str, Any] = {
        "option": edge_name(variation.name),
        "value": "" if variation.is_reference else edge_value(variation.name, variation.value),
        "in_use": variation.is_reference,
        "fault": fault,
    }
    if fault:
        return row
    groups = [result.values for result in found]
    mean, error = average_by_increment(groups).mean, bootstrap_error(groups)
    row |= {
        "drops": sum(result.drops for result in found),
        "candidates": sum(result.candidates for result in found),
        "segments": sum(values.shape[1] for values in groups),
    }
    for number, name in enumerate(OUTCOMES):
        row |= {name: mean[number], f"{name}_se": error.larger[number]}
    return row
