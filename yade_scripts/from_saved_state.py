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


def convert(states: Sequence[Path], folder: Path, named: dict[int, int]) -> list[str]:
    """Write a snapshot a state and their origin; return what was assumed. ValueError for a state that does not fit."""
    notes, heights, rotation, walls = [], [], None, named
    for index, state in enumerate(states):
        yade.O.reset()
        yade.O.load(str(state))
        if yade.O.periodic:
            raise ValueError(f"{state.name}: its cell is periodic; contacts across its boundary are not read")
        discs = export.disc_numbers()
        if not discs:
            raise ValueError(f"{state.name}: no sphere in it")
        walls = named or walls_beside_discs()
        place = [yade.O.bodies[body].state.pos[2] for body in discs]
        if np.ptp(place) > 1e-6 * max(yade.O.bodies[body].shape.radius for body in discs):
            raise ValueError(f"{state.name}: the spheres do not lie in one plane z; only discs are read")
        everything = {**discs, **walls}
        particles = export.particle_table(discs, rotation)
        stray = {i for contact in yade.O.interactions for i in (contact.id1, contact.id2)} - everything.keys()
        if stray:
            raise ValueError(f"{state.name}: body {min(stray)} touches a disc and is no known wall; name it by --wall")
        height = distance_between_walls(export.contact_table(everything), particles)
        heights.append(height)
        strain = 0.0
        if index:
            if height is None or heights[0] is None:
                raise ValueError(f"{state.name}: the axial strain is unknown: bottom or top wall without a contact")
            strain = 1 - height / heights[0]
        particles, _, _ = export.write_snapshot(folder, index, strain, walls, rotation)
        rotation = particles["rotation"]
    notes.append("axial strain: decrease of the distance between bottom and top wall since the first state")
    found = ", ".join(f"body {body} {export_format.WALLS[wall]}" for body, wall in sorted(walls.items())) or "none"
    notes.append(f"walls: {found}")
    return notes


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
    except (ValueError, RuntimeError, OSError) as error:
        print(" ".join(str(error).split()), file=sys.stderr)
        return FAILED
    print(json.dumps({"yade_version": yade.config.version, "notes": notes}))
    return DONE


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
