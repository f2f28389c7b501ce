"""Averaged buckling data made from the model with noise, and how often a calibration's intervals hold the truth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.calibration import CALIBRATED, MEASURES, Column, SegmentHistories, calibrate
from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.three_particle import loading

N_RUNS, N_SEGMENTS = 5, 20
WIDE = np.radians(np.linspace(4, 25, 7))  # both sliders yield within
LATE = np.radians(np.linspace(14, 24, 7))  # as in the paper: the support has yielded before
NOISE = {
    "buckling_angle": np.radians(1.0),
    "axial_force": 0.8,
    "normal_displacement_over_R": 0.007,
    "axial_displacement_over_R": 0.02,
    "rotation": np.radians(1.5),
    "lateral_force": 0.3,
}
TRUTH = {name: float(np.asarray(value)) for name, value in TABLE_3.ratios().items() if name in CALIBRATED}


def synthetic(
    angle: FloatArray, noise: float = 1.0, seed: int = 0, parameters: ChainParameters = TABLE_3, n_runs: int = N_RUNS
) -> list[SegmentHistories]:
    """Segments that follow the model, each with its own departure, and each run with one: alike at every increment."""
    rng = np.random.default_rng(seed)
    state = loading(parameters, angle)
    exact = {name: getattr(state, name) for name in MEASURES if name != "buckling_angle"} | {"buckling_angle": angle}
    # The lateral support has yielded at the mean over the drop in the paper's data; here it is what is measured.
    exact["lateral_force"] = np.full(angle.shape, float(parameters.lateral_strength * parameters.radius))
    for name in ("axial_displacement_over_R", "rotation"):
        exact[name] = exact[name] - exact[name][0]
    runs = []
    for _ in range(n_runs):
        arrays = {}
        for name in MEASURES:
            own = noise * NOISE[name] * (rng.normal(size=N_SEGMENTS) + 0.8 * rng.normal())
            free = noise * 0.3 * NOISE[name] * rng.normal(size=(len(angle), N_SEGMENTS))
            growth = 1.0
            if name in ("axial_displacement_over_R", "rotation"):
                growth = np.linspace(0, 1, len(angle))[:, None]
            arrays[name] = exact[name][:, None] + growth * (own + free)
        arrays["buckling_angle"] = np.abs(arrays["buckling_angle"])
        runs.append(SegmentHistories(**arrays))
    return runs


def coverage(column: Column, trials: int, truth: Mapping[str, float] = TRUTH) -> dict[str, int]:
    """In how many of `trials` the 95 % interval of each parameter holds `truth`: five packings of twenty segments each.

    The perfect column starts at its state at 4 degrees, the paper's shift; the imperfect one is unloaded there.
    """
    held = dict.fromkeys(CALIBRATED, 0)
    parameters = TABLE_3
    if column is Column.IMPERFECT:
        parameters = TABLE_3.with_ratios(imperfection_deg=np.degrees(WIDE[0]))
    for trial in range(trials):
        runs = synthetic(WIDE, seed=500 + trial, parameters=parameters)
        result = calibrate(runs, TABLE_3, column=column, samples=50, profile_points=0, random_seed=trial)
        for estimate in result.estimates:
            held[estimate.name] += estimate.interval.low <= truth[estimate.name] <= estimate.interval.high
    return held
