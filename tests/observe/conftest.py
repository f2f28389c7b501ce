"""One small biaxial test in real YADE, for the tests marked `yade`."""

from __future__ import annotations

from pathlib import Path

import pytest

from harness.cli import main
from harness.reading.exports import Run, read_run, run_folders

STUDY = """
name = "observed"
script = "biaxial"
seeds = [1]

[parameters]
particle_count = 400
final_axial_strain = 0.07
"""


@pytest.fixture(scope="session")
def real_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """400 discs to 7% axial strain, past the peak."""
    folder: Path = tmp_path_factory.mktemp("observed")
    study = folder / "observed.toml"
    study.write_text(STUDY)
    assert main(["run", str(study), "--out", str(folder / "out"), "--jobs", "1"]) == 0
    return read_run(run_folders(folder / "out")[0])
