"""Run folders made by hand: what a run leaves, small, so that a test can break one thing in it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from yade_scripts import export_format, parameters

RADIUS = 1e-3
OVERLAP = 1e-6
SIDE = 3


def snapshot_arrays(axial_strain: float = 0.0, iteration: int = 0) -> dict[str, Any]:
    """A square lattice of 3 x 3 equal discs, its side discs in contact with walls: 12 + 12 contacts."""
    kn = 1e5
    step = 2 * RADIUS - OVERLAP
    x, y = (values.ravel() * step for values in np.meshgrid(np.arange(SIDE), np.arange(SIDE)))
    ids = np.arange(SIDE * SIDE)
    first, second, nx, ny = [], [], [], []
    for disc in ids:
        column, row = disc % SIDE, disc // SIDE
        for di, dj, wall in ((1, 0, -2), (0, 1, -4), (-1, 0, -1), (0, -1, -3)):
            inside = 0 <= column + di < SIDE and 0 <= row + dj < SIDE
            if inside and di + dj < 0:
                continue  # listed by the neighbour
            first.append(disc)
            second.append(disc + di + SIDE * dj if inside else wall)
            nx.append(di)
            ny.append(dj)
    n = len(first)
    particle = {
        "id": ids,
        "radius": np.full(ids.size, RADIUS),
        "x": x,
        "y": y,
        **dict.fromkeys(("rotation", "vx", "vy", "spin"), np.zeros(ids.size)),
    }
    contact = {
        "id1": np.array(first),
        "id2": np.array(second),
        "x": x[first] + RADIUS * np.array(nx),
        "y": y[first] + RADIUS * np.array(ny),
        "nx": np.array(nx, float),
        "ny": np.array(ny, float),
        "overlap": np.full(n, OVERLAP),
        "fn": np.full(n, kn * OVERLAP),
        **dict.fromkeys(("ft", "moment"), np.zeros(n)),
        "kn": np.full(n, kn),
        "kt": np.full(n, kn / 2),
        "kr": np.full(n, kn / 2 * RADIUS**2),
        "friction": np.full(n, 0.7),
        "rolling_limit": np.full(n, 0.2 * RADIUS),
    }
    arrays: dict[str, Any] = {"axial_strain": axial_strain, "time": axial_strain / 8e-3, "iteration": iteration}
    arrays |= {f"particle_{name}": values for name, values in particle.items()}
    arrays |= {f"contact_{name}": values for name, values in contact.items()}
    return arrays


def write_manifest(folder: Path, given: Mapping[str, Any] | None = None, **changes: Any) -> None:
    """Write run.json for what stands in `folder`, as a run does at its end."""
    files = {
        path.relative_to(folder).as_posix(): {
            "bytes": path.stat().st_size,
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        }
        for path in sorted(folder.rglob("*"))
        if path.suffix in (".npz", ".csv")
    }
    snapshots = [
        {"index": index, "axial_strain": 0.001 * index}
        for index, _ in enumerate(sorted(folder.glob("snapshots/*.npz")))
    ]
    units = {parameter.name: parameter.unit for parameter in parameters.BIAXIAL}
    manifest = {
        "format": export_format.FORMAT,
        "status": export_format.STATUS_DONE,
        "failure": None,
        "script": "biaxial.py",
        "parameters": {
            name: {"value": value, "unit": units.get(name, "")} for name, value in parameters.check(given or {}).items()
        },
        "provenance": {"yade": "2023.02a"},
        "steps": 100,
        "timings": {"total_s": 1.0},
        "preparation": {"solid_fraction": 0.858, "coordination": 4.3},
        "validity": {
            "servo_error_max": 0.01,
            "servo_error_mean": 0.001,
            "unbalanced_force_max": 0.01,
            "overlap_max": 0.05,
            "inertial_number": 1e-4,
            "kinetic_over_elastic_max": 0.01,
            "escaped_discs": 0,
            "settled": True,
        },
        "products": {"files": files, "history_rows": 3, "snapshots": snapshots},
    }
    manifest |= changes
    (folder / export_format.MANIFEST).write_text(json.dumps(manifest))


def write_run(folder: Path, given: Mapping[str, Any] | None = None, n_snapshots: int = 3, **changes: Any) -> Path:
    """Make a complete run of `n_snapshots` at strains 0, 0.001, ..."""
    (folder / export_format.SNAPSHOTS).mkdir(parents=True)
    for index in range(n_snapshots):
        path = folder / export_format.SNAPSHOTS / f"{export_format.snapshot_name(index)}.npz"
        np.savez(path, **snapshot_arrays(0.001 * index, 10 * index))
    names = export_format.names(export_format.HISTORY_COLUMNS)
    rows = [",".join(names)]
    rows += [",".join("0" if name != "axial_strain" else f"{0.001 * row:.6f}" for name in names) for row in range(3)]
    (folder / export_format.HISTORY).write_text("\n".join(rows) + "\n")
    write_manifest(folder, given, **changes)
    return folder
