"""Isotropic packings: random discs pressed together without friction; one per seed, made once, shared by all runs.

Without friction a contact has no history, so that positions and radii are the whole state: the same packing serves
every friction and rolling friction. By hand: `python3 yade_scripts/packing.py PARAMETERS.json --packings DIR`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

if __name__ == "__main__":
    # Last: installed, that folder holds the packages of another Python, which must not hide YADE's own
    sys.path.append(str(Path(sys.argv[0]).resolve().parent.parent))
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # one thread repeats bit for bit; read when YADE is imported

from yade_scripts import export, materials, parameters, punch_bed, run_folder, walls

try:
    import yade
except ImportError:
    yade = None

INITIAL_SOLID_FRACTION = 0.5  # random placement without overlaps jams at 0.547
DENSITY = 2650.0  # kg/m^3; sets the time scale of the preparation alone, not where it ends
DAMPING = 0.2
TIME_STEP_FACTOR = 0.5  # over sqrt(mass/normal stiffness), all masses equal
INERTIAL_NUMBER = 2e-3  # of the contraction that brings the discs together
UNBALANCED_FORCE = 1e-4  # mean resultant force over mean contact force at which a packing is settled
SERVO_ERROR = 1e-3  # of the wall stresses of a settled packing
MOST_STEPS = 400_000
RECIPE = 1  # one more whenever the preparation changes, so that packings made the old way are not taken for new ones

Report = Callable[[int], None]


class Packing(NamedTuple):
    """A settled isotropic packing.

    Attributes:
        radii: (n,) [m].
        positions: (n, 2) centres [m].
        faces: (4,) inner faces of the walls: left, right, bottom, top [m].
        facts: solid fraction, coordination, unbalanced force, servo error, steps, and whether it settled.
    """

    radii: np.ndarray
    positions: np.ndarray
    faces: np.ndarray
    facts: dict[str, Any]


def file_name(values: Mapping[str, Any]) -> str:
    """Name of the packing's file: readable, and different for whatever makes the packing different."""
    chosen = {name: values[name] for name in parameters.PACKING_NAMES}
    shape = {punch_bed.ASPECT: values[punch_bed.ASPECT]} if punch_bed.ASPECT in values else {}
    recipe = punch_bed.RECIPE if shape else RECIPE
    mark = parameters.fingerprint({**chosen, **shape, "recipe": recipe})
    return f"n{chosen['particle_count']}-{chosen['size_distribution']}-s{chosen['seed']}-{mark}.npz"


def packing_of(values: Mapping[str, Any], folder: Path, report: Report = lambda _: None) -> tuple[Packing, str]:
    """Return the packing of a run's parameters and its file's name; prepare and keep it if `folder` has none."""
    name = file_name(values)
    if not (folder / name).is_file():
        if punch_bed.ASPECT in values:
            packing = bed(values, report)
        else:
            yade.O.reset()
            packing = prepare(values, report)
            yade.O.reset()
        arrays = {"radii": packing.radii, "positions": packing.positions, "faces": packing.faces}
        run_folder.write(
            folder, name, export.archive({**arrays, "facts": np.array(json.dumps(packing.facts))}), durable=True
        )
    return read(folder / name), name


def read(path: Path) -> Packing:
    """Read a packing's file."""
    with np.load(path, allow_pickle=False) as stored:
        facts = json.loads(str(stored["facts"]))
        return Packing(stored["radii"], stored["positions"], stored["faces"], facts)


def bed(values: Mapping[str, Any], report: Report = lambda _: None) -> Packing:
    """Make the bed of a punch; see `punch_bed`."""
    radii, found = punch_bed.bed_of(values, report)
    return Packing(radii, found.positions, np.array((0, found.extents[0], 0, found.extents[1])), found.facts)


