"""The fast implementation against the plain one, on random packings."""

from __future__ import annotations

import math

import numpy as np
import plain
import pytest
from agreement import as_set, assert_chains_agree, assert_window_agrees
from packings import random_packing, random_window

from forcechain.observe.chains import find_chains
from forcechain.observe.filters import potential_energy
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import find_segments
from forcechain.observe.stress import particle_stress

CHAIN_CHOICES = (
    {},
    {"stress_weight": "none"},
    {"stress_threshold": 0.7},
    {"alignment_rule": "180/Z"},
    {"alignment_angle": math.radians(60)},
    {"minimum_chain_length": 5},
    {"segment_rule": "every", "alignment_angle": math.radians(70), "stress_threshold": 0.5},
    {"wall_segments": "drop"},
)
WINDOW_CHOICES = (
    {},
    {"already_plastic": "count"},
    {"neighbour_ring": "centre"},
    {"neighbour_ring": "chain"},
    {"neighbour_ring": "all"},
    {"neighbours_at": "start"},
    {"neighbours_at": "start", "neighbour_ring": "chain", "already_plastic": "count"},
    {"segment_rule": "every", "stress_threshold": 0.6},
    {"energy_terms": ("normal",), "energy_tolerance": 0.2},
    {"minimum_angle_growth": math.radians(0.2), "plastic_tolerance": 0.06},
)


@pytest.mark.parametrize("choice", CHAIN_CHOICES, ids=str)
def test_chains_and_segments(choice):
    options = AnalysisOptions(**choice)
    counted = 0
    for seed in range(4):
        packing = random_packing(seed)
        chains = find_chains(packing, options)
        segments = find_segments(packing, chains, options)
        assert_chains_agree(chains, segments, plain.chains(packing, options, seed), options)
        counted += len(segments)
    assert counted > 20  # so that the agreement means something


@pytest.mark.parametrize("choice", WINDOW_CHOICES, ids=str)
def test_window(choice):
    options = AnalysisOptions(**choice)
    drops = [assert_window_agrees(random_window(seed, side=16), options, seed=seed) for seed in range(3)]
    assert sum(drop.n_buckled for drop in drops) >= 8


def test_every_class_occurs():
    """The comparison of classes has all of them to compare."""
    options = AnalysisOptions(neighbour_ring="chain", stress_threshold=0.6)
    found = [assert_window_agrees(random_window(seed, length=4, side=16, at_limit=0.04), options) for seed in range(5)]
    classes = np.concatenate([drop.yielding.buckling_class for drop in found])
    assert set(classes.tolist()) == {1, 2, 3, 4}


def test_stress_and_energy():
    packing = random_packing(5)
    s = plain.PlainSnapshot(packing)
    for weight in ("area", "none"):
        expected = np.array([plain.stress(s, i, weight) for i in range(s.n)])
        np.testing.assert_allclose(particle_stress(packing, weight=weight), expected, rtol=1e-9, atol=1e-12)
    for terms in (("normal",), ("tangential", "rolling"), ("normal", "tangential", "rolling")):
        expected = [plain.energy(s, i, terms) for i in range(s.n)]
        np.testing.assert_allclose(potential_energy(packing, terms), expected, rtol=1e-12)


def test_the_comparison_can_fail():
    """A wrong option on one side shows: the two implementations do not agree by accident."""
    packing = random_packing(0)
    options = AnalysisOptions()
    found = plain.chains(packing, options)
    chains = find_chains(packing, AnalysisOptions(alignment_angle=math.radians(40)))
    assert as_set(chains.links) != set(found["links"])
    with pytest.raises(AssertionError):
        assert_chains_agree(chains, find_segments(packing, chains, options), found, options)
