"""The command line: exit statuses, one line for what goes wrong, and what each command says of itself."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import forcechain
from harness import cli
from harness.commands import doctor
from harness.errors import InputError, RunError

FakeYade = Any  # of conftest.py
ROOT = Path(__file__).parents[2]
COMMANDS = cli.command_names()


def raising(error: BaseException) -> Callable[[argparse.Namespace], int]:
    def execute(_: argparse.Namespace) -> int:
        raise error

    return execute


@pytest.fixture
def status_raises(monkeypatch: pytest.MonkeyPatch) -> Callable[[BaseException], int]:
    def call(error: BaseException) -> int:
        monkeypatch.setattr(cli.load("status"), "execute", raising(error))
        return cli.main(["status", "."])

    return call


def test_the_commands_are_there() -> None:
    expected = {"doctor", "demo", "run", "status", "analyse", "compare", "report", "model", "export", "import"}
    assert expected <= set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_helps_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([name, "--help"]) == 0
    told = capsys.readouterr().out
    assert f"example: forcechain {name}" in told
    assert "exit status: 0 good" in told
    module = cli.load(name)
    assert "\n" not in module.HELP


def test_the_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    told = capsys.readouterr().out
    assert set(COMMANDS) <= {line.split()[0] for line in told.splitlines() if line.startswith("    ")}


def test_the_version_names_yades_too(fake_yade: FakeYade, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    expected = f"forcechain {forcechain.__version__}, YADE 2023.02a ({fake_yade.command})\n"
    assert capsys.readouterr().out == expected


@pytest.mark.parametrize(
    "arguments", [[], ["nonsense"], ["status"], ["run", "x.toml", "--jobs", "0"], ["status", "--j"]]
)
def test_wrong_usage_is_exit_status_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(arguments) == 2
    assert "usage: forcechain" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "status"), [(InputError("x.toml: unknown key\n'y'"), 2), (RunError("run a: failed:\n y"), 3)]
)
def test_an_expected_failure_is_one_line(
    error: Exception, status: int, status_raises: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert status_raises(error) == status
    told = capsys.readouterr().err
    assert told == f"forcechain: {' '.join(str(error).split())}\n"


def test_ctrl_c_is_one_line(status_raises: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert status_raises(KeyboardInterrupt()) == 130
    assert capsys.readouterr().err == "forcechain: interrupted\n"


def test_a_fault_of_our_own_is_not_hidden(status_raises: Callable[..., int]) -> None:
    with pytest.raises(ZeroDivisionError):
        status_raises(ZeroDivisionError())


def test_a_reader_that_leaves_is_no_fault(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    for number in range(3):
        write_run(tmp_path / f"run{number}")
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "harness", "status", str(tmp_path)]
    ended = subprocess.run(command, cwd=ROOT, stdout=writing, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_status_of_a_folder_without_runs_is_bad_input(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["status", str(tmp_path)]) == 2
    assert "no run in it" in capsys.readouterr().err


def test_status_of_single_runs(
    tmp_path: Path, write_run: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    good = write_run(tmp_path / "good")
    assert cli.main(["status", str(good)]) == 0
    assert capsys.readouterr().out == "good  done\n1 runs: 1 done\n"
    own = write_run(tmp_path / "own")
    (own / "run.json").unlink()
    (own / "parameters.json").write_text("{}")
    assert cli.main(["status", str(tmp_path)]) == 3
    assert capsys.readouterr().out.splitlines() == ["good  done", "own   waiting", "2 runs: 1 waiting, 1 done"]


def test_doctor_is_content(capsys: pytest.CaptureFixture[str], fake_yade: FakeYade) -> None:
    # A YADE whose Python can import it: this Python, and an empty package
    told = fake_yade.command.read_text().replace(str(fake_yade.home / "python-of-yade"), sys.executable)
    fake_yade.command.write_text(told)
    assert cli.main(["doctor", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["good"] is True
    names = [finding["name"] for finding in content["findings"]]
    assert names[0] == "forcechain"
    needed = {finding["name"] for finding in content["findings"] if not finding["optional"]}
    assert {"forcechain", "Python", "numpy", "scipy", "pandas", "matplotlib", "jinja2", "YADE", "YADE runs"} <= needed
    assert {"distributed", "ffmpeg"} == set(names) - needed


def test_doctor_tells_what_may_be_had_as_well(
    capsys: pytest.CaptureFixture[str], fake_yade: FakeYade, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = fake_yade.command.read_text().replace(str(fake_yade.home / "python-of-yade"), sys.executable)
    fake_yade.command.write_text(told)
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(doctor.importlib.metadata, "requires", lambda _: ["no-such-library>=1; extra == 'dask'"])
    assert cli.main(["doctor"]) == 0  # nothing that is needed is missing
    lines = capsys.readouterr().out.splitlines()
    for name, remedy in (("no-such-library", "pip install 'no-such-library>=1'"), ("ffmpeg", "apt-get install")):
        place = next(row for row, line in enumerate(lines) if line.startswith(f"-   {name}"))
        assert remedy in lines[place + 1]


def test_doctor_names_the_remedy(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("YADE_COMMAND", raising=False)
    monkeypatch.setenv("PATH", "")
    assert cli.main(["doctor"]) == 3
    told = capsys.readouterr().out
    assert "NO  YADE" in told
    assert "mend it with: " in told
    assert "apt-get install --no-install-recommends yade" in told


def test_doctor_sees_a_broken_and_an_old_yade(fake_yade: FakeYade, capsys: pytest.CaptureFixture[str]) -> None:
    told = fake_yade.command.read_text().replace(str(fake_yade.home / "python-of-yade"), sys.executable)
    fake_yade.command.write_text(told.replace("2023.02a", "2019.01a"))
    (fake_yade.home / "py" / "yade" / "__init__.py").write_text("raise ImportError('libboost is missing')")
    assert cli.main(["doctor", "--json"]) == 3
    findings = {finding["name"]: finding for finding in json.loads(capsys.readouterr().out)["findings"]}
    assert "older than 2023.02" in findings["YADE"]["found"]
    assert "importing it fails (ImportError: libboost is missing)" in findings["YADE runs"]["found"]
    assert not findings["YADE"]["good"]
    assert not findings["YADE runs"]["good"]


def test_doctor_sees_a_missing_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        doctor.importlib.metadata, "requires", lambda _: ["no-such-library>=1", "numpy", "x; extra == 'd'"]
    )
    missing, there = doctor._libraries()
    assert (missing.name, missing.good, there.good) == ("no-such-library", False, True)
    assert missing.remedy is not None
    assert missing.remedy.endswith("-m pip install 'no-such-library>=1'")


def test_the_demo_runs_compares_and_reports(
    fake_yade: FakeYade, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps: list[tuple[str, Path]] = []
    for name, status in (("compare", 1), ("report", 0)):

        def execute(options: argparse.Namespace, name: str = name, status: int = status) -> int:
            steps.append((name, options.directory))
            return status

        monkeypatch.setattr(cli.load(name), "execute", execute)
    assert cli.main(["demo", "--out", str(tmp_path / "out")]) == 1
    assert steps == [("compare", tmp_path / "out"), ("report", tmp_path / "out")]
    steps.clear()
    monkeypatch.setattr(cli.load("compare"), "execute", raising(InputError("no drop")))
    assert cli.main(["demo", "--out", str(tmp_path / "out")]) == 2  # complete runs are not made again
    assert steps == []
    fake_yade.behave({2: "crash"})
    assert cli.main(["demo", "--out", str(tmp_path / "second")]) == 3
    assert steps == []
