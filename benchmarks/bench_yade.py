"""Our script against plain ones of YADE: `python benchmarks/bench_yade.py [--discs N]`. Status 1: a target missed.

The same packing, laws, time step and strain rate, three ways: ours with its samples, a plain script that steps by small
calls of `O.run`, and one with a single call and no sample. They take turns in every round; ratios are medians over the
rounds, of processor time (one thread each), which a busy machine stretches least, and of time by the clock.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT)]

# ruff: noqa: E402
from harness.running.yade_environment import Yade, need_yade
from yade_scripts import parameters

WAYS = ("ours", "chunks", "long")
TARGET_SAMPLING = 0.05


def timed(yade: Yade, script: Path, task: dict[str, Any], folder: Path) -> dict[str, float]:
    """Run one way in a YADE of its own; what it has measured."""
    folder.mkdir()
    file = folder / "task.json"
    file.write_text(json.dumps({**task, "folder": str(folder)}))
    done = subprocess.run(
        yade.invocation(script, [str(file)]), env=yade.environment(), capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise SystemExit(f"{task['way']}: {done.stderr[-2000:]}")
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def main() -> int:
    """Measure, print a line each, and judge."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--discs", type=int, default=5098, metavar="N")
    parser.add_argument("--strain", type=float, default=0.005, help="axial strain of each test (default: %(default)g)")
    parser.add_argument("--rounds", type=int, default=5, metavar="N")
    parser.add_argument("--snapshots", type=float, default=2.5e-4, help="strain between two (default: %(default)g)")
    parser.add_argument("--packings", type=Path, metavar="DIR", help="where packings are kept, or made")
    parser.add_argument("--json", action="store_true", help="every round, for machines")
    options = parser.parse_args()
    yade = need_yade()
    values = parameters.check(
        {
            "particle_count": options.discs,
            "final_axial_strain": options.strain,
            "snapshot_strain_interval": options.snapshots,
        }
    )
    rounds: list[dict[str, dict[str, float]]] = []
    with tempfile.TemporaryDirectory() as scratch:
        task = {"values": values, "packings": str((options.packings or Path(scratch) / "packings").resolve())}
        script = Path(__file__).with_name("yade_speed.py")
        short = {**values, "final_axial_strain": 1e-4}
        timed(yade, script, {**task, "values": short, "way": "ours"}, Path(scratch) / "first")  # makes the packing
        for number in range(options.rounds):
            rounds.append(
                {
                    way: timed(yade, script, {**task, "way": way}, Path(scratch) / f"{number}-{way}")
                    for way in WAYS[number % 3 :] + WAYS[: number % 3]
                }
            )
    if options.json:
        print(json.dumps({"discs": options.discs, "load": os.getloadavg(), "yade": yade.version, "rounds": rounds}))
    else:
        print(f"YADE {yade.version}, {options.discs} discs, {options.rounds} rounds, load {os.getloadavg()[1]:.1f}")
    shares = []
    for kind, name in (("cpu_", "processor"), ("", "clock")):
        speed = {way: [one[way]["steps"] / one[way][f"{kind}seconds"] for one in rounds] for way in WAYS}
        share = statistics.median(
            one["ours"][f"sampling_{kind}seconds"] / one["ours"][f"{kind}seconds"] for one in rounds
        )
        shares.append(share)
        lines = [f"{name}: {way:7s} {statistics.median(speed[way]):8.1f} steps/s" for way in WAYS]
        for way in WAYS[1:]:
            ratios = [mine / other for mine, other in zip(speed["ours"], speed[way], strict=True)]
            lines.append(
                f"{name}: ours over {way}: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})"
            )
        lines.append(f"{name}: samples take {share:.1%} of our script")
        print("\n".join(lines), file=sys.stderr if options.json else sys.stdout)
    missed = min(shares) > TARGET_SAMPLING
    print(
        f"samples at {options.snapshots:g}: target {TARGET_SAMPLING:.0%}{'  MISSED' if missed else ''}", file=sys.stderr
    )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
