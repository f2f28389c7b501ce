"""Write states that YADE saved (`O.save`) as snapshots of run-folder format 1, in the order given.

Run it by YADE, `yade -n -x yade_scripts/from_saved_state.py STATE... --folder FOLDER`, or by the system's Python with
YADE's Python folder on PYTHONPATH. A state loads in the version of YADE that saved it. What is no sphere is a wall,
named after where it lies beside the discs; `--wall left=ID` names one itself.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

if __name__ == "__main__":
    # Last: installed, that folder holds the packages of another Python, which must not hide YADE's own
    sys.path.append(str(Path(sys.argv[0]).resolve().parent.parent))
    os.environ.setdefault("OMP_NUM_THREADS", "1")

from yade_scripts import export, export_format, run_folder

try:
    import yade
except ImportError:
    yade = None

NUMBERS = {name: number for number, name in export_format.WALLS.items()}
DONE, FAILED, BAD_INPUT = 0, 1, 2
LINEARITY = 1e-3  # of the sum of two radii: how far an overlap may be from force over stiffness (bodies move on a step)
FLATNESS = 1e-6  # of the largest radius: how far centres may lie from one plane


def read_walls(given: Sequence[str]) -> dict[int, int]:
    """Return the walls by body number from texts like "left=0"; ValueError in one line for anything else.

    >>> read_walls(["left=0", "top=3"])
    {0: -1, 3: -4}
    """
    walls: dict[int, int] = {}
    for text in given:
        name, _, body = text.partition("=")
        if name not in NUMBERS or not body.isdecimal():
            raise ValueError(f"--wall {text}: expected one of {', '.join(NUMBERS)} and a body's number, as in left=0")
        walls[int(body)] = NUMBERS[name]
    return walls


def walls_beside_discs() -> dict[int, int]:
    """Return the walls by body number: each body with a shape, no sphere, that lies beside the discs' centres.

    One in front of or behind them bears no force in the plane and is left out.
    """
    bodies = yade.O.bodies
    centres = np.array([tuple(body.state.pos)[:2] for body in bodies if isinstance(body.shape, yade.Sphere)])
    low, high = centres.min(axis=0), centres.max(axis=0)
    walls = {}
    for body in bodies:
        if body.shape is None or isinstance(body.shape, yade.Sphere):
            continue
        x, y = tuple(body.state.pos)[:2]
        beyond = {"left": low[0] - x, "right": x - high[0], "bottom": low[1] - y, "top": y - high[1]}
        side = max(beyond, key=lambda name: beyond[name])
        if beyond[side] > 0:
            walls[body.id] = NUMBERS[side]
    return walls


def distance_between_walls(contacts: export.Table, particles: export.Table) -> float | None:
    """Distance between the faces of bottom and top wall [m], from the contacts with them; None where one has none."""
    faces = []
    for name in ("bottom", "top"):
        rows = np.flatnonzero(contacts["id2"] == NUMBERS[name])
        if not len(rows):
            return None
        disc = contacts["id1"][rows]
        reach = particles["radius"][disc] - contacts["overlap"][rows]
        faces.append(float(np.mean(particles["y"][disc] + reach * contacts["ny"][rows])))
    return faces[1] - faces[0]


def with_overlap(particles: export.Table, contacts: export.Table, state: str) -> export.Table:
    """Contacts with their overlap, which YADE does not save: normal force over stiffness, as in every linear law.

    Raises ValueError where the centres of two discs tell another overlap: the law is not linear, or damped.
    """
    overlap = contacts["fn"] / contacts["kn"]
    first, second = contacts["id1"], np.maximum(contacts["id2"], 0)
    radii = particles["radius"][first] + particles["radius"][second]
    distance = np.hypot(*(particles[axis][second] - particles[axis][first] for axis in ("x", "y")))
    wrong = (contacts["id2"] >= 0) & ~(np.abs(radii - distance - overlap) <= LINEARITY * radii)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"{state}: discs {first[row]} and {second[row]} overlap by {(radii - distance)[row]:g} m, expected "
            f"{overlap[row]:g} m, normal force over stiffness; only linear contact laws are read"
        )
    return {**contacts, "overlap": overlap}


def convert(states: Sequence[Path], folder: Path, named: dict[int, int]) -> list[str]:
    """Write a snapshot a state; return what was assumed. ValueError in one line for a state that does not fit."""
    walls, rotation, first_height, count = named, None, None, 0
    for index, state in enumerate(states):
        yade.O.reset()
        yade.O.load(str(state), quiet=True)
        discs = export.disc_numbers()
        check_scene(state.name, discs)
        if index and len(discs) != count:
            raise ValueError(f"{state.name}: expected {count} spheres as in the first state, found {len(discs)}")
        count = len(discs)
        walls = named or walls_beside_discs()
        touched = {body for contact in yade.O.interactions for body in (contact.id1, contact.id2)}
        stray = touched - discs.keys() - walls.keys()
        if stray:
            raise ValueError(f"{state.name}: body {min(stray)} touches a disc and is no known wall; name it by --wall")
        particles, contacts = export.tables(walls, rotation)
        rotation = particles["rotation"]
        contacts = with_overlap(particles, contacts, state.name)
        height = distance_between_walls(contacts, particles)
        strain = 0.0
        if index == 0:
            first_height = height
        elif height is None or first_height is None:
            raise ValueError(f"{state.name}: the axial strain is unknown: bottom or top wall without a contact")
        else:
            strain = 1 - height / first_height
        export.write_tables(folder, index, strain, particles, contacts)
    found = ", ".join(f"body {body} {export_format.WALLS[wall]}" for body, wall in sorted(walls.items())) or "none"
    return [
        "axial strain: decrease of the distance between bottom and top wall since the first state",
        f"walls: {found}",
        "overlaps: normal force over normal stiffness; YADE does not save them",
    ]


def check_scene(state: str, discs: dict[int, int]) -> None:
    """Raise ValueError unless the loaded scene is a sample in one plane without a periodic cell."""
    if yade.O.periodic:
        raise ValueError(f"{state}: its cell is periodic; contacts across its boundary are not read")
    if not discs:
        raise ValueError(f"{state}: no sphere in it")
    bodies = [yade.O.bodies[number] for number in discs]
    if np.ptp([body.state.pos[2] for body in bodies]) > FLATNESS * max(body.shape.radius for body in bodies):
        raise ValueError(f"{state}: the spheres do not lie in one plane z; only discs are read")


def main(arguments: Sequence[str]) -> int:
    """Convert; return the exit status: 0 done, 1 a state does not fit, 2 bad input."""
    parser = argparse.ArgumentParser(prog="from_saved_state.py", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("states", nargs="+", type=Path, metavar="STATE", help="files written by O.save, in order")
    parser.add_argument("--folder", type=Path, required=True, help="the run's folder")
    parser.add_argument("--wall", action="append", default=[], metavar="NAME=ID", help="a wall and its body's number")
    options = parser.parse_args(arguments)
    if yade is None:
        print(run_folder.NO_YADE, file=sys.stderr)
        return BAD_INPUT
    try:
        notes = convert(options.states, options.folder, read_walls(options.wall))
    except AttributeError as error:  # contacts of another kind than export.py reads
        print(f"contacts or bodies of a kind that is not read: {error}", file=sys.stderr)
        return FAILED
    except (ValueError, RuntimeError, OSError) as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return FAILED
    print(json.dumps({"yade_version": yade.config.version, "notes": notes}))
    return DONE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
