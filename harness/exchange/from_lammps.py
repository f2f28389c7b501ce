"""Dumps of LAMMPS and LIGGGHTS to a run in format 1: atoms renumbered, forces split by the contact's geometry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from forcechain.arrays import FloatArray, IntArray
from forcechain.observe.macroscopic import box_of
from forcechain.observe.snapshot import Snapshot
from harness.errors import InputError
from harness.exchange.dump_tables import (
    Dialect,
    Names,
    Notes,
    joined,
    read_atoms,
    read_pairs,
    sorted_ids,
    wall_contacts,
)
from harness.exchange.dumps import Frame, find_frames
from harness.exchange.new_folder import new_folder
from harness.exchange.snapshot_tables import write_run, write_table

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


def import_dumps(source: Path, folder: Path, dialect: Dialect, settings: Mapping[str, float], names: Names) -> int:
    """Read the dumps in the folder `source`, write a run into `folder`; return the number of its snapshots.

    `settings` are of `SETTINGS`. Atoms are renumbered from 0 in the order of their ids; `ids.csv` has both numbers.
    Raises InputError in one line for anything that is missing, inconsistent or not a number.
    """
    values = _settings(settings)
    atoms, pairs = find_frames(source)
    lonely = sorted(atoms.keys() ^ pairs.keys())
    if lonely:
        frame = atoms.get(lonely[0]) or pairs[lonely[0]]
        raise InputError(f"{frame.where}: the other dump has no such time step; dump atoms and pairs at the same steps")
    frames = [(atoms[step], pairs[step]) for step in sorted(atoms)]
    notes = Notes()
    with new_folder(folder) as making:
        strains = _strains(frames, dialect, values, names, notes)
        snapshots = _snapshots(frames, dialect, values, names, strains, notes)
        ids = sorted_ids(frames[0][0].read(names.atoms), frames[0][0].where)
        write_table(making, "ids.csv", {"id": np.arange(len(ids)), "atom": ids})
        # notes fill while snapshots are made, so origin.json reads them when it is written: last
        origin = {"source": source.resolve().name, "source_format": dialect.name, "settings": values, "notes": notes}
        return write_run(making, snapshots, None, origin)


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


def _strains(
    frames: Sequence[tuple[Frame, Frame]],
    dialect: Dialect,
    values: Mapping[str, float],
    names: Names,
    notes: Notes,
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
    notes: Notes,
) -> Iterator[Snapshot]:
    first_ids: IntArray | None = None
    rotation: FloatArray = np.zeros(0)
    before: tuple[float, FloatArray] | None = None
    for number, (atom_frame, pair_frame) in enumerate(frames):
        atoms = read_atoms(atom_frame, names, notes)
        if first_ids is None:
            first_ids, rotation = atoms["id"], np.zeros(len(atoms["id"]))
        if not np.array_equal(first_ids, atoms["id"]):
            raise InputError(f"{atom_frame.where}: its atoms are not those of the first frame; none may come or go")
        time = _time(atom_frame, values)
        if before is not None:  # a sphere's angle is not dumped: trapezoidal rule
            rotation = rotation + 0.5 * (before[1] + atoms["omegaz"]) * (time - before[0])
        before = (time, atoms["omegaz"])
        contacts = joined(
            read_pairs(pair_frame, atoms, dialect, values, names, notes), wall_contacts(atoms, values, notes)
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
