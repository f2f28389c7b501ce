"""The cluster: side particles, void, strain, curvature, nonaffine motion."""

from __future__ import annotations

import numpy as np
import pytest

from forcechain.theory.cluster import (
    BOTTOM,
    LEFT_UPPER,
    MIDDLE,
    RIGHT_UPPER,
    TOP,
    cluster,
    measured,
    side_contact_displacements,
    side_particle_position,
)
from forcechain.theory.parameters import TABLE_3
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement

ANGLES = np.radians([1, 5, 14, 20, 25, 40])


def test_side_particles_carry_the_lateral_force():
    """(28) with (29) put back into normal and tangential parts gives (27)."""
    fs, R, kn, kt = 2.9, 1.14e-3, 1.05e5, 0.5 * 1.05e5
    for t in ANGLES:
        x, y = side_particle_position(t, fs, R, kn, kt)
        relative = np.array([-x + np.sqrt(3) * R + 2 * R * np.sin(t), y - R])  # (28)
        normal, tangential = np.array([-np.sqrt(3), 1]) / 2, np.array([1, np.sqrt(3)]) / 2
        un, ut = side_contact_displacements(fs, kn, kt)
        assert relative @ normal == pytest.approx(-un, rel=1e-9)  # pressed together
        assert relative @ tangential == pytest.approx(ut, rel=1e-9)
        assert un == pytest.approx(np.sqrt(3) * fs / 4 / kn)
        assert ut == pytest.approx(fs / 4 / kt)


def test_unloaded_cluster_is_hexagonal_close_packing():
    c = cluster(TABLE_3, straight(TABLE_3, [0.0]))
    R = TABLE_3.radius
    assert c.area[0] == pytest.approx(6 * np.sqrt(3) * R**2, rel=1e-14)
    assert 1 - c.void_area[0] / c.area[0] == pytest.approx(np.pi / np.sqrt(12), rel=1e-14)
    gaps = np.linalg.norm(c.position[0] - c.position[0, MIDDLE], axis=-1)
    np.testing.assert_allclose(np.delete(gaps, MIDDLE), 2 * R, rtol=1e-14)


def test_no_dilatation_before_buckling_and_dilatation_throughout():
    before = cluster(TABLE_3, straight(TABLE_3, np.linspace(0, critical_displacement(TABLE_3), 5)))
    assert (np.diff(before.dilatation) < 0).all()  # the chain shortens, nothing moves out
    path = loading(TABLE_3, np.radians(np.arange(0, 31, 0.5)))  # the range of the paper's figures
    after = cluster(TABLE_3, path)
    assert (np.diff(after.dilatation) > 0).all()
    assert (np.diff(after.void_area) > 0).all()
    assert (np.diff(path.axial_force) < 0).all()  # strain-softening under dilatation
    # Later the chain shortens faster than the middle particle moves out, which (29) does not stop.
    late = cluster(TABLE_3, loading(TABLE_3, np.radians([33, 45])))
    assert late.dilatation[1] < late.dilatation[0]


def test_void_area_by_counting_points():
    c = cluster(TABLE_3, loading(TABLE_3, np.radians([0, 10, 25])))
    R = TABLE_3.radius
    rng = np.random.default_rng(3)
    points = rng.uniform(-3 * R, 3 * R, (400_000, 2))
    for i in range(3):
        ring = c.position[i][[0, 6, 5, 2, 3, 4]]
        edge = np.roll(ring, -1, axis=0) - ring
        rel = points[:, None, :] - ring
        inside = (edge[:, 0] * rel[..., 1] - edge[:, 1] * rel[..., 0] >= 0).all(axis=1)  # convex
        free = (np.linalg.norm(points[:, None, :] - c.position[i], axis=-1) > R).all(axis=1)
        counted = (inside & free).mean() * 36 * R**2
        assert c.void_area[i] == pytest.approx(counted, rel=0.03)


