"""One snapshot's files (an npz, or a pair of CSV tables): finding them, and making a checked Snapshot of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from forcechain.observe.snapshot import Snapshot
from harness.errors import InputError
from harness.reading import tables
from yade_scripts import export_format
from yade_scripts.export_format import CONTACT_COLUMNS, PARTICLE_COLUMNS, Column

PARTICLES_CSV = ".particles.csv"
CONTACTS_CSV = ".contacts.csv"
NPZ = ".npz"
ITERATION = Column("iteration", "-", True, "step number")


def places(folder: Path) -> tuple[Path, Path]:
    """Return where the snapshots of a run may lie: their own folder, or, of other origin, the run's."""
    return folder / export_format.SNAPSHOTS, folder


def numbered_files(folder: Path) -> dict[str, Path]:
    """Numbered snapshot files of a folder: stem to the file that stands for the snapshot."""
    found: dict[str, Path] = {}
    for place in places(folder):
        for ending in (PARTICLES_CSV, NPZ):
            for path in place.glob(f"*{ending}"):
                stem = path.name.removesuffix(ending)
                if stem.isascii() and stem.isdigit():
                    found[stem] = path
    return found


def find_file(folder: Path, index: int) -> Path | None:
    """Return the file that stands for snapshot number `index`, or None."""
    stem = export_format.snapshot_name(index)
    for place in places(folder):
        for ending in (NPZ, PARTICLES_CSV):
            if (place / (stem + ending)).exists():
                return place / (stem + ending)
    return None


def read_contents(path: Path, where: str) -> dict[Path, bytes]:
    """Return the files of a snapshot with their content: the npz, or particles and then contacts.

    InputError for a name that is none of a snapshot, or a file that cannot be read.
    """
    paths = [path]
    if path.suffix != NPZ:
        if not path.name.endswith(PARTICLES_CSV):
            raise InputError(f"{where}: expected a snapshot's {NPZ} or {PARTICLES_CSV} file, found {path.name}")
        paths.append(path.with_name(path.name.removesuffix(PARTICLES_CSV) + CONTACTS_CSV))
    return {item: tables.read_bytes(item, f"{where}: {item.name}") for item in paths}


def scalars_of(archive: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the axial strain, time and step number of an npz; InputError where one is missing or no number."""
    values: dict[str, Any] = {}
    for name in export_format.SNAPSHOT_SCALARS:
        value = archive.get(name)
        if value is None or np.asarray(value).ndim or np.asarray(value).dtype.kind not in "iuf":
            found = "nothing" if value is None else f"{np.asarray(value).dtype} of shape {np.asarray(value).shape}"
            raise InputError(f"{where}: {name}: expected one number, found {found}")
        number = np.asarray(value).item()
        if not np.isfinite(number):
            raise InputError(f"{where}: {name}: expected a finite number, found {number}")
        if name == ITERATION.name and (number != int(number) or abs(number) > np.iinfo(np.int64).max):
            raise InputError(f"{where}: {name}: expected a whole number of 64 bits, found {number}")
        values[name] = number
    return values


def build(path: Path, contents: Mapping[Path, bytes], scalars: Mapping[str, Any], where: str) -> Snapshot:
    """Return the snapshot in `contents` (as `read_contents` gives them); `scalars` count for CSV tables alone.

    InputError in one line that begins with `where` and names file, table, row, what was expected and what was found.
    """
    if path.suffix == NPZ:
        where = f"{where}: {path.name}"
        archive = tables.read_npz(contents[path], where)
        scalars = scalars_of(archive, where)
        particles = tables.checked(archive, PARTICLE_COLUMNS, "particles", where, "particle_")
        contacts = tables.checked(archive, CONTACT_COLUMNS, "contacts", where, "contact_")
    else:
        particle_file, contact_file = contents
        read = {item: tables.read_csv(contents[item], f"{where}: {item.name}") for item in contents}
        particles = tables.checked(read[particle_file], PARTICLE_COLUMNS, "particles", f"{where}: {particle_file.name}")
        contacts = tables.checked(read[contact_file], CONTACT_COLUMNS, "contacts", f"{where}: {contact_file.name}")
        where = f"{where}: {path.name.removesuffix(PARTICLES_CSV)}"
    particles = _in_order_of_id(particles, where)
    try:
        return Snapshot(
            axial_strain=float(scalars["axial_strain"]),
            time=float(scalars["time"]),
            iteration=int(scalars["iteration"]),
            radius=particles["radius"],
            position=np.stack((particles["x"], particles["y"]), axis=1),
            rotation=particles["rotation"],
            velocity=np.stack((particles["vx"], particles["vy"]), axis=1),
            spin=particles["spin"],
            contact_ids=np.stack((contacts["id1"], contacts["id2"]), axis=1),
            contact_point=np.stack((contacts["x"], contacts["y"]), axis=1),
            contact_normal=np.stack((contacts["nx"], contacts["ny"]), axis=1),
            overlap=contacts["overlap"],
            normal_force=contacts["fn"],
            tangential_force=contacts["ft"],
            moment=contacts["moment"],
            normal_stiffness=contacts["kn"],
            tangential_stiffness=contacts["kt"],
            rolling_stiffness=contacts["kr"],
            friction=contacts["friction"],
            rolling_limit=contacts["rolling_limit"],
        )
    except ValueError as error:
        raise InputError(f"{where}: {error}; export particles and contacts at one step") from None


def _in_order_of_id(particles: tables.Table, where: str) -> tables.Table:
    ids = particles["id"]
    n_particles = len(ids)
    wrong = (ids < 0) | (ids >= n_particles)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise InputError(
            f"{where}: particles row {row}, column 'id': expected 0 to {n_particles - 1} ({n_particles} particles), "
            f"found {ids[row]}; number the particles from 0 without gaps"
        )
    order = np.argsort(ids, kind="stable")
    repeated = ids[order][1:] == ids[order][:-1]
    if repeated.any():
        row = int(order[1:][int(np.argmax(repeated))])
        raise InputError(f"{where}: particles row {row}, column 'id': {ids[row]} is there twice")
    return {name: values[order] for name, values in particles.items()}
