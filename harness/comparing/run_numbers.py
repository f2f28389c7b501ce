"""The headline numbers of every single run: what two studies are compared by, seed by seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from forcechain.arrays import FloatArray
from forcechain.calibration import Column, Identified, calibrate
from harness.analysing.averages import histories
from harness.analysing.buckling_data import Analysis
from harness.comparing import paper
from harness.comparing.calibrations import FEWEST_SEGMENTS, segment_histories
from harness.comparing.comparison import model_parameters
from harness.errors import InputError

FEWEST_RESAMPLES = 40  # of a calibration whose interval is not asked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A number that every run has one of: its column's name, words, unit, and what the paper prints, if anything."""

    name: str
    words: str
    unit: str
    paper: float | None = None


_PRINTED = {reference.quantity: reference.value for reference in paper.PRINTED}
_TABLE_1 = paper.TABLE_1[0.2]

QUANTITIES = (
    Quantity(name="solid_fraction", words="solid fraction, prepared", unit="-", paper=_PRINTED["solid_fraction"]),
    Quantity(name="coordination", words="coordination number, prepared", unit="-", paper=_PRINTED["coordination"]),
    Quantity(name="peak_stress_ratio", words="peak stress ratio", unit="-", paper=_PRINTED["peak_stress_ratio"]),
    Quantity(name="strain_at_peak", words="axial strain at the peak", unit="-", paper=_PRINTED["strain_at_peak"]),
    Quantity(name="coordination_at_drops", words="coordination number, start of the drops", unit="-"),
    Quantity(name="segments_a_drop", words="buckled segments in a drop", unit="-"),
    Quantity(
        name="initial_angle_deg",
        words="initial buckling angle",
        unit="deg",
        paper=_PRINTED["initial_buckling_angle_deg"],
    ),
    Quantity(
        name="angle_growth_deg",
        words="growth of the buckling angle",
        unit="deg",
        paper=_PRINTED["buckling_angle_growth_deg"],
    ),
    Quantity(name="axial_force_start_N", words="axial force, start of the drop", unit="N"),
    Quantity(name="axial_force_N", words="axial force, mean over the drop", unit="N"),
    Quantity(name="rotation_end_deg", words="rotation, end of the drop", unit="deg"),
    Quantity(name="lateral_force_N", words="lateral force, support", unit="N", paper=_PRINTED["lateral_force_N"]),
    Quantity(name="lateral_magnitude_N", words="lateral force, magnitude", unit="N", paper=_PRINTED["lateral_force_N"]),
    *(
        Quantity(name=f"class_{number}_percent", words=f"class {number}, share", unit="%", paper=_TABLE_1[number - 1])
        for number in (1, 2, 3, 4)
    ),
    Quantity(name="sliding_share_percent", words="slides inside the chain first, share", unit="%"),
    Quantity(name="kFC_over_kn", words="calibrated kFC", unit="kn", paper=0.014),
)


def run_numbers(analysis: Analysis, case: str) -> pd.DataFrame:
    """Return the numbers of the runs of one case: a row a run, by its seed (by its name where the seed is unknown).

    Columns are the names of `QUANTITIES`; not a number where a run has none: no buckled segments, too few to calibrate.
    Raises InputError when two runs of the case have one seed.
    """
    facts = analysis.runs[analysis.runs["case"] == case]
    rows = {}
    for _, fact in facts.iterrows():
        run = fact["run"]
        key = str(run) if pd.isna(fact.get("seed")) else f"seed {int(fact['seed'])}"
        if key in rows:
            raise InputError(f"{analysis.name}: case {case}: expected one run a seed, found two of {key}")
        rows[key] = _of_run(analysis, case, str(run), fact)
    return pd.DataFrame.from_dict(rows, orient="index", columns=[quantity.name for quantity in QUANTITIES])


def _of_run(analysis: Analysis, case: str, run: str, fact: pd.Series) -> dict[str, float]:
    told = ("solid_fraction", "coordination", "peak_stress_ratio", "strain_at_peak")
    found = {name: float(fact[name]) for name in told if not pd.isna(fact.get(name))}
    drops = analysis.macroscopic[analysis.macroscopic["run"] == run]
    if len(drops):
        found["coordination_at_drops"] = float(drops["coordination_start"].mean())
    segments = analysis.segments[analysis.segments["run"] == run]
    if not len(segments):
        return found

    def mean(measure: str, reduced: Callable[[FloatArray], FloatArray]) -> float:
        (history,) = histories(segments, measure)
        return float(reduced(history).mean())

    found |= {
        "segments_a_drop": float((segments["increment"] == 0).sum() / len(drops)),
        "initial_angle_deg": mean("buckling_angle_deg", lambda history: history[0]),
        "angle_growth_deg": mean("buckling_angle_deg", lambda history: history[-1] - history[0]),
        "axial_force_start_N": mean("axial_force_N", lambda history: history[0]),
        "axial_force_N": mean("axial_force_N", lambda history: history),
        "rotation_end_deg": mean("rotation_deg", lambda history: history[-1]),
        "lateral_force_N": mean("lateral_force_N", lambda history: history),
        "lateral_magnitude_N": mean("lateral_force_N", np.abs),
    }
    yielding = analysis.yielding[analysis.yielding["run"] == run]
    for number in (1, 2, 3, 4):
        found[f"class_{number}_percent"] = 100 * float((yielding["buckling_class"] == number).mean())
    found["sliding_share_percent"] = 100 * float(yielding["slides_first"].astype(bool).mean())
    found["kFC_over_kn"] = _chain_stiffness(analysis, case, segments)
    return found


def _chain_stiffness(analysis: Analysis, case: str, segments: pd.DataFrame) -> float:
    if int((segments["increment"] == 0).sum()) < FEWEST_SEGMENTS:
        return float("nan")
    given = model_parameters(analysis.runs[analysis.runs["case"] == case], {})
    try:
        fitted = calibrate(
            segment_histories(segments), given, column=Column.PERFECT, samples=FEWEST_RESAMPLES, profile_points=0
        )
    except ValueError as error:
        raise InputError(f"case {case}: cannot be calibrated: {error}") from None
    chain = fitted.estimates[0]
    return float("nan") if chain.identified is Identified.NO else chain.value
