"""The drops a report shows: which ones, their snapshots, and what the analysis found in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd

from forcechain.arrays import BoolArray, IntArray
from forcechain.observe.filters import potential_energy
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.snapshot import Snapshot
from forcechain.observe.transitions import Drop, snapshots_of_drop
from harness.analysing.analysis_options import read_options
from harness.analysing.buckling_data import Analysis
from harness.reading.exports import Run


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """One drop of one run, with what the analysis found in it.

    Attributes:
        case, run, drop: which: the case, the run's name, the drop's number in it from 1 on.
        rows: (n_increments + 1,) rows of its snapshots in the run's index.
        counts: a sentence on what each filter left.
        start, end: the snapshots at its start A and its end B.
        in_chain: (n_particles,) is in a force chain at A.
        lost_energy: (n_particles,) has less potential energy at B than at A.
        segments: (n_buckled, 3) particles of the buckled segments.
        classes: (n_buckled,) their classes, 0 to 4.
    """

    case: str
    run: str
    drop: int
    rows: IntArray
    counts: str
    start: Snapshot
    end: Snapshot
    in_chain: BoolArray
    lost_energy: BoolArray
    segments: IntArray
    classes: IntArray

    @property
    def where(self) -> str:
        """Words for a caption: case, run, drop and its strains."""
        strains = f"{self.start.axial_strain:.4f} to {self.end.axial_strain:.4f}"
        return f"{self.case}, {self.run}, drop {self.drop}, axial strain {strains}"

    @property
    def aspect(self) -> float:
        """Height over width of the packing."""
        width, height = np.ptp(self.start.position, axis=0)
        return float(height / width)


def options_of(analysis: Analysis) -> AnalysisOptions:
    """Return the options an analysis was made with."""
    given = {name: entry["value"] for name, entry in analysis.options.items()}
    return read_options(given, str(analysis.folder))[0]


def of_drop(table: pd.DataFrame, run: str, drop: int) -> pd.DataFrame:
    """Return the rows of one drop of one run."""
    chosen: pd.DataFrame = table[(table["run"] == run) & (table["drop"] == drop)]
    return chosen


def drop_rows(analysis: Analysis, run: Run, drop: int) -> IntArray:
    """Return the rows (n_increments + 1,) of the snapshots of a drop, A first, as the analysis chose them."""
    row = of_drop(analysis.drops, run.name, drop).iloc[0]
    chosen = Drop(**{item.name: float(row[item.name]) for item in fields(Drop)})
    return snapshots_of_drop(run.axial_strain, chosen, options_of(analysis))


def is_there(run: Run, row: int) -> bool:
    """Whether a snapshot is there to be read. It may not be in reduced results; elsewhere its absence is an error."""
    return not run.reduced or run.has_snapshot(row)


def busiest_drops(analysis: Analysis, case: str | None = None) -> list[tuple[str, int]]:
    """Return run and number of every drop (of a case), those with the most buckled segments first."""
    counted = [record for record in analysis.ledger if case in (None, record["case"])]
    ordered = sorted(counted, key=lambda record: -record["buckled_segments"])
    return [(record["run"], record["drop"]) for record in ordered]


def scene_of(analysis: Analysis, runs: Mapping[str, Run], run: str, drop: int) -> Scene | None:
    """Return one drop's scene; None where its first and last snapshots were not kept."""
    rows = drop_rows(analysis, runs[run], drop)
    if not all(is_there(runs[run], int(row)) for row in (rows[0], rows[-1])):
        return None
    record = next(record for record in analysis.ledger if (record["run"], record["drop"]) == (run, drop))
    start, end = (runs[run].snapshot(int(row)) for row in (rows[0], rows[-1]))
    in_chain = np.zeros(start.n_particles, dtype=np.bool_)
    in_chain[of_drop(analysis.members, run, drop)["particle"].to_numpy(dtype=np.int64)] = True
    terms = options_of(analysis).energy_terms
    yielding = of_drop(analysis.yielding, run, drop)
    found = record["buckled_segments"] > 0  # without any the tables of segments have no such columns
    return Scene(
        case=record["case"],
        run=run,
        drop=drop,
        rows=rows,
        counts=f"{record['in_chains']} of {record['particles']} discs are in force chains, {record['lost_energy']} of "
        f"them lost potential energy, {record['buckled_segments']} three-particle segments buckled.",
        start=start,
        end=end,
        in_chain=in_chain,
        lost_energy=potential_energy(end, terms) < potential_energy(start, terms),
        segments=yielding[["particle_1", "particle_2", "particle_3"]].to_numpy(dtype=np.int64)
        if found
        else np.zeros((0, 3), dtype=np.int64),
        classes=yielding["buckling_class"].to_numpy(dtype=np.int64) if found else np.zeros(0, dtype=np.int64),
    )


def busiest_scene(analysis: Analysis, runs: Mapping[str, Run], case: str) -> Scene | None:
    """Return the scene of a case's drop with the most buckled segments; None without drops or without its snapshots."""
    for run, drop in busiest_drops(analysis, case)[:1]:
        return scene_of(analysis, runs, run, drop)
    return None