def prepare(values: Mapping[str, Any], report: Report = lambda _: None) -> Packing:
    """Make a packing in an empty simulation: scatter, contract, press with the confining stress until it rests."""
    generator = np.random.default_rng(values["seed"])
    radii = materials.radii_of(values, generator)
    disc_area = math.pi * float((radii**2).sum())
    side = math.sqrt(disc_area / INITIAL_SOLID_FRACTION)
    positions = scatter(radii, side, generator)

    stress, stiffness = values["confining_stress"], values["normal_stiffness"]
    masses, inertias = materials.masses_and_inertias(radii, DENSITY, "equal")
    mass = float(masses[0])
    rules = materials.frictionless(stiffness, values["preparation_friction"])
    materials.add_discs(radii, positions, masses, inertias, rules)
    box = walls.add_walls((0, side, 0, side), float(radii.max()), rules)
    yade.O.engines = materials.engines(rules, DAMPING)
    yade.O.dt = TIME_STEP_FACTOR * math.sqrt(mass / stiffness)

    # The discs set out with the velocities of a homogeneous contraction, else the walls would sweep up a dense rim.
    rate = INERTIAL_NUMBER * math.sqrt(stress / mass)
    for wall in walls.INWARD:
        walls.drive(box, wall, rate * side / 2)
    inward = -rate * (positions - side / 2)
    for number, velocity in enumerate(inward.tolist()):
        yade.O.bodies[number].state.vel = (*velocity, 0.0)
    while sum(walls.stresses(box)) < 2 * stress and yade.O.iter < MOST_STEPS:
        step(20)
        report(yade.O.iter)

    for number in range(len(radii)):
        yade.O.bodies[number].state.vel = (0, 0, 0)
    for wall in walls.INWARD:
        walls.release(box, wall, wall_mass(mass, len(radii)))
    settled = False
    while not settled and yade.O.iter < MOST_STEPS:
        walls.push(box, tuple(walls.INWARD), stress)
        step(100)
        report(yade.O.iter)
        with walls.held(box):
            unbalanced = yade.utils.unbalancedForce()
        error = max(abs(found / stress - 1) for found in walls.stresses(box))
        settled = unbalanced <= UNBALANCED_FORCE and error <= SERVO_ERROR

    final = np.array([tuple(yade.O.bodies[number].state.pos) for number in range(len(radii))])[:, :2]
    width, height = walls.extents(box)
    facts = {
        "settled": settled,
        "solid_fraction": disc_area / (width * height),
        "coordination": coordination(len(radii), len(walls.contacts(box))),
        "unbalanced_force": float(unbalanced),
        "servo_error": float(error),
        "steps": int(yade.O.iter),
        "yade_version": yade.config.version,
    }
    return Packing(radii, final, walls.faces(box), facts)


def scatter(radii: np.ndarray, side: float, generator: np.random.Generator) -> np.ndarray:
    """(n, 2) random centres [m] of discs that do not overlap in a square of the given side, the largest placed first.

    >>> generator = np.random.default_rng(1)
    >>> at = scatter(np.array([1.0, 1.0]), 5.0, generator)
    >>> bool(np.hypot(*(at[0] - at[1])) >= 2)
    True
    """
    positions = np.zeros((len(radii), 2))
    cell = 2 * float(radii.max())
    placed: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
    for number in np.argsort(-radii, kind="stable").tolist():
        radius = float(radii[number])
        while True:
            x, y = (radius + (side - 2 * radius) * generator.random(2)).tolist()
            column, row = int(x // cell), int(y // cell)
            around = [(column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
            near = (disc for place in around for disc in placed.get(place, ()))
            if all((x - other[0]) ** 2 + (y - other[1]) ** 2 >= (radius + other[2]) ** 2 for other in near):
                break
        positions[number] = x, y
        placed.setdefault((column, row), []).append((x, y, radius))
    return positions


def wall_mass(disc_mass: float, count: int) -> float:
    """Mass [kg] of a free wall: a quarter of the layer of discs against it.

    The heavier a wall, the longer it lags in a collapse: with 600 discs the confining stress, averaged over 1e-4 of
    strain, is off by at most 1 % with this mass, by 4 % with a whole layer's. A still lighter wall rattles.
    """
    return disc_mass * math.sqrt(count) / 4


def coordination(count: int, at_walls: int) -> float:
    """Mean number of contacts of `count` discs; one with another disc counts for both, one with a wall for one."""
    return float(2 * yade.O.interactions.countReal() - at_walls) / count


def step(count: int) -> None:
    """Make `count` steps. A loop of single steps stops at once when interrupted, and costs nothing."""
    advance = yade.O.step
    for _ in range(count):
        advance()


def main(arguments: Sequence[str]) -> int:
    """Prepare the packing of a run's parameters; return the exit status: 0 it is there, 2 bad input."""
    parser = argparse.ArgumentParser(prog="packing.py", description=(__doc__ or "").split("\n\n", maxsplit=1)[0])
    parser.add_argument("parameters", type=Path, metavar="PARAMETERS.json", help="parameter names and values of a run")
    parser.add_argument("--packings", type=Path, required=True, metavar="DIR", help="where packings are kept")
    parser.add_argument("--test", choices=list(parameters.TESTS), default="biaxial", help="whose parameters they are")
    options = parser.parse_args(arguments)
    try:
        values = run_folder.read_parameters(options.parameters, parameters.TESTS[options.test])
    except (OSError, ValueError) as error:
        print(f"{options.parameters}: {error}", file=sys.stderr)
        return 2
    if yade is None:
        print(run_folder.NO_YADE, file=sys.stderr)
        return 2
    packing, name = packing_of(values, options.packings)
    print(f"{name}: {json.dumps(packing.facts)}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
