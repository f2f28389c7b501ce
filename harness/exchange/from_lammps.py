"""Dumps of LAMMPS and LIGGGHTS to a run in format 1: atoms renumbered, forces split by the contact's geometry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from forcechain.arrays import FloatArray, IntArray
from forcechain.observe.macroscopic import box_of
from forcechain.observe.snapshot import Snapshot
from harness.errors import InputError
from harness.exchange.dumps import Frame, find_frames
from harness.exchange.new_folder import new_folder
from harness.exchange.snapshot_tables import write_run, write_table
from harness.tables import Table, checked
from yade_scripts.export_format import Column

SETTINGS = {
    "normal_stiffness": "of every contact between discs [N/m]; needed",
    "tangential_stiffness": "of every contact between discs [N/m]; 0",
    "friction": "coefficient of sliding friction [-]; 0",
    "rolling_stiffness": "k_roll [N/m]; times the effective radius squared: the rolling stiffness; 0",
    "rolling_friction": "mu_roll [-]; times the effective radius: the largest moment over the normal force; 0",
    "wall_stiffness": "normal stiffness of contacts with walls [N/m]; that of the discs",
    "wall_tangential_stiffness": "of contacts with walls [N/m]; 0",
    "wall_friction": "coefficient of sliding friction at walls [-]; 0",
    "time_step": "[s], where the dump has no ITEM: TIME",
    "strain_rate": "engineering axial strain per second since the first frame [1/s]; without it, walls or box tell",
}
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


def import_dumps(source: Path, folder: Path, dialect: Dialect, settings: Mapping[str, float], names: Names) -> int:
    """Read the dumps in the folder `source`, write a run into `folder`; return the number of its snapshots.

    `settings` are of `SETTINGS`. Atoms are renumbered from 0 in the order of their ids; `ids.csv` has both numbers.
    Raises InputError in one line for anything that is missing, inconsistent or not a number.
    """
    values = _settings(settings)
    atoms, pairs = find_frames(source)
    for step, frame in atoms.items():
        if step not in pairs:
            raise InputError(f"{frame.where}: there is no dump of pairs at this time step; dump both every N steps")
    frames = [(atoms[step], pairs[step]) for step in sorted(atoms)]
    notes = _Notes()
    with new_folder(folder) as making:
        strains = _strains(frames, dialect, values, names, notes)
        snapshots = _snapshots(frames, dialect, values, names, strains, notes)
        ids = _ids(frames[0][0].read(names.atoms), frames[0][0].where)
        write_table(making, "ids.csv", {"id": np.arange(len(ids)), "atom": ids})
        # notes fill while snapshots are made, so origin.json reads them when it is written: last
        origin = {"source": source.resolve().name, "source_format": dialect.name, "settings": values, "notes": notes}
        return write_run(making, snapshots, None, origin)


class _Notes(list[str]):
    """What was assumed, each thing once."""

    def add(self, note: str) -> None:
        if note not in self:
            self.append(note)


def _settings(given: Mapping[str, float]) -> dict[str, float]:
    if "normal_stiffness" not in given:
        raise InputError("--set normal_stiffness=N/m is needed: dumps do not tell stiffnesses, energies need them")
    for name, value in given.items():
        least = "above 0" if name in ("normal_stiffness", "wall_stiffness", "time_step") else "of at least 0"
        if value < 0 or (value == 0 and least == "above 0"):
            raise InputError(f"--set {name}: expected a value {least}, found {value:g}")
    return {
        "tangential_stiffness": 0.0,
        "friction": 0.0,
        "rolling_stiffness": 0.0,
        "rolling_friction": 0.0,
        "wall_stiffness": given["normal_stiffness"],
        "wall_tangential_stiffness": 0.0,
        "wall_friction": 0.0,
    } | dict(given)


def _time(frame: Frame, values: Mapping[str, float]) -> float:
    if frame.time is not None:
        return frame.time
    if "time_step" not in values:
        raise InputError(f"{frame.where}: no ITEM: TIME in it: give --set time_step=SECONDS (dump_modify time yes)")
    return frame.time_step * values["time_step"]


def _ids(table: Table, where: str) -> IntArray:
    ids: IntArray = np.sort(checked(table, ATOM_COLUMNS[:1], "atoms", where)["id"])
    repeated = ids[1:] == ids[:-1]
    if repeated.any():
        raise InputError(f"{where}: atom {ids[int(np.argmax(repeated))]} is there twice")
    return ids


def _strains(
    frames: Sequence[tuple[Frame, Frame]],
    dialect: Dialect,
    values: Mapping[str, float],
    names: Names,
    notes: _Notes,
) -> list[float]:
    """Return the engineering axial strain of each frame: from the rate, from the walls, or from the box."""
    times = [_time(atoms, values) for atoms, _ in frames]
    if "strain_rate" in values:
        notes.add("axial strain: strain_rate times the time since the first frame")
        return [values["strain_rate"] * (time - times[0]) for time in times]
    heights = [atoms.box[1][1] - atoms.box[1][0] for atoms, _ in frames]
    if len(frames) == 1:
        notes.add("axial strain: 0, one frame alone")
        return [0.0]
    if len(set(heights)) > 1:
        notes.add("axial strain: decrease of the box's height over the first")
        return [1 - height / heights[0] for height in heights]
    try:
        boxes = [box_of(snapshot) for snapshot in _snapshots(frames, dialect, values, names, None, notes)]
    except ValueError as error:
        raise InputError(
            f"{frames[0][0].path.parent.name}: the axial strain is unknown: the box keeps its height, and of walls: "
            f"{error}; give --set strain_rate=PER_SECOND"
        ) from None
    notes.add("axial strain: decrease of the distance between bottom and top wall over the first")
    return [1 - box.height / boxes[0].height for box in boxes]


def _snapshots(
    frames: Sequence[tuple[Frame, Frame]],
    dialect: Dialect,
    values: Mapping[str, float],
    names: Names,
    strains: Sequence[float] | None,
    notes: _Notes,
) -> Iterator[Snapshot]:
    first_ids: IntArray | None = None
    rotation: FloatArray = np.zeros(0)
    before: tuple[float, FloatArray] | None = None
    for number, (atom_frame, pair_frame) in enumerate(frames):
        atoms = _atoms(atom_frame, names, notes)
        if first_ids is None:
            first_ids, rotation = atoms["id"], np.zeros(len(atoms["id"]))
        if not np.array_equal(first_ids, atoms["id"]):
            raise InputError(f"{atom_frame.where}: its atoms are not those of the first frame; none may come or go")
        time = _time(atom_frame, values)
        if before is not None:  # a sphere's angle is not dumped: trapezoidal rule
            rotation = rotation + 0.5 * (before[1] + atoms["omegaz"]) * (time - before[0])
        before = (time, atoms["omegaz"])
        contacts = _joined(
            _pairs(pair_frame, atoms, dialect, values, names, notes), _wall_contacts(atoms, values, notes)
        )
        try:
            yield Snapshot(
                axial_strain=0.0 if strains is None else strains[number],
                time=time,
                iteration=atom_frame.time_step,
                radius=atoms["radius"],
                position=np.column_stack((atoms["x"], atoms["y"])),
                rotation=rotation,
                velocity=np.column_stack((atoms["vx"], atoms["vy"])),
                spin=atoms["omegaz"],
                **contacts,
            )
        except ValueError as error:
            raise InputError(f"{atom_frame.where}: {error}") from None


def _atoms(frame: Frame, names: Names, notes: _Notes) -> Table:
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
    if "z" in found and len(found["z"]) and np.ptp(found["z"]) > FLATNESS * np.mean(found["radius"]):
        raise InputError(f"{frame.where}: expected centres in one plane z, found them {np.ptp(found['z']):g} m apart")
    for name in ("vx", "vy", "omegaz"):
        if name not in found:
            notes.add(f"no column {name} in the dump of atoms: taken as 0" + ", rotations too" * (name == "omegaz"))
            found[name] = np.zeros(len(found["id"]))
    if "omegaz" in table:
        notes.add("rotations: integral of omegaz over the frames (trapezoidal rule), 0 at the first")
    _ids(found, frame.where)
    order = np.argsort(found["id"], kind="stable")
    return {name: values[order] for name, values in found.items()}


def _pairs(
    frame: Frame, atoms: Table, dialect: Dialect, values: Mapping[str, float], names: Names, notes: _Notes
) -> dict[str, Any]:
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


def _wall_contacts(atoms: Table, values: Mapping[str, float], notes: _Notes) -> dict[str, Any] | None:
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


def _joined(pairs: dict[str, Any], walls: dict[str, Any] | None) -> dict[str, Any]:
    if walls is None:
        return pairs
    return {name: np.concatenate((pairs[name], walls[name])) for name in pairs}
