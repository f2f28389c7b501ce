"""Run inside YADE: one test of a packing, ours or a plain script's, timed: yade_speed.py TASK.json, one line of JSON.

TASK has `values` (a run's parameters), `packings` (their folder), `folder` (for the run) and `way`: "ours", our script
with its samples; "chunks", a plain script that calls `O.run` for every 20 steps; "long", the same with one call.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT))
os.environ.setdefault("OMP_NUM_THREADS", "1")

# ruff: noqa: E402
import yade
import yade.utils

from yade_scripts import course, materials, packing, parameters
from yade_scripts.plan import plan_of
from yade_scripts.recorder import Recorder
from yade_scripts.sample import Sample

CHUNK = 20


class Clock:
    """Wall and processor time [s] since its last start, summed."""

    def __init__(self) -> None:
        """Nothing measured yet."""
        self.wall = self.cpu = 0.0

    def timed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return `function`, whose calls add to this clock."""

        def call(*arguments: Any, **named: Any) -> Any:
            wall, cpu = time.perf_counter(), time.process_time()
            try:
                return function(*arguments, **named)
            finally:
                self.wall += time.perf_counter() - wall
                self.cpu += time.process_time() - cpu

        return call


def ours(task: Mapping[str, Any]) -> dict[str, float]:
    """Time our script as it is from its first step to its manifest, and its samples."""
    sampling = Clock()
    began: list[tuple[float, float]] = []
    Recorder.snapshot = sampling.timed(Recorder.snapshot)  # type: ignore[method-assign]

    class Timed(Sample):
        def settle(self, *arguments: Any) -> Any:
            found = super().settle(*arguments)
            began.append((time.perf_counter(), time.process_time()))
            return found

        history_row = sampling.timed(Sample.history_row)
        tables = sampling.timed(Sample.tables)

    values = task["values"]
    course.run(Path(course.__file__), parameters.BIAXIAL, Timed, values, Path(task["folder"]), packings(task), 1e9)
    (wall, cpu) = began[0]
    manifest = json.loads((Path(task["folder"]) / "run.json").read_text())
    return {
        "steps": manifest["steps"],
        "seconds": time.perf_counter() - wall,
        "cpu_seconds": time.process_time() - cpu,
        "sampling_seconds": sampling.wall,
        "sampling_cpu_seconds": sampling.cpu,
    }


def plain(task: Mapping[str, Any]) -> dict[str, float]:
    """The same discs, laws, step and rate as a user of YADE writes it: its six walls with their stress controller."""
    values = task["values"]
    start, _ = packing.packing_of(values, packings(task))
    yade.O.reset()
    rules = materials.contact_rules(values)
    masses, inertias = materials.masses_and_inertias(start.radii, values["density"], values["mass"], values["shape"])
    plan = plan_of(values, masses)
    materials.add_discs(start.radii, start.positions, masses, inertias, rules)
    smooth = yade.O.materials.append(
        yade.CohFrictMat(
            young=rules.normal_stiffness / float(start.radii.mean()),
            poisson=rules.tangential_stiffness_ratio,
            frictionAngle=0,
            momentRotationLaw=False,
            isCohesive=False,
        )
    )
    left, right, bottom, top = start.faces.tolist()
    thickness = 0.01
    walls = yade.utils.aabbWalls([(left, bottom, -0.5), (right, top, 0.5)], thickness=thickness, material=smooth)
    numbers = yade.O.bodies.append(walls)
    triax = yade.TriaxialStressController(
        thickness=thickness,
        internalCompaction=False,
        stressMask=1,
        goal1=-values["confining_stress"],
        goal2=-plan.strain_rate,
        goal3=0,
        max_vel=1.0,
        wall_back_activated=False,
        wall_front_activated=False,
    )
    names = ("left", "right", "bottom", "top", "back", "front")
    for name, number in zip(names, numbers, strict=True):
        setattr(triax, f"wall_{name}_id", number)
    yade.O.engines = [
        yade.ForceResetter(),
        yade.InsertionSortCollider([yade.Bo1_Sphere_Aabb(), yade.Bo1_Box_Aabb()]),
        yade.InteractionLoop(
            [yade.Ig2_Sphere_Sphere_ScGeom6D(), yade.Ig2_Box_Sphere_ScGeom6D()],
            [yade.Ip2_CohFrictMat_CohFrictMat_CohFrictPhys()],
            [yade.Law2_ScGeom6D_CohFrictPhys_CohesionMoment(always_use_moment_law=True, useIncrementalForm=True)],
        ),
        triax,
        yade.NewtonIntegrator(damping=values["damping"]),
    ]
    yade.O.dt = plan.time_step
    yade.O.run(1, True)
    clock = Clock()
    run = clock.timed(yade.O.run)
    if task["way"] == "long":
        run(plan.last_step, True)
    else:
        for _ in range(plan.last_step // CHUNK):
            run(CHUNK, True)
    return {
        "steps": yade.O.iter - 1,
        "seconds": clock.wall,
        "cpu_seconds": clock.cpu,
        "contacts_a_disc": 2 * yade.O.interactions.countReal() / len(start.radii),
        "lateral_stress": -float(triax.stress(1)[0]),
        "axial_stress": -float(triax.stress(3)[1]),
    }


def packings(task: Mapping[str, Any]) -> Path:
    """Folder of the packings."""
    return Path(task["packings"])


if __name__ == "__main__":
    given = json.loads(Path(sys.argv[1]).read_text())
    print(json.dumps(ours(given) if given["way"] == "ours" else plain(given)))
