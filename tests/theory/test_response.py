"""Response under displacement control, its snapdowns, and the trends of the paper's section 6.3."""

from __future__ import annotations

import numpy as np
import pytest

from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.response import displacement_controlled, snapdowns
from forcechain.theory.states import Stability, Status
from forcechain.theory.three_particle import loading
from forcechain.theory.yielding import critical_displacement, critical_force, yield_angles


def peak(p: ChainParameters) -> tuple[float, float]:
    """Largest force and its displacement under displacement control."""
    D = np.linspace(0, 0.8, 4001)
    state = displacement_controlled(p, D)
    top = int(np.argmax(state.axial_force))
    return float(state.axial_force[top]), float(D[top])


def test_response_follows_the_path_where_the_displacement_grows():
    t = np.linspace(0.01, 1.2, 50)
    path = loading(TABLE_3, t)
    state = displacement_controlled(TABLE_3, path.axial_displacement_over_R)
    np.testing.assert_allclose(state.axial_force, path.axial_force, rtol=1e-9)
    np.testing.assert_allclose(state.angle, t, rtol=1e-9)
    first = displacement_controlled(TABLE_3, critical_displacement(TABLE_3) * np.array([0, 0.5, 0.999]))
    assert first.stage.tolist() == ["1a"] * 3


@pytest.mark.parametrize("friction", [0.02, 0.0201, 0.01])
def test_snapdown_skips_the_unstable_part_and_releases_energy(friction):
    p = TABLE_3.with_ratios(rolling_friction=friction)
    jump, *later = snapdowns(p)
    assert all(other.angle_before >= jump.angle_after for other in later)
    between = loading(p, np.linspace(jump.angle_before, jump.angle_after, 200)[1:-1])
    assert (between.axial_displacement_over_R < jump.axial_displacement_over_R).all()
    assert (between.stability == Stability.UNSTABLE).any()
    assert jump.force_after < jump.force_before
    assert jump.energy_released > 0
    assert jump.angle_before == pytest.approx(float(yield_angles(p).moment), abs=1e-6)
    D = jump.axial_displacement_over_R + np.array([-1e-6, 1e-6])
    state = displacement_controlled(p, D)
    assert state.axial_force[0] == pytest.approx(jump.force_before, rel=1e-3)
    assert state.axial_force[1] == pytest.approx(jump.force_after, rel=1e-3)
    for other in later:  # where the lateral support yields, a small one
        assert other.angle_before == pytest.approx(float(yield_angles(p).lateral), abs=1e-6)
        assert 0 < other.energy_released < jump.energy_released
    assert (np.diff(displacement_controlled(p, np.linspace(0, 1, 500)).angle) >= 0).all()


def test_a_fold_snaps_too():
    p = TABLE_3.with_ratios(lateral_stiffness=1e-4)
    (jump,) = snapdowns(p)
    assert jump.angle_before == pytest.approx(float(yield_angles(p).moment), abs=1e-9)
    assert np.isnan(jump.energy_released)
    assert displacement_controlled(p, 0.5).status == Status.BEYOND_FOLD


def test_displacements_beyond_a_right_angle_have_a_status():
    assert displacement_controlled(TABLE_3, 3.9999999).status == Status.ABOVE_RIGHT_ANGLE
    with pytest.raises(ValueError, match="axial displacement over R"):
        displacement_controlled(TABLE_3, -1)
    with pytest.raises(ValueError, match="no buckling"):
        snapdowns(TABLE_3.with_ratios(lateral_stiffness=0.6))
    with pytest.raises(ValueError, match="one parameter set"):
        snapdowns(TABLE_3.with_ratios(lateral_stiffness=[0.05, 0.06]))


# The trends of section 6.3, over the values of Fig. 6.


def test_normal_stiffness_scales_the_force_and_leaves_the_critical_displacement():
    soft, hard = TABLE_3.with_ratios(normal_stiffness=7e4), TABLE_3.with_ratios(normal_stiffness=1.4e5)
    assert critical_displacement(soft) == pytest.approx(float(critical_displacement(hard)), rel=1e-13)
    assert critical_force(hard) == pytest.approx(2 * float(critical_force(soft)), rel=1e-13)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("chain_tangential_stiffness", [0.009, 0.014, 0.03]),
        ("rolling_stiffness", [0, 0.01, 0.1, 0.5]),
        ("lateral_stiffness", [0.04, 0.06, 0.09]),
    ],
)
def test_critical_load_and_its_displacement_grow_with_stiffness(name, values):
    p = TABLE_3.with_ratios(**{name: np.array(values)})
    assert (np.diff(critical_force(p)) > 0).all()
    assert (np.diff(critical_displacement(p)) > 0).all()


def test_peak_load_of_an_imperfect_chain_grows_with_rolling_friction_and_saturates():
    peaks = [peak(TABLE_3.with_ratios(imperfection_deg=2, rolling_friction=mu)) for mu in (0.02, 0.2, 0.3, 0.45)]
    forces, displacements = np.array(peaks).T
    assert forces[1] > forces[0]
    assert displacements[1] > displacements[0]
    np.testing.assert_allclose(forces[1:], forces[1], rtol=1e-12)
    # Well into stage 3 the load still grows with rolling friction.
    late = [
        float(displacement_controlled(TABLE_3.with_ratios(rolling_friction=mu), 0.5).axial_force[0])
        for mu in (0.02, 0.2, 0.3)
    ]
    assert np.all(np.diff(late) > 0)


def test_peak_load_grows_with_lateral_strength_for_an_imperfect_chain():
    peaks = [peak(TABLE_3.with_ratios(imperfection_deg=2, lateral_strength=ls)) for ls in (0.002, 0.005, 0.01, 0.024)]
    forces, displacements = np.array(peaks).T
    assert (np.diff(forces) >= 0).all()
    assert forces[1] > forces[0] * 1.05
    assert displacements[1] > displacements[0]
    # The larger the strength the slower the softening of a perfect chain.
    late = [
        float(displacement_controlled(TABLE_3.with_ratios(lateral_strength=ls), 0.4).axial_force[0])
        for ls in (0.01, 0.024, 0.04, 0.06)
    ]
    assert np.all(np.diff(late) > 0)


def test_order_of_yielding_switches_as_rolling_friction_falls():
    angles = yield_angles(TABLE_3.with_ratios(rolling_friction=np.array([0.02, 0.2, 0.3, 0.45])))
    assert ((angles.moment < angles.lateral) == [True, False, False, False]).all()


@pytest.mark.parametrize(
    ("name", "with_snapdown", "without"),
    [
        ("rolling_friction", [0.02], [0.2, 0.3, 0.45]),
        ("lateral_stiffness", [0.09], [0.04, 0.06]),
        ("lateral_strength", [0.01], [0.024, 0.04, 0.06]),
    ],
)
def test_snapdown_for_small_friction_large_lateral_stiffness_small_strength(name, with_snapdown, without):
    for value in with_snapdown:
        assert snapdowns(TABLE_3.with_ratios(**{name: value}))
    for value in without:
        assert not snapdowns(TABLE_3.with_ratios(**{name: value}))
