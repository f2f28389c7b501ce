"""How fast the theory is: `python benchmarks/bench_theory.py`. Exit status 1 when a target is missed.

Processor seconds on one core, the best of some repetitions: a million points of the three-particle model, each with its
own angle and its own nine parameters; the whole post-critical path of a column of 50; how the path's cost grows with N.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"  # before numpy is imported: one core is what the targets are for

# ruff: noqa: E402
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from forcechain.theory.continuation import follow_column
from forcechain.theory.history import follow
from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.three_particle import loading
from forcechain.theory.yielding import yield_angles

POINTS = 1_000_000
TARGET_POINTS_S, TARGET_COLUMN_S, TARGET_GROWTH = 0.5, 2.0, 1.5
SIZES = (25, 50, 100, 200)


def best(work: Callable[[], object], repetitions: int = 5) -> float:
    """Processor seconds of the fastest of several runs."""
    taken = []
    for _ in range(repetitions):
        start = time.process_time()
        work()
        taken.append(time.process_time() - start)
    return min(taken)


def parameters_of_figure_6(n: int) -> ChainParameters:
    """Draw n parameter sets over the ranges of the paper's Fig. 6."""
    rng = np.random.default_rng(0)
    return ChainParameters.from_ratios(
        normal_stiffness=rng.uniform(7e4, 1.4e5, n),
        chain_tangential_stiffness=rng.uniform(0.009, 0.03, n),
        rolling_stiffness=rng.uniform(0, 0.5, n),
        rolling_friction=rng.uniform(0.02, 0.45, n),
        lateral_stiffness=rng.uniform(0.04, 0.09, n),
        lateral_strength=rng.uniform(0.01, 0.06, n),
        imperfection_deg=rng.uniform(0, 2, n),
    )


def main() -> int:
    angles = np.random.default_rng(1).uniform(np.radians(2), np.radians(60), POINTS)
    many = parameters_of_figure_6(POINTS)
    each = best(lambda: loading(many, angles))
    one = best(lambda: loading(TABLE_3, angles))
    roots = best(lambda: yield_angles(many), 1)
    history = best(lambda: follow(TABLE_3, np.radians([25, 20, 40, 0])))
    columns = {n: best(lambda n=n: follow_column(TABLE_3, n, unload=False), 3) for n in SIZES}
    # The number of points differs from column to column, as do the sites that yield: fit the trend.
    growth = float(np.polyfit(np.log(SIZES), np.log([columns[n] for n in SIZES]), 1)[0])

    results = (
        (f"{POINTS:,} points, each its own parameters", each, TARGET_POINTS_S, "s"),
        (f"{POINTS:,} points, one parameter set", one, TARGET_POINTS_S, "s"),
        (f"{POINTS:,} pairs of yield angles", roots, None, "s"),
        ("one chain loaded, unloaded, loaded, unloaded", history, None, "s"),
        *((f"path of a column of {n}", columns[n], TARGET_COLUMN_S if n == 50 else None, "s") for n in SIZES),
        ("growth of the path's cost with N, exponent", growth, TARGET_GROWTH, ""),
    )
    missed = False
    for name, value, target, unit in results:
        verdict = "" if target is None else f"  target below {target:g}: {'met' if value < target else 'MISSED'}"
        missed |= target is not None and value >= target
        print(f"{name:46} {value:8.3f} {unit:1}{verdict}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
