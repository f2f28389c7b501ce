"""The closed form against the printed numbers and against its own equations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.states import Stability, Status
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement, critical_force, yield_angles

# t [deg], stage, F [N], d, D/R, w [deg] of Table 3, computed apart from this program to nine decimals
PRINTED = [
    (5, "1b", 10.896666670, 0.090686730, 0.195904487, 0.272027965),
    (14, "2", 9.273071418, 0.075168100, 0.264687667, 0.755079573),
    (20, "2", 7.214467922, 0.056636443, 0.347671213, 1.067503308),
    (25, "3", 5.207104560, 0.039425559, 0.446232234, 16.158226419),
]


@pytest.mark.parametrize(("angle_deg", "stage", "force", "overlap", "displacement", "rotation_deg"), PRINTED)
def test_printed_values_of_table_3(angle_deg, stage, force, overlap, displacement, rotation_deg):
    state = loading(TABLE_3, np.radians(angle_deg))
    assert state.stage == stage
    assert state.status == Status.EQUILIBRIUM
    printed_digits = 0.5e-9
    for found, printed in (
        (state.axial_force, force),
        (state.normal_displacement_over_R, overlap),
        (state.axial_displacement_over_R, displacement),
        (np.degrees(state.rotation), rotation_deg),
    ):
        assert abs(float(found) - printed) <= printed_digits * 1.01


def test_printed_critical_load_and_yield_angles():
    assert abs(critical_force(TABLE_3) - 10.942468405) <= 0.51e-9
    assert abs(critical_displacement(TABLE_3) - 0.182831552) <= 0.51e-9
    angles = yield_angles(TABLE_3)
    assert abs(np.degrees(angles.lateral) - 11.536959) <= 0.51e-6
    assert abs(np.degrees(angles.moment) - 22.311269) <= 0.51e-6


def printed_equation(number: str, t: float, p: ChainParameters) -> float:
    """Axial force by the formulas as the paper prints them, symbol by symbol."""
    R, kn, kr, kt = p.radius, p.normal_stiffness, p.rolling_stiffness, p.chain_tangential_stiffness
    ks, ls, mu, ti = p.lateral_stiffness, p.lateral_strength, p.rolling_friction, p.imperfection
    c2, sin, imp = np.cos(t) ** 2, np.sin(t), np.sin(ti)
    if number == "10":
        root = 1 - 2 * c2 * (2 * kt * kr + ks * kt + ks * kr) / (kn * (kt + kr))
    elif number == "23":
        root = 1 - 2 * c2 / kn * (2 * kt * kr / (kt + kr) + ls / (2 * sin))
    elif number == "A.1":
        root = 1 - 2 * c2 * (2 * kt * kr + ks * kt + ks * kr) * (sin - imp) / (kn * (kt + kr) * sin)
    elif number == "A.2":
        root = 1 - 2 * c2 / (kn * sin) * (2 * kt * kr * (sin - imp) / (kt + kr) + ls / 2)
    else:  # 26
        a = mu * c2 - sin
        return R * kn / (sin * np.cos(t)) * (-a - np.sqrt(a * a - ls * sin * c2 / kn))
    return R * kn / np.cos(t) * (1 - np.sqrt(root))


@pytest.mark.parametrize(
    ("number", "imperfection_deg", "angle_deg"),
    [("10", 0, 8), ("23", 0, 17), ("26", 0, 40), ("A.1", 2, 9), ("A.2", 2, 18), ("26", 2, 40)],
)
def test_force_is_the_printed_equation(number, imperfection_deg, angle_deg):
    p = TABLE_3.with_ratios(imperfection_deg=imperfection_deg)
    t = np.radians(angle_deg)
    assert loading(p, t).axial_force == pytest.approx(printed_equation(number, t, p), rel=1e-13)
    assert loading(p, t * 1.1).axial_force != pytest.approx(printed_equation(number, t, p), rel=1e-3)


def random_parameters(n: int, seed: int = 1) -> ChainParameters:
    """Parameter sets that can buckle, over a range well beyond the paper's; a third of them imperfect."""
    rng = np.random.default_rng(seed)

    def log(low, high):
        return np.exp(rng.uniform(np.log(low), np.log(high), n))

    return ChainParameters.from_ratios(
        radius=log(1e-4, 1e-2),
        normal_stiffness=log(1e3, 1e7),
        chain_tangential_stiffness=log(2e-3, 0.08),
        rolling_stiffness=log(1e-3, 2),
        rolling_friction=log(1e-3, 1),
        lateral_stiffness=log(5e-3, 0.3),
        lateral_strength=log(1e-3, 0.2),
        imperfection_deg=np.where(rng.random(n) < 0.33, rng.uniform(0, 15, n), 0.0),
    )