def test_end_particles_turn_opposite_ways_and_the_middle_one_does_not():
    c = cluster(TABLE_3, loading(TABLE_3, ANGLES))
    np.testing.assert_allclose(c.rotation[:, BOTTOM], -c.rotation[:, TOP])
    assert (c.rotation[:, BOTTOM] > 0).all()
    assert (c.rotation[:, MIDDLE] == 0).all()
    assert (c.position[:, MIDDLE, 0] < 0).all()
    assert (c.position[:, LEFT_UPPER, 0] < -np.sqrt(3) * TABLE_3.radius).all()
    np.testing.assert_allclose(c.position[:, RIGHT_UPPER], np.tile(c.reference[RIGHT_UPPER], (6, 1)))


def test_tangential_displacement_of_the_chain_follows_from_the_motion():
    """Displacement and rotation of the cluster give back (6): the senses of rotation are right."""
    state = loading(TABLE_3, ANGLES)
    c = cluster(TABLE_3, state)
    R = TABLE_3.radius
    leftwards = -(c.position[:, MIDDLE, 0] - c.position[:, BOTTOM, 0])
    sliding = leftwards - R * (c.rotation[:, BOTTOM] + c.rotation[:, MIDDLE])
    np.testing.assert_allclose(TABLE_3.chain_tangential_stiffness * sliding * R, state.contact_moment, rtol=1e-9)


def test_measures_of_known_motions():
    state = straight(TABLE_3, [0.0])
    c = cluster(TABLE_3, state)
    R, reference = TABLE_3.radius, c.reference
    gradient = np.array([[0.01, -0.03], [0.02, 0.004]])
    moved = reference + reference @ gradient.T + np.array([3e-4, -1e-4])
    same = measured(R, reference, moved[None], np.full((1, 7), 0.07))
    np.testing.assert_allclose(same.displacement_gradient[0], gradient, atol=1e-14)
    np.testing.assert_allclose(same.nonaffine_displacement, 0, atol=1e-17)
    np.testing.assert_allclose(same.micropolar_strain[0], gradient - 0.07 * np.array([[0, -1], [1, 0]]), atol=1e-14)
    np.testing.assert_allclose(same.curvature, 0, atol=1e-12)
    slope = np.array([2.0, -5.0])
    bent = measured(R, reference, reference[None], (reference @ slope)[None])
    np.testing.assert_allclose(bent.curvature[0], slope, rtol=1e-12)
    kicked = reference.copy()
    kicked[MIDDLE] += (1e-4, 0)
    alone = measured(R, reference, kicked[None], np.zeros((1, 7)))
    np.testing.assert_allclose(alone.nonaffine_displacement[0, MIDDLE], (1e-4, 0), atol=1e-18)
    # a rigid rotation of all is no micropolar strain (small angle)
    spun = measured(
        R, reference, (reference + 1e-6 * reference @ np.array([[0, 1], [-1, 0]]))[None], np.full((1, 7), 1e-6)
    )
    np.testing.assert_allclose(spun.micropolar_strain, 0, atol=1e-15)


def test_nonaffine_motion_of_the_middle_particle_grows_with_buckling():
    c = cluster(TABLE_3, loading(TABLE_3, ANGLES))
    assert (np.diff(np.linalg.norm(c.nonaffine_displacement[:, MIDDLE], axis=-1)) > 0).all()
    assert (np.abs(c.curvature[:, 1]) > 0).all()


@pytest.mark.parametrize(
    ("parameters", "state", "message"),
    [
        (TABLE_3.with_ratios(imperfection_deg=2), loading(TABLE_3, 0.1), "perfect chain"),
        (TABLE_3.with_ratios(rolling_friction=[0.1, 0.2]), loading(TABLE_3, 0.1), "one parameter set"),
        (TABLE_3, loading(TABLE_3, 1.6), "states of equilibrium"),
    ],
)
def test_clusters_that_are_none(parameters, state, message):
    with pytest.raises(ValueError, match=message):
        cluster(parameters, state)
