"""A run as CSV tables of format 1: what a spreadsheet or any script reads, and this package reads back unchanged."""

from __future__ import annotations

from pathlib import Path

from harness.exchange.new_folder import new_folder
from harness.exchange.snapshot_tables import contact_table, particle_table, write_history, write_origin, write_table
from harness.reading.exports import Run
from harness.reading.snapshot_files import CONTACTS_CSV, PARTICLES_CSV
from yade_scripts import export_format


def write_csv_run(run: Run, folder: Path) -> Path:
    """Write every snapshot of `run`, their index and its history as CSV into the new folder `folder`, and return it.

    Numbers have the digits that give them back exactly. The run's parameters go to `origin.json`: its manifest vouches
    for other files than these. Raises InputError when a snapshot cannot be read or `folder` is there already.
    """
    with new_folder(folder) as making:
        rows = []
        for number, snapshot in zip(run.snapshot_index.tolist(), run.snapshots(), strict=True):
            stem = f"{export_format.SNAPSHOTS}/{export_format.snapshot_name(number)}"
            write_table(making, stem + PARTICLES_CSV, particle_table(snapshot))
            write_table(making, stem + CONTACTS_CSV, contact_table(snapshot))
            rows.append((number, snapshot.axial_strain, snapshot.time, snapshot.iteration))
        index = dict(zip(("index", *export_format.SNAPSHOT_SCALARS), zip(*rows, strict=True), strict=True))
        write_table(making, f"{export_format.SNAPSHOTS}/{export_format.SNAPSHOT_INDEX}", index)
        if run.history is not None:
            write_history(making, run.history)
        origin = {"source": run.name, "source_format": "run folder", "parameters": dict(run.parameters)}
        write_origin(making, origin)
    return folder
