"""A biaxial test in two dimensions: discs between four rigid walls, compressed along y at a constant rate.

Run it by YADE, `yade -n -x yade_scripts/biaxial.py PARAMETERS.json`, or by the system's Python with YADE's Python
folder on PYTHONPATH (no prompt, no ports). The run's folder gets snapshots, a history and, last, `run.json`.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
import traceback
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SCRIPT = Path(sys.argv[0] if __name__ == "__main__" else __file__).resolve()
if __name__ == "__main__":
    sys.path.insert(0, str(SCRIPT.parent.parent))
    # One thread, so that a run repeats bit for bit; YADE reads this when it is imported.
    os.environ.setdefault("OMP_NUM_THREADS", "1")

from yade_scripts import export, export_format, materials, packing, parameters, run_folder, walls  # noqa: E402

try:
    import yade
except ImportError:
    yade = None

CHUNK = 20  # steps between two looks at the clock and two corrections of the walls' push


class Plan(NamedTuple):
    """When a run steps and samples: the loading rate and the step numbers of its samples.

    Attributes:
        strain_rate: engineering strain rate along y [1/s].
        time_step: [s].
        history_steps: step numbers of the history's rows, from 0 to the last step.
        snapshot_steps: step numbers of the snapshots, from 0 to the last step.
    """

    strain_rate: float
    time_step: float
    history_steps: list[int]
    snapshot_steps: list[int]


def plan_of(values: Mapping[str, Any], masses: np.ndarray) -> Plan:
    """Lay out the steps of a run: equal steps, as many a sampling interval as the largest safe step asks for.

    The time step is shortened a little so that the sampling intervals are whole numbers of steps; where the intervals
    are too fine for that, samples fall on the nearest step.
    """
    rate = values["inertial_number"] / math.sqrt(float(masses.mean()) / values["confining_stress"])
    largest = values["time_step_factor"] * math.sqrt(float(masses.min()) / values["normal_stiffness"])
    history, snapshots = values["history_strain_interval"], values["snapshot_strain_interval"]
    shared = common_measure(history, snapshots)
    time_step = largest
    if shared / (rate * largest) > 4:
        time_step = shared / rate / math.ceil(shared / (rate * largest))
    last = round(values["final_axial_strain"] / (rate * time_step))
    return Plan(
        rate,
        time_step,
        sample_steps(history / (rate * time_step), last),
        sample_steps(snapshots / (rate * time_step), last),
    )


def common_measure(one: float, other: float) -> float:
    """Return the largest number that goes a whole number of times into both, read as decimal fractions.

    >>> common_measure(1e-4, 2.5e-4)
    5e-05
    """
    first, second = Fraction(repr(one)), Fraction(repr(other))
    numerator = math.gcd(first.numerator * second.denominator, second.numerator * first.denominator)
    return float(Fraction(numerator, first.denominator * second.denominator))


def sample_steps(interval: float, last: int) -> list[int]:
    """Step numbers nearest to the multiples of `interval` [steps], with 0 and `last`, each once.

    >>> sample_steps(2.5, 8)
    [0, 2, 5, 8]
    """
    steps = {0, last} | {round(number * interval) for number in range(1, int(last / interval) + 1)}
    return sorted(step for step in steps if step <= last)


class Sample:
    """The sample in the simulation: discs, walls, and what is measured on them."""

    def __init__(self, values: Mapping[str, Any], start: packing.Packing) -> None:
        """Put a packing's discs and walls into the empty simulation, at rest, with the run's contact rules."""
        self.values = values
        self.count = len(start.radii)
        self.mean_radius = float(start.radii.mean())
        self.disc_area = math.pi * float((start.radii**2).sum())
        self.masses, inertias = materials.masses_and_inertias(start.radii, values["density"], values["mass"])
        rules = materials.contact_rules(values)
        materials.add_discs(start.radii, start.positions, self.masses, inertias, rules)
        self.walls = walls.add_walls(start.faces, float(start.radii.max()), rules)
        self.width, self.height = walls.extents(self.walls)
        yade.O.engines = materials.engines(rules, values["damping"])
        for wall in (walls.LEFT, walls.RIGHT):
            walls.release(self.walls, wall, packing.wall_mass(float(self.masses.mean()), self.count))

    def press(self) -> None:
        """Push the side walls with the confining stress over the height they confine now."""
        walls.push(self.walls, (walls.LEFT, walls.RIGHT), self.values["confining_stress"])

    def load(self, strain_rate: float) -> None:
        """Set the bottom and top walls moving, and the discs with them as in a homogeneous compression.

        Walls that start into a sample at rest send a stress wave through it, a few per cent of the confining stress.
        """
        for wall in (walls.BOTTOM, walls.TOP):
            walls.drive(self.walls, wall, strain_rate * self.height / 2)
        _, _, bottom, top = walls.faces(self.walls)
        for number in range(self.count):
            state = yade.O.bodies[number].state
            state.vel = (0, -strain_rate * (state.pos[1] - (bottom + top) / 2), 0)

    def axial_strain(self) -> float:
        """Engineering strain along y since the start, compression positive."""
        return 1 - walls.extents(self.walls)[1] / self.height

    def history_row(self) -> dict[str, float]:
        """One row of the history."""
        width, height = walls.extents(self.walls)
        lateral, axial = walls.stresses(self.walls)
        with walls.held(self.walls):
            unbalanced, kinetic = yade.utils.unbalancedForce(), yade.utils.kineticEnergy()
        return {
            "axial_strain": 1 - height / self.height,
            "lateral_strain": 1 - width / self.width,
            "axial_stress": axial,
            "lateral_stress": lateral,
            "stress_ratio": (axial - lateral) / (axial + lateral),
            "solid_fraction": self.disc_area / (width * height),
            "coordination": packing.coordination(self.walls, self.count),
            "unbalanced_force": unbalanced,
            "kinetic_energy": kinetic,
            "elastic_energy": materials.elastic_energy(),
            "servo_error": lateral / self.values["confining_stress"] - 1,
            "time": yade.O.time,
            "iteration": yade.O.iter,
        }

    def escaped(self, particles: export.Table) -> int:
        """Count discs whose centre is outside the walls."""
        left, right, bottom, top = walls.faces(self.walls)
        inside = (particles["x"] > left) & (particles["x"] < right) & (particles["y"] > bottom) & (particles["y"] < top)
        return int((~inside).sum())


def run(values: Mapping[str, Any], folder: Path, packings: Path) -> None:
    """Make the whole test; the run's folder is complete when this returns."""
    started, clock = run_folder.now(), time.monotonic()
    progress = run_folder.Progress(folder)
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
    rows: list[dict[str, float]] = []
    products: dict[str, run_folder.Product] = {}
    snapshots: list[dict[str, float]] = []
    worst = {"overlap": 0.0, "escaped": 0}
    rotation = None
    wanted_rows, wanted_snapshots = set(plan.history_steps), set(plan.snapshot_steps)
    stops = sorted(wanted_rows | wanted_snapshots | set(range(0, plan.history_steps[-1], CHUNK)))
    sampling = 0.0
    for stop in stops:
        packing.step(first + stop - yade.O.iter)
        before = time.monotonic()
        if stop in wanted_rows:
            rows.append(sample.history_row())
        if stop in wanted_snapshots:
            strain = sample.axial_strain()
            particles, contacts, product = export.write_snapshot(
                folder, len(snapshots), strain, sample.walls.numbers, rotation
            )
            rotation = particles["rotation"]
            products[product.name] = product
            snapshots.append({"index": len(snapshots), "axial_strain": strain, "time": yade.O.time})
            worst["overlap"] = max(worst["overlap"], float(contacts["overlap"].max()))
            worst["escaped"] = max(worst["escaped"], sample.escaped(particles))
        if stop == 0:
            sample.load(plan.strain_rate)
        sample.press()
        progress.tell("loading", sample.axial_strain(), target, yade.O.iter - first, final=stop == stops[-1])
        sampling += time.monotonic() - before

    names = export_format.names(export_format.HISTORY_COLUMNS)
    products[export_format.HISTORY] = run_folder.write_csv(
        folder, export_format.HISTORY, names, ([row[name] for name in names] for row in rows)
    )
    index_names = export_format.names(export_format.SNAPSHOT_INDEX_COLUMNS)
    manifest = {
        "format": export_format.FORMAT,
        "status": export_format.STATUS_DONE,
        "script": SCRIPT.name,
        "parameters": parameters_entry(values),
        "derived": {
            "time_step": {"value": plan.time_step, "unit": "s"},
            "strain_rate": {"value": plan.strain_rate, "unit": "1/s"},
            "mean_mass": {"value": float(sample.masses.mean()), "unit": "kg"},
            "mean_radius": {"value": sample.mean_radius, "unit": "m"},
            "initial_width": {"value": sample.width, "unit": "m"},
            "initial_height": {"value": sample.height, "unit": "m"},
            "wall_mass": {"value": packing.wall_mass(float(sample.masses.mean()), sample.count), "unit": "kg"},
        },
        "provenance": run_folder.provenance(yade.config.version, values["seed"], started),
        "steps": plan.history_steps[-1],
        "timings": {
            "preparation_s": prepared - clock,
            "loading_s": time.monotonic() - prepared,
            "sampling_s": sampling,
        },
        "preparation": {**start.facts, "packing": packing_name},
        "validity": validity(rows, worst, sample, plan, start),
        "products": {
            "files": run_folder.products_entry(products),
            "history_rows": len(rows),
            "snapshots": [{name: snapshot[name] for name in index_names} for snapshot in snapshots],
        },
    }
    run_folder.write_json(folder, export_format.MANIFEST, manifest, durable=True)


