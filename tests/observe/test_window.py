"""One drop as a whole: its parts are those of the functions it joins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from packings import random_window, turned

from forcechain.observe.chains import find_chains
from forcechain.observe.filters import buckled_segments
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.plasticity import classify
from forcechain.observe.segments import find_segments, measure
from forcechain.observe.window import observe_drop

OPTIONS = AnalysisOptions(stress_threshold=0.7)


class Lazy:
    """Snapshots that are made when asked for, as a reader of files makes them."""

    def __init__(self, snapshots):
        self.snapshots = snapshots
        self.asked = 0

    def __len__(self):
        return len(self.snapshots)

    def __getitem__(self, index):
        snapshot = self.snapshots[index]
        self.asked += 1
        return replace(snapshot)


def test_the_parts_fit_together():
    window = random_window(3, length=6, side=20)
    drop = observe_drop(window, OPTIONS)
    chains = find_chains(window[0], OPTIONS)
    segments = find_segments(window[0], chains, OPTIONS)
    filtered = buckled_segments(window[0], window[-1], chains, segments, OPTIONS)
    assert drop.n_buckled > 5
    assert drop.ledger == filtered.ledger
    assert drop.ledger.buckled_segments == drop.n_buckled
    assert drop.ledger.candidate_segments == len(drop.segments)
    np.testing.assert_array_equal(drop.buckled, segments[filtered.buckled])
    np.testing.assert_allclose(drop.axial_strain, [snapshot.axial_strain for snapshot in window])
    assert drop.measures.axial_force.shape == (6, drop.n_buckled)
    np.testing.assert_array_equal(
        drop.measures.lateral_force[4], measure(window[4], window[0], drop.buckled).lateral_force
    )
    assert (drop.measures.axial_displacement[0] == 0).all()
    assert (drop.measures.rotation[0] == 0).all()
    growth = drop.measures.buckling_angle[-1] - drop.measures.buckling_angle[0]
    assert (growth >= OPTIONS.minimum_angle_growth).all()
    again = classify(window, drop.buckled, chains, OPTIONS)
    np.testing.assert_array_equal(drop.yielding.buckling_class, again.buckling_class)


def test_snapshots_may_be_read_when_asked_for():
    window = random_window(3, length=5, side=20)
    lazy = Lazy(window)
    drop, direct = observe_drop(lazy, OPTIONS), observe_drop(window, OPTIONS)
    np.testing.assert_array_equal(drop.measures.axial_force, direct.measures.axial_force)
    np.testing.assert_array_equal(drop.yielding.weak_network, direct.yielding.weak_network)
    assert lazy.asked <= 2 * len(window) + 4


def test_a_turned_window_gives_the_same():
    window = random_window(8, length=4, side=16)
    drop = observe_drop(window, OPTIONS)
    assert drop.n_buckled > 5
    for angle, reflected in ((1.0, False), (2.0, True)):
        image = observe_drop([turned(snapshot, angle, reflected=reflected) for snapshot in window], OPTIONS)
        np.testing.assert_array_equal(image.buckled, drop.buckled)
        np.testing.assert_allclose(image.measures.lateral_force, drop.measures.lateral_force, rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(image.measures.rotation, drop.measures.rotation, rtol=1e-7, atol=1e-12)
        np.testing.assert_array_equal(image.yielding.buckling_class, drop.yielding.buckling_class)


def test_magnitudes_of_the_lateral_force():
    window = random_window(8, length=4, side=16)
    signed = observe_drop(window, OPTIONS).measures.lateral_force
    bare = observe_drop(window, replace(OPTIONS, lateral_force="magnitude")).measures.lateral_force
    assert (signed < 0).any()
    np.testing.assert_array_equal(bare, np.abs(signed))


def test_results_are_frozen():
    drop = observe_drop(random_window(3, length=3), OPTIONS)
    for array in (drop.buckled, drop.segments, drop.axial_strain, drop.measures.rotation, drop.chains.label,
                  drop.filtered.buckled, drop.yielding.chain_moment, drop.chains.stress.major):  # fmt: skip
        assert not array.flags.writeable


def test_a_window_that_cannot_be():
    window = random_window(3, length=3)
    with pytest.raises(ValueError, match="snapshots: expected the start and the end of a drop at least, found 1"):
        observe_drop(window[:1], OPTIONS)
    with pytest.raises(ValueError, match=r"snapshot 1: expected an axial strain above 0.002, found 0.001"):
        observe_drop(window[::-1], OPTIONS)
