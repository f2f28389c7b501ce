"""Averages of a study as tables: over the buckled segments of each case, with counts and standard errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from forcechain.arrays import FloatArray
from forcechain.observe.averages import BootstrapError, average_by_increment, bootstrap_error

MEASURES = (
    "buckling_angle_deg",
    "axial_force_N",
    "axial_displacement_over_R",
    "normal_displacement_over_R",
    "rotation_deg",
    "lateral_force_N",
)
KEY = ["run", "drop", "segment"]
AVERAGE_COLUMNS = ["case", "increment", "strain_since_start", "segments", "runs"] + [
    name + ending for name in MEASURES for ending in ("", "_se_segments", "_se_runs", "_se")
]
CLASS_COLUMNS = ["case", "class", "segments", "of", "percent", "percent_se"]


def histories(segments: pd.DataFrame, measure: str) -> list[FloatArray]:
    """Return `measure` of the buckled segments run by run, each (n_increments + 1, n_segments), drops side by side."""
    groups = []
    for _, of_run in segments.groupby("run", sort=False):
        table = of_run.set_index(["increment", "drop", "segment"])[measure].unstack(["drop", "segment"])
        groups.append(table.to_numpy(dtype=np.float64))
    return groups


def mean_and_error(groups: Sequence[FloatArray]) -> tuple[FloatArray, BootstrapError]:
    """Mean over all segments of all runs at each place, and its standard errors; `groups` as `histories` gives them."""
    return average_by_increment(groups).mean, bootstrap_error(groups)


def average(segments: pd.DataFrame) -> pd.DataFrame:
    """Average every measure over all buckled segments of all drops and runs of a case, at each increment.

    Returns one row a case and increment: `strain_since_start` (axial strain since the start of the drop), `segments`
    (how many were averaged), `runs` (how many runs they come from), and for each measure its mean, its standard errors
    over segments and over runs, and the larger of both, which is to be quoted.
    """
    tables = []
    for case, of_case in segments.groupby("case", sort=False):
        strain = histories(of_case, "axial_strain")
        columns: dict[str, object] = {
            "case": case,
            "increment": np.arange(len(strain[0])),
            "strain_since_start": np.concatenate([run - run[0] for run in strain], axis=1).mean(axis=1),
            "segments": sum(run.shape[1] for run in strain),
            "runs": len(strain),
        }
        for name in MEASURES:
            mean, error = mean_and_error(histories(of_case, name))
            columns |= {
                name: mean,
                f"{name}_se_segments": error.by_segment,
                f"{name}_se_runs": error.by_seed,
                f"{name}_se": error.larger,
            }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=AVERAGE_COLUMNS)


def class_shares(yielding: pd.DataFrame) -> pd.DataFrame:
    """Share of each class among the buckled segments of a case, in percent, with its standard error: as Table 1.

    A row "slides first" gives the share in which a contact of the chain slides before the chain's moment yields.
    """
    rows = []
    for case, of_case in yielding.groupby("case", sort=False):
        flags = {str(number): of_case["buckling_class"] == number for number in (1, 2, 3, 4)}
        flags["slides first"] = of_case["slides_first"].astype(bool)
        for name, flag in flags.items():
            percent = 100.0 * flag
            groups = [np.asarray(values, dtype=np.float64)[None, :] for _, values in percent.groupby(of_case["run"])]
            mean, error = mean_and_error(groups)
            rows.append((case, name, int(flag.sum()), len(flag), float(mean[0]), float(error.larger[0])))
    return pd.DataFrame(rows, columns=CLASS_COLUMNS)
