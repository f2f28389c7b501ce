"""From a folder of runs to buckling data: drops, segments, averages, classes and the ledger of counts, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from forcechain.observe.options import AnalysisOptions
from forcechain.observe.transitions import Drop, find_drops, given_drops, snapshots_of_drop
from forcechain.observe.window import DropObservation, observe_drop
from harness.analysing import macroscopic
from harness.analysing.averages import MEASURES
from harness.analysing.run_facts import run_facts
from harness.errors import InputError
from harness.progress import watched
from harness.reading.exports import Run, read_run


@dataclass(frozen=True, slots=True, kw_only=True)
class RunAnalysis:
    """What one run gave: a row of facts, and tables with a row a drop, a segment and increment, a segment, a chain."""

    facts: Mapping[str, Any]
    drops: pd.DataFrame
    segments: pd.DataFrame
    yielding: pd.DataFrame
    chains: pd.DataFrame
    members: pd.DataFrame
    macroscopic: pd.DataFrame
    ledger: tuple[Mapping[str, Any], ...]


def choose_drops(
    run: Run, options: AnalysisOptions, intervals: Sequence[tuple[float, float]] | None
) -> tuple[Drop, ...]:
    """Return the drops of a run: over the given intervals, or found in its history.

    InputError when the history is not there, or too short, or an interval does not fit it.
    """
    try:
        if run.history is not None and "stress_ratio" in run.history:
            strain, ratio = run.history["axial_strain"].to_numpy(), run.history["stress_ratio"].to_numpy()
            if intervals is not None:
                return given_drops(strain, ratio, intervals, options)
            return find_drops(strain, ratio, options)
    except ValueError as error:
        raise InputError(f"run {run.name}: {error}") from None
    raise InputError(
        f"run {run.name}: expected a history.csv with axial_strain and stress_ratio to find its drops, found none; "
        "write one beside the snapshots"
    )


def analyse_run(
    run: Run,
    case: str,
    options: AnalysisOptions,
    intervals: Sequence[tuple[float, float]] | None = None,
) -> RunAnalysis:
    """Find the drops of one run, its buckled segments in each, and measure them.

    Raises InputError in one line for tables that cannot be used.
    """
    key = {"run": run.name, "case": case}
    facts = run_facts(run)
    radius = facts["mean_radius"]
    drop_rows, segment_rows, yielding_rows, chain_rows, member_rows, ledger = [], [], [], [], [], []
    macroscopic_rows = []
    chosen = choose_drops(run, options, intervals)
    for number, drop in enumerate(chosen, start=1):
        try:
            rows = snapshots_of_drop(run.axial_strain, drop, options)
            snapshots = [run.snapshot(int(row)) for row in rows]
            observed = observe_drop(snapshots, options)
        except ValueError as error:
            raise InputError(f"run {run.name}: drop {number}: {error}") from None
        of_drop = key | {"drop": number}
        drop_rows.append(of_drop | asdict(drop) | {"first_snapshot": int(rows[0]), "last_snapshot": int(rows[-1])})
        segment_rows.append(_segment_table(observed, radius).assign(**of_drop))
        yielding_rows.append(_yielding_table(observed).assign(**of_drop))
        chain_rows.append(_chain_table(observed).assign(**of_drop))
        member_rows.append(_member_table(observed).assign(**of_drop))
        macroscopic_rows.append(of_drop | macroscopic.drop_facts(snapshots, observed.buckled))
        ledger.append(of_drop | asdict(observed.ledger))
    return RunAnalysis(
        facts=key | facts | {"drops": len(chosen)},
        drops=pd.DataFrame(drop_rows, columns=None if drop_rows else ["run", "case", "drop", "start", "end"]),
        segments=_joined(segment_rows, ["run", "case", "drop", "increment", *MEASURES]),
        yielding=_joined(yielding_rows, ["run", "case", "drop", "buckling_class", "slides_first"]),
        chains=_joined(chain_rows, ["run", "case", "drop", "chain", "length", "branch_points"]),
        members=_joined(member_rows, ["run", "case", "drop", "particle", "chain"]),
        macroscopic=pd.DataFrame(macroscopic_rows, columns=["run", "case", "drop", *macroscopic.COLUMNS]),
        ledger=tuple(ledger),
    )


def analyse_runs(
    runs: Sequence[tuple[Run, str]],
    options: AnalysisOptions,
    intervals: Sequence[tuple[float, float]] | None = None,
    jobs: int = 1,
) -> list[RunAnalysis]:
    """Analyse runs given with their cases, `jobs` side by side; the result does not depend on their number."""
    if jobs <= 1 or len(runs) <= 1:
        todo = watched(runs, "runs analysed", len(runs))
        return [analyse_run(run, case, options, intervals) for run, case in todo]
    # Fresh processes: a forked copy of one that runs numerical threads may hang.
    with ProcessPoolExecutor(min(jobs, len(runs)), get_context("spawn")) as pool:
        futures = [pool.submit(_analyse_folder, run.folder, case, options, intervals) for run, case in runs]
        for _ in watched(as_completed(futures), "runs analysed", len(futures)):
            pass
        return [future.result() for future in futures]


def _analyse_folder(
    folder: Path, case: str, options: AnalysisOptions, intervals: Sequence[tuple[float, float]] | None
) -> RunAnalysis:
    return analyse_run(read_run(folder), case, options, intervals)


def cases_of(runs: Sequence[Run]) -> list[str]:
    """Name the case of each run: the parameters in which runs differ, seed apart; runs of one case are its seeds.

    A run without parameters (tables of other origin) is a case of its own.
    """
    described = [run for run in runs if run.parameters]
    names = {name for run in described for name in run.parameters} - {"seed"}
    varying = [name for name in sorted(names) if len({repr(run.parameters.get(name)) for run in described}) > 1]
    labels = []
    for run in runs:
        if not run.parameters:
            labels.append(run.name)
        elif varying:
            labels.append(", ".join(f"{name} {_brief(run.parameters.get(name))}" for name in varying))
        else:
            friction = run.parameters.get("rolling_friction")
            labels.append("all runs" if friction is None else f"rolling_friction {_brief(friction)}")
    return labels


def _brief(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _joined(tables: list[pd.DataFrame], columns: list[str]) -> pd.DataFrame:
    if not tables:
        return pd.DataFrame(columns=columns)
    table = pd.concat(tables, ignore_index=True)
    first = ["run", "case", "drop"]
    return table[first + [name for name in table.columns if name not in first]]


def _segment_table(observed: DropObservation, radius: float) -> pd.DataFrame:
    measures, buckled = observed.measures, observed.buckled
    n_times, n_buckled = measures.buckling_angle.shape
    return pd.DataFrame(
        {
            "segment": np.tile(np.arange(n_buckled), n_times),
            "increment": np.repeat(np.arange(n_times), n_buckled),
            "axial_strain": np.repeat(observed.axial_strain, n_buckled),
            "particle_1": np.tile(buckled[:, 0], n_times),
            "particle_2": np.tile(buckled[:, 1], n_times),
            "particle_3": np.tile(buckled[:, 2], n_times),
            "buckling_angle_deg": np.degrees(measures.buckling_angle).ravel(),
            "axial_force_N": measures.axial_force.ravel(),
            "axial_displacement_over_R": measures.axial_displacement.ravel() / radius,
            "normal_displacement_over_R": measures.normal_displacement.ravel() / radius,
            "rotation_deg": np.degrees(measures.rotation).ravel(),
            "lateral_force_N": measures.lateral_force.ravel(),
        }
    )


def _yielding_table(observed: DropObservation) -> pd.DataFrame:
    yielding, buckled = observed.yielding, observed.buckled
    return pd.DataFrame(
        {
            "segment": np.arange(len(buckled)),
            "particle_1": buckled[:, 0],
            "particle_2": buckled[:, 1],
            "particle_3": buckled[:, 2],
            "buckling_class": yielding.buckling_class,
            "chain_moment_increment": yielding.chain_moment,
            "weak_network_increment": yielding.weak_network,
            "chain_sliding_increment": yielding.chain_sliding,
            "slides_first": yielding.slides_first,
        }
    )


def _chain_table(observed: DropObservation) -> pd.DataFrame:
    chains = observed.chains
    return pd.DataFrame(
        {
            "chain": np.arange(chains.n_chains),
            "length": chains.length,
            "branch_points": chains.branch_points,
        }
    )


def _member_table(observed: DropObservation) -> pd.DataFrame:
    members = np.flatnonzero(observed.chains.in_chain)
    return pd.DataFrame({"particle": members, "chain": observed.chains.label[members]})
