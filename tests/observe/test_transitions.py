"""Drops on curves whose drops are known, and what must not move them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from forcechain.observe.options import AnalysisOptions
from forcechain.observe.transitions import find_drops, given_drops, smoothed, snapshots_of_drop

LENGTH = 0.007
# A biaxial test in outline: hardening, three collapses of 0.002 strain, each after a gentle decline, recovery between.
KNOTS = [(0.0, 0.0), (0.02, 0.55), (0.047, 0.69), (0.050, 0.685), (0.052, 0.65), (0.060, 0.66), (0.063, 0.655),
         (0.065, 0.61), (0.078, 0.62), (0.082, 0.615), (0.084, 0.56), (0.10, 0.565)]  # fmt: skip
STARTS = (0.047, 0.060, 0.078)  # where an interval of 0.007 falls most: from the peak, or it ends at the trough


def curve(step=1e-4, noise=0.0, seed=0, last=0.1):
    strain = np.arange(0, last + step / 2, step)
    ratio = np.interp(strain, *np.transpose(KNOTS))
    return strain, ratio + noise * np.random.default_rng(seed).normal(size=len(strain))


def starts(drops):
    return [drop.start for drop in drops]


def test_three_collapses():
    drops = find_drops(*curve(), AnalysisOptions())
    assert len(drops) == 3
    for drop, (peak, trough) in zip(drops, ((0.047, 0.052), (0.060, 0.065), (0.078, 0.084)), strict=True):
        assert drop.length == pytest.approx(LENGTH)
        assert drop.start <= peak + 5e-4
        assert drop.end >= trough
        assert drop.fall > 0.03
        assert drop.prominence > 0.03
        assert drop.peak == pytest.approx(np.interp(peak, *np.transpose(KNOTS)), abs=2e-3)
    assert all(one.end <= other.start for one, other in pairwise(drops))


@pytest.mark.parametrize("step", [2.5e-5, 1e-4, 5e-4, 1e-3])
@pytest.mark.parametrize("noise", [0.0, 0.002, 0.005])
def test_noise_and_sampling_do_not_move_the_drops(step, noise):
    """The same three collapses, each inside its drop; a drop is longer than its collapse and may shift by the rest."""
    expected = starts(find_drops(*curve(), AnalysisOptions()))
    for seed in range(5):
        drops = find_drops(*curve(step, noise if step < 5e-4 else noise / 3, seed), AnalysisOptions())
        np.testing.assert_allclose(starts(drops), expected, atol=0.4 * LENGTH if noise else 5e-4)
        for drop, (steep, trough) in zip(drops, ((0.050, 0.052), (0.063, 0.065), (0.082, 0.084)), strict=True):
            assert drop.start <= steep
            assert drop.end >= trough - 2 * step


def test_the_first_or_the_largest():
    first = find_drops(*curve(), AnalysisOptions(drop_count=2))
    largest = find_drops(*curve(), AnalysisOptions(drop_count=2, drop_selection="largest"))
    every = find_drops(*curve(), AnalysisOptions())
    assert first == every[:2]
    by_fall = sorted(every, key=lambda drop: -drop.fall)[:2]
    assert set(largest) == set(by_fall)
    assert starts(largest) == sorted(starts(largest))
    assert set(first) != set(largest)


def test_thresholds():
    falls = [drop.fall for drop in find_drops(*curve(), AnalysisOptions())]
    assert len(find_drops(*curve(), AnalysisOptions(drop_fall=max(falls) - 1e-6))) == 1
    assert find_drops(*curve(), AnalysisOptions(drop_fall=0.5)) == ()
    assert find_drops(*curve(), AnalysisOptions(drop_prominence=0.5)) == ()


def test_hardening_has_no_drops():
    strain = np.linspace(0, 0.1, 1001)
    assert find_drops(strain, np.sqrt(strain), AnalysisOptions(drop_fall=0, drop_prominence=0)) == ()
    wavy = np.sqrt(strain) + 0.002 * np.sin(strain * 2000)
    assert find_drops(strain, wavy, AnalysisOptions()) == ()


def test_steady_softening_is_no_collapse():
    strain = np.linspace(0, 0.1, 1001)
    assert find_drops(strain, 0.7 - 4 * strain, AnalysisOptions()) == ()


def test_a_collapse_at_the_end_of_the_curve_counts():
    assert len(find_drops(*curve(last=0.0848), AnalysisOptions())) == 3


def test_a_curve_shorter_than_a_drop():
    with pytest.raises(ValueError, match=r"expected more than a drop's 0.007, found 0.005"):
        find_drops(*curve(last=0.005), AnalysisOptions())


@pytest.mark.parametrize(
    ("strain", "ratio", "message"),
    [
        ([0, 1, 1, 2], [1, 2, 3, 4], "axial_strain, row 2: expected more than 1, found 1"),
        ([0, 1, 2], [1, 2], r"stress_ratio: expected an array of shape \(3,\), found \(2,\)"),
        ([0, 1, np.nan], [1, 2, 3], "axial_strain, row 2: expected a finite number, found nan"),
        ([0], [1], "axial_strain: expected at least 2 samples, found 1"),
    ],
)
def test_curves_that_cannot_be(strain, ratio, message):
    with pytest.raises(ValueError, match=message):
        find_drops(strain, ratio, AnalysisOptions())
    with pytest.raises(ValueError, match=message):
        given_drops(strain, ratio, [(0.1, 0.2)], AnalysisOptions())


def test_smoothing_is_exact_on_lines_and_blind_to_the_sampling():
    strain, ratio = curve(1e-4)
    at = np.linspace(0, 0.1, 777)
    np.testing.assert_allclose(smoothed(strain, 3 * strain, at, 0.002), 3 * at, atol=1e-12)
    np.testing.assert_allclose(smoothed(strain, ratio, at, 0.0), np.interp(at, strain, ratio))
    finer = np.unique(np.concatenate((strain, np.linspace(0, 0.1, 3001))))
    again = smoothed(finer, np.interp(finer, strain, ratio), at, 0.002)
    np.testing.assert_allclose(again, smoothed(strain, ratio, at, 0.002), atol=1e-12)


def test_given_drops():
    paper = [(0.059, 0.066), (0.046, 0.053), (0.080, 0.087)]
    drops = given_drops(*curve(), paper, AnalysisOptions())
    assert [(drop.start, drop.end) for drop in drops] == sorted(paper)
    assert all(drop.fall > 0 for drop in drops)
    found = find_drops(*curve(), AnalysisOptions())[0]
    assert given_drops(*curve(), [(found.start, found.end)], AnalysisOptions())[0].fall == pytest.approx(found.fall)
    assert given_drops(*curve(), [(0.01, 0.02)], AnalysisOptions())[0].fall < 0
    assert given_drops(*curve(), [], AnalysisOptions()) == ()


@pytest.mark.parametrize(
    ("intervals", "message"),
    [
        ([(0.05, 0.04)], "drop 0.05-0.04: expected a start below the end"),
        ([(0.095, 0.102)], "drop 0.095-0.102: expected strains between 0 and 0.1"),
        ([(0.04, 0.047), (0.046, 0.053)], "drop 0.046-0.053: expected no overlap, found 0.04-0.047"),
        ([(0.04, 0.047), (0.05, 0.058)], "drop 0.05-0.058: expected a length of 0.007, found 0.008"),
    ],
)
def test_given_drops_that_cannot_be(intervals, message):
    with pytest.raises(ValueError, match=message):
        given_drops(*curve(), intervals, AnalysisOptions())


def test_snapshots_of_a_drop():
    drop = given_drops(*curve(), [(0.046, 0.053)], AnalysisOptions())[0]
    strain = np.arange(401) * 2.5e-4 + 3e-6
    rows = snapshots_of_drop(strain, drop, AnalysisOptions())
    np.testing.assert_array_equal(rows, np.arange(184, 213))
    assert snapshots_of_drop(strain, drop, AnalysisOptions(increments=7)).tolist() == list(range(184, 213, 4))
    with pytest.raises(ValueError, match=r"expected a snapshot every 0.00025 of axial strain for 28 increments"):
        snapshots_of_drop(strain[::2], drop, AnalysisOptions())
    with pytest.raises(ValueError, match=r"found 0.05 nearest to 0.053"):
        snapshots_of_drop(strain[:201] - 3e-6, drop, AnalysisOptions())
    with pytest.raises(ValueError, match="expected at least two snapshots, in order of strain"):
        snapshots_of_drop(strain[::-1], drop, AnalysisOptions())
