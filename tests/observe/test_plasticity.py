"""Classes of segments whose contacts yield at chosen increments."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from packings import build, take_contacts

from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.plasticity import classify, rolling, sliding

R = 1e-3
CHAIN = [(0, 1), (1, 2)]  # contacts of the chain, then
SUPPORT, TO_END, BETWEEN, OUTER, CHAIN_TO_CHAIN = (1, 3), (2, 4), (3, 4), (4, 5), (2, 6)
SEGMENT = np.array([[0, 1, 2]])


def snapshot(rolls=(), slides=()):
    """A column 0-1-2, weak discs 3 and 4 that touch it and each other, 5 behind 4; pairs at their limits as given."""
    position = 2 * R * np.array([(0, 0), (0, 1), (0, 2), (0.9, 0.7), (0.9, 1.7), (1.9, 1.7), (0, 3)])
    pairs = [*CHAIN, SUPPORT, TO_END, BETWEEN, OUTER, CHAIN_TO_CHAIN]
    forces = [40.0, 40.0, 2.0, 2.0, 2.0, 2.0, 40.0]
    contacts = [(*pair, force) for pair, force in zip(pairs, forces, strict=True)]
    contacts += [(0, (-3, -90), 40.0), (6, (-4, 90), 40.0)]
    made = build(position, R, contacts)
    tangential, moment = np.zeros(made.n_contacts), np.zeros(made.n_contacts)
    for row, pair in enumerate(pairs):
        sign = -1.0 if row % 2 else 1.0
        tangential[row] = sign * (1.0 if pair in slides else 0.5) * made.friction[row] * made.normal_force[row]
        moment[row] = -sign * (1.0 if pair in rolls else 0.5) * made.rolling_limit[row] * made.normal_force[row]
    return replace(made, tangential_force=tangential, moment=moment)


def classes(*instants, **choices):
    """Each instant is (rolls, slides); the first is the start."""
    options = AnalysisOptions(stress_threshold=0.9, **choices)
    snapshots = [snapshot(*instant) for instant in instants]
    chains = find_chains(snapshots[0], options)
    assert np.flatnonzero(chains.in_chain).tolist() == [0, 1, 2, 6]
    found = classify(snapshots, SEGMENT, chains, options)
    return int(found.chain_moment[0]), int(found.weak_network[0]), int(found.buckling_class[0])


NOTHING = ((), ())
ROLL = ((CHAIN[1],), ())
SLIDE = ((), (SUPPORT,))


def test_the_four_classes():
    assert classes(NOTHING, NOTHING, NOTHING) == (-1, -1, 1)
    assert classes(NOTHING, NOTHING, ((CHAIN[0],), (SUPPORT,))) == (2, 2, 2)
    assert classes(NOTHING, SLIDE, ROLL) == (2, 1, 3)
    assert classes(NOTHING, ROLL, SLIDE) == (1, 2, 4)
    assert classes(NOTHING, SLIDE) == (-1, 1, 3)
    assert classes(NOTHING, ROLL) == (1, -1, 4)


def test_support_yields_by_sliding_or_rolling():
    assert classes(NOTHING, ((SUPPORT,), ())) == (-1, 1, 3)
    assert classes(NOTHING, ((), (SUPPORT,))) == (-1, 1, 3)


def test_a_sliding_chain_contact_is_neither():
    """It is counted on its own: the class is by the chain's moment."""
    assert classes(NOTHING, ((), (CHAIN[0],))) == (-1, -1, 1)
    options = AnalysisOptions(stress_threshold=0.9)
    snapshots = [snapshot(), snapshot((), CHAIN[:1]), snapshot(CHAIN, ())]
    found = classify(snapshots, SEGMENT, find_chains(snapshots[0], options), options)
    assert found.chain_sliding.tolist() == [1]
    assert found.slides_in_chain.tolist() == [True]
    assert found.slides_first.tolist() == [True]
    later = classify([snapshots[0], snapshots[2], snapshots[1]], SEGMENT, find_chains(snapshots[0], options), options)
    assert later.slides_in_chain.tolist() == [True]
    assert later.slides_first.tolist() == [False]


def test_how_far_the_ring_reaches():
    for pair, rings in (
        (SUPPORT, ("centre", "chain", "between", "all")),
        (TO_END, ("chain", "between", "all")),
        (BETWEEN, ("between", "all")),
        (OUTER, ("all",)),
    ):
        for ring in ("centre", "chain", "between", "all"):
            expected = (-1, 1, 3) if ring in rings else (-1, -1, 1)
            assert classes(NOTHING, ((), (pair,)), neighbour_ring=ring) == expected, (pair, ring)


def test_particles_of_chains_are_no_weak_neighbours():
    """2-6 is a contact of the chain beyond the segment: neither its moment nor its sliding counts."""
    assert classes(NOTHING, ((CHAIN_TO_CHAIN,), (CHAIN_TO_CHAIN,)), neighbour_ring="all") == (-1, -1, 1)


def test_what_was_plastic_at_the_start():
    """Ignored until it yields anew, or counted at the first increment at which it still is."""
    start = ((CHAIN[0],), (SUPPORT,))
    assert classes(start, start, start) == (-1, -1, 1)
    assert classes(start, start, start, already_plastic="count") == (1, 1, 2)
    assert classes(start, NOTHING, start) == (2, 2, 2)
    assert classes(start, start, ((CHAIN[0], CHAIN[1]), (SUPPORT,))) == (2, -1, 4)  # the other contact of the chain
    assert classes(SLIDE, ((SUPPORT,), (SUPPORT,))) == (-1, 1, 3)  # it slides already, now it also rolls


def test_neighbours_at_the_start_or_at_the_increment():
    """The support 1-3 is lost before 3-4 slides: 3 is then no neighbour any more."""
    options = {at: AnalysisOptions(stress_threshold=0.9, neighbours_at=at) for at in ("start", "current")}
    start, end = snapshot(), snapshot((), (BETWEEN,))
    kept = [row for row, pair in enumerate(end.contact_ids.tolist()) if tuple(pair) != SUPPORT]
    end = take_contacts(end, kept)
    for at, expected in (("start", 1), ("current", -1)):
        found = classify([start, end], SEGMENT, find_chains(start, options[at]), options[at])
        assert found.weak_network.tolist() == [expected]


def test_a_contact_is_plastic_within_the_tolerance():
    made = snapshot(rolls=CHAIN, slides=(SUPPORT,))
    assert np.flatnonzero(sliding(made, 1e-9)).tolist() == [2]
    assert np.flatnonzero(rolling(made, 1e-9)).tolist() == [0, 1]  # the walls have no limit and never yield
    short = replace(made, tangential_force=made.tangential_force * (1 - 1e-8))
    assert not sliding(short, 1e-9).any()
    assert sliding(short, 1e-7).any()


def test_a_window_needs_two_snapshots_of_the_same_particles():
    options = AnalysisOptions()
    made = snapshot()
    chains = find_chains(made, options)
    with pytest.raises(ValueError, match="snapshots: expected the start and at least one increment, found 1"):
        classify([made], SEGMENT, chains, options)
    other = build([(0, 0), (0, 2 * R)], R, [(0, 1, 1.0)])
    with pytest.raises(ValueError, match="snapshot 1: expected 7 particles, found 2"):
        classify([made, other], SEGMENT, chains, options)
