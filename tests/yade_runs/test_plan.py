"""The plan of a test, its parameters and the tables' order: what needs no YADE."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from yade_scripts import export, packing, parameters
from yade_scripts.plan import plan_of

MASSES = np.array([1e-5, 2e-5, 3e-5])


def planned(**given_values: Any):
    return plan_of(parameters.check(given_values), MASSES)


def test_the_loading_rate_follows_from_the_inertial_number_unless_given() -> None:
    assert planned().strain_rate == pytest.approx(1e-4 / np.sqrt(2e-5 / 700), rel=1e-12)
    assert planned(strain_rate=0.25).strain_rate == 0.25


def test_stiffer_springs_and_true_masses_shorten_the_step() -> None:
    fine = {"history_strain_interval": 1e-3, "snapshot_strain_interval": 1e-3}
    limit = np.sqrt(1e-5 / 1.05e5)
    for options, factor in (
        ({}, 0.5),
        ({"mass": "true"}, 0.3),
        ({"tangential_stiffness_ratio": 2.0}, 0.25),
        ({"rolling_stiffness_ratio": 8.0}, 0.125),
        ({"rolling_stiffness_ratio": 0.0}, 0.5),
        ({"time_step_factor": 0.07}, 0.07),
    ):
        assert 0.98 * factor < planned(**fine, **options).time_step / limit <= factor


@settings(max_examples=60, deadline=None)
@given(
    history=st.sampled_from([1e-5, 5e-5, 1e-4, 1.3e-4, 2.5e-4, 1e-3]),
    snapshots=st.sampled_from([3e-5, 1.25e-4, 2.5e-4, 7e-4, 1e-2]),
    final=st.sampled_from([0.01, 0.0373, 0.1]),
    rate=st.sampled_from([0.1, 0.5, 3.0]),
)
def test_samples_fall_within_half_a_step_of_the_multiples(
    history: float, snapshots: float, final: float, rate: float
) -> None:
    plan = planned(
        history_strain_interval=history, snapshot_strain_interval=snapshots, final_axial_strain=final, strain_rate=rate
    )
    step = plan.strain_rate * plan.time_step
    assert plan.time_step <= 0.5 * np.sqrt(1e-5 / 1.05e5) * (1 + 1e-12)
    for steps, interval in ((plan.history_steps, history), (plan.snapshot_steps, snapshots)):
        assert steps[0] == 0
        assert steps[-1] == plan.last_step
        assert sorted(set(steps)) == steps
        strains = np.array(steps[:-1]) * step
        off = strains - interval * np.round(strains / interval)
        assert np.abs(off).max() <= 0.5 * step * (1 + 1e-6)
    assert abs(plan.last_step * step - final) <= 0.5 * step * (1 + 1e-6)


@pytest.mark.parametrize("text", ["0.1", "0.2:0.1", "a:b", "0.1:0.2:0.3", "-0.1:0.2", "0.1:1.5", "nan:0.2"])
def test_strain_intervals_that_are_none(text: str) -> None:
    with pytest.raises(parameters.ParameterError, match="expected BEGIN:END"):
        parameters.check({"dense_strain_intervals": text})


def test_packings_are_told_apart_by_what_makes_them_different() -> None:
    name = packing.file_name(parameters.check({}))
    same = ({"friction": 0.1}, {"rolling_friction": 0.0}, {"mass": "true"}, {"density": 1.0}, {"wall_friction": 0.5})
    other = ({"seed": 2}, {"particle_count": 10}, {"confining_stress": 1.0}, {"preparation_friction": 0.1})
    assert all(packing.file_name(parameters.check(values)) == name for values in same)
    assert len({name} | {packing.file_name(parameters.check(values)) for values in other}) == len(other) + 1


def test_contacts_are_turned_to_the_order_of_the_format() -> None:
    zeros = np.zeros(3)
    contacts = {
        "id1": np.array([-3, 2, 0]),
        "id2": np.array([1, 0, 1]),
        "nx": np.array([0.0, 1.0, 1.0]),
        "ny": np.array([1.0, 0.0, 0.0]),
        "ft": np.array([0.1, 0.2, 0.3]),
        "moment": np.array([0.0, 5.0, 6.0]),
        "fn": zeros,
    }
    table = export.in_order(contacts)
    np.testing.assert_array_equal(np.stack((table["id1"], table["id2"]), axis=1), [[0, 1], [0, 2], [1, -3]])
    np.testing.assert_array_equal(table["nx"], [1, -1, 0])
    np.testing.assert_array_equal(table["ny"], [0, 0, -1])
    np.testing.assert_array_equal(table["moment"], [6, -5, 0])
    np.testing.assert_array_equal(table["ft"], [0.3, 0.2, 0.1])
    with pytest.raises(ValueError, match="two walls touch"):
        export.in_order(contacts | {"id2": np.array([-1, 0, 1])})
