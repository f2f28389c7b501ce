"""Columns of 3, 4 and 5 particles fitted to a study's stretches of that length, with the ledger of what was counted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pandas as pd

from forcechain.calibration import Calibration, Column, LongColumn, SegmentHistories, calibrate_long
from forcechain.calibration.long_columns import FEWEST
from forcechain.observe.stretches import find_stretches
from harness.analysing.buckling_data import Analysis
from harness.comparing.calibrations import COLUMNS, segment_histories
from harness.comparing.comparison import model_parameters
from harness.errors import InputError
from harness.text_table import number, render

LENGTHS = (3, 4, 5)  # those the paper analysed; longer stretches are few
HEADER = (
    "particles",
    "stretches",
    "kFC / kn",
    "95 %",
    "status",
    "ks / kn",
    "95 %",
    "status",
    "ls / kn",
    "critical force [N]",
    "at the start [N]",
    "n.r.m.s. F",
    "with N = 3's",
)
MEANING = (
    "a stretch: segments that buckle one after the other along a chain; 3 particles: a segment by itself\n"
    "critical force: of the fitted column; at the start: of the stretches; n.r.m.s. F: of the axial force, fitted, and "
    "with the kFC and ks of the three-particle fit"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StretchFits:
    """The columns of one case.

    Attributes:
        fitted: N -> the column of N particles.
        without: N -> why there is none.
        ledger: buckled segments; stretches by their number of particles; those left out because they branch.
    """

    fitted: Mapping[int, LongColumn]
    without: Mapping[int, str]
    ledger: Mapping[str, int]


def stretch_histories(segments: pd.DataFrame) -> tuple[dict[int, list[SegmentHistories]], dict[str, int]]:
    """Return N -> the means over each stretch of N particles, a set a run, of one case's segments; and the ledger."""
    parts = []
    ledger = {"buckled segments": 0, "branched stretches": 0}
    for _, of_drop in segments.groupby(["run", "drop"], sort=False):
        first = of_drop[of_drop["increment"] == of_drop["increment"].min()]
        found = find_stretches(first[["particle_1", "particle_2", "particle_3"]].to_numpy(dtype=np.int64))
        ledger["buckled segments"] += len(first)
        ledger["branched stretches"] += int((~found.is_line).sum())
        label = pd.Series(found.label, index=first["segment"])
        stretch = of_drop["segment"].map(label).to_numpy(dtype=np.int64)
        table = of_drop.assign(stretch=stretch, particles=found.n_particles[stretch])
        parts.append(table[found.is_line[stretch]])
    lines = pd.concat(parts, ignore_index=True)
    measures = [column for column, _ in COLUMNS.values()]
    by_length = {}
    for length, of_length in lines.groupby("particles"):
        n_particles = int(str(length))
        keys = ["run", "drop", "stretch", "increment"]
        means = of_length.groupby(keys, sort=False)[measures].mean().reset_index()
        by_length[n_particles] = segment_histories(means.rename(columns={"stretch": "segment"}))
        counted = sum(run.buckling_angle.shape[1] for run in by_length[n_particles])
        ledger[f"stretches of {n_particles} particles"] = counted
    return by_length, ledger


def calibrate_stretches(
    analysis: Analysis, calibrations: Mapping[str, Mapping[Column, Calibration]]
) -> dict[str, StretchFits]:
    """Fit the columns of `LENGTHS` in every case that has a three-particle calibration of the perfect column.

    Raises InputError for segments that cannot be used.
    """
    found = {}
    for case, of_case in calibrations.items():
        if Column.PERFECT not in of_case:
            continue
        segments = analysis.segments[analysis.segments["case"] == case]
        given = model_parameters(analysis.runs[analysis.runs["case"] == case], {})
        try:
            by_length, ledger = stretch_histories(segments)
        except ValueError as error:
            raise InputError(f"case {case}: its stretches cannot be averaged: {error}") from None
        fitted, without = {}, {}
        for n_particles in LENGTHS:
            runs = by_length.get(n_particles, [])
            counted = sum(run.buckling_angle.shape[1] for run in runs)
            if counted < FEWEST:
                without[n_particles] = f"too few stretches: {counted}, expected at least {FEWEST}"
                continue
            try:
                fitted[n_particles] = calibrate_long(runs, given, n_particles, three=of_case[Column.PERFECT].parameters)
            except ValueError as error:
                without[n_particles] = str(error)
        found[case] = StretchFits(fitted=fitted, without=without, ledger=ledger)
    return found


def as_plain(fits: StretchFits) -> dict[str, Any]:
    """Return the fits as plain values, for TOML and JSON."""
    return {
        "ledger": dict(fits.ledger),
        "not_fitted": {str(n_particles): why for n_particles, why in fits.without.items()} or None,
        "columns": [
            {
                "particles": column.n_particles,
                "stretches": column.n_stretches,
                "runs": column.n_runs,
                "critical_force_N": column.critical_force,
                "force_at_start_N": column.first_force,
                "sum_of_squares": column.sum_of_squares,
                "parameters": {
                    estimate.name: {
                        "value": estimate.value,
                        "unit": "normal_stiffness",
                        "interval": list(asdict(estimate.interval).values()),
                        "standard_error": estimate.standard_error,
                        "identified": estimate.identified.value,
                    }
                    for estimate in column.estimates
                },
                "normalised_rms": dict(column.deviation),
                "normalised_rms_with_three": dict(column.of_three) if column.of_three else None,
            }
            for column in fits.fitted.values()
        ],
    }


def text(fits: StretchFits) -> str:
    """Write the fits as a table, and what was counted."""
    rows = []
    for column in fits.fitted.values():
        chain, lateral, strength = column.estimates
        cells = [str(column.n_particles), str(column.n_stretches)]
        for estimate in (chain, lateral):
            ends = (number(estimate.interval.low), number(estimate.interval.high))
            cells += [number(estimate.value), " to ".join(ends), estimate.identified.value]
        cells += [number(strength.value), number(column.critical_force), number(column.first_force)]
        three = None if column.of_three is None else column.of_three["axial_force"]
        rows.append((*cells, number(column.deviation["axial_force"], 2), number(three, 2)))
    counted = ", ".join(f"{count} {what}" for what, count in fits.ledger.items())
    lines = [f"{n_particles} particles: not fitted: {why}" for n_particles, why in fits.without.items()]
    return "\n".join([render(HEADER, rows, right=(0, 1, 2, 5, 8, 9, 10, 11, 12)), *lines, counted, MEANING])
