"""A biaxial test in two dimensions: discs between four rigid walls, compressed along y at a constant rate.

Run it by YADE, `yade -n -x yade_scripts/biaxial.py PARAMETERS.json`, or by the system's Python with YADE's Python
folder on PYTHONPATH (no prompt, no ports). The run's folder gets snapshots, a history and, last, `run.json`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

SCRIPT = Path(sys.argv[0] if __name__ == "__main__" else __file__).resolve()
if __name__ == "__main__":
    # Last: installed, that folder holds the packages of another Python, which must not hide YADE's own
    sys.path.append(str(SCRIPT.parent.parent))
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # one thread repeats bit for bit; read when YADE is imported

# ruff: noqa: E402
from yade_scripts import command, course, parameters
from yade_scripts.sample import Sample


def run(values: Mapping[str, Any], folder: Path, packings: Path, checkpoint_every: float) -> None:
    """Make the whole test, or what a killed run has left of it; the run's folder is complete when this returns."""
    course.run(SCRIPT, parameters.BIAXIAL, Sample, values, folder, packings, checkpoint_every)


if __name__ == "__main__":
    sys.exit(command.main(SCRIPT, __doc__, parameters.BIAXIAL, run, sys.argv[1:]))
