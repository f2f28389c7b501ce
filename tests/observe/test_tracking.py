"""Chains followed in time, their members in order, and the choices to vary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from packings import branched, build, column, random_packing, random_window, relabelled

from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import find_segments
from forcechain.observe.sensitivity import VARIATIONS, variations
from forcechain.observe.tracking import match_chains, ordered_members, persisting_segments

R = 1e-3
OPTIONS = AnalysisOptions(stress_threshold=0.5)


def columns(broken=()):
    """Two columns of six discs side by side, 0-5 and 6-11; the links named are gone."""
    position = [(10 * R * c, 2 * R * k) for c in range(2) for k in range(6)]
    contacts = []
    for first in (0, 6):
        contacts += [(first, (-3, -90), 10.0), (first + 5, (-4, 90), 10.0)]
        for k in range(first, first + 5):
            if (k, k + 1) in broken:  # what the link bore, walls bear
                contacts += [(k, (-4, 90), 10.0), (k + 1, (-3, -90), 10.0)]
            else:
                contacts.append((k, k + 1, 10.0))
    return find_chains(build(position, R, contacts), OPTIONS)


def test_the_same_chains():
    found = match_chains(columns(), columns())
    assert found.later.tolist() == [0, 1]
    assert found.earlier.tolist() == [0, 1]
    assert found.shared.tolist() == [6, 6]


def test_a_chain_that_sheds_discs_persists_one_that_falls_apart_collapses():
    before, after = columns(), columns(broken=[(1, 2), (7, 8), (9, 10)])
    assert after.length.tolist() == [4]  # 2-5; what is left of the other is shorter than a chain
    found = match_chains(before, after)
    assert found.later.tolist() == [0, -1]
    assert found.shared.tolist() == [4, 0]
    born = match_chains(after, before)
    assert born.later.tolist() == [0]
    assert born.earlier.tolist() == [0, -1]


def test_of_two_parts_one_persists():
    found = match_chains(columns(), columns(broken=[(2, 3)]))
    assert sorted(found.earlier.tolist()) == [-1, 0, 1]
    assert found.shared.tolist() == [3, 6]


def test_matches_of_random_windows_are_mutual():
    window = random_window(5, length=2, side=20)
    one, other = (find_chains(snapshot, OPTIONS) for snapshot in window)
    found = match_chains(one, other)
    persists = found.later >= 0
    assert 0 < persists.sum() < one.n_chains or one.n_chains < 3
    np.testing.assert_array_equal(found.earlier[found.later[persists]], np.flatnonzero(persists))
    for chain in np.flatnonzero(persists):
        shared = (one.label == chain) & (other.label == found.later[chain])
        assert shared.sum() == found.shared[chain]
    with pytest.raises(ValueError, match="after: expected 400 particles, found 12"):
        match_chains(one, columns())


def test_no_chains():
    bare = find_chains(build([(0, 0), (1, 0)], R, []), OPTIONS)
    found = match_chains(bare, bare)
    assert len(found.later) == len(found.earlier) == 0
    members, start = ordered_members(bare)
    assert members.tolist() == []
    assert start.tolist() == [0]


def test_segments_that_persist():
    one = np.array([[0, 1, 2], [1, 2, 3], [4, 5, 6]])
    assert persisting_segments(one, one[[2, 0]], 7).tolist() == [True, False, True]
    assert persisting_segments(one, np.zeros((0, 3), dtype=int), 7).tolist() == [False] * 3
    with pytest.raises(ValueError, match="segments, row 2: expected particles 0 to 5"):
        persisting_segments(one, one, 6)


def test_members_stand_in_the_order_of_the_chain():
    rng = np.random.default_rng(0)
    for _ in range(3):
        snapshot, number = relabelled(column([0] * 7), rng)
        members, start = ordered_members(find_chains(snapshot, OPTIONS))
        along = number.tolist() if number[0] < number[-1] else number[::-1].tolist()
        assert members.tolist() == along
        assert start.tolist() == [0, 8]
    assert ordered_members(find_chains(branched(), OPTIONS))[0].tolist() == [0, 1, 2, 3, 5, 4, 6]


def test_every_member_is_listed_once():
    chains = find_chains(random_packing(9, side=30), OPTIONS)
    members, start = ordered_members(chains)
    assert chains.n_chains > 5
    for number in range(chains.n_chains):
        listed = members[start[number] : start[number + 1]]
        np.testing.assert_array_equal(np.sort(listed), np.flatnonzero(chains.label == number))
        linked = {tuple(row) for row in chains.links.tolist()}
        for place in range(1, len(listed)):  # each is linked to one before it: the listing walks along the chain
            assert any(tuple(sorted((int(listed[place]), int(one)))) in linked for one in listed[:place])


def test_variations_change_one_choice_each():
    reference = AnalysisOptions(stress_threshold=1.1)
    found = variations(reference)
    assert found[0].is_reference
    assert found[0].options == reference
    assert not any(variation.is_reference for variation in found[1:])
    for name, value, options in found[1:]:
        assert getattr(options, name) == value != getattr(reference, name)
        free = {"drop_length": "increments"}.get(name, name)
        changed = {name: getattr(reference, name), free: getattr(reference, free)}
        assert replace(options, **changed) == reference
    assert {name for name, *_ in found[1:]} == set(VARIATIONS)
    longer = next(v.options for v in found if v.name == "drop_length" and v.value == 0.01)
    assert longer.drop_length / longer.increments == pytest.approx(0.007 / 28)


def test_a_variation_of_nothing():
    with pytest.raises(ValueError, match="table: expected options, found 'stress'"):
        variations(AnalysisOptions(), {"stress": (1,)})
    with pytest.raises(ValueError, match="segment_rule: expected one of"):
        variations(AnalysisOptions(), {"segment_rule": ("worst",)})


def test_variations_find_other_segments():
    """The choices do something: most change what is found in a random packing."""
    packing = random_packing(6, side=25)

    def count(options):
        return len(find_segments(packing, find_chains(packing, options), options))

    reference = count(AnalysisOptions())
    for name in ("stress_weight", "stress_threshold", "alignment_angle", "minimum_chain_length", "segment_rule"):
        assert any(count(v.options) != reference for v in variations(AnalysisOptions(), {name: VARIATIONS[name]}))
