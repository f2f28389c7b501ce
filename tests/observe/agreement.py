"""Hold the observation of a window against the plain implementation, segment by segment."""

from __future__ import annotations

import numpy as np
import plain
import pytest

from forcechain.observe.window import observe_drop

MEASURES = (
    "buckling_angle", "axial_force", "axial_displacement", "normal_displacement", "rotation", "lateral_force",
)  # fmt: skip


def as_set(segments):
    return {tuple(row) for row in segments.tolist()}


def assert_chains_agree(chains, segments, found, options):
    assert set(np.flatnonzero(chains.bearing_force).tolist()) == set(found["bearing"])
    assert set(np.flatnonzero(chains.highly_stressed).tolist()) == found["highly"]
    assert as_set(chains.links) == set(found["links"])
    ours = [set(np.flatnonzero(chains.label == k).tolist()) for k in range(chains.n_chains)]
    assert sorted(map(sorted, ours)) == sorted(map(sorted, found["chains"]))
    assert as_set(segments) == plain.segments(found, options)


def assert_window_agrees(snapshots, options, *, seed=0):
    """Return the observation, whose every part has been compared."""
    drop = observe_drop(snapshots, options)
    found = plain.chains(snapshots[0], options, seed)
    assert_chains_agree(drop.chains, drop.segments, found, options)
    in_chains = set().union(*found["chains"]) if found["chains"] else set()
    expected = plain.buckled(snapshots[0], snapshots[-1], plain.segments(found, options), in_chains, options)
    assert as_set(drop.buckled) == expected
    for column, segment in enumerate(drop.buckled.tolist()):
        for row, snapshot in enumerate(snapshots):
            values = plain.measures(snapshot, snapshots[0], segment)
            for name in MEASURES:
                got = getattr(drop.measures, name)[row, column]
                assert got == pytest.approx(values[name], rel=1e-7, abs=1e-12), (segment, row, name)
        moment, lateral, slide, number = plain.classify(snapshots, tuple(segment), in_chains, options)
        assert drop.yielding.chain_moment[column] == (-1 if moment is None else moment)
        assert drop.yielding.weak_network[column] == (-1 if lateral is None else lateral)
        assert drop.yielding.buckling_class[column] == number
        assert drop.yielding.chain_sliding[column] == (-1 if slide is None else slide)
    return drop
