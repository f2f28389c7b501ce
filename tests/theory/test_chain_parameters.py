"""The inputs of the model: what is admitted, and how ratios and SI values go together."""

from __future__ import annotations

import numpy as np
import pytest

from forcechain.theory.parameters import TABLE_3, ChainParameters


def test_table_3():
    assert TABLE_3.radius == 1.14e-3
    assert TABLE_3.rolling_stiffness == 0.5 * 1.05e5
    assert TABLE_3.lateral_strength == pytest.approx(0.024 * 1.05e5, rel=1e-15)
    assert TABLE_3.shape == ()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("radius", 0, "radius: expected a finite number above 0, found 0"),
        ("normal_stiffness", -1, "normal_stiffness: expected a finite number above 0, found -1"),
        ("rolling_friction", float("nan"), "rolling_friction: expected a finite number of at least 0, found nan"),
        ("lateral_stiffness", -0.1, "lateral_stiffness: expected a finite number of at least 0, found -0.1"),
        ("lateral_strength", [0.1, -2], r"lateral_strength, entry \(1,\): expected .*, found -2"),
        ("imperfection_deg", 90, "imperfection: expected an angle of at least 0 and below pi/2"),
        ("chain_tangential_stiffness", "soft", "chain_tangential_stiffness: expected numbers"),
        ("stiffness", 1, "unknown parameter 'stiffness'"),
    ],
)
def test_inadmissible_values_are_named(name, value, message):
    with pytest.raises(ValueError, match=message):
        ChainParameters.from_ratios(**{name: value})


def test_shapes_that_do_not_broadcast():
    with pytest.raises(ValueError, match="broadcast together"):
        ChainParameters.from_ratios(rolling_friction=[0.1, 0.2], lateral_strength=[0.1, 0.2, 0.3])


def test_ratios_come_back_and_stay_when_the_stiffness_changes():
    changed = TABLE_3.with_ratios(normal_stiffness=7e4, imperfection_deg=2)
    assert changed.ratios()["lateral_stiffness"] == pytest.approx(0.06, rel=1e-15)
    assert changed.lateral_stiffness == pytest.approx(0.06 * 7e4, rel=1e-15)
    assert changed.imperfection == pytest.approx(np.radians(2), rel=1e-15)


def test_arrays_are_copied_and_frozen():
    friction = np.array([0.1, 0.2])
    parameters = TABLE_3.with_ratios(rolling_friction=friction)
    friction[0] = 9
    assert parameters.rolling_friction[0] == 0.1
    with pytest.raises(ValueError, match="read-only"):
        parameters.rolling_friction[0] = 1
