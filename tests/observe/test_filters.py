"""Energies, filters and the ledger."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from packings import build, column

from forcechain.observe.chains import find_chains
from forcechain.observe.filters import buckled_segments, potential_energy, total_ledger
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import find_segments

R = 1e-3
KN, KT, KR = 1.05e5, 0.5 * 1.05e5, 0.5 * 1.05e5 * R**2


def test_energy_is_shared_between_discs_and_whole_at_walls():
    snapshot = build([(0, 0), (0, 2 * R)], R, [(0, 1, 10.0, 3.0, 2e-4), (0, (-3, -90), 8.0)])
    normal, tangential, rolling = 100 / (2 * KN), 9 / (2 * KT), 4e-8 / (2 * KR)
    wall = 64 / (2 * KN)
    np.testing.assert_allclose(
        potential_energy(snapshot),
        [0.5 * (normal + tangential + rolling) + wall, 0.5 * (normal + tangential + rolling)],
    )
    np.testing.assert_allclose(potential_energy(snapshot, ("rolling",)), 0.5 * rolling)


def test_energy_needs_a_stiffness():
    snapshot = build([(0, 0), (0, 2 * R)], R, [(0, (-3, -90), 8.0), (0, 1, 10.0, 3.0, 2e-4)])
    soft = replace(snapshot, rolling_stiffness=np.zeros(2))
    with pytest.raises(ValueError, match="contacts row 1: expected a rolling stiffness above 0 where a load is borne"):
        potential_energy(soft)
    assert (potential_energy(soft, ("normal", "tangential")) > 0).all()
    with pytest.raises(ValueError, match="terms: expected some of normal, tangential, rolling, found"):
        potential_energy(snapshot, ("axial",))


def pass_filters(before, after, **choices):
    options = AnalysisOptions(stress_threshold=0.8, **choices)
    chains = find_chains(before, options)
    segments = find_segments(before, chains, options)
    return segments, buckled_segments(before, after, chains, segments, options)


def test_the_three_filters_one_by_one():
    """A column of six gives four segments; the load falls on all but the uppermost contact, the middle bends."""
    before = column([5, -5, 5, -5, 5])
    after = column([5, -5, 20, -20, 5], force=6.0)
    contacts = after.normal_force.copy()
    contacts[4] = contacts[6] = 20.0  # 4-5 and the wall above: the discs 4 and 5 gain energy
    after = replace(after, normal_force=contacts)
    segments, found = pass_filters(before, after)
    assert segments.tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5]]
    assert found.lost_energy.tolist() == [True, True, True, True, False, False]
    assert found.lost_energy_segment.tolist() == [True, True, False, False]
    assert found.buckled.tolist() == [False, True, False, False]
    np.testing.assert_allclose(np.degrees(found.angle_growth), [0.0, 7.5, 15.0, 7.5], atol=1e-9)
    ledger = found.ledger
    assert (ledger.particles, ledger.bearing_force, ledger.highly_stressed) == (6, 6, 6)
    assert (ledger.in_chains, ledger.lost_energy) == (6, 4)
    assert (ledger.candidate_segments, ledger.lost_energy_segments, ledger.buckled_segments) == (4, 2, 1)


def test_the_thresholds_of_the_filters():
    before, after = column([5, -5]), column([7, -7], force=8.0)  # 2 degrees more, 36% of the energy lost
    for choices, expected in (
        ({}, True),
        ({"minimum_angle_growth": math.radians(1.999)}, True),
        ({"minimum_angle_growth": math.radians(2.001)}, False),
        ({"energy_tolerance": 0.35}, True),
        ({"energy_tolerance": 0.37}, False),
    ):
        assert pass_filters(before, after, **choices)[1].buckled.tolist() == [expected], choices
    assert not pass_filters(before, column([3, -3], force=8.0))[1].buckled.any()  # it straightens
    assert not pass_filters(before, column([7, -7], force=10.0))[1].buckled.any()  # it keeps its energy exactly


def test_energy_terms_decide():
    before, after = column([5, -5]), column([7, -7], force=8.0)
    after = replace(after, tangential_force=np.array([6.0, 6.0, 0.0, 0.0]))
    assert not pass_filters(before, after)[1].buckled.any()
    assert pass_filters(before, after, energy_terms=("normal",))[1].buckled.all()


def test_other_particles():
    with pytest.raises(ValueError, match="end: expected 3 particles, found 2"):
        pass_filters(column([0, 0]), column([0]))


def test_ledgers_add_up():
    ledger = pass_filters(column([5, -5]), column([7, -7], force=8.0))[1].ledger
    total = total_ledger([ledger, ledger, ledger])
    assert (total.particles, total.candidate_segments, total.buckled_segments) == (9, 3, 3)
    assert total_ledger([]).particles == 0
