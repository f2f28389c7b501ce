"""How often does the gate cry wolf? Fresh seeds of the demo, checked in groups of two against its baseline.

    python benchmarks/false_alarms.py [--seeds 40] [--first 101] [--out FOLDER] [--baseline FILE]

Every group is a study as the demo is: two packings that the baseline has not seen. Prints each group that fails, with
the lines that do, and ends with 1 when more than one of twenty groups fails.
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
GROUP = 2  # packings, as the demo has
MOST = 1 / 20


def forcechain(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "harness", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


def lines_that_fail(seeds: list[int], out: Path, baseline: Path) -> list[str]:
    """Run the demo with `seeds` and check it; return what does not pass."""
    study = tomllib.loads((ROOT / "studies" / "demo.toml").read_text(encoding="utf-8")) | {"seeds": seeds}
    place = out / f"seeds-{seeds[0]}-{seeds[-1]}"
    place.mkdir(parents=True, exist_ok=True)
    file = place / "demo.toml"
    file.write_text(dumps(study), encoding="utf-8")
    run = forcechain("run", str(file), "--out", str(place / "results"))
    if run.returncode != 0:
        raise SystemExit(f"seeds {seeds}: the runs did not end well: {run.stderr or run.stdout}")
    told = forcechain("check", str(place / "results"), "--baseline", str(baseline), "--json")
    if not told.stdout:
        raise SystemExit(f"seeds {seeds}: {told.stderr}")
    lines = json.loads(told.stdout)["lines"]
    return [f"{line['quantity']}: {line['outcome']}, {line['why']}" for line in lines if line["outcome"] != "pass"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=40, help="how many (default: 40, twenty groups)")
    parser.add_argument("--first", type=int, default=101, help="the first one (default: 101)")
    parser.add_argument("--out", type=Path, help="where the runs go (default: a folder that is removed)")
    parser.add_argument("--baseline", type=Path, default=ROOT / "baselines" / "demo.toml")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = args.out or Path(scratch)
        groups = [[first, first + 1] for first in range(args.first, args.first + args.seeds - GROUP + 1, GROUP)]
        alarms = 0
        for seeds in groups:
            wrong = lines_that_fail(seeds, out, args.baseline)
            alarms += bool(wrong)
            print(f"seeds {seeds[0]} and {seeds[-1]}: {'; '.join(wrong) or 'pass'}", flush=True)
    print(f"{alarms} of {len(groups)} studies of fresh seeds fail")
    return 0 if alarms <= MOST * len(groups) else 1


if __name__ == "__main__":
    sys.exit(main())
