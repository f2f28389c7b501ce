"""How often does the gate cry wolf? Fresh seeds of the demo, each checked as a study of its own against its baseline.

    python benchmarks/false_alarms.py [--seeds 20] [--first 101] [--group 1] [--out FOLDER] [--baseline FILE]

Prints each study that fails, with the lines that do, and ends with 1 when more than one of twenty fails.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from harness.toml_text import dumps

ROOT = Path(__file__).parents[1]
MOST = 1 / 20


def forcechain(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "harness", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


def run_all(seeds: list[int], out: Path) -> Path:
    """Run the demo with all the seeds; return its results."""
    study = tomllib.loads((ROOT / "studies" / "demo.toml").read_text(encoding="utf-8")) | {"seeds": seeds}
    out.mkdir(parents=True, exist_ok=True)
    file = out / "all.toml"
    file.write_text(dumps(study), encoding="utf-8")
    run = forcechain("run", str(file), "--out", str(out / "all"))
    if run.returncode != 0:
        raise SystemExit(f"the runs did not end well: {run.stderr or run.stdout}")
    return out / "all"


def lines_that_fail(seeds: list[int], results: Path, baseline: Path) -> list[str]:
    """Check the runs of some seeds as a study of their own; return what does not pass."""
    place = results.parent / ("seeds-" + "-".join(map(str, seeds)))
    (place / "runs").mkdir(parents=True, exist_ok=True)
    study = tomllib.loads((results / "study.toml").read_text(encoding="utf-8")) | {"seeds": seeds}
    (place / "study.toml").write_text(dumps(study), encoding="utf-8")
    for seed in seeds:
        (run,) = (results / "runs").glob(f"seed{seed}-*")
        link = place / "runs" / run.name
        if not link.exists():
            link.symlink_to(run)
    told = forcechain("check", str(place), "--baseline", str(baseline), "--json")
    if not told.stdout:
        raise SystemExit(f"seeds {seeds}: {told.stderr}")
    lines = json.loads(told.stdout)["lines"]
    return [f"{line['quantity']}: {line['outcome']}, {line['why']}" for line in lines if line["outcome"] != "pass"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20, help="how many (default: 20)")
    parser.add_argument("--first", type=int, default=101, help="the first one (default: 101)")
    parser.add_argument("--group", type=int, default=1, help="seeds of a study (default: 1)")
    parser.add_argument("--out", type=Path, help="where the runs go (default: a folder that is removed)")
    parser.add_argument("--baseline", type=Path, default=ROOT / "baselines" / "demo.toml")
    args = parser.parse_args()
    seeds = list(range(args.first, args.first + args.seeds))
    groups = [seeds[place : place + args.group] for place in range(0, args.seeds, args.group)]
    alarms = 0
    with tempfile.TemporaryDirectory() as scratch:
        results = run_all(seeds, (args.out or Path(scratch)).resolve())
        for group in groups:
            wrong = lines_that_fail(group, results, args.baseline)
            alarms += bool(wrong)
            print(f"seeds {', '.join(map(str, group))}: {'; '.join(wrong) or 'pass'}", flush=True)
    print(f"{alarms} of {len(groups)} studies of fresh seeds fail")
    return 0 if alarms <= MOST * len(groups) else 1


if __name__ == "__main__":
    sys.exit(main())