def test_random_sets_are_in_equilibrium_within_their_yield_limits():
    p = random_parameters(2000)
    t = np.linspace(0.02, 1.5, 60)[:, None]
    state = loading(p, t)
    good = (state.status == Status.EQUILIBRIUM) | (state.status == Status.BEYOND_FOLD)
    assert good.mean() > 0.8
    d, kn = state.normal_displacement_over_R, p.normal_stiffness
    m, s = state.contact_moment / p.radius**2, state.lateral_force / (2 * p.radius)
    residual = d * (2 - d) * np.sin(t) - 2 * np.cos(t) ** 2 * (m + s) / kn
    assert np.abs(residual[good]).max() < 1e-14
    # both springs in series carry the moment
    assert np.abs((p.rolling_stiffness * (state.rotation - state.plastic_rotation) - m)[good] / kn.max()).max() < 1e-13
    growth = np.sin(t) - np.sin(p.imperfection)
    assert np.abs((p.chain_tangential_stiffness * (2 * growth - state.rotation) - m)[good] / kn.max()).max() < 1e-13
    # yield: within the limit where elastic, on it where plastic
    limit = p.rolling_friction * kn * d
    assert (m <= limit * (1 + 1e-12))[good].all()
    plastic = np.isin(state.stage, ["2'", "3"])
    assert np.abs((m / limit)[good & plastic] - 1).max() < 1e-12
    half = np.broadcast_to(np.asarray(p.lateral_strength) / 2, t.shape[:1] + p.shape)
    assert (s <= half * (1 + 1e-12))[good].all()
    # plasticity never runs backwards while the angle grows
    assert (np.diff(np.where(good, state.plastic_rotation, np.nan), axis=0)[good[1:] & good[:-1]] >= 0).all()
    assert (np.diff(np.where(good, state.plastic_support, np.nan), axis=0)[good[1:] & good[:-1]] >= 0).all()


def test_moment_yields_once_and_from_below_for_every_chain_that_can_buckle():
    p = random_parameters(3000, seed=7)
    angles = yield_angles(p)
    ok = angles.status == Status.EQUILIBRIUM
    assert ok.sum() > 2000
    t = np.linspace(1e-4, np.pi / 2 - 1e-6, 700)[:, None]
    state = loading(p, t)
    inside = (t > p.imperfection) & ok
    yielded = np.isin(state.stage, ["2'", "3"])
    assert (yielded == (t > angles.moment))[inside].all()


@pytest.mark.parametrize("lateral_strength", [0.01, 0.024, 0.06])
@pytest.mark.parametrize("rolling_friction", [0.02, 0.2, 0.45])
@pytest.mark.parametrize("imperfection_deg", [0, 2])
def test_moment_yield_angle_against_a_scalar_search(rolling_friction, imperfection_deg, lateral_strength):
    p = TABLE_3.with_ratios(
        rolling_friction=rolling_friction, imperfection_deg=imperfection_deg, lateral_strength=lateral_strength
    )

    def excess(t: float) -> float:
        st = np.sin(t) - np.sin(p.imperfection)
        m = 2 * p.rolling_stiffness * p.chain_tangential_stiffness * st
        m /= p.rolling_stiffness + p.chain_tangential_stiffness
        s = min(p.lateral_stiffness * st, p.lateral_strength / 2)
        d = 1 - np.sqrt(1 - 2 * np.cos(t) ** 2 * (m + s) / (p.normal_stiffness * np.sin(t)))
        return m - p.rolling_friction * p.normal_stiffness * d

    root = brentq(excess, p.imperfection + 1e-3, 1.5, xtol=1e-14)
    assert yield_angles(p).moment == pytest.approx(root, abs=1e-12)


def test_moment_first_is_stage_2_prime_and_then_3():
    p = TABLE_3.with_ratios(rolling_friction=0.02)
    angles = yield_angles(p)
    assert angles.moment < angles.lateral
    stages = loading(p, np.array([angles.moment - 1e-6, angles.moment + 1e-6, angles.lateral + 1e-6])).stage
    assert stages.tolist() == ["1b", "2'", "3"]


@pytest.mark.parametrize(
    ("changes", "first_stage", "same_force_as"),
    [
        ({"rolling_stiffness": 0}, "1b", {"rolling_stiffness": 0, "rolling_friction": 0}),
        ({"rolling_friction": 0}, "2'", {"rolling_stiffness": 0, "rolling_friction": 0}),
        ({"lateral_strength": 0, "rolling_friction": 1e3}, "2", {"lateral_stiffness": 0, "rolling_friction": 1e3}),
    ],
)
def test_absent_supports(changes, first_stage, same_force_as):
    t = np.radians([0, 1, 5, 20])
    state = loading(TABLE_3.with_ratios(**changes), t)
    assert (state.status == Status.EQUILIBRIUM).all()
    assert state.stage[1] == first_stage
    np.testing.assert_allclose(
        state.axial_force, loading(TABLE_3.with_ratios(**same_force_as), t).axial_force, rtol=1e-14
    )
    # without a moment the end particles roll on the middle one
    if "lateral_strength" not in changes:
        np.testing.assert_allclose(state.rotation, 2 * np.sin(t), rtol=1e-14)


