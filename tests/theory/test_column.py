"""The column of N particles: its equations against an energy written down apart, its modes, its post-critical paths."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.linalg import cholesky_banded, eig_banded

from forcechain.theory.column import (
    BAND,
    Column,
    buckling_modes,
    elastic_hessian,
    imperfect_angles,
    stiffness_by_eigenproblem,
)
from forcechain.theory.column_path import ColumnPath
from forcechain.theory.continuation import follow_column
from forcechain.theory.history import Ending, unloading
from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.states import Status
from forcechain.theory.three_particle import loading
from forcechain.theory.yielding import yield_angles


def contact_energy(x, p: ChainParameters, force: float, start_sine=0.0, plastic_rotation=0.0):
    """Energy of contacts less the axial load's work, from (4), (5)-(8); x: (5, ...) w, u, next w, next u, overlap."""
    w, u, w_next, u_next, d = x
    sine = (u_next - u) / 2 + start_sine
    cosine = np.sqrt(1 - sine**2)
    tangential = 2 * (sine - start_sine) - w - w_next
    energy = p.normal_stiffness * d**2 / 2 + p.chain_tangential_stiffness * tangential**2 / 2
    energy = energy + p.rolling_stiffness * (w_next - w - plastic_rotation) ** 2 / 2
    return energy - force / p.radius * (2 - (2 - d) * cosine)


def numerical_hessian(p: ChainParameters, n: int, force: float) -> np.ndarray:
    """Second differences of the potential about the straight column, in lower band storage.

    Unknown are w, u and the overlap above of each particle in turn, so a contact couples unknowns at most 4 apart.
    """
    d = force / (p.normal_stiffness * p.radius)
    base = np.array([0, 0, 0, 0, d])
    h = 1e-4
    local = np.zeros((5, 5))
    for i in range(5):
        for j in range(5):
            terms = [
                si * sj * contact_energy(base + h * (si * np.eye(5)[i] + sj * np.eye(5)[j]), p, force)
                for si in (1, -1)
                for sj in (1, -1)
            ]
            local[i, j] = sum(terms) / (4 * h * h)
    where = (0, 1, 3, 4, 2)  # of w, u, next w, next u, overlap, counted from the particle's first
    band = np.zeros((5, 3 * n))
    for i, row in enumerate(where):
        for j, column in enumerate(where):
            if row >= column:
                band[row - column, column : 3 * (n - 1) : 3] += local[i, j]
    band[0, 3 * n - 3] += local[2, 2]  # the last particle ends the last contact
    band[0, 3 * n - 2] += local[3, 3]
    band[1, 3 * n - 3] += local[2, 3]
    return held_ends(band, n, p)


def held_ends(band: np.ndarray, n: int, p: ChainParameters) -> np.ndarray:
    """Add the lateral springs; hold the ends sideways and the overlap that no contact has."""
    band[0, 4 : 3 * n - 3 : 3] += p.lateral_stiffness
    for held in (1, 3 * n - 2, 3 * n - 1):
        for apart in range(5):
            band[apart, held] = 0.0
            if held >= apart:
                band[apart, held - apart] = 0.0
        band[0, held] = p.normal_stiffness
    return band


def positive_definite(band: np.ndarray) -> bool:
    try:
        cholesky_banded(band, lower=True)
    except np.linalg.LinAlgError:
        return False
    return True


def test_critical_load_is_where_the_numerical_hessian_ceases_to_be_positive():
    for n in range(3, 201):
        force = float(buckling_modes(TABLE_3, n).critical_force[0])
        assert positive_definite(numerical_hessian(TABLE_3, n, force * (1 - 1e-5)))
        assert not positive_definite(numerical_hessian(TABLE_3, n, force * (1 + 1e-5)))


@pytest.mark.parametrize("n", [4, 9, 20])
def test_every_mode_costs_the_hessian_one_more_positive_direction(n):
    p = TABLE_3.with_ratios(lateral_stiffness=0.02)
    for k, force in enumerate(buckling_modes(p, n).critical_force):
        if not np.isfinite(force):
            break
        bands = (numerical_hessian(p, n, float(force) * (1 + e)) for e in (-1e-5, 1e-5))
        below, above = (eig_banded(band, lower=True, eigvals_only=True) for band in bands)
        assert (below < 0).sum() == k
        assert (above < 0).sum() == k + 1


@pytest.mark.parametrize("changes", [{}, {"rolling_stiffness": 0}, {"rolling_friction": 0}, {"lateral_stiffness": 0.2}])
@pytest.mark.parametrize("n", [3, 4, 5, 8, 33])
def test_closed_form_of_the_modes_is_the_eigenproblem(n, changes):
    p = TABLE_3.with_ratios(**changes)
    modes = buckling_modes(p, n)
    np.testing.assert_allclose(modes.stiffness, stiffness_by_eigenproblem(p, n), rtol=1e-10)
    stored, shortening = elastic_hessian(p, n)
    shapes = np.concatenate((modes.rotations, modes.lateral_displacement[:, 1:-1]), axis=1)
    np.testing.assert_allclose(
        stored @ shapes.T, shortening @ shapes.T * modes.stiffness, atol=1e-10 * p.normal_stiffness
    )


