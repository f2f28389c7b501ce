"""Measures of segments whose values are known by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from packings import NORMAL_STIFFNESS, build, column, random_packing

from forcechain.observe.chains import find_chains
from forcechain.observe.neighbours import find_neighbours
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import axial_line, find_segments, measure
from forcechain.observe.stress import Principal

R = 1e-3
SEGMENT = np.array([[1, 2, 3]])


def bent(angle_deg=20.0, extra=(), turn=(0.0,) * 5):
    """Discs 0-1-2-3-4 upwards, 2 to the right of the line 1-3 by 2 R sin(angle); 10 N on top and bottom of 1-3."""
    t = math.radians(angle_deg)
    up, right, left = (0.0, 1.0), (math.sin(t), math.cos(t)), (-math.sin(t), math.cos(t))
    position = 2 * R * np.concatenate(([(0.0, 0.0)], np.cumsum([up, right, left, up], axis=0)))
    extra_discs = [place for place, *_ in extra if place is not None]
    contacts = [(0, 1, 10.0), (1, 2, 11.0, 0.4), (2, 3, 13.0, -0.2), (3, 4, 10.0), (0, (-3, -90), 10.0)]
    number = 5
    for place, one, *load in extra:
        if place is None:
            contacts.append((one, *load))
        else:
            contacts.append((one, number, *load))
            number += 1
    position = np.concatenate((position, np.array(extra_discs).reshape(-1, 2)))
    rotation = np.concatenate((turn, np.zeros(len(extra_discs))))
    return build(position, R, contacts, rotation=rotation)


def place(disc, degrees, snapshot=None):
    centre = (snapshot or bent()).position[disc]
    return centre + 2 * R * np.array((math.cos(math.radians(degrees)), math.sin(math.radians(degrees))))


def lateral(extra, **kwargs):
    snapshot = bent(extra=extra)
    return measure(snapshot, snapshot, SEGMENT, **kwargs).lateral_force[0]


def axial(extra):
    snapshot = bent(extra=extra)
    return measure(snapshot, snapshot, SEGMENT).axial_force[0]


def test_angle_and_displacements():
    start, end = bent(14.0), bent(23.0, turn=(0.0, 0.30, 0.05, -0.10, 0.0))
    found = measure(end, start, SEGMENT)
    assert math.degrees(found.buckling_angle[0]) == pytest.approx(23.0)
    assert found.axial_displacement[0] == pytest.approx(
        4 * R * (math.cos(math.radians(14)) - math.cos(math.radians(23)))
    )
    assert found.rotation[0] == pytest.approx(0.20)  # |(0.30 - 0.05) - (-0.10 - 0.05)|/2
    assert found.normal_displacement[0] == pytest.approx(12.0 / NORMAL_STIFFNESS)
    np.testing.assert_allclose(axial_line(end, SEGMENT)[0], [[0, 1]], atol=1e-12)


def test_angle_is_the_mean_of_two():
    """Arms of unequal length: 2 R and 4 R at 30 degrees from each other's continuation."""
    position = R * np.array([(0, 0), (0, 2), (4 * math.sin(math.pi / 6), 2 + 4 * math.cos(math.pi / 6))])
    snapshot = build(position, R, [(0, 1, 1.0)])
    line = math.atan2(position[2, 0], position[2, 1])
    assert measure(snapshot, snapshot, [[0, 1, 2]]).buckling_angle[0] == pytest.approx(
        0.5 * (line + math.pi / 6 - line)
    )


def test_a_lost_contact_counts_as_no_overlap():
    start = bent()
    lost = build(start.position, R, [(0, 1, 10.0), (2, 3, 13.0), (3, 4, 10.0)])
    assert measure(lost, start, SEGMENT).normal_displacement[0] == pytest.approx(6.5 / NORMAL_STIFFNESS)


def test_lateral_force_is_positive_towards_the_line():
    right = (place(2, 0), 2, 3.0, 0.5)  # its tangential force acts along the line
    left = (place(2, 180), 2, 1.25)
    oblique = (place(2, -30), 2, 2.0, 0.6)
    assert lateral([right]) == pytest.approx(3.0)
    assert lateral([left]) == pytest.approx(-1.25)
    assert lateral([left], lateral_force="magnitude") == pytest.approx(1.25)
    assert lateral([right, left]) == pytest.approx(1.75)
    # Contact along (cos -30, sin -30); on disc 2 the force is -(2 n + 0.6 t) with t = (0.5, 0.866).
    assert lateral([oblique]) == pytest.approx(2 * math.cos(math.pi / 6) + 0.6 * 0.5)
    assert lateral([(None, 2, (-2, 0), 1.5)]) == pytest.approx(1.5)  # a wall supports as a disc does
    assert lateral([]) == 0


