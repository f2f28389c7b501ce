"""Histories of one chain: events, energies and the agreement with the closed form of monotonic loading."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from test_three_particle import random_parameters

from forcechain.theory.history import Ending, History, follow, unloading
from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.states import Stability, Status
from forcechain.theory.three_particle import loading
from forcechain.theory.yielding import FIELDS, too_stiff, yield_angles

PRINTED_STAGE_4_CASES = [(25, 24), (25, 18), (40, 36), (15, 12)]


def random_set(n: int, seed: int) -> list[ChainParameters]:
    p = random_parameters(4 * n, seed)
    rows = np.flatnonzero(~too_stiff(p))[:n]
    return [ChainParameters(**{name: np.broadcast_to(getattr(p, name), 4 * n)[i] for name in FIELDS}) for i in rows]


def check_path(path: History, p: ChainParameters, tolerance: float = 1e-8) -> None:
    """Equilibrium, yield conditions, growth of dissipation and the energy balance (18) at every point."""
    state, R, kn = path.state, p.radius, p.normal_stiffness
    t, d = state.angle, state.normal_displacement_over_R
    m, s = state.contact_moment / R**2, state.lateral_force / (2 * R)
    away = t > 0
    residual = d * (2 - d) * np.sin(t) - 2 * np.cos(t) ** 2 * (m + s) / kn
    assert np.abs(residual[away]).max() < 1e-12
    assert (np.abs(m) <= p.rolling_friction * kn * d + 1e-10 * kn).all()
    assert (np.abs(s) <= p.lateral_strength / 2 * (1 + 1e-12)).all()
    scale = np.abs(path.work).max()
    assert np.diff(path.moment_dissipation).min() >= -1e-12 * scale
    assert np.diff(path.lateral_dissipation).min() >= -1e-12 * scale
    assert path.energy_error < tolerance
    for before, after in pairwise(path.arcs):  # one arc hands over to the next without a jump
        end, start = before.at(before.end), after.at(after.start)
        for name in ("d", "w", "wp", "tp"):
            assert float(getattr(start, name)) == pytest.approx(float(getattr(end, name)), abs=1e-7)


@pytest.mark.parametrize("changes", [{}, {"rolling_friction": 0.02}, {"imperfection_deg": 2}, {"rolling_friction": 0}])
def test_loading_leg_is_the_closed_form(changes):
    p = TABLE_3.with_ratios(**changes)
    path = follow(p, [1.2])
    closed = loading(p, path.state.angle)
    for name in ("axial_force", "normal_displacement_over_R", "rotation", "lateral_force", "plastic_rotation"):
        np.testing.assert_allclose(getattr(path.state, name), getattr(closed, name), rtol=1e-11, atol=1e-14)
    corners = np.isin(path.state.angle, [arc.start for arc in path.arcs])
    assert (path.state.stage == closed.stage)[~corners].all()
    check_path(path, p)


def test_thousand_random_chains_loaded_unloaded_and_loaded_again():
    rng = np.random.default_rng(11)
    endings = []
    for p in random_set(1000, seed=21):
        first = rng.uniform(p.imperfection + 0.02, 1.3)
        second = rng.uniform(max(p.imperfection, 0.5 * first), first)
        path = follow(p, [first, second, min(1.4, first * 1.1), 0.0], points=24)
        check_path(path, p)
        endings.append(path.ending)
    assert {Ending.SEPARATED, Ending.STRAIGHT} <= set(endings)
    assert endings.count(Ending.DEAD_END) < 100


def test_states_are_stationary_points_of_the_energy():
    """At given plastic displacements psi - F D has no slope in overlap, angle or rotation (finite differences)."""
    rng = np.random.default_rng(5)
    for p in random_set(1000, seed=31):
        first = rng.uniform(p.imperfection + 0.05, 1.3)
        path = follow(p, [first, 0.6 * first], points=12)
        state = path.state
        for i in rng.choice(len(state.angle), 2, replace=False):
            if state.angle[i] < 1e-3:
                continue
            force, wp, tp = state.axial_force[i], state.plastic_rotation[i], state.plastic_support[i]

            def energy(x, p=p, force=force, wp=wp, tp=tp):
                d, t, w = x
                st = np.sin(t) - np.sin(p.imperfection)
                psi = p.normal_stiffness * d**2 + p.chain_tangential_stiffness * (2 * st - w) ** 2
                psi += p.rolling_stiffness * (w - wp) ** 2
                psi += 2 * p.lateral_stiffness * (st - tp) ** 2 * (p.lateral_strength > 0)
                displacement = 4 * np.cos(p.imperfection) - 2 * (2 - d) * np.cos(t)
                return psi / p.normal_stiffness - force / (p.normal_stiffness * p.radius) * displacement

            x = np.array([state.normal_displacement_over_R[i], state.angle[i], state.rotation[i]])
            for axis in range(3):
                step = np.zeros(3)
                step[axis] = 1e-5
                slope = (energy(x + step) - energy(x - step)) / 2e-5
                assert abs(slope) < 1e-8
                moved = x + 1e-3 * np.eye(3)[(axis + 1) % 3]
                assert abs((energy(moved + step) - energy(moved - step)) / 2e-5) < 10  # finite elsewhere too
        wrong = np.array([x[0] * 1.1 + 1e-3, x[1], x[2]])
        step = np.array([1e-5, 0, 0])
        assert abs(energy(wrong + step) - energy(wrong - step)) / 2e-5 > 1e-5


def printed_stage_4(p: ChainParameters, start: float, t: float) -> tuple[float, float]:
    """F and w of the paper's stage 4, with wp and tp taken at `start`, as printed."""
    R, kn, kr, kt, ks = (
        p.radius,
        p.normal_stiffness,
        p.rolling_stiffness,
        p.chain_tangential_stiffness,
        p.lateral_stiffness,
    )
    at = loading(p, start)
    wp, tp = float(at.plastic_rotation), float(at.plastic_support)
    supports = kt * kr * (2 * np.sin(t) - wp) / (kt + kr) + ks * (np.sin(t) - tp)
    force = R * kn / np.cos(t) * (1 - np.sqrt(1 - 2 * np.cos(t) ** 2 / (kn * np.sin(t)) * supports))
    return force, (2 * kt * np.sin(t) + kr * wp) / (kt + kr)


