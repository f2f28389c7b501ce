"""The examples of docs/model.md run."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from harness import cli

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "model.md").read_text()
COMMANDS = [line.split("#")[0].strip() for line in PAGE.splitlines() if line.startswith("forcechain model")]


def test_python_example_runs():
    (example,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(example, "docs/model.md", "exec"), names)
    assert names["path"].energy_error < 1e-12


@pytest.mark.parametrize("command", COMMANDS)
def test_command_runs(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(shlex.split(command)[1:]) == 0
    assert capsys.readouterr().out or list(tmp_path.iterdir())


def test_pictures_are_there():
    pictures = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", PAGE)
    assert len(pictures) >= 5
    assert all((Path(__file__).resolve().parents[2] / "docs" / picture).is_file() for picture in pictures)