def test_readings_of_the_total_supporting_force():
    right = (place(2, 0), 2, 3.0, 0.5)
    left = (place(2, 180), 2, 1.25)
    oblique = (place(2, -30), 2, 2.0, 0.6)
    assert lateral([right, left], lateral_force="supporting") == pytest.approx(3.0)
    assert lateral([left], lateral_force="supporting") == 0
    assert lateral([right, left], lateral_force="horizontal") == pytest.approx(4.25)  # the line 1-3 stands upright
    assert lateral([oblique], lateral_force="horizontal") == pytest.approx(2 * math.cos(math.pi / 6) + 0.6 * 0.5)
    with pytest.raises(ValueError, match="expected one of 'support', 'magnitude', 'supporting', 'horizontal'"):
        lateral([left], lateral_force="sideways")


def test_lateral_force_on_a_straight_segment_is_a_magnitude():
    for side in (0, 180):
        straight = bent(0.0)
        pushed = bent(0.0, [(place(2, side, straight), 2, 3.0)])
        assert measure(pushed, pushed, SEGMENT).lateral_force[0] == pytest.approx(3.0)


def test_axial_force_comes_from_beyond_the_ends():
    """Both ends feel 10 N; what lies beside or above the line through 1 adds nothing, whatever it pushes."""
    assert axial([]) == pytest.approx(10.0)
    assert axial([(place(1, 3), 1, 5.0)]) == pytest.approx(10.0)
    assert axial([(place(1, 170), 1, 5.0, 2.0)]) == pytest.approx(10.0)
    below = (place(1, -150), 1, 4.0)
    assert axial([below]) == pytest.approx(0.5 * (10.0 + 10.0 + 4.0 * math.sin(math.radians(30))))
    # A tangential force takes part by its own projection: normal to the left and down, t = (0.5, -0.866).
    rubbing = (place(1, -150), 1, 4.0, 1.0)
    assert axial([rubbing]) == pytest.approx(0.5 * (20.0 + 2.0 + math.cos(math.radians(30))))


def test_a_wall_counts_where_its_contact_point_lies():
    assert axial([(None, 1, (-1, 170), 5.0)]) == pytest.approx(10.0)
    assert axial([(None, 1, (-1, -150), 4.0)]) == pytest.approx(11.0)
    straight = measure(column([20, -20]), column([20, -20]), [[0, 1, 2]])
    assert straight.axial_force[0] == pytest.approx(10.0)  # wall below, wall above


def test_the_order_of_the_ends_does_not_matter():
    extra = [(place(2, 0), 2, 3.0), (place(1, -150), 1, 4.0)]
    snapshot, reference = bent(20.0, extra), bent(14.0, extra, (0.0, 0.1, 0.2, 0.4, 0.0))
    one, other = measure(snapshot, reference, SEGMENT), measure(snapshot, reference, SEGMENT[:, ::-1])
    for name in one.__dataclass_fields__:
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-12)


def test_eigenvector_signs_do_not_matter():
    packing = random_packing(7)
    options = AnalysisOptions(stress_threshold=0.7)
    chains = find_chains(packing, options)
    segments = find_segments(packing, chains, options)
    rng = np.random.default_rng(0)
    for _ in range(5):
        sign = rng.choice((-1.0, 1.0), (packing.n_particles, 1))
        stress = Principal(
            major=chains.stress.major, minor=chains.stress.minor, direction=sign * chains.stress.direction
        )
        np.testing.assert_array_equal(find_segments(packing, replace(chains, stress=stress), options), segments)


def test_neighbours_list_every_end_once():
    packing = random_packing(2)
    listed = find_neighbours(packing)
    owner = np.repeat(np.arange(packing.n_particles), np.diff(listed.start))
    assert len(owner) == np.count_nonzero(packing.contact_ids >= 0)
    for own, partner, contact, sign in zip(owner, listed.partner, listed.contact, listed.sign, strict=True):
        pair = (own, partner) if sign < 0 else (partner, own)
        assert tuple(packing.contact_ids[contact]) == pair


@pytest.mark.parametrize(
    ("segments", "message"),
    [
        ([[0, 1]], r"segments: expected an array of shape \(any, 3\), found \(1, 2\)"),
        ([[0, 1, 9]], r"segments, row 0: expected particles 0 to 4, found \[0, 1, 9\]"),
        ([[0, 1, 2], [1, 2, 1]], "segments, row 1: expected two ends, found both at one point"),
    ],
)
def test_segments_that_cannot_be(segments, message):
    with pytest.raises(ValueError, match=message):
        measure(bent(), bent(), segments)


def test_a_reference_of_other_particles():
    with pytest.raises(ValueError, match="reference: expected 5 particles, found 3"):
        measure(bent(), column([0, 0]), SEGMENT)
