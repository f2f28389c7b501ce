"""What a run has recorded so far: history rows and snapshots, and the manifest that vouches for them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from yade_scripts import checkpoint, export, export_format, parameters, run_folder

try:
    import yade
except ImportError:
    yade = None

Quantity = tuple[float, str]  # value and unit


class Recorder:
    """Collects the rows and snapshots of one run in its folder.

    Attributes:
        folder: the run's folder.
        rows: rows of the history, by column.
        snapshots: index, axial strain and time of each snapshot.
        largest_overlap: [m], over all snapshots.
        rotation: (n,) of the discs in the last snapshot [rad].
    """

    def __init__(self, folder: Path) -> None:
        """Start with nothing recorded."""
        self.folder = folder
        self.started = run_folder.now()
        self.rows: list[Mapping[str, float]] = []
        self.snapshots: list[dict[str, float]] = []
        self.products: dict[str, run_folder.Product] = {}
        self.largest_overlap = 0.0
        self.rotation: np.ndarray | None = None

    def discard_leftovers(self) -> None:
        """Remove what an earlier attempt has left in the folder: checkpoints of another run, snapshots, history."""
        checkpoint.clear(self.folder)
        for path in (self.folder / export_format.SNAPSHOTS).glob("[0-9]*.npz"):
            path.unlink()
        (self.folder / export_format.HISTORY).unlink(missing_ok=True)

    def snapshot(self, axial_strain: float, particles: export.Table, contacts: export.Table) -> None:
        """Write the next snapshot."""
        index = len(self.snapshots)
        product = export.write_tables(self.folder, index, axial_strain, particles, contacts)
        self.rotation = particles["rotation"]
        self.products[product.name] = product
        self.snapshots.append({"index": index, "axial_strain": axial_strain, "time": yade.O.time})
        self.largest_overlap = max(self.largest_overlap, float(contacts["overlap"].max(initial=0.0)))

    def state(self) -> dict[str, Any]:
        """Everything recorded so far, in plain lists and numbers, for a checkpoint."""
        return {
            "started": self.started,
            "rows": [dict(row) for row in self.rows],
            "snapshots": self.snapshots,
            "products": list(self.products.values()),
            "largest_overlap": self.largest_overlap,
            "rotation": None if self.rotation is None else self.rotation.tolist(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take over what `state` gave at a checkpoint."""
        self.started = state["started"]
        self.rows = state["rows"]
        self.snapshots = state["snapshots"]
        self.products = {name: run_folder.Product(name, size, sha256) for name, size, sha256 in state["products"]}
        self.largest_overlap = state["largest_overlap"]
        self.rotation = None if state["rotation"] is None else np.array(state["rotation"])

    def write_history(self) -> None:
        """Write the history's rows as they are now."""
        names = export_format.names(export_format.HISTORY_COLUMNS)
        rows = ([row[name] for name in names] for row in self.rows)
        product = run_folder.write_csv(self.folder, export_format.HISTORY, names, rows)
        self.products[product.name] = product

    def finish(
        self,
        script: Path,
        values: Mapping[str, Any],
        table: Sequence[parameters.Parameter],
        derived: Mapping[str, Quantity],
        **figures: Any,
    ) -> None:
        """Write the history and then the manifest of a run that is done; `figures` are its further parts."""
        self.write_history()
        manifest = {
            **heading(export_format.STATUS_DONE, script, values, table, self.started),
            "derived": {name: {"value": value, "unit": unit} for name, (value, unit) in derived.items()},
            **figures,
            "products": {
                "files": {
                    name: {"bytes": product.size, "sha256": product.sha256} for name, product in self.products.items()
                },
                "history_rows": len(self.rows),
                "snapshots": self.snapshots,
            },
        }
        run_folder.settle(self.folder)  # what the manifest vouches for outlives a power cut, as the manifest does
        run_folder.write_json(self.folder, export_format.MANIFEST, manifest, durable=True)


def heading(
    status: str, script: Path, values: Mapping[str, Any], table: Sequence[parameters.Parameter], started: str
) -> dict[str, Any]:
    """Parts that every manifest has, whether its run is done or has failed."""
    units = {parameter.name: parameter.unit for parameter in table}
    return {
        "format": export_format.FORMAT,
        "status": status,
        "script": script.name,
        "parameters": {name: {"value": value, "unit": units.get(name, "")} for name, value in values.items()},
        "provenance": run_folder.provenance(yade.config.version, values.get("seed"), started),
    }
