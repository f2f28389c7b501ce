"""Study files: what a good one plans, and the one line a bad one ends in."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from harness.errors import InputError
from harness.reading.exports import run_folders
from harness.study import RunSettings, read_study, study_in

DEMO = Path(__file__).parents[2] / "studies" / "demo.toml"


def write(folder: Path, text: str) -> Path:
    path = folder / "trial.toml"
    path.write_text(text)
    return path


def test_the_demo_is_the_paper_small() -> None:
    study = read_study(DEMO)
    first, second = study.planned_runs()
    assert study.name == "demo"
    assert first.parameters["particle_count"] == 600
    assert first.parameters["rolling_friction"] == 0.2
    assert (first.parameters["seed"], second.parameters["seed"]) == (1, 2)


def test_a_grid_makes_every_combination_with_readable_ids(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "seeds = [1, 2]\n[parameters]\nparticle_count = 100\n"
        "[grid]\nrolling_friction = [0.2, 0.05]\nsize_distribution = ['bidisperse', 'uniform']\n",
    )
    study = read_study(path)
    ids = [run.run_id for run in study.planned_runs()]
    assert study.name == "trial"
    assert len(set(ids)) == 8
    assert ids[0].startswith("mu_r0.2-bidisperse-seed1-")
    assert len(ids[0].rsplit("-", 1)[1]) == 8
    varied = {(run.parameters["rolling_friction"], run.parameters["seed"]) for run in study.planned_runs()}
    assert varied == {(0.2, 1), (0.2, 2), (0.05, 1), (0.05, 2)}


def test_an_id_tells_every_parameter_and_does_not_care_how_it_was_given(tmp_path: Path) -> None:
    def only_id(text: str) -> str:
        return read_study(write(tmp_path, text)).planned_runs()[0].run_id

    plain = only_id("[parameters]\nfriction = 0.7\n")
    assert only_id("") == plain  # the default, said or not
    assert only_id("[parameters]\nfriction = 0.70\n[run]\njobs = 3\n") == plain
    assert only_id("[parameters]\nfriction = 0.71\n") != plain
    assert only_id("[parameters]\nparticle_count = 5098.0\n") == plain


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("sead = [1]", "unknown key 'sead'; did you mean 'seeds'?"),
        ("rolling_friction = 0.2", "it is a parameter: put it under [parameters] or [grid]"),
        (
            "[parameters]\nroling_friction = 0.2",
            "unknown parameter 'roling_friction'; did you mean 'rolling_friction'?",
        ),
        ("[grid]\nroling_friction = [0.2]", "unknown parameter 'roling_friction'; did you mean 'rolling_friction'?"),
        ("[parameters]\nfriction = 'high'", "friction: expected a number from 0 up to 10, found 'high'"),
        ("[parameters]\nfriction = -1", "friction: expected a number from 0 up to 10"),
        ("[parameters]\nseed = 1", "list the seeds at the top"),
        ("[parameters]\nfriction = 0.1\n[grid]\nfriction = [0.1]", "'friction' stands in [parameters] and in [grid]"),
        ("[grid]\nfriction = 0.1", "[grid] friction: expected a list of values, found 0.1"),
        ("[grid]\nfriction = []", "[grid] friction: expected a list of values, found []"),
        ("[grid]\nfriction = [0.1, 0.1]", "two runs have the same parameters"),
        ("seeds = [1, 1]", "two runs have the same parameters"),
        ("seeds = [-1]", "seeds: expected whole numbers from 0"),
        ("seeds = [true]", "seeds: expected whole numbers from 0"),
        ("seeds = []", "seeds: expected whole numbers from 0"),
        ("grid = 3", "grid: expected a table [grid], found 3"),
        ("name = '../up'", "name: expected letters"),
        ("script = 'biaxal'", "script: expected 'biaxial', 'punch' or the path of a script, found no file"),
        ("[run]\njob = 2", "[run] unknown key 'job'; did you mean 'jobs'?"),
        ("[run]\njobs = 0", "[run] jobs: expected a whole number above 0, found 0"),
        ("[run]\nretries = -1", "[run] retries: expected a whole number from 0, found -1"),
        ("[run]\nservo_bound = 'small'", "[run] servo_bound: expected a number above 0, found 'small'"),
        ("[run]\nservo_bound = nan", "[run] servo_bound: expected a number above 0, found nan"),
        ("x = = 1", "not TOML"),
    ],
)
def test_a_bad_study_ends_in_one_line(tmp_path: Path, text: str, expected: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_study(path)
    assert expected in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_study_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such study file"):
        read_study(tmp_path / "none.toml")


def test_run_settings_are_read(tmp_path: Path) -> None:
    path = write(tmp_path, "[run]\njobs = 3\ntime_limit_s = 60\nservo_bound = 0.05\n")
    assert read_study(path).run == RunSettings(jobs=3, time_limit_s=60, servo_bound=0.05)


def test_a_script_of_the_users_own_takes_any_parameter(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("")
    study = read_study(write(tmp_path, "script = 'mine.py'\n[grid]\ndepth = [1, 2.5]\n"))
    assert study.script == str(tmp_path / "mine.py")
    assert [dict(run.parameters) for run in study.planned_runs()] == [
        {"depth": 1, "seed": 1},
        {"depth": 2.5, "seed": 1},
    ]
    with pytest.raises(InputError, match=r"depth: expected a number, a string, true or false, found \[1\]"):
        read_study(write(tmp_path, "script = 'mine.py'\n[parameters]\ndepth = [1]\n"))


def test_results_know_their_study_and_its_runs(tmp_path: Path, write_run: Callable[..., Path]) -> None:
    results = tmp_path / "results"
    study = read_study(write(tmp_path, "seeds = [2, 1]\n[parameters]\nparticle_count = 10\n"))
    folders = [write_run(results / "runs" / run.run_id, run.parameters) for run in study.planned_runs()]
    write_run(results / "runs" / "left-from-before")
    assert study_in(results) is None
    (results / "study.toml").write_text(study.source.read_text())
    assert run_folders(results) == tuple(folders)
    for directory in (results, folders[0]):
        found = study_in(directory)
        assert found is not None
        assert found.seeds == (2, 1)
