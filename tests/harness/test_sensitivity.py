"""The sweep over the choices of the analysis, on a study whose every number is known."""

from __future__ import annotations

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from buckling_study import DROP, GROWTH_DEG, LATERAL, LENGTH, N_COLUMNS, first_angle_deg, write_buckling_study

from forcechain.observe.options import AnalysisOptions
from harness.analysing.analysis_options import read_options
from harness.analysing.sensitivity import OUTCOMES, edge_name, edge_value, sensitivity
from harness.cli import main
from harness.errors import InputError
from harness.figures.sensitivity import N_PANELS, plot_sensitivity
from harness.figures.style import style
from harness.reading.exports import read_run, run_folders

SEEDS = (1, 2, 3)
SEGMENTS = len(SEEDS) * N_COLUMNS * (LENGTH - 2)
TABLE = {
    "minimum_angle_growth": tuple(np.radians([0.0, 1.0, 2.0, 4.5])),
    "minimum_chain_length": (3, 6),
    "lateral_force": ("support", "magnitude"),
    "drop_length": (0.004,),
    "increments": (16, 200),
}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_buckling_study(tmp_path_factory.mktemp("study") / "zigzag", SEEDS)


def row(table: pd.DataFrame, option: str, value: str) -> pd.Series:
    found = table[(table["option"] == option) & (table["value"] == value)]
    assert len(found) == 1
    return found.iloc[0]


def test_what_is_in_use_comes_first(study: Path) -> None:
    runs = [(read_run(folder), "all") for folder in run_folders(study)]
    found = sensitivity(runs, AnalysisOptions(increments=16), [DROP], table=TABLE)
    first = found.iloc[0]
    assert bool(first["in_use"])
    assert not found["in_use"][1:].any()
    assert (first["segments"], first["drops"], first["candidates"]) == (SEGMENTS, len(SEEDS), SEGMENTS)
    assert first["initial_angle_deg"] == pytest.approx(np.mean([first_angle_deg(seed) for seed in SEEDS]), abs=1e-6)
    assert first["angle_growth_deg"] == pytest.approx(GROWTH_DEG, abs=1e-6)
    assert first["lateral_force_N"] == pytest.approx(LATERAL)
    assert sum(first[f"class_{number}_percent"] for number in (1, 2, 3, 4)) == pytest.approx(100)
    assert first["initial_angle_deg_se"] > 0.2  # seeds differ by 1 degree
    assert first["lateral_force_N_se"] == pytest.approx(0, abs=1e-9)


def test_each_choice_moves_what_it_should(study: Path) -> None:
    runs = [(read_run(folder), "all") for folder in run_folders(study)]
    found = sensitivity(runs, AnalysisOptions(increments=16), [DROP], table=TABLE)
    assert row(found, "minimum_angle_growth_deg", "4.5")["segments"] == SEGMENTS
    stricter = {"minimum_angle_growth": (np.radians(GROWTH_DEG + 0.1),)}
    assert sensitivity(runs, AnalysisOptions(increments=16), [DROP], table=stricter).iloc[1]["segments"] == 0
    longer = row(found, "minimum_chain_length", "6")
    assert (longer["segments"], longer["candidates"]) == (0, 0)
    assert np.isnan(longer["initial_angle_deg"])
    assert "drop_length" not in set(found["option"])  # drops were given


def test_what_the_snapshots_do_not_allow_is_said_and_the_rest_goes_on(study: Path) -> None:
    runs = [(read_run(folder), "all") for folder in run_folders(study)]
    found = sensitivity(runs, AnalysisOptions(increments=16), [DROP], table=TABLE)
    finer = row(found, "increments", "200")
    assert "expected a snapshot every" in finer["fault"]
    assert np.isnan(finer["segments"])
    assert (found.loc[found["option"] != "increments", "fault"] == "").all()
    with pytest.raises(InputError, match=r"run seed1: drop 0.005-0.009: expected a snapshot every"):
        sensitivity(runs, AnalysisOptions(increments=200), [DROP], table=TABLE)


def test_side_by_side_is_the_same(study: Path) -> None:
    runs = [(read_run(folder), "all") for folder in run_folders(study)]
    options = AnalysisOptions(increments=16)
    few = {"lateral_force": ("magnitude",)}
    one = sensitivity(runs, options, [DROP], table=few)
    other = sensitivity(runs, options, [DROP], table=few, jobs=2)
    pd.testing.assert_frame_equal(one, other)


def test_names_at_the_edge_are_those_of_a_study_file() -> None:
    for option, value in (("alignment_angle", 0.5), ("segment_rule", "every"), ("stress_threshold", 1.25)):
        text = edge_value(option, value)
        given = float(text) if isinstance(value, float) else text
        options, _ = read_options({edge_name(option): given}, "here")
        assert getattr(options, option) == pytest.approx(value) if isinstance(value, float) else value


def test_the_figure_shows_every_variation(study: Path) -> None:
    runs = [(read_run(folder), "all") for folder in run_folders(study)]
    found = sensitivity(runs, AnalysisOptions(increments=16), [DROP], table=TABLE)
    with style():
        figure, axes = plt.subplots(1, N_PANELS, sharey=True)
        plot_sensitivity(found, axes=axes)
        words = [tick.get_text() for tick in axes[0].get_yticklabels()]
        plt.close(figure)
    assert words[0] == "as set"
    assert "minimum angle growth: 4.5" in words
    assert len(words) == (found["fault"] == "").sum()


def test_the_command_writes_table_and_figure(
    study: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("harness.analysing.sensitivity.VARIATIONS", {"segment_rule": ("every",)})
    assert main(["analyse", str(study), "--sensitivity", "--jobs", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    names = [Path(file).name for file in told["sensitivity"]]
    assert names == ["sensitivity.csv", "sensitivity.svg"]
    written = pd.read_csv(told["sensitivity"][0])
    assert set(OUTCOMES) <= set(written.columns)
    assert b"<svg" in Path(told["sensitivity"][1]).read_bytes()
