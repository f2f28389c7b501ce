"""The script under the real yade-batch: a table of two small runs, and tables that are wrong."""

from __future__ import annotations

import ast
import json
import subprocess
from pathlib import Path

import pytest
from yade_run_files import BIAXIAL, RunScript, manifest_of

from harness.cli import main
from harness.reading.exports import run_folders
from harness.running.yade_environment import Yade
from harness.study import read_study
from yade_scripts import batch_table

pytestmark = pytest.mark.yade

TABLE = """rolling_friction! seed! particle_count final_axial_strain snapshot_strain_interval size_distribution !THREADS
0.2   7   200  0.012   1e-3   'bidisperse'   1    # the first
0.05  =   =    =       =      *              =
"""


@pytest.fixture(scope="module")
def batch(yade: Yade, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which yade-batch has run a table."""
    command = Path(f"{Path(yade.command).resolve()}-batch")
    if not command.is_file():
        pytest.skip("this YADE has no yade-batch")
    folder = tmp_path_factory.mktemp("batch")
    (folder / "two.table").write_text(TABLE)
    done = subprocess.run(
        [command, "--jobs=2", "--plot-update=0", "--log=%.log", "two.table", BIAXIAL],
        env={name: value for name, value in yade.environment().items() if name != "OMP_NUM_THREADS"},
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    return folder


def test_each_line_leaves_a_whole_run(batch: Path) -> None:
    runs = sorted((batch / "two" / "runs").iterdir())
    assert [run.name.rsplit("-", 1)[0] for run in runs] == ["mu_r0.05-seed7", "mu_r0.2-bidisperse-seed7"]
    for run, friction in zip(runs, (0.05, 0.2), strict=True):
        manifest = manifest_of(run)
        found = {name: entry["value"] for name, entry in manifest["parameters"].items()}
        assert manifest["status"] == "done"
        assert manifest["provenance"]["threads"] == 1
        assert (found["rolling_friction"], found["size_distribution"], found["seed"]) == (friction, "bidisperse", 7)
        assert (found["particle_count"], found["final_axial_strain"]) == (200, 0.012)
        assert json.loads((run / "parameters.json").read_text()) == found
        assert len(manifest["products"]["snapshots"]) == 13


def test_the_runs_are_those_of_a_study_with_the_same_table(batch: Path) -> None:
    (batch / "trial.toml").write_text("table = 'two.table'\n")
    planned = {run.run_id: dict(run.parameters) for run in read_study(batch / "trial.toml").planned_runs()}
    found = {run.name: json.loads((run / "parameters.json").read_text()) for run in run_folders(batch / "two")}
    assert found == planned


def test_the_results_can_be_analysed(batch: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["analyse", str(batch / "two")])
    assert status == 0, capsys.readouterr().err
    assert (batch / "two" / "analysis" / "runs.csv").read_text().count("seed7") == 2


def test_yades_own_reader_finds_the_same(batch: Path, run_script: RunScript, tmp_path: Path) -> None:
    script = tmp_path / "theirs.py"
    script.write_text(
        "import json, sys, yade.utils\n"
        "rows = yade.utils.TableParamReader(sys.argv[1]).paramDict()\n"
        "print('rows', json.dumps({line: row for line, row in rows.items()}))\n"
    )
    done = run_script(script, batch / "two.table")
    (line,) = (text for text in done.stdout.splitlines() if text.startswith("rows "))
    theirs = {int(number): row for number, row in json.loads(line.removeprefix("rows ")).items()}
    ours = {row.line: row.values for row in batch_table.read(batch / "two.table")}
    assert list(ours) == list(theirs)
    for number, values in ours.items():
        words = {
            name: word
            for name, word in theirs[number].items()
            if name != "description" and name[0] != "!" and word != "*"
        }
        assert values == {name: ast.literal_eval(word) for name, word in words.items()}


@pytest.mark.parametrize(
    ("content", "line", "told"),
    [
        ("friction\n1/2", 2, "some.table:2: friction: expected a number"),
        ("fricton\n0.2", 2, "did you mean 'friction'?"),
        ("friction\n0.2", 3, "some.table:3: expected the line of a run, one of 2"),
    ],
)
def test_a_bad_table_is_one_line_and_status_2(yade: Yade, tmp_path: Path, content: str, line: int, told: str) -> None:
    (tmp_path / "some.table").write_text(content)
    done = subprocess.run(
        yade.invocation(BIAXIAL, []),
        env=yade.environment() | {"YADE_BATCH": f"some.table:{line}"},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["some.table"]


def test_without_parameters_and_table(run_script: RunScript) -> None:
    done = run_script(BIAXIAL)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "expected PARAMETERS.json, or a line of a table from yade-batch; --help tells more"
    ]
