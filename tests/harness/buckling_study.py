"""A study made by hand whose every number is known: columns of discs zigzag more and more as their force falls."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from run_folders import write_manifest

from yade_scripts import export_format

RADIUS = 1.14e-3
STIFFNESS = 1.05e5
DROP = (0.005, 0.009)  # axial strains over which the columns buckle
INTERVAL = 2.5e-4
N_SNAPSHOTS = 45
N_COLUMNS = 4
LENGTH = 5  # discs of a column: three segments each
GROWTH_DEG = 5.0
FORCE = (12.0, 8.0)  # N, at the start and the end of the drop
LATERAL = 1.5  # N, from a weak disc on the middle disc of every segment
ROTATION_DEG = 10.0
PEAK = 0.7


def first_angle_deg(seed: int) -> float:
    """Buckling angle of every segment before the drop."""
    return 12.0 + seed


def _share(axial_strain: float) -> float:
    return float(np.clip((axial_strain - DROP[0]) / (DROP[1] - DROP[0]), 0, 1))


def arrays(axial_strain: float, seed: int, force_factor: float = 1.0) -> dict[str, Any]:
    """Tables of one instant: `N_COLUMNS` zigzag columns, and beside each inner disc a weak one that presses on it."""
    angle = np.radians(first_angle_deg(seed) + GROWTH_DEG * _share(axial_strain))
    force = force_factor * (FORCE[0] + (FORCE[1] - FORCE[0]) * _share(axial_strain))
    centres, contacts = [], []
    for column in range(N_COLUMNS):
        first = len(centres)
        side = np.where(np.arange(LENGTH) % 2, 1.0, 0.0)
        x = 20 * RADIUS * column + 2 * RADIUS * np.sin(angle) * side
        y = 2 * RADIUS * np.cos(angle) * np.arange(LENGTH)
        centres += list(zip(x, y, strict=True))
        for disc in range(LENGTH - 1):
            contacts.append((first + disc, first + disc + 1, force))
        contacts.append((first, -3, force))
        contacts.append((first + LENGTH - 1, -4, force))
        for disc in range(1, LENGTH - 1):  # pressed back towards the line 1-3
            outward = 1.0 if disc % 2 else -1.0
            centres.append((x[disc] + outward * 2 * RADIUS, y[disc]))
            contacts.append((len(centres) - 1, first + disc, LATERAL))
    position = np.array(centres)
    n = len(position)
    ids = np.array([(a, b) for a, b, _ in contacts])
    wall = ids[:, 1] < 0
    down = np.array([[0.0, -1.0]])
    normal = np.where(ids[:, 1:] == -3, down, -down)
    branch = position[np.maximum(ids[:, 1], 0)] - position[ids[:, 0]]
    normal = np.where(wall[:, None], normal, branch / np.maximum(np.linalg.norm(branch, axis=1), 1e-9)[:, None])
    point = position[ids[:, 0]] + RADIUS * normal
    m = len(ids)
    particle = {
        "id": np.arange(n),
        "radius": np.full(n, RADIUS),
        "x": position[:, 0],
        "y": position[:, 1],
        "rotation": np.radians(ROTATION_DEG)
        * _share(axial_strain)
        * np.arange(n),  # ends of a segment: two steps apart
        **dict.fromkeys(("vx", "vy", "spin"), np.zeros(n)),
    }
    contact = {
        "id1": ids[:, 0],
        "id2": ids[:, 1],
        "x": point[:, 0],
        "y": point[:, 1],
        "nx": normal[:, 0],
        "ny": normal[:, 1],
        "overlap": np.zeros(m),
        "fn": np.array([load for _, _, load in contacts]),
        **dict.fromkeys(("ft", "moment"), np.zeros(m)),
        "kn": np.full(m, STIFFNESS),
        "kt": np.full(m, 0.5 * STIFFNESS),
        "kr": np.where(wall, 0.0, 0.5 * STIFFNESS * RADIUS**2),
        "friction": np.where(wall, 0.0, 0.7),
        "rolling_limit": np.where(wall, 0.0, 0.2 * RADIUS),
    }
    found: dict[str, Any] = {
        "axial_strain": axial_strain,
        "time": axial_strain,
        "iteration": round(axial_strain / 1e-7),
    }
    found |= {f"particle_{name}": values for name, values in particle.items()}
    return found | {f"contact_{name}": values for name, values in contact.items()}


def write_buckling_run(folder: Path, seed: int, force_factor: float = 1.0, **changes: Any) -> Path:
    """Make the complete run of `seed`."""
    (folder / export_format.SNAPSHOTS).mkdir(parents=True)
    strains = INTERVAL * np.arange(N_SNAPSHOTS)
    for index, strain in enumerate(strains):
        path = folder / export_format.SNAPSHOTS / f"{export_format.snapshot_name(index)}.npz"
        np.savez(path, **arrays(float(strain), seed, force_factor))
    names = export_format.names(export_format.HISTORY_COLUMNS)
    lines = [",".join(names)]
    for strain in np.arange(0, strains[-1] + 1e-5, 1e-4):
        ratio = PEAK * min(1.0, 0.9 + 20 * strain) - 0.2 * _share(strain)
        values = {"axial_strain": strain, "lateral_strain": -strain, "stress_ratio": ratio}
        lines.append(",".join(f"{values.get(name, 0):.9g}" for name in names))
    (folder / export_format.HISTORY).write_text("\n".join(lines) + "\n")
    given = {"seed": seed, "smallest_radius": RADIUS, "largest_radius": RADIUS}
    snapshots = [{"index": index, "axial_strain": float(strain)} for index, strain in enumerate(strains)]
    write_manifest(folder, given, **changes)
    _replace_snapshots(folder, snapshots)
    return folder


def _replace_snapshots(folder: Path, snapshots: list[dict[str, Any]]) -> None:
    path = folder / export_format.MANIFEST
    manifest = json.loads(path.read_text())
    manifest["products"]["snapshots"] = snapshots
    path.write_text(json.dumps(manifest))


def write_buckling_study(directory: Path, seeds: tuple[int, ...] = (1, 2, 3)) -> Path:
    """Make a folder with a run a seed."""
    for seed in seeds:
        write_buckling_run(directory / "runs" / f"seed{seed}", seed)
    return directory
