"""The choices of the analysis: every one checked, every one described."""

from __future__ import annotations

import dataclasses
import math

import pytest

from forcechain.observe.options import AnalysisOptions


def test_every_option_says_what_it_is():
    for item in dataclasses.fields(AnalysisOptions):
        assert item.metadata["meaning"], item.name
        assert item.metadata["unit"], item.name
        assert item.default == getattr(AnalysisOptions(), item.name)


def test_options_survive_a_round_trip():
    options = AnalysisOptions(energy_terms=["rolling", "normal"], increments=14.0, stress_threshold=2)
    assert options.energy_terms == ("normal", "rolling")
    assert isinstance(options.increments, int)
    assert isinstance(options.stress_threshold, float)
    assert AnalysisOptions(**dataclasses.asdict(options)) == options


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("stress_weight", "volume", "stress_weight: expected one of 'area', 'none', found 'volume'"),
        ("stress_threshold", 0, "stress_threshold: expected a number above 0, found 0"),
        ("alignment_angle", 1.6, "alignment_angle: expected a number from 0 up to 1.5708, found 1.6"),
        ("alignment_angle", math.nan, "alignment_angle: expected a number from 0 up to 1.5708, found nan"),
        ("alignment_angle", "45", "alignment_angle: expected a number from 0 up to 1.5708, found '45'"),
        ("minimum_chain_length", 2.5, "minimum_chain_length: expected a whole number from 2, found 2.5"),
        ("minimum_chain_length", math.inf, "minimum_chain_length: expected a whole number from 2, found inf"),
        ("increments", True, "increments: expected a whole number from 1, found True"),
        ("energy_terms", (), "energy_terms: expected some of normal, tangential, rolling, each once, found ()"),
        ("energy_terms", ("normal", "normal"), "energy_terms: expected some of normal, tangential, rolling, each once"),
        ("energy_terms", "normal", "energy_terms: expected a sequence of terms, found 'normal'"),
        ("energy_tolerance", 1.5, "energy_tolerance: expected a number from 0 up to 1, found 1.5"),
        ("drop_length", 0.0, "drop_length: expected a number above 0 up to 1, found 0.0"),
        ("drop_smoothing", 0.01, "drop_smoothing: expected at most drop_length = 0.007, found 0.01"),
        ("neighbour_ring", None, "neighbour_ring: expected one of 'centre', 'chain', 'between', 'all', found None"),
    ],
)
def test_each_value_is_checked(name, value, message):
    with pytest.raises(ValueError) as caught:  # noqa: PT011  (the message is compared in full below)
        AnalysisOptions(**{name: value})
    assert str(caught.value).startswith(message)
