"""From snapshots back to the tables of run-folder format 1, and these into a folder of that format."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from forcechain import __version__
from forcechain.observe.macroscopic import Box, box_of, contact_stress, coordination, solid_fraction
from forcechain.observe.snapshot import Snapshot
from harness.reading.tables import Table
from yade_scripts import export_format
from yade_scripts.export import archive
from yade_scripts.run_folder import write, write_csv, write_json

ORIGIN = "origin.json"  # where a folder without a manifest comes from


def particle_table(snapshot: Snapshot) -> Table:
    """Return the particle columns of format 1, each (n_particles,), in their order."""
    return {
        "id": np.arange(snapshot.n_particles),
        "radius": snapshot.radius,
        "x": snapshot.position[:, 0],
        "y": snapshot.position[:, 1],
        "rotation": snapshot.rotation,
        "vx": snapshot.velocity[:, 0],
        "vy": snapshot.velocity[:, 1],
        "spin": snapshot.spin,
    }


def contact_table(snapshot: Snapshot) -> Table:
    """Return the contact columns of format 1, each (n_contacts,), in their order."""
    return {
        "id1": snapshot.contact_ids[:, 0],
        "id2": snapshot.contact_ids[:, 1],
        "x": snapshot.contact_point[:, 0],
        "y": snapshot.contact_point[:, 1],
        "nx": snapshot.contact_normal[:, 0],
        "ny": snapshot.contact_normal[:, 1],
        "overlap": snapshot.overlap,
        "fn": snapshot.normal_force,
        "ft": snapshot.tangential_force,
        "moment": snapshot.moment,
        "kn": snapshot.normal_stiffness,
        "kt": snapshot.tangential_stiffness,
        "kr": snapshot.rolling_stiffness,
        "friction": snapshot.friction,
        "rolling_limit": snapshot.rolling_limit,
    }


def write_snapshot(folder: Path, index: int, snapshot: Snapshot) -> None:
    """Write snapshot number `index` of the run in `folder` as an npz archive."""
    arrays: dict[str, Any] = {
        "axial_strain": np.float64(snapshot.axial_strain),
        "time": np.float64(snapshot.time),
        "iteration": np.int64(snapshot.iteration),
    }
    arrays |= {f"particle_{name}": values for name, values in particle_table(snapshot).items()}
    arrays |= {f"contact_{name}": values for name, values in contact_table(snapshot).items()}
    write(folder, f"{export_format.SNAPSHOTS}/{export_format.snapshot_name(index)}.npz", archive(arrays))


def write_table(folder: Path, name: str, table: Mapping[str, Any]) -> None:
    """Write a table of numbers as CSV, every number with the digits that give it back exactly."""
    columns = [np.asarray(values).tolist() for values in table.values()]  # plain numbers print shortest
    write_csv(folder, name, list(table), zip(*columns, strict=True))


def write_history(folder: Path, history: pd.DataFrame) -> None:
    """Write a run's history as CSV, every number with the digits that give it back exactly."""
    write(folder, export_format.HISTORY, history.to_csv(index=False).encode())


def write_origin(folder: Path, origin: Mapping[str, Any]) -> None:
    """Write where the tables in `folder` come from, and what was assumed of them."""
    write_json(folder, ORIGIN, {"format": export_format.FORMAT, "package_version": __version__} | dict(origin))


def write_run(
    folder: Path, snapshots: Iterable[Snapshot], history: pd.DataFrame | None, origin: Mapping[str, Any]
) -> int:
    """Write a run of other origin into `folder`, one snapshot in memory at a time; return their number.

    Without a `history` one is made: a row a snapshot that bears a load.
    """
    rows: list[dict[str, float]] = []
    number = 0
    for number, snapshot in enumerate(snapshots, start=1):
        write_snapshot(folder, number - 1, snapshot)
        if history is None:
            rows += history_rows(snapshot)
    if history is None and rows:
        history = pd.DataFrame(rows)
    if history is not None:
        write_history(folder, history)
    write_origin(folder, origin)
    return number


def history_rows(snapshot: Snapshot) -> list[dict[str, float]]:
    """Return the row of the history that a snapshot gives; none when its mean stress is not above zero.

    Stresses are those of the contacts, over the area between the four walls, or without them over the rectangle round
    all discs; the stress ratio does not depend on that choice.
    """
    box = _box(snapshot)
    if not (snapshot.n_contacts and box.width > 0 and box.height > 0):
        return []
    stress = contact_stress(snapshot, box.area)
    lateral, axial = float(stress[0, 0]), float(stress[1, 1])
    if not lateral + axial > 0:
        return []
    return [
        {
            "axial_strain": snapshot.axial_strain,
            "axial_stress": axial,
            "lateral_stress": lateral,
            "stress_ratio": (axial - lateral) / (axial + lateral),
            "solid_fraction": solid_fraction(snapshot, box.area),
            "coordination": coordination(snapshot).every_particle,
            "time": snapshot.time,
            "iteration": snapshot.iteration,
        }
    ]


def _box(snapshot: Snapshot) -> Box:
    if set(snapshot.contact_ids[:, 1].tolist()) >= {-1, -2, -3, -4}:
        return box_of(snapshot)
    low = (snapshot.position - snapshot.radius[:, None]).min(axis=0)
    high = (snapshot.position + snapshot.radius[:, None]).max(axis=0)
    return Box(left=float(low[0]), right=float(high[0]), bottom=float(low[1]), top=float(high[1]))
