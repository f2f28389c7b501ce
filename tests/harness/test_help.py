"""What a user meets first: help that fits a screen, completion in a real shell, studies to start from."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from harness import cli
from harness.bundled import bundled_results, bundled_studies
from harness.commands import studies
from harness.study import read_study

COMMANDS = cli.command_names()
COLUMNS, LINES = 80, 40
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("arguments", [[], *([name] for name in COMMANDS)], ids=lambda words: words[0] if words else "")
def test_every_help_fits_a_screen(
    arguments: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))
    assert cli.main([*arguments, "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= LINES
    assert [line for line in lines if len(line) > COLUMNS] == []


def test_an_example_of_several_lines_can_be_pasted() -> None:
    given = "forcechain approve results/demo --baseline baselines/a-rather-long-name.toml --reason 'checked by hand'"
    told = cli._example(given).removeprefix("example: ")
    assert len(told.splitlines()) > 1
    echoed = subprocess.run(["bash", "-c", f"printf '%s\\n' {told}"], capture_output=True, text=True, check=True)
    assert echoed.stdout.splitlines()[-1] == "checked by hand"


@pytest.fixture(scope="module")
def completion_script() -> str:
    printed = [sys.executable, "-m", "harness", "--print-completion", "bash"]
    return subprocess.run(printed, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def completed(words: str, script: str, folder: Path) -> set[str]:
    """What bash offers for the last of `words`, by the script that the command prints."""
    shell = """
        source /dev/stdin <<<"$1"
        shift
        COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*" COMP_POINT=${#COMP_LINE}
        entry=$(complete -p forcechain)
        function=${entry##*-F } && ${function% *} forcechain "${@: -1}" "${@: -2:1}"
        printf '%s\\n' "${COMPREPLY[@]}"
    """
    command = ["bash", "--norc", "-c", shell, "bash", script, *words.split(" ")]
    told = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert told.stderr == ""
    return set(told.stdout.split())


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("forcechain ana", {"analyse"}),
        ("forcechain run --eng", {"--engine"}),
        ("forcechain export x --to v", {"vtk"}),
        ("forcechain studies --keys ", set(studies.TABLES)),
        ("forcechain run my", {"my.toml", "my_folder"}),
        ("forcechain compare my", {"my_folder"}),
        ("forcechain nonsense", set()),
    ],
)
def test_bash_completes(words: str, offered: set[str], completion_script: str, tmp_path: Path) -> None:
    (tmp_path / "my.toml").touch()
    (tmp_path / "my_folder").mkdir()
    assert completed(words, completion_script, tmp_path) == offered


def test_every_bundled_study_is_listed_and_printed_to_the_letter(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["studies", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {"demo", "paper"} <= set(told)
    assert all(told.values()), "a study that does not say what it is"
    for name, file in bundled_studies().items():
        assert cli.main(["studies", name]) == 0
        assert capsys.readouterr().out == file.read_text()
        read_study(file)


def test_results_that_come_along_are_copied_whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copy = tmp_path / "copy"
    assert cli.main(["studies", "paper", "--out", str(copy)]) == 0
    source = bundled_results("paper")
    files = {file.relative_to(source) for file in source.rglob("*") if file.is_file()}
    assert files == {file.relative_to(copy) for file in copy.rglob("*") if file.is_file()}
    assert cli.main(["studies", "paper", "--out", str(copy)]) == 2  # never over what is there
    assert "found one with files" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["demo"], "no results of this study come along"), (["papr"], "did you mean 'paper'?"), ([], "name of a study")],
)
def test_results_that_do_not_come_along_are_one_line(
    arguments: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["studies", *arguments, "--out", str(tmp_path / "copy")]) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "copy").exists()


def test_a_study_that_is_not_there_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["studies", "dmo"]) == 2
    assert "did you mean 'demo'?" in capsys.readouterr().err


@pytest.mark.parametrize("table", studies.TABLES)
def test_the_printed_table_is_a_study_with_every_default(table: str, tmp_path: Path) -> None:
    file = tmp_path / "all.toml"
    script = 'script = "punch"\n' if table == "punch" else ""
    file.write_text(script + studies.toml(table))
    given = tomllib.loads(file.read_text())["parameters" if table == "punch" else table]
    with_defaults = {entry.name for entry in studies.keys(table) if entry.default}
    assert set(given) == with_defaults
    study = read_study(file)
    plain = tmp_path / "plain.toml"
    plain.write_text(f'name = "all"\n{script}')
    assert study.planned_runs() == read_study(plain).planned_runs()
    assert study.run == read_study(plain).run


@pytest.mark.parametrize("table", studies.TABLES)
def test_every_name_of_a_table_says_what_it_means(table: str) -> None:
    assert [entry.name for entry in studies.keys(table) if not entry.meaning] == []