@pytest.mark.parametrize(("start_deg", "angle_deg"), PRINTED_STAGE_4_CASES)
def test_stage_4_is_the_printed_one_until_the_moment_slips(start_deg, angle_deg):
    start, t = np.radians(start_deg), np.radians(angle_deg)
    state = unloading(TABLE_3, start, t)
    force, rotation = printed_stage_4(TABLE_3, start, t)
    assert state.stage[0] == "4"
    assert state.axial_force[0] == pytest.approx(force, rel=1e-12)
    assert state.rotation[0] == pytest.approx(rotation, rel=1e-12)


def test_moment_slips_again_before_the_chain_is_unloaded_unless_held():
    """At zero force a moment has no strength left, so the printed stage 4 cannot reach it with wp frozen."""
    start = np.radians(25)
    free, held = follow(TABLE_3, [start, 0.0]), follow(TABLE_3, [start, 0.0], sliders="held")
    assert free.state.stage[-1] == "4'"
    assert held.state.stage[-1] == "4"
    assert free.ending == held.ending == Ending.SEPARATED
    assert free.state.contact_moment[-1] == pytest.approx(0, abs=1e-12)
    assert abs(held.state.contact_moment[-1]) > 1e-6
    assert held.energy_error < 1e-12
    below = unloading(TABLE_3, start, np.radians(5))
    assert below.status[0] == Status.SEPARATED
    assert np.isnan(below.axial_force[0])


def test_elastic_chain_unloads_along_its_loading_path_to_the_straight_column():
    path = follow(TABLE_3, np.radians([8.0, 0.0]))
    assert path.ending == Ending.STRAIGHT
    assert path.state.angle[-1] == 0
    back = path.leg == 1
    np.testing.assert_allclose(
        path.state.axial_force[back][:-1], loading(TABLE_3, path.state.angle[back][:-1]).axial_force, rtol=1e-13
    )
    assert path.moment_dissipation[-1] == path.lateral_dissipation[-1] == 0


def test_reloading_meets_the_point_it_left_and_yields_there():
    path = follow(TABLE_3, np.radians([25, 20, 26]))
    names = path.state.stage[path.leg == 2]
    assert names[0] == "4"
    assert names[-1] == "3"
    assert path.state.axial_force[-1] == pytest.approx(float(loading(TABLE_3, np.radians(26)).axial_force), rel=1e-12)


def test_weak_lateral_support_folds_the_path_and_snaps():
    p = TABLE_3.with_ratios(lateral_stiffness=1e-4)
    angles = yield_angles(p)
    assert angles.folds
    after = loading(p, angles.moment + 0.05)
    assert after.status == Status.BEYOND_FOLD
    path = follow(p, [0.5])
    assert path.ending == Ending.REACHED
    assert [arc.direction for arc in path.arcs][-2:] == [-1, 1]
    assert (path.state.stability[path.leg == 0] == Stability.UNSTABLE).any()
    assert path.state.axial_force[-1] == pytest.approx(float(loading(p, 0.5).axial_force), rel=1e-9)
    check_path(path, p)
    assert not yield_angles(TABLE_3).folds


def test_a_support_that_yields_early_and_is_weak_leaves_no_path_when_the_moment_yields():
    """Going back in angle would unload the stiff support at once, going on would need a moment beyond its limit."""
    p = TABLE_3.with_ratios(lateral_strength=1e-5)
    angles = yield_angles(p)
    assert angles.folds
    path = follow(p, [0.5])
    assert path.ending == Ending.DEAD_END
    assert path.state.angle[-1] == pytest.approx(float(angles.moment), abs=1e-9)
    check_path(path, p)


def test_without_any_lateral_support_the_chain_falls():
    path = follow(TABLE_3.with_ratios(lateral_strength=0), [0.5])
    assert path.ending == Ending.SEPARATED
    assert path.state.axial_force[-1] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("turning", "message"),
    [([], "found none"), ([1.6], "below pi/2"), ([0.3, 0.3], "twice in a row"), ([float("nan")], "finite")],
)
def test_turning_angles_that_are_none(turning, message):
    with pytest.raises(ValueError, match=message):
        follow(TABLE_3, turning)


def test_a_chain_too_stiff_to_buckle_has_no_path():
    with pytest.raises(ValueError, match="no buckling"):
        follow(TABLE_3.with_ratios(lateral_stiffness=1), [0.3])


def test_unloading_above_its_start():
    with pytest.raises(ValueError, match="at most the angle of unloading"):
        unloading(TABLE_3, 0.3, 0.4)


def test_unloading_from_where_loading_does_not_lead():
    with pytest.raises(ValueError, match="a start that loading reaches"):
        unloading(TABLE_3.with_ratios(lateral_strength=1e-5), 0.5, 0.3)
