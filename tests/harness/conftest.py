"""A YADE that is none: what the harness does when runs crash, hang, truncate or lie."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

FAKE = Path(__file__).with_name("fake_yade.py")


class FakeYade:
    """The stand-in's folder, and what it was called for."""

    def __init__(self, home: Path) -> None:
        self.home = home
        self.command = home / "yade"

    def behave(self, told: Mapping[int | str, str | list[str]]) -> None:
        content = {str(seed): what if isinstance(what, list) else [what] for seed, what in told.items()}
        if "packing" in told:
            content["packing"] = told["packing"]
        (self.home / "behaviour.json").write_text(json.dumps(content))

    def calls(self) -> list[str]:
        path = self.home / "calls.txt"
        return path.read_text().splitlines() if path.exists() else []

    def processes(self) -> list[int]:
        path = self.home / "processes.txt"
        return [int(line) for line in path.read_text().split()] if path.exists() else []


@pytest.fixture
def fake_yade(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeYade:
    """Put a fake YADE in the place of the real one, its command's text as YADE's own."""
    home = tmp_path / "fake"
    library = home / "py"
    (library / "yade").mkdir(parents=True)
    (library / "yade" / "__init__.py").write_text("")
    python = home / "python-of-yade"
    python.write_text(f"#!{sys.executable}\nimport runpy, sys\nrunpy.run_path({str(FAKE)!r}, run_name='__main__')\n")
    command = home / "yade"
    command.write_text(
        f"#!{python}\n# encoding: utf-8\nsys.path.insert(1,'{library}')\n"
        "features,version,debugbuild=' LOGGER VTK'.split(' '),'2023.02a',' '\n"
    )
    for path in (python, command):
        path.chmod(0o755)
    monkeypatch.setenv("YADE_COMMAND", str(command))
    monkeypatch.setenv("FAKE_YADE", str(home))
    return FakeYade(home)


@pytest.fixture
def write_study(tmp_path: Path) -> Callable[..., Path]:
    """Write a study file of small runs: write_study(seeds, run={...}, text="...")."""

    def write(seeds: list[int], run: Mapping[str, Any] | None = None, text: str = "") -> Path:
        lines = ['name = "trial"', f"seeds = {seeds}", text, "[parameters]", "particle_count = 10", "[run]"]
        lines += [f"{name} = {value}" for name, value in (run or {}).items()]
        path = tmp_path / "trial.toml"
        path.write_text("\n".join(lines) + "\n")
        return path

    return write