def test_modes_of_three_particles_are_the_paper():
    modes = buckling_modes(TABLE_3, 3)
    assert modes.critical_force[0] == pytest.approx(10.942468405, abs=1e-9)
    assert modes.critical_displacement_over_R[0] == pytest.approx(0.182831552, abs=1e-9)
    np.testing.assert_allclose(modes.angles[0], [1, -1], atol=1e-14)
    w = 2 * 0.014 / 0.514  # (13) for a small angle of 1
    np.testing.assert_allclose(modes.rotations[0], [w, 0, -w], atol=1e-13)


def test_modes_too_stiff_to_occur_have_no_load():
    modes = buckling_modes(TABLE_3.with_ratios(lateral_stiffness=0.4), 6)
    assert np.isnan(modes.critical_force).any()
    assert (np.isnan(modes.critical_force) == (modes.stiffness > TABLE_3.normal_stiffness)).all()


@pytest.mark.parametrize("rolling_friction", [0.2, 1e-3])
def test_tangent_is_the_derivative_of_the_residual(rolling_friction):
    p, n = TABLE_3.with_ratios(rolling_friction=rolling_friction), 7
    rng = np.random.default_rng(2)
    column = Column(p, n, np.zeros(n - 1))
    y = rng.normal(size=2 * n) * 0.1
    y[1] = y[-1] = 0
    zero_w, zero_u = np.zeros(n - 1), np.zeros(n)
    response = column.respond(y, 0.08, zero_w, zero_u)
    assert response.moment_slips.any()
    inner = [i for i in range(2 * n) if i not in (1, 2 * n - 1)]
    if response.moment_slips.all():
        inner.remove(2 * (n // 2))
    for j in range(2 * n):
        step = np.zeros(2 * n)
        step[j] = 1e-6
        ahead, behind = (column.respond(y + s * step, 0.08, zero_w, zero_u).residual for s in (1, -1))
        for i in inner:
            tangent = response.band[BAND + i - j, j] if abs(i - j) <= BAND else 0.0
            assert (ahead[i] - behind[i]) / 2e-6 == pytest.approx(tangent, abs=1e-9)
    ahead, behind = (column.respond(y, 0.08 + s * 1e-6, zero_w, zero_u).residual for s in (1, -1))
    np.testing.assert_allclose(((ahead - behind) / 2e-6)[inner], response.by_load[inner], atol=1e-9)


CASES = [
    {},
    {"rolling_friction": 0.02},
    {"imperfection_deg": 2},
    {"imperfection_deg": 2, "rolling_friction": 0.02},
    {"rolling_friction": 0},
    {"rolling_stiffness": 0},
    {"rolling_stiffness": 0, "rolling_friction": 0},
    {"lateral_strength": 0.06},
    {"lateral_stiffness": 0.09},
    {"imperfection_deg": 14},
]


@pytest.mark.parametrize("changes", CASES)
def test_three_particles_follow_the_closed_form(changes):
    """Stages 1b, 2 or 2', 3 and unloading, in both orders of yielding, to 1e-8 relative."""
    p = TABLE_3.with_ratios(**changes)
    path = follow_column(p, 3, unload=True)
    assert path.ending == Ending.SEPARATED
    up = ~path.unloading
    t = path.angles[:, 0]
    closed = loading(p, np.maximum(t[up], float(p.imperfection)))
    np.testing.assert_allclose(path.axial_force[up], closed.axial_force, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(
        path.axial_displacement_over_R[up], closed.axial_displacement_over_R, rtol=1e-8, atol=1e-12
    )
    np.testing.assert_allclose(path.rotations[up, 0], closed.rotation, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(path.lateral_force[up, 1], closed.lateral_force, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(path.rotations[:, 1], 0, atol=1e-8)
    np.testing.assert_allclose(path.angles[:, 1], -t, atol=1e-9)
    back = unloading(p, t[up][-1], np.minimum(t[~up], t[up][-1]))
    there = back.status == Status.EQUILIBRIUM
    assert there.sum() > 5
    scale = closed.axial_force.max()
    np.testing.assert_allclose(path.axial_force[~up][there], back.axial_force[there], rtol=1e-8, atol=1e-8 * scale)
    angles = yield_angles(p)
    if changes.get("rolling_stiffness", 1) != 0 and p.rolling_friction > 0:
        slipped = path.moment_plastic[up, 0]
        assert (slipped == (t[up] > angles.moment))[1:].all()


def test_three_particles_that_fold_turn_back_in_angle():
    p = TABLE_3.with_ratios(lateral_stiffness=1e-4)
    assert yield_angles(p).folds
    path = follow_column(p, 3)
    assert path.ending == Ending.REACHED
    assert np.diff(path.angles[:, 0]).min() < 0
    assert path.falling.any()
    late = path.angles[:, 0] > 0.3
    np.testing.assert_allclose(path.axial_force[late], loading(p, path.angles[late, 0]).axial_force, rtol=1e-7)


def check_column(path: ColumnPath, p: ChainParameters, start_angles: np.ndarray) -> None:
    """Equilibrium against derivatives of the separate energy, yield conditions, dissipation."""
    R, kn = p.radius, p.normal_stiffness
    for i in range(1, len(path.axial_force), 7):
        w, u, d = path.rotations[i], path.lateral_displacement_over_R[i], path.normal_displacement_over_R[i]
        slipped = np.diff(w) - path.contact_moment[i] / (p.rolling_stiffness * R**2)

        def slope(k, w=w, u=u, d=d, slipped=slipped, i=i):
            x = np.array([w[:-1], u[:-1], w[1:], u[1:], d]) + 0j
            x[k] += 1e-30j  # a complex step: the derivative without a difference
            return contact_energy(x, p, float(path.axial_force[i]), np.sin(start_angles), slipped).imag / 1e-30 / kn

        assert np.abs(slope(4)).max() < 1e-9
        balance_w = np.zeros(len(w))
        balance_w[:-1] += slope(0)
        balance_w[1:] += slope(2)
        assert np.abs(balance_w).max() < 1e-9
        balance_u = np.zeros(len(w))
        balance_u[:-1] += slope(1)
        balance_u[1:] += slope(3)
        balance_u += path.lateral_force[i] / (R * kn)
        assert np.abs(balance_u[1:-1]).max() < 1e-9
    limit = p.rolling_friction * kn * R**2 * path.normal_displacement_over_R
    assert (np.abs(path.contact_moment) <= limit * (1 + 1e-9) + 1e-15).all()
    assert (np.abs(path.lateral_force) <= R * p.lateral_strength * (1 + 1e-9)).all()
    assert np.diff(path.moment_dissipation).min() >= -1e-12 * path.work.max()
    assert np.diff(path.lateral_dissipation).min() >= -1e-12 * path.work.max()


@pytest.mark.parametrize("n", [4, 5, 12, 50, 200])
@pytest.mark.parametrize(("mode", "imperfection_deg"), [(0, 0), (1, 0), (0, 3), (1, 3)])
def test_paths_of_longer_columns(n, mode, imperfection_deg):
    p = TABLE_3.with_ratios(imperfection_deg=imperfection_deg)
    path = follow_column(p, n, mode=mode, unload=True)
    assert path.ending in (Ending.SEPARATED, Ending.DEAD_END)
    assert np.isclose(np.abs(path.angles[~path.unloading][-1]).max(), np.radians(40), rtol=1e-9)
    check_column(path, p, imperfect_angles(p, n, mode))
    if imperfection_deg == 0:
        assert path.axial_force[0] == pytest.approx(buckling_modes(p, n).critical_force[mode], rel=1e-12)


def test_energy_balance_of_the_column_closes_with_the_square_of_the_step():
    def error(step):
        path = follow_column(TABLE_3, 12, largest_step=step)
        gap = path.work - path.stored - path.moment_dissipation - path.lateral_dissipation
        return np.abs(gap).max() / path.work.max()

    assert error(0.02) < 5e-4
    assert error(0.0025) < error(0.02) / 10


def test_imperfection_in_given_angles():
    angles = np.arcsin(np.array([0.03, 0.01, -0.02, -0.02]))
    path = follow_column(TABLE_3, 5, imperfection_angles=angles)
    np.testing.assert_allclose(path.angles[0], angles, atol=1e-15)
    assert path.axial_force[0] == 0
    assert path.axial_force.max() < buckling_modes(TABLE_3, 5).critical_force[0]
    check_column(path, TABLE_3, angles)


def test_cost_of_a_long_path():
    """Far within the targets of benchmarks/bench_theory.py, in processor time."""
    follow_column(TABLE_3, 5)
    start = time.process_time()
    follow_column(TABLE_3, 50, unload=True)
    assert time.process_time() - start < 2


@pytest.mark.parametrize(
    ("n", "options", "message"),
    [
        (2, {}, "n_particles: expected a whole number from 3 to 200, found 2"),
        (201, {}, "n_particles: .* found 201"),
        (5, {"mode": 3}, "mode: expected 0 to 2 for 5 particles, found 3"),
        (5, {"imperfection_angles": [0.1, 0, 0, 0]}, "sum to 0"),
        (5, {"imperfection_angles": [0.1, -0.1]}, r"shape \(4,\)"),
        (5, {"largest_angle": 2.0}, "largest_angle: expected above 0 and below pi/2"),
        (3, {"largest_step": 0.0}, "largest_step"),
    ],
)
def test_inadmissible_columns(n, options, message):
    with pytest.raises(ValueError, match=message):
        follow_column(TABLE_3, n, **options)


def test_a_column_too_stiff_to_buckle():
    with pytest.raises(ValueError, match="no buckling"):
        follow_column(TABLE_3.with_ratios(lateral_stiffness=0.6), 3)


def test_a_column_that_nothing_supports_has_no_path():
    bare = TABLE_3.with_ratios(rolling_stiffness=0, lateral_stiffness=0, imperfection_deg=3)
    path = follow_column(bare, 4, largest_angle=0.5)
    assert path.ending == Ending.DEAD_END
    assert (path.axial_force == 0).all()
