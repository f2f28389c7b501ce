"""Chains and segments whose answers are known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from packings import branched, build, column, random_packing, relabelled, take_contacts, turned

from forcechain.observe.chains import find_chains
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.segments import find_segments, measure
from forcechain.observe.stress import bearing_force, particle_stress, principal

R = 1e-3
EVERY = AnalysisOptions(segment_rule="every", stress_threshold=0.5)


def observe(snapshot, options=None):
    options = options or AnalysisOptions()
    chains = find_chains(snapshot, options)
    return chains, find_segments(snapshot, chains, options)


def test_straight_chain_of_five():
    chains, segments = observe(column([0, 0, 0, 0]))
    assert chains.n_chains == 1
    assert chains.length.tolist() == [5]
    assert chains.branch_points.tolist() == [0]
    assert segments.tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4]]


def test_stress_of_a_pressed_column():
    """Each disc: 10 N at arms of R on both sides, over its area: 2 F R/(pi R^2), nothing across."""
    found = principal(particle_stress(column([0, 0, 0, 0])))
    np.testing.assert_allclose(found.major, 2 * 10 / (math.pi * R), rtol=1e-12)
    np.testing.assert_allclose(found.minor, 0, atol=1e-9)
    np.testing.assert_allclose(np.abs(found.direction[:, 1]), 1)
    moment = particle_stress(column([0, 0]), weight="none")
    np.testing.assert_allclose(moment[:, 1, 1], 2 * 10 * R, rtol=1e-12)


@pytest.mark.parametrize(("angle", "n_segments"), [(10, 5), (40, 5), (50, 0)])
def test_zigzag(angle, n_segments):
    """Discs alternate left and right, so the stress of each inner disc points along the column, or, beyond 45, across.

    All are one chain if a link may stand that far off; across the column both links of a disc lie on one side of it.
    """
    snapshot = column([angle, -angle, angle, -angle, angle, -angle])
    off = min(angle, 90 - angle)
    chains, segments = observe(snapshot, AnalysisOptions(stress_threshold=0.5, alignment_angle=math.radians(off + 1)))
    assert chains.label[1:-1].tolist() == [0] * 5
    assert len(segments) == n_segments
    tight = AnalysisOptions(stress_threshold=0.5, alignment_angle=math.radians(off - 1))
    assert observe(snapshot, tight)[0].n_chains == 0


def test_branched_chain():
    """The best link goes straight on from 2 (its direction leans a little to the branch, 11 degrees); every, both."""
    options = AnalysisOptions(stress_threshold=0.5)
    chains, segments = observe(branched(), options)
    assert chains.length.tolist() == [7]
    assert chains.degree.tolist() == [1, 2, 3, 2, 1, 2, 1]
    assert chains.branch_points.tolist() == [1]
    assert segments.tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4], [2, 5, 6]]
    assert observe(branched(), EVERY)[1].tolist() == [[0, 1, 2], [1, 2, 3], [1, 2, 5], [2, 3, 4], [2, 5, 6]]


def test_threshold_keeps_what_is_at_or_above_the_mean():
    """At 1 the trunk alone is above the mean; 3 particles, so one segment."""
    chains, segments = observe(branched())
    assert np.flatnonzero(chains.highly_stressed).tolist() == [0, 1, 2]
    assert segments.tolist() == [[0, 1, 2]]
    assert observe(branched(), AnalysisOptions(minimum_chain_length=4))[0].n_chains == 0


def test_rattlers_do_not_lower_the_mean():
    """Two columns, one at half the force; a rattler more would bring the weak one above the mean of all particles."""
    x = 10 * R
    position = [(0, 2 * R * k) for k in range(3)] + [(x, 2 * R * k) for k in range(3)]
    position += [(30 * R, 4 * R * k) for k in range(6)]
    contacts = []
    for first, force in ((0, 10.0), (3, 6.0)):
        contacts += [(first, (-3, -90), force), (first, first + 1, force), (first + 1, first + 2, force)]
        contacts += [(first + 2, (-4, 90), force)]
    snapshot = build(position, R, contacts)
    assert np.flatnonzero(bearing_force(snapshot)).tolist() == [0, 1, 2, 3, 4, 5]
    assert np.flatnonzero(observe(snapshot)[0].highly_stressed).tolist() == [0, 1, 2]


def test_a_link_needs_a_force():
    """A contact listed without a force joins nothing."""
    snapshot = column([0, 0, 0, 0])
    position, contacts = snapshot.position, [(0, (-3, -90), 10.0), (0, 1, 10.0), (1, (-4, 90), 10.0), (1, 2, 0.0)]
    contacts += [(2, (-3, -90), 10.0), (2, 3, 10.0), (3, 4, 10.0), (4, (-4, 90), 10.0)]
    chains, _ = observe(build(position, R, contacts))
    assert chains.links.tolist() == [[0, 1], [2, 3], [3, 4]]
    assert chains.length.tolist() == [3]


def test_isotropic_particles_have_no_direction():
    """Pressed alike from four sides: no principal direction, so no link, however the axes are turned."""
    position = 2 * R * np.array([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)])
    contacts = [(0, k, 10.0) for k in (1, 2, 3, 4)]
    contacts += [(k, (wall, 90 * (k - 1)), 10.0) for k, wall in ((1, -2), (2, -4), (3, -1), (4, -3))]
    for angle in (0.0, 0.3, 1.1):
        snapshot = turned(build(position, R, contacts), angle)
        found = principal(particle_stress(snapshot))
        assert found.direction[0].tolist() == [0, 0]
        assert observe(snapshot)[0].n_chains == 0


def test_no_contacts_no_chains():
    chains, segments = observe(build([(0, 0), (1, 0)], R, []))
    assert chains.n_chains == 0
    assert segments.shape == (0, 3)
    assert measure(build([(0, 0), (1, 0)], R, []), build([(0, 0), (1, 0)], R, []), segments).rotation.shape == (0,)


def test_wall_segments_can_be_dropped():
    kept = observe(column([0, 0, 0, 0]), AnalysisOptions(wall_segments="drop"))[1]
    assert kept.tolist() == [[1, 2, 3]]


def test_alignment_by_coordination():
    """Five discs in a column, walls at both ends: two contacts each, which gives no angle below 90 degrees."""
    with pytest.raises(ValueError, match="180/Z: expected a coordination above 2, found 2"):
        observe(column([0, 0, 0, 0]), AnalysisOptions(alignment_rule="180/Z"))
    packing = random_packing(3)
    chains = find_chains(packing, AnalysisOptions(alignment_rule="180/Z"))
    bearing = np.count_nonzero(chains.bearing_force)
    assert chains.alignment_angle == pytest.approx(math.pi * bearing / np.count_nonzero(packing.contact_ids >= 0))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rule", ["best", "every"])
def test_segments_move_with_the_packing(seed, rule):
    """Rotation, reflection, magnification and relabelling change no segment and no measure."""
    options = AnalysisOptions(segment_rule=rule, stress_threshold=0.7)
    packing = random_packing(seed)
    moved = turned(packing, 0.1, reflected=False)  # a reference that differs: displacements and rotations count
    reference = turned(moved, -0.1 + 1e-3)
    chains, segments = observe(packing, options)
    values = measure(packing, reference, segments)
    assert len(segments) > 10
    rng = np.random.default_rng(seed)
    for angle, reflected, scale in ((0.7, False, 1.0), (2.9, True, 1.0), (math.pi / 2, True, 3.0), (-1.3, False, 0.2)):
        image = turned(packing, angle, reflected=reflected, scale=scale)
        chains_image, segments_image = observe(image, options)
        np.testing.assert_array_equal(segments_image, segments)
        np.testing.assert_array_equal(chains_image.label, chains.label)
        got = measure(image, turned(reference, angle, reflected=reflected, scale=scale), segments)
        for name, power in (("buckling_angle", 0), ("rotation", 0), ("axial_force", 1), ("lateral_force", 1),
                            ("axial_displacement", 1), ("normal_displacement", 1)):  # fmt: skip
            np.testing.assert_allclose(
                getattr(got, name), scale**power * getattr(values, name), rtol=1e-8, atol=scale**power * 1e-12
            )
    renumbered, new_number = relabelled(packing, rng)
    renumbered_reference = turned(reference, 0.0, shift=(0, 0))
    again, segments_again = observe(renumbered, options)
    expected = np.sort(new_number[segments][:, [0, 2]], axis=1)
    expected = {(int(a), int(c), int(b)) for (a, b), c in zip(expected, new_number[segments[:, 1]], strict=True)}
    assert {tuple(row) for row in segments_again.tolist()} == expected
    assert again.n_chains == chains.n_chains
    assert sorted(again.length.tolist()) == sorted(chains.length.tolist())
    order = np.argsort(new_number)
    renumbered_reference = relabel_like(renumbered_reference, order)
    got = measure(renumbered, renumbered_reference, segments_again)
    np.testing.assert_allclose(np.sort(got.lateral_force), np.sort(values.lateral_force), rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(np.sort(got.rotation), np.sort(values.rotation), rtol=1e-8, atol=1e-12)


def relabel_like(reference, order):
    """Positions and rotations of the reference in the new numbering; it needs no contacts."""
    bare = take_contacts(reference, [])
    return type(bare)(
        **{
            name: getattr(bare, name)[order] if name in ("radius", "position", "rotation", "velocity", "spin")
            else getattr(bare, name)
            for name in bare.__dataclass_fields__
        }
    )  # fmt: skip


def test_a_tie_goes_to_the_larger_force():
    """Two links equally far off the vertical above the centre: the more loaded one is taken, whatever its number."""
    tilt = math.radians(20)
    for left, right in ((12.0, 11.9999999), (11.9999999, 12.0)):
        position = (
            2 * R * np.array([(0, 0), (0, -1), (-math.sin(tilt), math.cos(tilt)), (math.sin(tilt), math.cos(tilt))])
        )
        position[2:, 0] *= 1.6  # apart
        contacts = [
            (0, 1, 20.0),
            (1, (-3, -90), 20.0),
            (0, 2, left),
            (0, 3, right),
            (2, (-4, 90), 14.0),
            (3, (-4, 90), 14.0),
        ]
        chains, segments = observe(build(position, R, contacts), AnalysisOptions(stress_threshold=0.2))
        assert chains.length.tolist() == [4]
        assert [0, 2 if left > right else 3] == [segments[0, 1], max(segments[0])]
