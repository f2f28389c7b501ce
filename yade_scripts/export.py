"""Write what YADE simulates now as a snapshot of run-folder format 1. Works in any YADE script of discs or spheres.

    from yade_scripts import export
    export.write_snapshot("my-run", 0, axial_strain=0.0, walls={wall_id: -1})

The script must find this package: put the folder that holds `yade_scripts` on `PYTHONPATH`.
"""

from __future__ import annotations

import functools
import io
import math
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from yade_scripts import export_format, run_folder

try:
    import yade
except ImportError:
    yade = None

Table = dict[str, np.ndarray]

# Fixed, so that the same arrays make the same bytes.
ARCHIVE_DATE = (1980, 1, 1, 0, 0, 0)
REPETITIVE = ("id", "radius", "id1", "id2", "kn", "kt", "kr", "friction", "limit")  # last words of columns' names


def disc_numbers() -> dict[int, int]:
    """Number in the export (0 to n-1) of every sphere, by its body number."""
    spheres = [body.id for body in yade.O.bodies if isinstance(body.shape, yade.Sphere)]
    return {body: number for number, body in enumerate(sorted(spheres))}


def particle_table(numbers: Mapping[int, int], previous_rotation: np.ndarray | None = None) -> Table:
    """Columns of the particle table. `numbers` is what `disc_numbers` gave.

    `previous_rotation`, (n,) [rad], is the rotation of the snapshot before: with it the rotation goes on past a half
    turn, without it it lies between minus and plus pi.
    """
    bodies = yade.O.bodies
    rows = []
    for body in numbers:
        disc = bodies[body]
        state = disc.state
        position, velocity, turn = state.pos, state.vel, state.ori
        place = (disc.shape.radius, position[0], position[1], 2 * math.atan2(turn[2], turn[3]))
        rows.append((*place, velocity[0], velocity[1], state.angVel[2]))
    values = np.array(rows, dtype=np.float64).reshape(len(rows), 7)
    table: Table = {"id": np.fromiter(numbers.values(), dtype=np.int64, count=len(rows))}
    names = export_format.names(export_format.PARTICLE_COLUMNS)[1:]
    table |= {name: values[:, column].copy() for column, name in enumerate(names)}
    table["rotation"] = unwrapped(table["rotation"], previous_rotation)
    return table


def unwrapped(rotation: np.ndarray, previous: np.ndarray | None) -> np.ndarray:
    """(n,) rotations moved by whole turns to within half a turn of `previous` (of zero if there is none) [rad].

    >>> unwrapped(np.array([-3.0, 6.0]), np.array([3.0, 0.0])).round(3).tolist()
    [3.283, -0.283]
    """
    reference = np.zeros(len(rotation)) if previous is None else previous
    turns = np.round((rotation - reference) / (2 * math.pi))
    return np.asarray(rotation - 2 * math.pi * turns)


def contact_table(numbers: Mapping[int, int], interactions: Iterable[Any] | None = None) -> Table:
    """Columns of the contact table, of all contacts or of those given, sorted by id1 and id2.

    `numbers` maps body numbers to discs (0 to n-1) and walls (negative). A contact of a body that is not in it is an
    error, as is a contact between two walls.
    """
    ids, rows = [], []
    for interaction in yade.O.interactions if interactions is None else interactions:
        geometry, physics = interaction.geom, interaction.phys
        normal, point, shear = geometry.normal, geometry.contactPoint, physics.shearForce
        nx, ny = normal[0], normal[1]
        force = physics.normalForce
        fn = force[0] * nx + force[1] * ny
        ft = shear[1] * nx - shear[0] * ny
        rolling = isinstance(physics, yade.CohFrictPhys) and physics.momentRotationLaw
        moment, kr, limit = (physics.moment_bending[2], physics.kr, physics.maxRollPl) if rolling else (0.0, 0.0, 0.0)
        place = (point[0], point[1], nx, ny, geometry.penetrationDepth)
        ids.append((numbers[interaction.id1], numbers[interaction.id2]))
        rows.append((*place, fn, ft, moment, physics.kn, physics.ks, kr, physics.tangensOfFrictionAngle, limit))
    names = export_format.names(export_format.CONTACT_COLUMNS)
    pair = np.array(ids, dtype=np.int64).reshape(len(ids), 2)
    values = np.array(rows, dtype=np.float64).reshape(len(ids), len(names) - 2)
    table: Table = {"id1": pair[:, 0], "id2": pair[:, 1]}
    return in_order(table | {name: values[:, column] for column, name in enumerate(names[2:])})