def test_path_starts_at_the_critical_load_and_is_continuous():
    p = random_parameters(300, seed=3).with_ratios(imperfection_deg=0.0)
    ok = yield_angles(p).status == Status.EQUILIBRIUM
    small = loading(p, 1e-9)
    np.testing.assert_allclose(small.axial_force[ok], critical_force(p)[ok], rtol=1e-9)
    assert (loading(p, 0.0).stage[ok] == "1a").all()


def test_stage_1a_is_a_spring_of_two_contacts_up_to_the_critical_load():
    critical = critical_displacement(TABLE_3)
    state = straight(TABLE_3, [0, critical / 2, critical * 1.01])
    np.testing.assert_allclose(
        state.axial_force, 1.05e5 * 1.14e-3 * np.array([0, critical / 2, critical * 1.01]) / 2, rtol=1e-15
    )
    assert state.stability.tolist() == [Stability.STABLE, Stability.STABLE, Stability.UNSTABLE]


def test_stability_is_the_sign_of_the_slopes():
    p = random_parameters(400, seed=5)
    t, step = np.linspace(0.3, 1.4, 37)[:, None], 1e-6
    state, ahead = loading(p, t), loading(p, t + step)
    same = (state.status == Status.EQUILIBRIUM) & (state.stage == ahead.stage)
    rise_d = ahead.axial_displacement_over_R - state.axial_displacement_over_R
    rise_f = ahead.axial_force - state.axial_force
    clear = same & (np.abs(rise_d) > 1e-11) & (np.abs(rise_f) > 1e-9 * state.axial_force)
    assert clear.mean() > 0.5
    expected = np.where(rise_d <= 0, 0, np.where(rise_f > 0, 2, 1))
    assert (state.stability == expected)[clear].all()
    assert {0, 1, 2} <= set(state.stability[clear].tolist())


def test_points_outside_say_why():
    p = TABLE_3.with_ratios(imperfection_deg=2)
    state = loading(p, np.radians([1, 2, 90, 120]))
    assert [Status(code) for code in state.status] == [
        Status.BELOW_IMPERFECTION,
        Status.EQUILIBRIUM,
        Status.ABOVE_RIGHT_ANGLE,
        Status.ABOVE_RIGHT_ANGLE,
    ]
    assert np.isnan(state.axial_force).tolist() == [True, False, True, True]
    stiff = loading(TABLE_3.with_ratios(lateral_stiffness=0.6), 0.1)
    assert stiff.status == Status.TOO_STIFF
    assert "lower the stiffness" in Status(int(stiff.status)).meaning


@pytest.mark.parametrize("angle", [np.nan, np.inf, -0.1, "ten"])
def test_angles_that_are_none(angle):
    with pytest.raises(ValueError, match="angle: expected"):
        loading(TABLE_3, angle)


def test_results_are_read_only():
    state = loading(TABLE_3, 0.1)
    with pytest.raises(ValueError, match="read-only"):
        state.axial_force[...] = 0


@pytest.mark.parametrize("scale", [1e-3, 7.0])
def test_stiffness_and_radius_only_scale_the_forces(scale):
    """All stiffnesses together, or the radius, multiply every force; lengths over R and angles stay."""
    t = np.radians([1, 8, 15, 30, 70])
    for imperfection in (0, 2):
        base = TABLE_3.with_ratios(imperfection_deg=imperfection)
        before = loading(base, t)
        good = before.status == Status.EQUILIBRIUM
        for changed in (
            base.with_ratios(normal_stiffness=base.normal_stiffness * scale),
            base.with_ratios(radius=base.radius * scale),
        ):
            after = loading(changed, t)
            np.testing.assert_allclose(after.axial_force[good], scale * before.axial_force[good], rtol=1e-12)
            np.testing.assert_allclose(after.lateral_force[good], scale * before.lateral_force[good], rtol=1e-12)
            for name in ("axial_displacement_over_R", "normal_displacement_over_R", "rotation"):
                np.testing.assert_allclose(getattr(after, name)[good], getattr(before, name)[good], rtol=1e-11)
            assert (after.stage == before.stage).all()


def test_broadcasting_is_the_same_as_one_by_one():
    frictions, angles = np.array([0.0, 0.02, 0.2]), np.radians([0, 3, 12, 25, 95])
    together = loading(TABLE_3.with_ratios(rolling_friction=frictions[:, None]), angles)
    for i, friction in enumerate(frictions):
        for j, angle in enumerate(angles):
            one = loading(TABLE_3.with_ratios(rolling_friction=friction), angle)
            assert one.stage == together.stage[i, j]
            assert one.status == together.status[i, j]
            assert one.stability == together.stability[i, j]
            np.testing.assert_array_equal(one.axial_force, together.axial_force[i, j])


def test_shapes_that_do_not_broadcast():
    with pytest.raises(ValueError, match=r"broadcasts with the parameters' \(3,\), found \(2,\)"):
        loading(TABLE_3.with_ratios(rolling_friction=[0.1, 0.2, 0.3]), [0.1, 0.2])
