"""How fast the observation is: `python benchmarks/bench_observe.py [RUN]`. Exit status 1 when a target is missed.

Sizes from 5000 discs to a million; YADE's own particle stress and the tests' plain implementation beside it; with the
folder of a run, the whole analysis of its drops as well. Seconds are the best of some repetitions.
"""

from __future__ import annotations

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "observe")]

# ruff: noqa: E402
import plain

from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import find_segments
from forcechain.observe.snapshot import Snapshot
from forcechain.observe.stress import particle_stress
from forcechain.observe.window import observe_drop
from harness.analysing.pipeline import analyse_run
from harness.reading.exports import read_run
from harness.running.yade_environment import find_yade

SIZES = (5_000, 30_000, 200_000, 1_000_000)
RADIUS, STIFFNESS = 1e-3, 1.05e5
TARGET_SMALL_S, TARGET_LARGE_S, TARGET_MEMORY_GB, TARGET_GROWTH, TARGET_RUN_S = 0.010, 2.0, 2.0, 1.1, 5.0
INCREMENTS, WINDOWS = 28, 3


def assembly(n_particles: int, seed: int = 0) -> Snapshot:
    """A jittered hexagonal assembly of bidisperse discs with broad random forces: two contacts a disc, no walls."""
    rng = np.random.default_rng(seed)
    side = math.ceil(math.sqrt(n_particles))
    row, place = divmod(np.arange(n_particles), side)
    position = 2 * RADIUS * np.stack((place + 0.5 * (row % 2), math.sqrt(0.75) * row), axis=1)
    position += RADIUS * rng.uniform(-0.2, 0.2, position.shape)
    position = position[rng.permutation(n_particles)]  # an export's numbers tell nothing about places
    radius = RADIUS * rng.choice((0.8, 1.2), n_particles)
    pairs = cKDTree(position).query_pairs(2.6 * RADIUS, output_type="ndarray")
    distance = np.linalg.norm(position[pairs[:, 1]] - position[pairs[:, 0]], axis=1)
    closest = np.argsort(distance - radius[pairs].sum(axis=1))[: 2 * n_particles]
    closest = closest[np.lexsort(pairs[closest].T[::-1])]  # by id1, then id2, as snapshots are exported
    pairs, distance = pairs[closest], distance[closest]
    normal = (position[pairs[:, 1]] - position[pairs[:, 0]]) / distance[:, None]
    count = len(pairs)
    force = rng.gamma(1.0, 5.0, count)
    return Snapshot(
        axial_strain=0.0,
        time=0.0,
        iteration=0,
        radius=radius,
        position=position,
        rotation=np.zeros(n_particles),
        velocity=np.zeros((n_particles, 2)),
        spin=np.zeros(n_particles),
        contact_ids=pairs,
        contact_point=position[pairs[:, 0]] + radius[pairs[:, 0], None] * normal,
        contact_normal=normal,
        overlap=force / STIFFNESS,
        normal_force=force,
        tangential_force=force * rng.uniform(-0.7, 0.7, count).round(1),  # a share of them at the limit
        moment=force * 0.2 * RADIUS * rng.uniform(-1, 1, count).round(1),
        normal_stiffness=np.full(count, STIFFNESS),
        tangential_stiffness=np.full(count, 0.5 * STIFFNESS),
        rolling_stiffness=np.full(count, 0.5 * STIFFNESS * RADIUS**2),
        friction=np.full(count, 0.7),
        rolling_limit=np.full(count, 0.2 * RADIUS),
    )


def best_of(repetitions: int, action: Callable[[], object]) -> float:
    """Shortest time of one call [s]."""
    times = []
    for _ in range(repetitions):
        begin = time.perf_counter()
        action()
        times.append(time.perf_counter() - begin)
    return min(times)


def observe(snapshot: Snapshot, options: AnalysisOptions) -> None:
    """Stress, chains, segments."""
    find_segments(snapshot, find_chains(snapshot, options), options)


