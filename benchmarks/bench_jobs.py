"""What a second core is worth: `python benchmarks/bench_jobs.py [DISCS [ROUNDS]]`; exit status 1 past the target.

The same four runs by `forcechain run`, one at a time and two at a time on two cores, packings made beforehand; in
turns, and the median of the ratios, because other work on the machine slows both. The load is told: when more than
this is at work, it is not this program's time that is measured.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = 0.55  # of the time on one core
ROUNDS = 3
STUDY = """
name = "jobs"
seeds = [1, 2, 3, 4]
[parameters]
particle_count = {discs}
final_axial_strain = {strain}
"""


def seconds(study: Path, out: Path, packings: Path, jobs: int) -> float:
    shutil.copytree(packings, out / "packings")
    began = time.perf_counter()
    command = [sys.executable, "-m", "harness", "run", str(study), "--out", str(out), "--jobs", str(jobs)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    spent = time.perf_counter() - began
    shutil.rmtree(out)
    return spent


def main(arguments: list[str]) -> int:
    discs = int(arguments[0]) if arguments else 600
    rounds = int(arguments[1]) if len(arguments) > 1 else ROUNDS
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        first, study = folder / "first.toml", folder / "jobs.toml"
        first.write_text(STUDY.format(discs=discs, strain=1e-4))  # makes the packings
        study.write_text(STUDY.format(discs=discs, strain=0.1))
        command = [sys.executable, "-m", "harness", "run", str(first), "--out", str(folder / "first")]
        subprocess.run(command, cwd=ROOT, check=False, capture_output=True)
        packings = folder / "first" / "packings"
        ratios = []
        print(
            f"four runs of {discs} discs; {len(os.sched_getaffinity(0))} cores; load before: {os.getloadavg()[0]:.1f}"
        )
        for number in range(rounds):
            one, two = (seconds(study, folder / f"{number}-{jobs}", packings, jobs) for jobs in (1, 2))
            ratios.append(two / one)
            load = os.getloadavg()[0]
            print(f"one job {one:.1f} s, two jobs {two:.1f} s, ratio {ratios[-1]:.3f}; load {load:.1f}", flush=True)
    ratio = statistics.median(ratios)
    print(f"two jobs over one, median: {ratio:.3f} (target: under {TARGET}): {'PASS' if ratio < TARGET else 'FAIL'}")
    return int(ratio >= TARGET)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
