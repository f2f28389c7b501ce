"""forcechain calibrate: from a study's tables to parameters.toml, and what it prints."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from buckling_study import LATERAL, RADIUS, STIFFNESS, write_buckling_study

from forcechain.calibration import Column
from forcechain.theory.parameters import TABLE_3
from forcechain.theory.three_particle import loading
from harness.analysing.analysis import analyse
from harness.analysing.buckling_data import Analysis
from harness.cli import main
from harness.comparing import stretches
from harness.comparing.calibrations import calibrate_study, segment_histories
from harness.figures.calibration import calibration_figure
from harness.toml_text import dumps


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", (1, 2, 3))


@pytest.fixture(scope="module")
def found(study: Path) -> Analysis:
    return analyse(study, jobs=1)


def following_the_model(analysis: Analysis) -> Analysis:
    """The same segments, their forces and displacements replaced by the model's at the mean angles."""
    segments = analysis.segments.copy()
    mean = segments.groupby("increment")["buckling_angle_deg"].transform("mean")
    state = loading(TABLE_3, np.radians(mean.to_numpy()))
    first = loading(TABLE_3, np.radians(mean[segments["increment"] == 0].iloc[0]))
    segments["axial_force_N"] = state.axial_force
    segments["normal_displacement_over_R"] = state.normal_displacement_over_R
    segments["axial_displacement_over_R"] = state.axial_displacement_over_R - first.axial_displacement_over_R
    segments["rotation_deg"] = np.degrees(state.rotation - first.rotation)
    segments["lateral_force_N"] = float(TABLE_3.lateral_strength * TABLE_3.radius)
    return replace(analysis, segments=segments)


def test_tables_reach_the_fit_in_si_units(found: Analysis) -> None:
    runs = segment_histories(found.segments)
    assert len(runs) == 3
    assert runs[0].buckling_angle[0] == pytest.approx(np.radians(13.0))
    assert runs[2].lateral_force == pytest.approx(LATERAL)


def test_a_study_that_follows_the_model_gives_its_parameters(found: Analysis) -> None:
    calibrations, without = calibrate_study(following_the_model(found), {}, columns=(Column.PERFECT,))
    assert not without
    (both,) = calibrations.values()
    chain, lateral, strength = both[Column.PERFECT].estimates
    assert chain.value == pytest.approx(0.014, rel=0.01)
    assert strength.value == pytest.approx(0.024, rel=1e-6)
    assert lateral.interval.low <= 0.06 <= lateral.interval.high
    reference = {"lateral_strength": 0.03}
    calibrations, _ = calibrate_study(following_the_model(found), reference, columns=(Column.PERFECT,))
    force = next(iter(calibrations.values()))[Column.PERFECT].goodness[0]
    assert force.calibrated < 0.01 < force.reference  # the study's own ratios are what the fit is compared with


def test_the_command_writes_parameters_that_read_back(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", str(study), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    content = tomllib.loads(Path(document["parameters"]).read_text(encoding="utf-8"))
    (case,) = content["cases"]
    assert case["name"] == "rolling_friction 0.2"
    for column in ("perfect", "imperfect"):
        strength = case[column]["parameters"]["lateral_strength"]
        assert strength["value"] == pytest.approx(LATERAL / RADIUS / STIFFNESS)
        assert strength["identified"] == "measured"
        assert strength["unit"] == "normal_stiffness"
        fit = document["cases"][case["name"]][column]["goodness_of_fit"]["axial_force"]
        assert case[column]["goodness_of_fit"]["axial_force"] == fit
    assert content["provenance"]["runs"] == ["seed1", "seed2", "seed3"]
    assert "bound (30)" in content["method"]
    assert main(["calibrate", str(study)]) == 0
    table = capsys.readouterr().out
    assert "lateral_strength" in table
    assert "n.r.m.s." in table


def test_too_few_segments_are_not_calibrated_and_named(found: Analysis) -> None:
    few = replace(found, segments=found.segments[found.segments["segment"] == 0])
    calibrations, without = calibrate_study(few, {})
    assert not calibrations
    assert without == {"rolling_friction 0.2": "too few buckled segments: 3, expected at least 5"}


def test_toml_reads_back_what_was_written() -> None:
    content = {
        "format": 1,
        "words": 'quote " backslash \\ line\nend \x7f µ',
        "truth": True,
        "numbers": [0.1, -2.0, 1e-9],
        "empty": [],
        "table": {"a key": 1, "deeper": {"x": [[1.0, 2.0], [3.0, 4.0]]}},
        "rows": [{"name": "a", "inner": {"y": 1}}, {"name": "b", "more": [{"z": 2}]}],
    }
    assert tomllib.loads(dumps(content)) == content
    assert tomllib.loads(dumps({"here": 1, "not": None})) == {"here": 1}
    with pytest.raises(ValueError, match="finite number"):
        dumps({"value": float("nan")})
    with pytest.raises(ValueError, match="expected a number, words"):
        dumps({"value": object()})


def test_stretches_are_counted_and_a_calibration_is_drawn(found: Analysis, monkeypatch: pytest.MonkeyPatch) -> None:
    calibrations, _ = calibrate_study(found, {}, columns=(Column.PERFECT,), samples=40, profile_points=5)
    monkeypatch.setattr(stretches, "LENGTHS", (3,))  # the fit itself is tested where it is made
    ((case, fits),) = stretches.calibrate_stretches(found, calibrations).items()
    calibration = calibrations[case][Column.PERFECT]
    assert fits.ledger == {
        "buckled segments": calibration.n_segments,
        "branched stretches": 0,
        "stretches of 5 particles": calibration.n_segments // 3,  # columns of five discs: three segments each
    }
    assert fits.without == {3: "too few stretches: 0, expected at least 8"}
    assert tomllib.loads(dumps(stretches.as_plain(fits)))["not_fitted"]["3"] in stretches.text(fits)
    by_length, _ = stretches.stretch_histories(found.segments)
    assert [run.lateral_force.mean() for run in by_length[5]] == pytest.approx([LATERAL] * 3)
    drawn = calibration_figure(found.averages, calibration, TABLE_3)
    assert [ax.axison for ax in drawn.axes] == [True] * 7 + [False]
