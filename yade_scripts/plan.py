"""When a test steps and samples: the time step, the loading rate, and the step numbers of its samples. No YADE."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from yade_scripts import parameters

# Of sqrt(smallest mass/normal stiffness), by the option `mass`, at the paper's stiffness ratios. Measured at 600 discs
# as the mean unbalanced force over that of a short step: equal masses 1.0 at 0.5, 5 at 0.55, 17 at 0.6, 110 at 0.65;
# true ones 1 at 0.3, 3 at 0.5.
SAFE_FACTORS = {"equal": 0.5, "true": 0.3}
STIFFEST_RATIO = 0.5  # the larger of the paper's tangential and rolling stiffness over the normal one


class Plan(NamedTuple):
    """Steps of a test.

    Attributes:
        strain_rate: engineering strain rate along y [1/s].
        time_step: [s].
        last_step: number of steps.
        history_steps: step numbers of the history's rows, from 0 to the last step, increasing.
        snapshot_steps: step numbers of the snapshots, from 0 to the last step, increasing.
    """

    strain_rate: float
    time_step: float
    last_step: int
    history_steps: list[int]
    snapshot_steps: list[int]


def plan_of(values: Mapping[str, Any], masses: np.ndarray) -> Plan:
    """Lay out the steps of a test with discs of the given masses, (n,) [kg].

    The time step is the largest that `time_step_factor` allows the lightest disc, shortened a little so that the
    sampling intervals are whole numbers of steps; where they are too fine for that, samples fall on the nearest step.
    """
    rate = values["strain_rate"] or values["inertial_number"] * math.sqrt(
        values["confining_stress"] / float(masses.mean())
    )
    factor = values["time_step_factor"] or safe_factor(values)
    time_step = factor * math.sqrt(float(masses.min()) / values["normal_stiffness"])
    history, snapshots = values["history_strain_interval"], values["snapshot_strain_interval"]
    dense = parameters.strain_intervals(values["dense_strain_intervals"])
    shared = common_measure([history, snapshots] + ([values["dense_snapshot_interval"]] if dense else []))
    if shared > 4 * rate * time_step:
        time_step = shared / rate / math.ceil(shared / (rate * time_step))
    step = rate * time_step
    last = round(values["final_axial_strain"] / step)
    wanted = set(sample_steps(snapshots / step, last))
    for begin, end in dense:
        inside = sample_steps(values["dense_snapshot_interval"] / step, last)
        wanted |= {number for number in inside if begin <= number * step * (1 + 1e-12) and number * step <= end}
    return Plan(rate, time_step, last, sample_steps(history / step, last), sorted(wanted))


def safe_factor(values: Mapping[str, Any]) -> float:
    """Time step over sqrt(smallest mass/normal stiffness) that is safe with these parameters.

    Rotations set the limit, so that tangential or rolling springs stiffer than the paper's ask for shorter steps.

    >>> given = {"mass": "equal", "tangential_stiffness_ratio": 0.5, "rolling_stiffness_ratio": 2.0}
    >>> safe_factor(given)
    0.25
    """
    ratio = max(values["tangential_stiffness_ratio"], values["rolling_stiffness_ratio"], STIFFEST_RATIO)
    return SAFE_FACTORS[values["mass"]] / math.sqrt(ratio / STIFFEST_RATIO)


def common_measure(intervals: Sequence[float]) -> float:
    """Return the largest number that goes a whole number of times into all, each read as a decimal fraction.

    >>> common_measure([1e-4, 2.5e-4])
    5e-05
    """
    fractions = [Fraction(repr(interval)) for interval in intervals]
    denominator = math.lcm(*(fraction.denominator for fraction in fractions))
    return float(Fraction(math.gcd(*(int(fraction * denominator) for fraction in fractions)), denominator))


def sample_steps(interval: float, last: int) -> list[int]:
    """Step numbers nearest to the multiples of `interval` [steps], with 0 and `last`, each once.

    >>> sample_steps(2.5, 8)
    [0, 2, 5, 8]
    """
    steps = {0, last} | {round(number * interval) for number in range(1, math.ceil(last / interval))}
    return sorted(step for step in steps if step <= last)
