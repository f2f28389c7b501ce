"""Stage one of every verdict: each figure decides, on both sides of its bound, and a figure not told is no pass."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from harness.reading.validity import faults, judge
from harness.running.run_state import State, state_of
from harness.study import RunSettings

GOOD: dict[str, Any] = {
    "script": "biaxial.py",
    "preparation": {"solid_fraction": 0.858},
    "validity": {
        "servo_error_max": 0.0199,
        "unbalanced_force_max": 0.02,
        "inertial_number": 1e-4,
        "kinetic_over_elastic_max": 0.015,
        "overlap_max": 0.2,
        "escaped_discs": 0,
        "settled": True,
    },
}


def with_figure(part: str, name: str, value: object) -> dict[str, Any]:
    changed = {**GOOD[part], name: value}
    if value is None:
        del changed[name]
    return {**GOOD, part: changed}


def test_a_good_run_is_valid() -> None:
    figures = judge(GOOD, RunSettings())
    assert len(figures) == 8
    assert all(figure.passed for figure in figures)
    assert faults(figures) is None


@pytest.mark.parametrize(
    ("part", "name", "value", "told"),
    [
        ("validity", "servo_error_max", 0.0201, "is 0.0201, expected at most 0.02"),
        ("validity", "servo_error_max", float("nan"), "is not told"),
        ("validity", "servo_error_max", None, "is not told"),
        ("validity", "servo_error_max", "small", "is not told"),
        ("validity", "unbalanced_force_max", 0.06, "is 0.06, expected at most 0.05"),
        ("validity", "inertial_number", 0.0011, "is 0.0011, expected at most 0.001"),
        ("validity", "inertial_number", None, "is not told"),
        ("validity", "kinetic_over_elastic_max", 0.051, "is 0.051, expected at most 0.05"),
        ("validity", "kinetic_over_elastic_max", None, "is not told"),
        ("validity", "overlap_max", 0.6, "is 0.6, expected at most 0.5"),
        ("validity", "overlap_max", float("inf"), "is inf, expected at most 0.5"),
        ("validity", "escaped_discs", 1, "is 1, expected at most 0"),
        ("validity", "settled", False, "is 0, expected at least 1"),
        ("preparation", "solid_fraction", 0.829, "is 0.829, expected at least 0.83 and at most 0.87"),
        ("preparation", "solid_fraction", 0.871, "is 0.871, expected at least 0.83 and at most 0.87"),
    ],
)
def test_each_figure_alone_makes_a_run_invalid(part: str, name: str, value: object, told: str) -> None:
    figures = judge(with_figure(part, name, value), RunSettings())
    assert [figure.name for figure in figures if not figure.passed] == [name]
    reason = faults(figures)
    assert reason is not None
    assert name in reason
    assert told in reason


def test_the_study_sets_the_bounds() -> None:
    assert faults(judge(with_figure("validity", "servo_error_max", 0.04), RunSettings(servo_bound=0.05))) is None
    assert faults(judge(GOOD, RunSettings(servo_bound=0.01))) is not None
    fast = with_figure("validity", "inertial_number", 2e-3)
    assert faults(judge(fast, RunSettings(inertial_number_bound=5e-3))) is None
    shaken = with_figure("validity", "kinetic_over_elastic_max", 0.1)
    assert faults(judge(shaken, RunSettings(kinetic_over_elastic_bound=0.2))) is None


def test_a_script_of_the_users_own_is_judged_by_what_it_tells() -> None:
    assert judge({"script": "mine.py"}, RunSettings()) == ()
    own = {"script": "mine.py", "validity": {"servo_error_max": 0.5}}
    assert [figure.passed for figure in judge(own, RunSettings())] == [False]


def test_an_invalid_run_is_not_done(run_folder: Path) -> None:
    assert state_of(run_folder, RunSettings()).state is State.DONE
    path = run_folder / "run.json"
    manifest = json.loads(path.read_text())
    manifest["validity"]["servo_error_max"] = 0.03
    path.write_text(json.dumps(manifest))
    state = state_of(run_folder, RunSettings())
    assert state.state is State.INVALID
    assert state.reason is not None
    assert "servo_error_max" in state.reason
