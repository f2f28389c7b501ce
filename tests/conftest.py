"""Fixtures for all tests: run folders to read and to break."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_folders import snapshot_arrays, write_manifest, write_run

from harness.running.yade_environment import find_yade
from yade_scripts import export_format


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave real runs out where there is no YADE, and there alone; the summary of the tests says so. CI refuses."""
    if find_yade() is None:
        if os.environ.get("CI"):
            raise pytest.UsageError("YADE is not installed, and CI is set: ./run setup installs it")
        for item in items:
            if item.get_closest_marker("yade"):
                item.add_marker(pytest.mark.skip(reason="YADE is not installed (./run setup installs it)"))


@pytest.fixture(scope="session")
def _run_original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("original") / "seed1-0123abcd")


@pytest.fixture(name="write_run", scope="session")
def _write_run() -> Callable[..., Path]:
    """Make a complete run: write_run(folder, parameters, n_snapshots=3, **changes of the manifest)."""
    return write_run


@pytest.fixture
def run_folder(_run_original: Path, tmp_path: Path) -> Path:
    """A complete run of three snapshots, free to be broken."""
    return Path(shutil.copytree(_run_original, tmp_path / _run_original.name))


@pytest.fixture
def rewrite() -> Callable[..., None]:
    """Change arrays of a snapshot, and the manifest with it when `vouched`."""

    def change(folder: Path, index: int = 1, vouched: bool = True, **arrays: Any) -> None:
        path = folder / export_format.SNAPSHOTS / f"{export_format.snapshot_name(index)}.npz"
        content = snapshot_arrays(0.001 * index, 10 * index) | arrays
        np.savez(path, **{name: values for name, values in content.items() if values is not None})
        if vouched:
            write_manifest(folder)

    return change