def in_order(contacts: Table) -> Table:
    """Return the contacts as the format asks for them: walls second, else the lower id first, sorted by ids."""
    one, other = contacts["id1"], contacts["id2"]
    swap = (other >= 0) & ((one < 0) | (one > other))
    first, second = np.where(swap, other, one), np.where(swap, one, other)
    if (first < 0).any():
        raise ValueError("two walls touch each other: leave walls that are no part of the test out of the simulation")
    order = np.argsort((first << 32) + second, kind="stable")  # by first, then second; half the time of lexsort
    table = {name: values[order] for name, values in contacts.items()}
    table["id1"], table["id2"] = first[order], second[order]
    for name in ("nx", "ny", "moment"):  # from the other side these change sign, and the tangential force does not
        table[name] = np.where(swap[order], -table[name], table[name])
    return table


def archive(arrays: Mapping[str, Any]) -> bytes:
    """Bytes of an npz archive of `arrays`; the same arrays give the same bytes.

    Columns with few different values are packed tightly; the others, digits of measured numbers, would hardly shrink.

    >>> archive({"a": np.arange(3)}) == archive({"a": np.arange(3)})
    True
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as target:
        for name, array in arrays.items():
            values = np.ascontiguousarray(array).reshape(np.shape(array))
            info = zipfile.ZipInfo(f"{name}.npy", ARCHIVE_DATE)
            packed = name.rpartition("_")[2] in REPETITIVE
            info.compress_type = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
            content = b"".join((_npy_header(values.dtype.str, values.shape), values.data))
            target.writestr(info, content, compresslevel=1)
    return buffer.getvalue()


@functools.lru_cache
def _npy_header(kind: str, shape: tuple[int, ...]) -> bytes:
    """Return what an npy file of this kind and shape begins with: a table's columns share it, and it takes its time."""
    with io.BytesIO() as start:
        np.lib.format.write_array_header_1_0(start, {"descr": kind, "fortran_order": False, "shape": shape})
        return start.getvalue()


def tables(walls: Mapping[int, int], previous_rotation: np.ndarray | None = None) -> tuple[Table, Table]:
    """Particle table and contact table of what YADE simulates now; the arguments are those of `write_snapshot`."""
    discs = disc_numbers()
    return particle_table(discs, previous_rotation), contact_table({**discs, **walls})


def write_tables(
    folder: str | Path, index: int, axial_strain: float, particles: Table, contacts: Table
) -> run_folder.Product:
    """Write a snapshot from its tables."""
    arrays: dict[str, Any] = {
        "axial_strain": np.float64(axial_strain),
        "time": np.float64(yade.O.time),
        "iteration": np.int64(yade.O.iter),
    }
    arrays |= {f"particle_{name}": values for name, values in particles.items()}
    arrays |= {f"contact_{name}": values for name, values in contacts.items()}
    name = f"{export_format.SNAPSHOTS}/{export_format.snapshot_name(index)}.npz"
    return run_folder.write(Path(folder), name, archive(arrays))


def write_snapshot(
    folder: str | Path,
    index: int,
    axial_strain: float,
    walls: Mapping[int, int],
    previous_rotation: np.ndarray | None = None,
) -> tuple[Table, Table, run_folder.Product]:
    """Write snapshot number `index` of the run in `folder`; return its particle table, contact table and file.

    `walls` maps body numbers of walls to -1 left, -2 right, -3 bottom, -4 top, -5 punch. Pass the rotation of the
    particle table returned by the last call as `previous_rotation`.
    """
    particles, contacts = tables(walls, previous_rotation)
    return particles, contacts, write_tables(folder, index, axial_strain, particles, contacts)
