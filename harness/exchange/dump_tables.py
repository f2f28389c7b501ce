"""Frames of dumps to arrays of format 1: atoms in the order of their ids, forces split by the contact's geometry."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from forcechain.arrays import FloatArray, IntArray
from harness.errors import InputError
from harness.exchange.dumps import Frame
from harness.reading.tables import Table, checked
from yade_scripts.export_format import Column

WALLS = {"left": (-1, (-1.0, 0.0)), "right": (-2, (1.0, 0.0)), "bottom": (-3, (0.0, -1.0)), "top": (-4, (0.0, 1.0))}
ATOM_COLUMNS = tuple(
    Column(name, unit, name == "id", meaning)
    for name, unit, meaning in (
        ("id", "-", "number of the atom"),
        ("x", "m", "centre"),
        ("y", "m", "centre"),
        ("radius", "m", "radius"),
    )
)
OPTIONAL_ATOM_COLUMNS = {"vx": "m/s", "vy": "m/s", "omegaz": "rad/s"} | {
    f"{wall}_{component}": "N" for wall in WALLS for component in ("fx", "fy")
}
PAIR_COLUMNS = tuple(
    Column(name, unit, name.startswith("id"), meaning)
    for name, unit, meaning in (
        ("id1", "-", "number of the first atom"),
        ("id2", "-", "number of the second atom"),
        ("fx", "N", "force on the first"),
        ("fy", "N", "force on the first"),
    )
)
TANGENTIAL_COLUMNS = (
    Column("tx", "N", False, "tangential force on the first, p1 of pair_style granular"),
    Column("ty", "N", False, "tangential force on the first, p2 of pair_style granular"),
)
ROLLING_COLUMNS: tuple[Column, ...] = (
    Column("rx", "N", False, "rolling force on the first, p5 of pair_style granular"),
    Column("ry", "N", False, "rolling force on the first, p6 of pair_style granular"),
)
ROLLING_TORQUE = Column("rolling_torque", "N m", False, "torque of the rolling resistance about z, on the first")
LARGEST_GAP = 0.5  # of the sum of radii: a pair further apart touches across a periodic boundary
FLATNESS = 1e-6  # of the mean radius: how far centres may lie from one plane


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """What differs between the codes.

    Attributes:
        name: of the code.
        splits_force: whether fx and fy are the normal force alone and tx, ty the tangential one (LAMMPS), or fx and fy
            are the whole force (LIGGGHTS).
    """

    name: str
    splits_force: bool


LAMMPS = Dialect(name="lammps", splits_force=True)
LIGGGHTS = Dialect(name="liggghts", splits_force=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """Names of the columns in order, for dumps whose headers do not name them; None: as in the header."""

    atoms: Sequence[str] | None = None
    pairs: Sequence[str] | None = None


class Notes(list[str]):
    """What was assumed, each thing once."""

    def add(self, note: str) -> None:
        """Append `note` unless it is there."""
        if note not in self:
            self.append(note)


def sorted_ids(table: Table, where: str) -> IntArray:
    """Return the numbers of the atoms (n,), increasing; InputError when one is there twice."""
    ids: IntArray = np.sort(checked(table, ATOM_COLUMNS[:1], "atoms", where)["id"])
    repeated = ids[1:] == ids[:-1]
    if repeated.any():
        raise InputError(f"{where}: atom {ids[int(np.argmax(repeated))]} is there twice")
    return ids


def read_atoms(frame: Frame, names: Names, notes: Notes) -> Table:
    """Return the columns of atoms (n,) that are known, in the order of their ids; velocities are 0 without columns.

    InputError for a column that is missing, a value that is no number, or a sample that is not in one plane.
    """
    table = dict(frame.read(names.atoms))
    if "radius" not in table and "diameter" in table:
        table["radius"] = checked(table, (Column("diameter", "m", False, "diameter"),), "atoms", frame.where)[
            "diameter"
        ]
        table["radius"] = table["radius"] / 2
    for centre in ("x", "y"):
        if centre not in table and f"{centre}u" in table:
            table[centre] = table[f"{centre}u"]
    optional = [Column(name, unit, False, name) for name, unit in OPTIONAL_ATOM_COLUMNS.items() if name in table]
    z = (Column("z", "m", False, "centre"),) if "z" in table else ()
    found = checked(table, (*ATOM_COLUMNS, *optional, *z), "atoms", frame.where)
    if not len(found["id"]):
        raise InputError(f"{frame.where}: expected atoms, found none")
    if found["radius"].min() <= 0:
        row = int(found["radius"].argmin())
        raise InputError(f"{frame.where} row {row}: expected a positive radius, found {found['radius'][row]:g}")
    if "z" in found and np.ptp(found["z"]) > FLATNESS * np.mean(found["radius"]):
        raise InputError(f"{frame.where}: expected centres in one plane z, found them {np.ptp(found['z']):g} m apart")
    for name in ("vx", "vy", "omegaz"):
        if name not in found:
            notes.add(f"no column {name} in the dump of atoms: taken as 0" + ", rotations too" * (name == "omegaz"))
            found[name] = np.zeros(len(found["id"]))
    if "omegaz" in table:
        notes.add("rotations: integral of omegaz over the frames (trapezoidal rule), 0 at the first")
    sorted_ids(found, frame.where)
    order = np.argsort(found["id"], kind="stable")
    return {name: values[order] for name, values in found.items()}


def read_pairs(
    frame: Frame, atoms: Table, dialect: Dialect, values: Mapping[str, float], names: Names, notes: Notes
) -> dict[str, Any]:
    """Return the contacts between atoms as arrays of a `Snapshot` (n_contacts, ...); `atoms` is of `read_atoms`.

    InputError for a column that is missing, an atom that is not there, or two that do not touch.
    """
    table = frame.read(names.pairs)
    columns = PAIR_COLUMNS + (TANGENTIAL_COLUMNS if dialect.splits_force else ())
    rolling: tuple[Column, ...] = ROLLING_COLUMNS
    torque: tuple[Column, ...] = (ROLLING_TORQUE,)
    if not (dialect.splits_force and any(column.name in table for column in rolling)):
        rolling = ()
    if ROLLING_TORQUE.name not in table:
        torque = ()
    pairs = checked(table, columns + rolling + torque, "pairs", frame.where)
    first, second = (_numbers_of(pairs[name], atoms["id"], name, frame.where) for name in ("id1", "id2"))
    position = np.column_stack((atoms["x"], atoms["y"]))
    branch = position[second] - position[first]
    distance = np.hypot(*branch.T)
    radius_1, radius_2 = atoms["radius"][first], atoms["radius"][second]
    _check_distance(distance, radius_1 + radius_2, pairs, frame.where)
    normal = branch / distance[:, None]
    overlap = radius_1 + radius_2 - distance
    force = -np.column_stack((pairs["fx"], pairs["fy"]))  # on the second, as format 1 has it
    if dialect.splits_force:
        force -= np.column_stack((pairs["tx"], pairs["ty"]))
    effective = radius_1 * radius_2 / (radius_1 + radius_2)
    n = len(first)
    if rolling:  # the torque on the first is R_eff n' x (rx, ry), n' from the second to the first
        moment = effective * (normal[:, 0] * pairs["ry"] - normal[:, 1] * pairs["rx"])
    elif torque:
        moment = -pairs["rolling_torque"]
    else:
        notes.add("no rolling resistance in the dump of pairs: moments are 0")
        moment = np.zeros(n)
    return {
        "contact_ids": np.column_stack((first, second)),
        # where the codes apply the tangential force: halfway into the overlap
        "contact_point": position[first] + (radius_1 - overlap / 2)[:, None] * normal,
        "contact_normal": normal,
        "overlap": overlap,
        "normal_force": np.sum(force * normal, axis=1),
        "tangential_force": force[:, 1] * normal[:, 0] - force[:, 0] * normal[:, 1],
        "moment": moment,
        "normal_stiffness": np.full(n, values["normal_stiffness"]),
        "tangential_stiffness": np.full(n, values["tangential_stiffness"]),
        "rolling_stiffness": values["rolling_stiffness"] * effective**2,
        "friction": np.full(n, values["friction"]),
        "rolling_limit": values["rolling_friction"] * effective,
    }


def _numbers_of(ids: IntArray, known: IntArray, name: str, where: str) -> IntArray:
    place = np.minimum(np.searchsorted(known, ids), len(known) - 1)
    wrong = known[place] != ids
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(f"{where} row {row}: {name}={ids[row]} is not an atom of this time step ({len(known)} atoms)")
    return place.astype(np.int64)


def _check_distance(distance: FloatArray, reach: FloatArray, pairs: Table, where: str) -> None:
    far = distance > (1 + LARGEST_GAP) * reach
    if (far | (distance == 0)).any():
        row = int(np.argmax(far | (distance == 0)))
        raise InputError(
            f"{where} row {row}: atoms {pairs['id1'][row]} and {pairs['id2'][row]} are {distance[row]:g} m apart, "
            f"expected about {reach[row]:g} m, the sum of their radii; contacts across a periodic boundary are not read"
        )


def wall_contacts(atoms: Table, values: Mapping[str, float], notes: Notes) -> dict[str, Any] | None:
    """Return the contacts with walls as arrays of a `Snapshot`, from the force of each wall on each atom, or None."""
    parts = []
    for wall, (number, outward) in WALLS.items():
        names = [f"{wall}_{component}" for component in ("fx", "fy")]
        if not any(name in atoms for name in names):
            notes.add(f"no force of the {wall} wall in the dump of atoms: no contacts with it")
            continue
        fx, fy = (atoms.get(name, np.zeros(len(atoms["id"]))) for name in names)
        discs = np.flatnonzero((fx != 0) | (fy != 0))
        normal = np.tile(outward, (len(discs), 1))
        force = -np.column_stack((fx, fy))[discs]  # on the wall
        normal_force = np.sum(force * normal, axis=1)
        n = len(discs)
        overlap = normal_force / values["wall_stiffness"]
        reach = atoms["radius"][discs] - overlap
        parts.append(
            {
                "contact_ids": np.column_stack((discs, np.full(n, number))),
                "contact_point": np.column_stack((atoms["x"], atoms["y"]))[discs] + reach[:, None] * normal,
                "contact_normal": normal,
                "overlap": overlap,
                "normal_force": normal_force,
                "tangential_force": force[:, 1] * normal[:, 0] - force[:, 0] * normal[:, 1],
                "moment": np.zeros(n),
                "normal_stiffness": np.full(n, values["wall_stiffness"]),
                "tangential_stiffness": np.full(n, values["wall_tangential_stiffness"]),
                "rolling_stiffness": np.zeros(n),
                "friction": np.full(n, values["wall_friction"]),
                "rolling_limit": np.zeros(n),
            }
        )
    if not parts:
        return None
    notes.add("overlap with a wall: normal force over wall_stiffness")
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def joined(pairs: dict[str, Any], walls: dict[str, Any] | None) -> dict[str, Any]:
    """Return the contacts of both kinds, those between atoms first."""
    if walls is None:
        return pairs
    return {name: np.concatenate((pairs[name], walls[name])) for name in pairs}
