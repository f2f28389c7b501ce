"""What an analysis leaves: the buckling data of a study as tables, and the names of the files they are kept in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from harness.reading.tested import BIAXIAL

FOLDER = "analysis"
OPTIONS = "options.json"  # written last: its presence says that the other files are whole
LEDGER = "ledger.json"
TABLES = ("runs", "drops", "segments", "yielding", "chains", "members", "macroscopic", "averages", "classes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """Buckling data of a study, as tables.

    Attributes:
        directory: the study's folder (or that of a single run).
        name: the study's name.
        options: every choice of the analysis: value, unit, meaning.
        runs: one row a run: case, seed, preparation, peak, number of drops.
        drops: one row a drop of a run.
        segments: one row a buckled segment and increment.
        yielding: one row a buckled segment: when its contacts yield, and its class.
        chains: one row a force chain at the start of a drop.
        members: one row a particle in a force chain at the start of a drop.
        macroscopic: one row a drop: solid fraction, coordination, stress ratio, dissipation, localisation.
        averages: one row a case and increment: count, mean and standard errors of every measure.
        classes: one row a case and class: count and percentage.
        ledger: one record a run and drop: what each filter left.
        left_out: run -> why it was not analysed (invalid, failed or not ended).
        reused: whether the files were there already, made from the same runs with the same options.
    """

    directory: Path
    name: str
    options: Mapping[str, Mapping[str, Any]]
    runs: pd.DataFrame
    drops: pd.DataFrame
    segments: pd.DataFrame
    yielding: pd.DataFrame
    chains: pd.DataFrame
    members: pd.DataFrame
    macroscopic: pd.DataFrame
    averages: pd.DataFrame
    classes: pd.DataFrame
    ledger: Sequence[Mapping[str, Any]]
    left_out: Mapping[str, str]
    reused: bool

    @property
    def cases(self) -> list[str]:
        """Names of the cases: runs that differ by their seed alone are one case."""
        return list(dict.fromkeys(self.runs["case"]))

    def particle_count(self, case: str) -> int:
        """Number of discs of the runs of a case."""
        return int(self.runs.loc[self.runs["case"] == case, "particle_count"].iloc[0])

    def test(self, case: str) -> str:
        """Name of the test that made the runs of a case; tables that do not say are of biaxial ones."""
        if "test" not in self.runs:
            return BIAXIAL
        return str(self.runs.loc[self.runs["case"] == case, "test"].iloc[0])

    @property
    def folder(self) -> Path:
        """Where the tables are."""
        return self.directory / FOLDER
