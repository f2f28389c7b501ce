"""Fixtures that run the real YADE: a script in a process of its own, and runs that several tests look at."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from yade_run_files import BIAXIAL, SMALL, RunScript

from harness.running.yade_environment import Yade, find_yade
from yade_scripts import export_format

collect_ignore = ["stress_probe.py", "options_probe.py", "save_states.py"]  # for YADE's Python, not for this one


@pytest.fixture(scope="session")
def yade() -> Yade:
    found = find_yade()
    if found is None:
        pytest.skip("YADE is not installed")
    return found


@pytest.fixture(scope="session")
def run_script(yade: Yade) -> RunScript:
    """Run a script with YADE: run_script(script, *arguments, by_command=False)."""

    def run(script: Path, *arguments: Any, by_command: bool = False) -> subprocess.CompletedProcess[str]:
        words = [str(script), *map(str, arguments)]
        command = [yade.command, "-n", "-x", *words] if by_command else yade.invocation(Path(words[0]), words[1:])
        return subprocess.run(
            command, env=yade.environment(), capture_output=True, text=True, timeout=400, check=False, cwd="/"
        )

    return run


@pytest.fixture
def killed_at_checkpoint(yade: Yade) -> Callable[..., None]:
    """Begin a run and kill it once it has saved its state: killed_at_checkpoint(file of parameters, script)."""

    def begin_and_kill(file: Path, script: Path = BIAXIAL) -> None:
        command = yade.invocation(script, [str(file), "--checkpoint-every", "0.1"])
        with subprocess.Popen(command, env=yade.environment(), stdout=subprocess.DEVNULL) as process:
            try:
                deadline = time.monotonic() + 300
                while not list(file.parent.glob("checkpoint-*")) and time.monotonic() < deadline:
                    assert process.poll() is None, "the run ended before its first checkpoint"
                    time.sleep(0.01)
            finally:
                process.kill()

    return begin_and_kill


@pytest.fixture(scope="session")
def make_run(run_script: RunScript) -> Callable[..., Path]:
    """Make a run in a folder: make_run(folder, by_command=False, **parameters), which must succeed."""

    def make(folder: Path, by_command: bool = False, **parameters: Any) -> Path:
        folder.mkdir(parents=True)
        file = folder / export_format.PARAMETERS
        file.write_text(json.dumps(SMALL | parameters))
        done = run_script(BIAXIAL, file, by_command=by_command)
        assert done.returncode == 0, done.stderr
        return folder

    return make


@pytest.fixture(scope="session")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="session")
def rough(make_run: Callable[..., Path], study: Path) -> Path:
    """A run with rolling friction 0.2."""
    return make_run(study / "runs" / "rough")


@pytest.fixture(scope="session")
def smooth(make_run: Callable[..., Path], rough: Path) -> Path:
    """The same run without rolling friction and with masses by size, from the same packing."""
    return make_run(rough.parent / "smooth", rolling_friction=0.0, mass="true")
