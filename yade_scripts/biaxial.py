"""A biaxial test in two dimensions: discs between four rigid walls, compressed along y at a constant rate.

Run it by YADE, `yade -n -x yade_scripts/biaxial.py PARAMETERS.json`, or by the system's Python with YADE's Python
folder on PYTHONPATH (no prompt, no ports). The run's folder gets snapshots, a history and, last, `run.json`.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

SCRIPT = Path(sys.argv[0] if __name__ == "__main__" else __file__).resolve()
if __name__ == "__main__":
    # Last: installed, that folder holds the packages of another Python, which must not hide YADE's own
    sys.path.append(str(SCRIPT.parent.parent))
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # one thread repeats bit for bit; read when YADE is imported

# ruff: noqa: E402
from yade_scripts import command, packing, parameters, run_folder, walls
from yade_scripts.plan import plan_of
from yade_scripts.recorder import Recorder
from yade_scripts.sample import Sample

try:
    import yade
except ImportError:
    yade = None

CHUNK = 20  # steps between two looks at the clock and two corrections of the walls' push


def run(values: Mapping[str, Any], folder: Path, packings: Path) -> None:
    """Make the whole test; the run's folder is complete when this returns."""
    clock = time.monotonic()
    recorder, progress = Recorder(folder), run_folder.Progress(folder)
    target = values["final_axial_strain"]
    progress.tell("preparing", 0.0, target, 0)
    start, packing_name = packing.packing_of(
        values, packings, lambda steps: progress.tell("preparing", 0.0, target, steps)
    )
    prepared = time.monotonic()

    yade.O.reset()
    sample = Sample(values, start)
    plan = plan_of(values, sample.masses)
    yade.O.dt = plan.time_step
    packing.step(1)  # finds the contacts; nothing pushes and nothing moves yet
    first = yade.O.iter
    rows, snapshots = set(plan.history_steps), set(plan.snapshot_steps)
    stops = sorted(rows | snapshots | set(range(0, plan.last_step, CHUNK)))
    error_sum, error_steps = walls.stresses(sample.walls)[0] / values["confining_stress"] - 1, 1
    escaped, sampling = 0, 0.0
    for stop in stops:
        steps = first + stop - yade.O.iter
        error_sum += sample.advance(steps)
        error_steps += steps
        before = time.monotonic()
        if stop in rows:
            recorder.rows.append(sample.history_row(error_sum / error_steps))
            error_sum, error_steps = 0.0, 0
        if stop in snapshots:
            particles, contacts = sample.tables(recorder.rotation)
            recorder.snapshot(sample.axial_strain(), particles, contacts)
            escaped = max(escaped, sample.escaped(particles))
        if stop == 0:
            sample.load(plan.strain_rate)
        sample.press()
        progress.tell("loading", sample.axial_strain(), target, stop, final=stop == plan.last_step)
        sampling += time.monotonic() - before

    mean_mass = float(sample.masses.mean())
    recorder.finish(
        SCRIPT,
        values,
        parameters.BIAXIAL,
        {
            "time_step": (plan.time_step, "s"),
            "strain_rate": (plan.strain_rate, "1/s"),
            "mean_mass": (mean_mass, "kg"),
            "mean_radius": (sample.mean_radius, "m"),
            "initial_width": (sample.width, "m"),
            "initial_height": (sample.height, "m"),
            "wall_mass": (sample.wall_mass, "kg"),
        },
        steps=plan.last_step,
        timings={
            "preparation_s": prepared - clock,
            "loading_s": time.monotonic() - prepared,
            "sampling_s": sampling,
        },
        preparation={**start.facts, "packing": packing_name},
        validity={
            **loading_figures(recorder.rows, plan.strain_rate, mean_mass),
            "overlap_max": recorder.largest_overlap / sample.mean_radius,
            "escaped_discs": escaped,
            "settled": start.facts["settled"],
        },
    )


def loading_figures(rows: Sequence[Mapping[str, float]], strain_rate: float, mean_mass: float) -> dict[str, float]:
    """Figures by which the loading is judged; the first row, before the loading, is left out."""
    loading = rows[1:]
    servo = [abs(row["servo_error"]) for row in loading]
    unbalanced = [row["unbalanced_force"] for row in loading]
    lateral = sum(row["lateral_stress"] for row in loading) / len(loading)
    return {
        "servo_error_max": max(servo),
        "servo_error_mean": sum(servo) / len(servo),
        "unbalanced_force_max": max(unbalanced),
        "unbalanced_force_mean": sum(unbalanced) / len(unbalanced),
        "inertial_number": strain_rate * math.sqrt(mean_mass / lateral),
        "kinetic_over_elastic_max": max(row["kinetic_energy"] / row["elastic_energy"] for row in loading),
    }


if __name__ == "__main__":
    sys.exit(command.main(SCRIPT, __doc__, parameters.BIAXIAL, run, sys.argv[1:]))
