"""Averages, their errors and the shares of classes, on numbers worked out by hand or drawn from known distributions."""

from __future__ import annotations

import numpy as np
import pytest

from forcechain.observe.averages import average_by_bins, average_by_increment, bootstrap_error, class_shares


def test_average_by_increment():
    found = average_by_increment([[[1.0, 3.0], [2.0, 2.0]], [[5.0], [8.0]]])
    assert found.count.tolist() == [3, 3]
    np.testing.assert_allclose(found.mean, [3, 4])
    np.testing.assert_allclose(found.standard_deviation, [2, np.sqrt(12)])
    np.testing.assert_allclose(found.standard_error, [2 / np.sqrt(3), 2])
    np.testing.assert_allclose(found.quartiles[0], [2, 3, 4])


def test_one_segment_or_none():
    one = average_by_increment([[[2.0], [3.0]]])
    assert one.mean.tolist() == [2, 3]
    assert np.isnan(one.standard_error).all()
    none = average_by_increment([np.zeros((2, 0)), np.zeros((2, 0))])
    assert none.count.tolist() == [0, 0]
    assert np.isnan(none.mean).all()


def test_average_by_bins_counts_a_segment_once_a_bin():
    """Segment 0 stays in the first bin for three increments, segment 1 passes on; the last edge belongs to its bin."""
    angle = np.array([[1.0, 1.0], [1.5, 2.0], [1.9, 4.0]])
    force = np.array([[10.0, 4.0], [20.0, 6.0], [30.0, 8.0]])
    found = average_by_bins([angle], [force], [1, 2, 3, 4])
    assert found.count.tolist() == [2, 1, 1]
    np.testing.assert_allclose(found.mean, [(20 + 4) / 2, 6, 8])
    assert average_by_bins([angle], [force], [4.5, 5]).count.tolist() == [0]
    split = average_by_bins([angle[:, :1], angle[:, 1:]], [force[:, :1], force[:, 1:]], [1, 2, 3, 4])
    np.testing.assert_array_equal(split.mean, found.mean)


def test_bootstrap_over_segments_is_the_standard_error():
    rng = np.random.default_rng(1)
    values = rng.normal(5, 2, (3, 200))
    found = bootstrap_error([values], samples=4000)
    expected = average_by_increment([values]).standard_error
    np.testing.assert_allclose(found.by_segment, expected, rtol=0.06)
    assert np.isnan(found.by_seed).all()
    np.testing.assert_array_equal(found.larger, found.by_segment)


def test_bootstrap_over_seeds_sees_what_segments_share():
    """Runs that differ by 1 from each other with segments that hardly differ: the error over runs is the larger."""
    rng = np.random.default_rng(2)
    runs = [offset + 0.1 * rng.normal(size=(2, 50)) for offset in rng.normal(0, 1, 12)]
    found = bootstrap_error(runs, samples=4000)
    means = np.array([run.mean(axis=1) for run in runs])
    expected = means.std(axis=0, ddof=1) / np.sqrt(len(runs))
    np.testing.assert_allclose(found.by_seed, expected, rtol=0.06)
    assert (found.by_seed > 2 * found.by_segment).all()
    np.testing.assert_array_equal(found.larger, found.by_seed)


def test_bootstrap_repeats():
    values = [np.arange(12.0).reshape(2, 6), np.ones((2, 3))]
    one, other = bootstrap_error(values), bootstrap_error(values)
    np.testing.assert_array_equal(one.by_seed, other.by_seed)
    assert (bootstrap_error(values, random_seed=1).by_segment != one.by_segment).any()


def test_class_shares():
    found = class_shares([[1, 2, 2, 3], [3, 3, 4, 4, 4, 4]])
    assert found.count.tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(found.share, [0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(found.standard_error, np.sqrt(np.array([0.09, 0.16, 0.21, 0.24]) / 10))
    assert np.isnan(class_shares([]).share).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: average_by_increment([]), "groups: expected at least one drop, found none"),
        (lambda: average_by_increment([np.ones((2, 3)), np.ones((3, 3))]), "group 1: expected 2 increments, found 3"),
        (lambda: average_by_increment([np.ones(3)]), r"group 0: expected an array of shape \(any, any\), found \(3,\)"),
        (
            lambda: average_by_bins([np.ones((2, 3))], [np.ones((2, 2))], [0, 1]),
            r"coordinates: expected shape \(2, 2\)",
        ),
        (lambda: average_by_bins([np.ones((2, 3))], [np.ones((2, 3))], [1, 0]), "edges: expected at least two, incr"),
        (lambda: bootstrap_error([np.ones((2, 3))], samples=1), "samples: expected at least 2, found 1"),
        (lambda: class_shares([[1, 5]]), "classes: expected 1 to 4, found 5"),
    ],
)
def test_what_cannot_be_averaged(call, message):
    with pytest.raises(ValueError, match=message):
        call()