def yade_seconds(snapshot: Snapshot) -> float | None:
    """Time of one `bodyStressTensors` of as many discs in YADE [s]; None where it is not installed."""
    yade = find_yade()
    if yade is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        discs = Path(folder) / "discs.npz"
        np.savez(discs, radius=snapshot.radius, position=snapshot.position)
        command = yade.invocation(Path(__file__).with_name("yade_stress.py"), [str(discs), "50"])
        told = subprocess.run(command, env=yade.environment(), capture_output=True, text=True, check=True, timeout=300)
    return float(json.loads(told.stdout.strip().splitlines()[-1])["seconds"])


def window(start: Snapshot, seed: int) -> list[Snapshot]:
    """Snapshots that shuffle their discs a little from one to the next."""
    rng = np.random.default_rng(seed)
    snapshots = []
    for step in range(INCREMENTS + 1):
        shaken = start.position + RADIUS * 2e-3 * step * rng.normal(size=start.position.shape)
        snapshots.append(replace(start, axial_strain=2.5e-4 * step, position=shaken))
    return [*snapshots[:-1], replace(snapshots[-1], normal_force=0.8 * start.normal_force)]


def main() -> int:
    """Measure, print a line each, and judge."""
    options = AnalysisOptions()
    missed: list[str] = []

    def judge(what: str, found: float, target: float, unit: str) -> None:
        print(f"{what:58s} {found:10.4g} {unit:3s} target {target:g}{'' if found <= target else '  MISSED'}")
        if found > target:
            missed.append(what)

    taken = []
    for size in SIZES:
        snapshot = assembly(size)
        taken.append(best_of(50 if size < 1e4 else 5, lambda s=snapshot: observe(s, options)))
        print(f"{size} discs, {snapshot.n_contacts} contacts: {1e3 * taken[-1]:.2f} ms, stress alone "
              f"{1e3 * best_of(5, lambda s=snapshot: particle_stress(s)):.2f} ms")  # fmt: skip
    small = assembly(SIZES[0])
    judge("stress, chains, segments of 5000 discs", taken[0], TARGET_SMALL_S, "s")
    judge("the same of a million", taken[-1], TARGET_LARGE_S, "s")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    judge("largest memory, making the million included", memory, TARGET_MEMORY_GB, "GB")
    growth = float(np.polyfit(np.log(SIZES), np.log(taken), 1)[0])  # above 1 by what leaves the caches
    judge(f"growth exponent, {SIZES[0]} to {SIZES[-1]} discs", growth, TARGET_GROWTH, "")

    def plainly() -> None:
        plain.segments(plain.chains(replace(small), options), options)

    slow = best_of(1, plainly)
    print(f"plain implementation, 5000 discs: {1e3 * slow:.0f} ms, {slow / taken[0]:.0f} times longer")
    in_yade = yade_seconds(small)
    if in_yade is None:
        print("YADE is not installed: its own particle stress is not measured")
    else:
        ours = best_of(50, lambda: particle_stress(small))
        print(f"YADE's bodyStressTensors, 5000 discs: {1e3 * in_yade:.2f} ms; particle_stress {1e3 * ours:.2f} ms")
    windows = [window(small, seed) for seed in range(WINDOWS)]
    all_of_it = replace(options, minimum_angle_growth=0.0)
    begin = time.perf_counter()
    buckled = [observe_drop(snapshots, all_of_it).n_buckled for snapshots in windows]
    in_memory = time.perf_counter() - begin
    judge(f"3 windows of 28 increments, 5000 discs, {sum(buckled)} segments", in_memory, TARGET_RUN_S, "s")
    for folder in sys.argv[1:]:
        begin = time.perf_counter()
        run = read_run(Path(folder))
        analysed = analyse_run(run, "all", options)
        judge(f"whole analysis of {run.name}, reading included", time.perf_counter() - begin, TARGET_RUN_S, "s")
        print(f"  {len(analysed.drops)} drops, {len(analysed.yielding)} buckled segments")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