def validity(
    rows: Sequence[Mapping[str, float]],
    worst: Mapping[str, float],
    sample: Sample,
    plan: Plan,
    start: packing.Packing,
) -> dict[str, Any]:
    """Figures by which a run is judged; those over time leave out the first row, which is before the loading."""
    loading = rows[1:] or rows
    servo = [abs(row["servo_error"]) for row in loading]
    unbalanced = [row["unbalanced_force"] for row in loading]
    lateral = sum(row["lateral_stress"] for row in loading) / len(loading)
    return {
        "servo_error_max": max(servo),
        "servo_error_mean": sum(servo) / len(servo),
        "unbalanced_force_max": max(unbalanced),
        "unbalanced_force_mean": sum(unbalanced) / len(unbalanced),
        "overlap_max": worst["overlap"] / sample.mean_radius,
        "inertial_number": plan.strain_rate * math.sqrt(float(sample.masses.mean()) / lateral),
        "kinetic_over_elastic_max": max(row["kinetic_energy"] / row["elastic_energy"] for row in loading),
        "escaped_discs": worst["escaped"],
        "settled": start.facts["settled"],
    }


def parameters_entry(values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Every parameter with its unit, as the manifest holds it."""
    return {
        parameter.name: {"value": values[parameter.name], "unit": parameter.unit} for parameter in parameters.BIAXIAL
    }


def failure_manifest(values: Mapping[str, Any], reason: str, started: str) -> dict[str, Any]:
    """Build the manifest of a run that failed."""
    return {
        "format": export_format.FORMAT,
        "status": export_format.STATUS_FAILED,
        "failure": reason,
        "script": SCRIPT.name,
        "parameters": parameters_entry(values),
        "provenance": run_folder.provenance(yade.config.version, values["seed"], started),
    }


def main(arguments: Sequence[str]) -> int:
    """Run the test that `arguments` ask for; return the exit status: 0 done, 1 failed, 2 bad input."""
    parser = argparse.ArgumentParser(prog=SCRIPT.name, description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("parameters", type=Path, metavar="PARAMETERS.json", help="parameter names and values")
    parser.add_argument("--folder", type=Path, help="the run's folder (default: that of PARAMETERS.json)")
    parser.add_argument(
        "--packings", type=Path, help="prepared packings (default: `packings` beside the folder `runs`)"
    )
    options = parser.parse_args(arguments)
    folder = (options.folder or options.parameters.parent).resolve()
    packings = options.packings or (folder.parent.parent if folder.parent.name == "runs" else folder) / "packings"
    try:
        values = run_folder.read_parameters(options.parameters, parameters.BIAXIAL)
    except (OSError, ValueError) as error:
        print(f"{options.parameters}: {error}", file=sys.stderr)
        return 2
    if yade is None:
        print(
            "YADE is not importable: put the folder of its Python package on PYTHONPATH, or run by `yade -n -x`",
            file=sys.stderr,
        )
        return 2
    started = run_folder.now()
    (folder / export_format.MANIFEST).unlink(missing_ok=True)
    try:
        run(values, folder, packings)
    except Exception as error:
        traceback.print_exc()
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        run_folder.write_json(folder, export_format.MANIFEST, failure_manifest(values, reason, started), durable=True)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
