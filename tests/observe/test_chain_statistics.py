"""Populations of chains known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from packings import branched, build, column, random_packing, turned

from forcechain.observe.chain_statistics import chain_statistics
from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions

OPTIONS = AnalysisOptions(stress_threshold=0.5)


def statistics(snapshot, options=OPTIONS):
    return chain_statistics(snapshot, find_chains(snapshot, options))


def test_an_upright_column():
    found = statistics(column([0, 0, 0]))
    assert found.chain_share == 1
    assert found.length_count.tolist() == [0, 0, 0, 0, 1]
    assert (found.mean_length, found.branching_share) == (4, 0)
    assert found.orientation == pytest.approx(math.pi / 2)
    assert found.alignment == pytest.approx(1)
    np.testing.assert_allclose(found.fabric, np.diag([0, 1]), atol=1e-12)


def test_a_branched_chain():
    """Four links upright, two at 30 degrees from upright."""
    found = statistics(branched())
    assert found.branching_share == 1
    doubled = np.array([(4 * -1 + 2 * -math.cos(math.pi / 3)), 2 * math.sin(math.pi / 3)]) / 6
    assert found.alignment == pytest.approx(np.hypot(*doubled))
    assert found.orientation == pytest.approx(0.5 * math.atan2(doubled[1], doubled[0]))


def test_links_of_too_short_chains_are_left_out():
    found = statistics(branched(), AnalysisOptions(minimum_chain_length=8, stress_threshold=0.5))
    assert found.chain_share == 0
    assert math.isnan(found.orientation)
    assert math.isnan(found.mean_length)
    assert found.fabric.tolist() == [[0, 0], [0, 0]]


def test_what_turns_and_what_does_not():
    packing = random_packing(1)
    found, image = statistics(packing), statistics(turned(packing, 0.4))
    mirrored = statistics(turned(packing, 0.0, reflected=True))
    assert image.alignment == pytest.approx(found.alignment)
    assert image.orientation == pytest.approx((found.orientation + 0.4) % math.pi)
    assert mirrored.orientation == pytest.approx(math.pi - found.orientation)
    assert 0 < found.chain_share < 1
    assert found.length_count @ np.arange(len(found.length_count)) == find_chains(packing, OPTIONS).in_chain.sum()


def test_chains_of_others():
    with pytest.raises(ValueError, match="chains: expected 2 particles, found 4"):
        chain_statistics(build([(0, 0), (1, 0)], 1e-3, []), find_chains(column([0, 0, 0]), OPTIONS))
