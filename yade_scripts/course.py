"""The course of a test, whatever is tested: packing, loading with samples on the way, checkpoints, the manifest."""

from __future__ import annotations

import bisect
import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from yade_scripts import checkpoint, export, packing, parameters, quick_tables, run_folder
from yade_scripts.plan import plan_of
from yade_scripts.recorder import Quantity, Recorder

try:
    import yade
except ImportError:
    yade = None

CHUNK = 20  # steps between two looks at the clock and two corrections of what presses on the sample

Row = Mapping[str, float]


class Tested(Protocol):
    """What is tested, in the simulation: how it is loaded, and what is measured on it."""

    masses: np.ndarray
    mean_radius: float
    reader: quick_tables.QuickTables

    def settle(self, report: packing.Report) -> tuple[float, dict[str, Any]]:
        """Bring it to its start, at rest; return the confining stress's error there and facts of how it went."""

    def press(self) -> None:
        """Correct what presses on it to where everything is now."""

    def load(self, strain_rate: float) -> None:
        """Set moving what is driven."""

    def advance(self, count: int) -> float:
        """Make `count` steps; return the sum over them of the confining stress's relative error."""

    def axial_strain(self) -> float:
        """How far the loading is."""

    def history_row(self, servo_error: float) -> dict[str, float]:
        """One row of the history, with the confining stress's mean error since the row before."""

    def tables(self, previous_rotation: np.ndarray | None) -> tuple[export.Table, export.Table]:
        """Particle table and contact table."""

    def escaped(self, particles: export.Table) -> int:
        """Count discs outside the walls."""

    def derived(self) -> dict[str, Quantity]:
        """Sizes, masses and rates that follow from the parameters."""

    def figures(self, loading: Sequence[Row], strain_rate: float) -> dict[str, float]:
        """Figures of its own by which the rows of the loading are judged."""


@dataclasses.dataclass
class Course:
    """How far a run has come, in numbers that go into a checkpoint.

    Attributes:
        step: the last step at which samples were taken; -1 before the first.
        error_sum, error_steps: sum of the confining stress's errors since the last row, and over how many steps.
        escaped: most discs seen outside the walls.
        sampling_s: time spent on samples [s].
        continued: where and when the run went on after a break.
        settling: facts of how the sample came to its start.
        tables_from: every way in which tables were read, "memory" or "interface".
    """

    step: int = -1
    error_sum: float = 0.0
    error_steps: int = 0
    escaped: int = 0
    sampling_s: float = 0.0
    continued: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    settling: dict[str, Any] = dataclasses.field(default_factory=dict)
    tables_from: list[str] = dataclasses.field(default_factory=list)


def run(
    script: Path,
    table: tuple[parameters.Parameter, ...],
    build: Callable[[Mapping[str, Any], packing.Packing, bool], Tested],
    values: Mapping[str, Any],
    folder: Path,
    packings: Path,
    checkpoint_every: float,
) -> None:
    """Make the whole test, or what a killed run has left of it; the run's folder is complete when this returns.

    `build(values, packing, new)` puts what is tested into an empty simulation, or, where `new` is false, finds it in
    one that has been loaded. `table` has the parameters of `script`.
    """
    clock = time.monotonic()
    recorder, progress = Recorder(folder), run_folder.Progress(folder)
    target = values["final_axial_strain"]

    def preparing(steps: int) -> None:
        progress.tell("preparing", 0.0, target, steps)

    preparing(0)
    start, packing_name = packing.packing_of(values, packings, preparing)
    identity = checkpoint.identity_of(values)
    state = checkpoint.load(folder, identity)
    if state is None:
        recorder.discard_leftovers()
        yade.O.reset()
        sample = build(values, start, True)
        yade.O.dt = plan_of(values, sample.masses).time_step
        error, settling = sample.settle(preparing)
        course = Course(error_sum=error, error_steps=1, settling=settling)
        preparation_s, loading_began = time.monotonic() - clock, time.monotonic()
    else:
        sample, course = build(values, start, False), Course(**state["course"])
        recorder.restore(state["recorder"])
        sample.press()
        course.continued.append({"axial_strain": sample.axial_strain(), "time": run_folder.now()})
        preparation_s, loading_began = state["preparation_s"], time.monotonic() - state["loading_s"]
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
            course.tables_from = sorted({*course.tables_from, sample.reader.way})
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

    recorder.finish(
        script,
        values,
        table,
        {
            "time_step": (plan.time_step, "s"),
            "strain_rate": (plan.strain_rate, "1/s"),
            "mean_mass": (float(sample.masses.mean()), "kg"),
            "mean_radius": (sample.mean_radius, "m"),
            **sample.derived(),
        },
        steps=plan.last_step,
        continued=course.continued,
        timings={
            "preparation_s": preparation_s,
            "loading_s": time.monotonic() - loading_began,
            "sampling_s": course.sampling_s,
        },
        tables_from=course.tables_from,
        preparation={**start.facts, **course.settling, "packing": packing_name},
        validity={
            **loading_figures(recorder.rows[1:]),
            **sample.figures(recorder.rows[1:], plan.strain_rate),
            "overlap_max": recorder.largest_overlap / sample.mean_radius,
            "escaped_discs": course.escaped,
            "settled": start.facts["settled"] and course.settling.get("settled", True),
        },
    )
    checkpoint.clear(folder)


def loading_figures(loading: Sequence[Row]) -> dict[str, float]:
    """Figures by which any loading is judged; `loading` leaves out the first row, before it.

    `servo_error_max` is of the means from row to row.
    """
    servo = [abs(row["servo_error"]) for row in loading]
    unbalanced = [row["unbalanced_force"] for row in loading]
    return {
        "servo_error_max": max(servo),
        "servo_error_mean": sum(servo) / len(servo),
        "unbalanced_force_max": max(unbalanced),
        "unbalanced_force_mean": sum(unbalanced) / len(unbalanced),
        "kinetic_over_elastic_max": max(row["kinetic_energy"] / row["elastic_energy"] for row in loading),
    }
