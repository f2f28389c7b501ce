"""What the tests of real runs share: the scripts, the small run they all make, and how to read its files."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from yade_scripts import export_format

ROOT = Path(__file__).parents[2]
BIAXIAL = ROOT / "yade_scripts" / "biaxial.py"
SMALL = {"particle_count": 200, "final_axial_strain": 0.03, "snapshot_strain_interval": 1e-3, "seed": 7}

RunScript = Callable[..., subprocess.CompletedProcess[str]]


def manifest_of(run: Path) -> dict[str, Any]:
    return json.loads((run / export_format.MANIFEST).read_text())


def snapshot_of(run: Path, index: int) -> dict[str, np.ndarray]:
    with np.load(run / export_format.SNAPSHOTS / f"{export_format.snapshot_name(index)}.npz") as stored:
        return {name: stored[name] for name in stored.files}


def history_of(run: Path) -> np.ndarray:
    return np.genfromtxt(run / export_format.HISTORY, delimiter=",", names=True)
