"""Facts of the whole sample on packings whose values are known by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from packings import build, random_packing, turned

from forcechain.observe.macroscopic import (
    box_of,
    contact_stress,
    coordination,
    solid_fraction,
    stress_ratio,
    unbalanced_forces,
    wall_stress,
)

R = 1e-3


def pressed_square(lateral=2.0, axial=6.0, extra=()):
    """Four discs between four walls 4 R apart, in balance; each column bears `axial`, each row `lateral`."""
    position = 2 * R * np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    contacts = [(0, 1, lateral), (2, 3, lateral), (0, 2, axial), (1, 3, axial)]
    contacts += [(k, (-1, 180), lateral) for k in (0, 2)] + [(k, (-2, 0), lateral) for k in (1, 3)]
    contacts += [(k, (-3, -90), axial) for k in (0, 1)] + [(k, (-4, 90), axial) for k in (2, 3)]
    position = np.concatenate((position, np.array([place for place, *_ in extra]).reshape(-1, 2)))
    return build(position, R, contacts + [contact for _, *more in extra for contact in more])


def test_box_and_solid_fraction():
    box = box_of(pressed_square())
    assert (box.left, box.right, box.bottom, box.top) == pytest.approx((-R, 3 * R, -R, 3 * R))
    assert box.area == pytest.approx(16 * R**2)
    assert solid_fraction(pressed_square(), box.area) == pytest.approx(math.pi / 4)


def test_stress_from_contacts_and_from_walls():
    """Two columns of 6 N over a width of 4 R, two rows of 2 N over the height: 3/R along y, 1/R along x."""
    sample = pressed_square()
    expected = np.diag([1 / R, 3 / R])
    np.testing.assert_allclose(contact_stress(sample, 16 * R**2), expected, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(wall_stress(sample, 16 * R**2), expected, rtol=1e-12, atol=1e-9)
    assert stress_ratio(contact_stress(sample, 16 * R**2)) == pytest.approx(0.5)
    oblique = contact_stress(turned(sample, 0.4), 16 * R**2)
    assert abs(oblique[0, 1]) > 100
    assert stress_ratio(oblique) == pytest.approx(0.5)


def test_walls_and_contacts_disagree_out_of_balance():
    sample = pressed_square()
    pushed = replace(sample, normal_force=np.where(np.arange(sample.n_contacts) == 2, 9.0, sample.normal_force))
    difference = contact_stress(pushed, 16 * R**2) - wall_stress(pushed, 16 * R**2)
    assert difference[1, 1] == pytest.approx(3.0 * 2 * R / (16 * R**2))
    force, _ = unbalanced_forces(pushed)
    np.testing.assert_allclose(force, [(0, -3), (0, 0), (0, 3), (0, 0)], atol=1e-12)


def test_balance_of_forces_and_moments():
    force, moment = unbalanced_forces(pressed_square())
    np.testing.assert_allclose(force, 0, atol=1e-12)
    np.testing.assert_allclose(moment, 0, atol=1e-15)
    # A contact along x from 0 to 1: 3 N tangential (up on 1, down on 0) and 2e-4 N m (on 1).
    rubbed = build([(0, 0), (2 * R, 0)], R, [(0, 1, 10.0, 3.0, 2e-4)])
    force, moment = unbalanced_forces(rubbed)
    np.testing.assert_allclose(force, [(-10, -3), (10, 3)], atol=1e-12)
    np.testing.assert_allclose(moment, [-3 * R - 2e-4, -3 * R + 2e-4])


def test_rattlers_are_removed_until_none_is_left():
    """Two discs in a tail: the last has one contact, and without it so has the other."""
    tail = [((6 * R, 0), (1, 4, 1.0)), ((8 * R, 0), (4, 5, 1.0)), ((20 * R, 0),)]
    found = coordination(pressed_square(extra=tail))
    assert found.rattler.tolist() == [False] * 4 + [True] * 3
    assert found.every_particle == pytest.approx((4 * 4 + 1 + 2 + 1) / 7)
    assert found.without_rattlers == pytest.approx(4.0)
    assert found.rattler_share == pytest.approx(3 / 7)
    assert coordination(build([(0, 0), (1, 0)], R, [])).without_rattlers == 0
    unloaded = coordination(build([(0, 0), (2 * R, 0)], R, [(0, 1, 0.0)]))
    assert unloaded.every_particle == 0  # a contact without a force is none


def test_unbalanced_forces_of_a_random_packing():
    """Every contact pushes both its discs alike: only walls leave a resultant on all together."""
    packing = random_packing(1)
    force, _ = unbalanced_forces(packing)
    at_wall = packing.contact_ids[:, 1] < 0
    np.testing.assert_allclose(force.sum(axis=0), -packing.contact_force[at_wall].sum(axis=0), atol=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: box_of(build([(0, 0), (2 * R, 0)], R, [(0, (-1, 180), 1.0)])), "some with the right wall .-2., found"),
        (lambda: solid_fraction(pressed_square(), 0.0), "area: expected above 0, found 0.0"),
        (lambda: contact_stress(pressed_square(), -1.0), "area: expected above 0, found -1.0"),
        (lambda: wall_stress(pressed_square(), math.nan), "area: expected above 0, found nan"),
        (lambda: stress_ratio(np.zeros((2, 2))), "stress: expected a mean above 0, found 0"),
    ],
)
def test_what_has_no_answer(call, message):
    with pytest.raises(ValueError, match=message):
        call()
