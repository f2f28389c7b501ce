"""A biaxial test in two dimensions: discs between four rigid walls, compressed along y at a constant rate.

Run it by YADE, `yade -n -x yade_scripts/biaxial.py PARAMETERS.json`, or by the system's Python with YADE's Python
folder on PYTHONPATH (no prompt, no ports). The run's folder gets snapshots, a history and, last, `run.json`.
"""

from __future__ import annotations

import bisect
import dataclasses
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
from yade_scripts import checkpoint, command, packing, parameters, run_folder, walls
from yade_scripts.plan import plan_of
from yade_scripts.recorder import Recorder
from yade_scripts.sample import Sample

try:
    import yade
except ImportError:
    yade = None

CHUNK = 20  # steps between two looks at the clock and two corrections of the walls' push


def run(values: Mapping[str, Any], folder: Path, packings: Path, checkpoint_every: float) -> None:
    """Make the whole test, or what a killed run has left of it; the run's folder is complete when this returns."""
    clock = time.monotonic()
    recorder, progress = Recorder(folder), run_folder.Progress(folder)
    target = values["final_axial_strain"]
    progress.tell("preparing", 0.0, target, 0)
    start, packing_name = packing.packing_of(
        values, packings, lambda steps: progress.tell("preparing", 0.0, target, steps)
    )
    preparation_s, loading_began = time.monotonic() - clock, time.monotonic()

    identity = checkpoint.identity_of(values)
    state = checkpoint.load(folder, identity)
    if state is None:
        recorder.discard_leftovers()
        sample, course = begin(values, start)
    else:
        sample, course = Sample(values, start, build=False), Course(**state["course"])
        recorder.restore(state["recorder"])
        sample.press()
        course.continued.append({"axial_strain": sample.axial_strain(), "time": run_folder.now()})
        preparation_s = state["preparation_s"]
        loading_began -= state["loading_s"]
    plan = plan_of(values, sample.masses)
    yade.O.dt = plan.time_step
    rows, snapshots = set(plan.history_steps), set(plan.snapshot_steps)
    stops = sorted(rows | snapshots | set(range(0, plan.last_step, CHUNK)))
    last_checkpoint = time.monotonic()
    for stop in stops[bisect.bisect_right(stops, course.step) :]:
        course.error_sum += sample.advance(stop - max(course.step, 0))
        course.error_steps += stop - max(course.step, 0)
        course.step = stop
        before = time.monotonic()
        if stop in rows:
            recorder.rows.append(sample.history_row(course.error_sum / course.error_steps))
            course.error_sum, course.error_steps = 0.0, 0
        if stop in snapshots:
            particles, contacts = sample.tables(recorder.rotation)
            recorder.snapshot(sample.axial_strain(), particles, contacts)
            course.escaped = max(course.escaped, sample.escaped(particles))
        if stop == 0:
            sample.load(plan.strain_rate)
        sample.press()
        course.sampling_s += time.monotonic() - before
        if time.monotonic() - last_checkpoint >= checkpoint_every:
            spent = {"preparation_s": preparation_s, "loading_s": time.monotonic() - loading_began}
            state = {"course": dataclasses.asdict(course), "recorder": recorder.state(), **spent}
            checkpoint.save(folder, stop, identity, state)
            last_checkpoint = time.monotonic()
        progress.tell("loading", sample.axial_strain(), target, stop, final=stop == plan.last_step)

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
        continued=course.continued,
        timings={
            "preparation_s": preparation_s,
            "loading_s": time.monotonic() - loading_began,
            "sampling_s": course.sampling_s,
        },
        preparation={**start.facts, "packing": packing_name},
        validity={
            **loading_figures(recorder.rows, plan.strain_rate, mean_mass, values["confining_stress"]),
            "overlap_max": recorder.largest_overlap / sample.mean_radius,
            "escaped_discs": course.escaped,
            "settled": start.facts["settled"],
        },
    )
    checkpoint.clear(folder)


@dataclasses.dataclass
class Course:
    """How far a run has come, in numbers that go into a checkpoint.

    Attributes:
        step: the last step at which samples were taken; -1 before the first.
        error_sum, error_steps: sum of the confining stress's errors since the last row, and over how many steps.
        escaped: most discs seen outside the walls.
        sampling_s: time spent on samples [s].
        continued: where and when the run went on after a break.
    """

    step: int = -1
    error_sum: float = 0.0
    error_steps: int = 0
    escaped: int = 0
    sampling_s: float = 0.0
    continued: list[dict[str, Any]] = dataclasses.field(default_factory=list)


def begin(values: Mapping[str, Any], start: packing.Packing) -> tuple[Sample, Course]:
    """Set up the simulation at rest, its contacts found, nothing moved yet."""
    yade.O.reset()
    sample = Sample(values, start)
    yade.O.dt = checkpoint.AT_REST
    packing.step(1)
    lateral, _ = walls.stresses(sample.walls)
    return sample, Course(error_sum=lateral / values["confining_stress"] - 1, error_steps=1)


def loading_figures(
    rows: Sequence[Mapping[str, float]], strain_rate: float, mean_mass: float, confining_stress: float
) -> dict[str, float]:
    """Figures by which the loading is judged; the first row, before the loading, is left out.

    `servo_error_max` is of the means from row to row; `servo_error_instant_max`, told but not judged, of the rows
    themselves, at which a disc may just rattle on a wall.
    """
    loading = rows[1:]
    servo = [abs(row["servo_error"]) for row in loading]
    unbalanced = [row["unbalanced_force"] for row in loading]
    lateral = sum(row["lateral_stress"] for row in loading) / len(loading)
    return {
        "servo_error_max": max(servo),
        "servo_error_mean": sum(servo) / len(servo),
        "servo_error_instant_max": max(abs(row["lateral_stress"] / confining_stress - 1) for row in loading),
        "unbalanced_force_max": max(unbalanced),
        "unbalanced_force_mean": sum(unbalanced) / len(unbalanced),
        "inertial_number": strain_rate * math.sqrt(mean_mass / lateral),
        "kinetic_over_elastic_max": max(row["kinetic_energy"] / row["elastic_energy"] for row in loading),
    }


if __name__ == "__main__":
    sys.exit(command.main(SCRIPT, __doc__, parameters.BIAXIAL, run, sys.argv[1:]))
