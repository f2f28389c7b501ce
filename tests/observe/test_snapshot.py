"""What a snapshot accepts, and the one line it answers with when it does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from packings import column, random_packing


def changed(snapshot, name, row, value):
    array = getattr(snapshot, name).copy()
    array[row] = value
    return replace(snapshot, **{name: array})


def test_arrays_are_read_only_copies():
    packing = random_packing(0)
    position = packing.position.copy()
    made = replace(packing, position=position)
    position[0] = 99
    assert made.position[0, 0] != 99
    view = packing.radius.copy()
    frozen_view = view[:]
    frozen_view.setflags(write=False)  # another name can still write to it
    made = replace(packing, radius=frozen_view)
    view[0] = 99
    assert made.radius[0] != 99
    for name in ("position", "contact_ids", "normal_force"):
        assert not getattr(made, name).flags.writeable
    assert replace(packing).position is packing.position  # nothing to protect, nothing copied


def test_whole_numbers_and_lists_will_do():
    made = replace(column([0]), contact_ids=[[0.0, 1.0], [0, -3], [1, -4]], axial_strain=np.float32(0.5))
    assert made.contact_ids.dtype == np.int64
    assert made.n_contacts == 3
    assert made.n_particles == 2


def test_the_force_of_a_contact():
    """Normal along y: turned by +90 degrees it points to -x."""
    made = replace(column([0]), tangential_force=[3.0, 0.0, 0.0])
    np.testing.assert_allclose(made.contact_force[0], (-3, 10), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "row", "value", "message"),
    [
        ("position", (1, 0), np.nan, "position, row 1: expected a finite number, found nan"),
        ("normal_force", 2, np.inf, "normal_force, row 2: expected a finite number, found inf"),
        ("radius", 1, 0.0, "particles row 1: expected a positive radius, found 0"),
        ("normal_stiffness", 1, -5.0, "contacts row 1: expected a positive normal_stiffness, found -5"),
        ("friction", 0, -0.1, "contacts row 0: expected a friction of at least 0, found -0.1"),
        ("contact_normal", 0, (0.0, 1.1), "contacts row 0: expected a unit normal, found length 1.1"),
        ("contact_ids", 0, (0, 7), r"contacts row 0: id2=7 is not a particle or a wall \(2 particles\)"),
        ("contact_ids", 0, (-3, 1), r"contacts row 0: id1=-3 is not a particle \(2 particles\)"),
        ("contact_ids", 0, (1, -6), "contacts row 0: id2=-6 is not a particle or a wall"),
        ("contact_ids", 0, (1, 1), "contacts row 0: particle 1 touches itself"),
        ("contact_ids", 0, (0, -3), "contacts: the contact of -3 and 0 is there twice"),
    ],
)
def test_values_that_cannot_be(name, row, value, message):
    with pytest.raises(ValueError, match=message):
        changed(column([0]), name, row, value)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("rotation", [0.0], r"rotation: expected an array of shape \(2,\), found \(1,\)"),
        ("contact_point", np.zeros((2, 2)), r"contact_point: expected an array of shape \(3, 2\), found \(2, 2\)"),
        ("contact_ids", [[0, 1.5], [0, -3], [1, -4]], "contact_ids, row 0: expected a whole number, found 1.5"),
        ("radius", ["a", "b"], "radius: expected numbers, found <U1"),
        ("axial_strain", float("nan"), "axial_strain: expected a finite number, found nan"),
    ],
)
def test_arrays_that_cannot_be(name, value, message):
    with pytest.raises(ValueError, match=message):
        replace(column([0]), **{name: value})


def test_the_same_contact_both_ways_round_is_there_twice():
    with pytest.raises(ValueError, match="contacts: the contact of 0 and 1 is there twice"):
        replace(column([0]), contact_ids=[[0, 1], [1, 0], [1, -4]])
