"""What a study amounts to: headline numbers and where they come from. A baseline keeps one, a check makes another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

import forcechain
from forcechain.calibration import Column
from harness.analysing.buckling_data import Analysis
from harness.comparing.calibrations import calibrate_study
from harness.gate.headlines import Headline, headlines
from harness.reading.consistency import MEANINGS, run_consistency
from harness.reading.exports import Run, read_run
from harness.reading.manifest import DIGITS, REDUCED, products_disagreement, tables_digest
from harness.study import RUNS

RESAMPLES = 100  # enough for a standard error; the interval of `forcechain calibrate` asks for more
CONTACTS = (  # of the tables themselves, whatever a parameter file says
    "particle_count",
    "normal_stiffness",
    "tangential_stiffness_ratio",
    "rolling_stiffness_ratio",
    "friction",
    "rolling_friction",
)
Plain = bool | int | float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One case: its parameters (seed apart), its contacts as the tables have them, its numbers.

    Attributes:
        name: of the case.
        seeds: of its runs, as far as they are told.
        parameters: name to value, empty for tables without a manifest.
        contacts: property to its value in every run, one entry if they agree.
        consistency: figure to its largest value over the runs.
        tables: run to a digest of its tables: equal ones are the same tables.
        headlines: the numbers.
    """

    name: str
    seeds: tuple[int, ...]
    parameters: Mapping[str, Plain]
    contacts: Mapping[str, tuple[float, ...]]
    consistency: Mapping[str, float]
    tables: Mapping[str, str]
    headlines: tuple[Headline, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """A study's cases, the options of its analysis, and the versions that made it."""

    study: str
    cases: tuple[Case, ...]
    options: Mapping[str, Any]
    versions: Mapping[str, tuple[str, ...]]
    broken: Mapping[str, str]


def measure(analysis: Analysis, reference: Mapping[str, float]) -> Measured:
    """Take a study's headline numbers, and check every table of every run against its checksum on the way."""
    calibrations, _ = calibrate_study(
        analysis, reference, columns=(Column.PERFECT,), samples=RESAMPLES, profile_points=0
    )
    numbers = headlines(analysis, {case: both[Column.PERFECT] for case, both in calibrations.items()})
    versions: dict[str, set[str]] = {"package": {forcechain.__version__}, "yade": set(), "script": set()}
    broken: dict[str, str] = {}
    cases = []
    for name in analysis.cases:
        facts = analysis.runs[analysis.runs["case"] == name]
        parameters: dict[str, Plain] = {}
        consistency: dict[str, float] = dict.fromkeys(MEANINGS, 0.0)
        tables = {}
        for run_name in facts["run"]:
            run = read_run(_folder(analysis.directory, str(run_name)))
            if run.manifest is not None:
                difference = products_disagreement(run.folder, run.manifest)
                if difference is not None:
                    broken[run.name] = difference
                    continue
                tables[run.name] = tables_digest(run.manifest)
                provenance = run.manifest.get("provenance", {})
                for key, told in (("yade", "yade_version"), ("script", "script_hash")):
                    if told in provenance:
                        versions[key].add(str(provenance[told])[:DIGITS])
            parameters |= {key: value for key, value in run.parameters.items() if key != "seed"}
            for figure, value in _consistency(run).items():
                consistency[figure] = max(consistency[figure], value)
        cases.append(
            Case(
                name=name,
                seeds=tuple(sorted(int(seed) for seed in pd.to_numeric(facts["seed"], errors="coerce").dropna())),
                parameters=parameters,
                contacts={
                    key: tuple(dict.fromkeys(float(f"{value:.7g}") for value in facts[key].dropna()))
                    for key in CONTACTS
                    if key in facts
                },
                consistency=consistency,
                tables=tables,
                headlines=tuple(number for number in numbers if number.case == name),
            )
        )
    return Measured(
        study=analysis.name,
        cases=tuple(cases),
        options={name: entry["value"] for name, entry in analysis.options.items()},
        versions={key: tuple(sorted(values)) for key, values in versions.items()},
        broken=broken,
    )


def _folder(directory: Path, run: str) -> Path:
    if directory.resolve().name == run:
        return directory
    parent = directory / RUNS if (directory / RUNS).is_dir() else directory
    return parent / run


def _consistency(run: Run) -> Mapping[str, float]:
    """Figures of a run's tables; of reduced results, those taken when the tables were whole."""
    if run.manifest is not None and REDUCED in run.manifest:
        kept = run.manifest[REDUCED].get("consistency", {})
        return {figure: float(kept[figure]) for figure in MEANINGS if figure in kept}
    return run_consistency(run)
