"""Strain, non-affine motion and dissipation between two snapshots whose difference is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from packings import build, random_packing, take_contacts, turned

from forcechain.observe.dissipation import dissipation, share_near
from forcechain.observe.kinematics import localisation, nonaffine_motion, strain_map

R = 1e-3
KN, KT, KR = 1.05e5, 0.5 * 1.05e5, 0.5 * 1.05e5 * R**2
GRADIENT = np.array([[2e-3, 5e-3], [-1e-3, -4e-3]])


def deformed(packing, gradient=GRADIENT):
    return replace(packing, position=packing.position + packing.position @ gradient.T)


def test_strain_of_an_affine_motion_is_exact():
    packing = random_packing(0)
    found = strain_map(packing, deformed(packing))
    expected = -0.5 * (GRADIENT + GRADIENT.T)
    np.testing.assert_allclose(found.strain, np.broadcast_to(expected, found.strain.shape), atol=1e-12)
    values = np.linalg.eigvalsh(expected)
    np.testing.assert_allclose(found.shear, values[1] - values[0])
    np.testing.assert_allclose(found.volumetric, values.sum())
    np.testing.assert_allclose(found.mean_strain, expected, atol=1e-12)
    assert localisation(found) == pytest.approx(0.5)
    covered = np.prod(np.ptp(packing.position, axis=0))
    assert 0.8 * covered < found.area.sum() < covered
    nonaffine = nonaffine_motion(packing, deformed(packing))
    assert np.isfinite(nonaffine).sum() > 80
    assert np.nanmax(nonaffine) < 1e-30


def test_a_shear_band_holds_the_strain():
    """Discs above the middle slide to the right: the strain is where the triangles cross it."""
    packing = random_packing(4, side=20)
    middle = np.median(packing.position[:, 1])
    moved = packing.position + np.where(packing.position[:, 1] > middle, 1e-4, 0.0)[:, None] * (1.0, 0.0)
    found = strain_map(packing, replace(packing, position=moved))
    in_band = np.abs(found.centre[:, 1] - middle) < 2 * R
    assert found.shear[~in_band].max() < 1e-12
    assert found.shear[in_band].max() > 0.02
    assert localisation(found) < 0.1


def test_nonaffine_motion_is_where_one_particle_moves_alone():
    packing = random_packing(2)
    lonely = 66
    position = packing.position.copy()
    position[lonely] += (1e-4, 0)
    found = nonaffine_motion(packing, replace(packing, position=position))
    near = {lonely} | {int(k) for pair in packing.contact_ids if lonely in pair for k in pair if k >= 0}
    assert np.nanmax(np.delete(found, sorted(near))) < 1e-20
    assert 0 < np.nanmax(found[sorted(near)]) < (1e-4) ** 2
    for angle, reflected in ((0.6, False), (2.0, True)):
        image = turned(packing, angle, reflected=reflected)
        image_after = turned(replace(packing, position=position), angle, reflected=reflected)
        np.testing.assert_allclose(nonaffine_motion(image, image_after), found, rtol=1e-6, atol=1e-16)


def test_nonaffine_motion_needs_three_neighbours():
    row = build([(0, 0), (2 * R, 0), (4 * R, 0), (2 * R, 2 * R)], R, [(0, 1, 1.0), (1, 2, 1.0), (1, 3, 1.0)])
    found = nonaffine_motion(row, row)
    assert np.isnan(found[[0, 2, 3]]).all()
    assert found[1] == 0


def pair(ft, moment, turn=(0.0, 0.0), shift=(0.0, 0.0), swapped=False):
    contact = (1, 0, 50.0, ft, -moment) if swapped else (0, 1, 50.0, ft, moment)
    snapshot = build([(0, 0), (2 * R, 0), (9, 9)], R, [contact], rotation=[*turn, 0.0])
    return replace(snapshot, position=snapshot.position + np.array([(0, 0), shift, (0, 0)]))


def test_elastic_loading_dissipates_nothing():
    """Disc 1 moves up by 1e-6 and turns by 1e-4: ft = -kt (1e-6 - R 1e-4), m = -kr 1e-4, both within their limits."""
    before, after = pair(0, 0), pair(-KT * (1e-6 - R * 1e-4), -KR * 1e-4, (0.0, 1e-4), (0.0, 1e-6))
    found = dissipation(before, after)
    assert found.ids.tolist() == [[0, 1]]
    np.testing.assert_allclose(found.sliding, 0, atol=1e-18)
    np.testing.assert_allclose(found.rolling, 0, atol=1e-18)


@pytest.mark.parametrize("swapped", [False, True])
def test_what_slides_and_rolls_at_its_limit_dissipates(swapped):
    """At constant force all motion is slip: 35 N over 1e-6 + R 1e-4; at constant moment all turning is rolling."""
    before = pair(-35.0, -0.01)
    after = pair(-35.0, -0.01, (1e-4, 3e-4), (0.0, 6e-7), swapped)
    found = dissipation(before, after)
    slip = 6e-7 - R * 4e-4
    np.testing.assert_allclose(found.sliding, 35.0 * slip, rtol=1e-9)
    np.testing.assert_allclose(found.rolling, 0.01 * 2e-4, rtol=1e-9)


def test_contacts_made_or_lost_and_walls_are_left_out():
    packing = random_packing(3)
    rng = np.random.default_rng(0)
    kept = np.sort(rng.permutation(packing.n_contacts)[:150])
    others = np.sort(rng.permutation(packing.n_contacts)[:150])
    found = dissipation(take_contacts(packing, kept), take_contacts(packing, others))
    common = packing.contact_ids[np.intersect1d(kept, others)]
    expected = {tuple(sorted(row)) for row in common[common[:, 1] >= 0].tolist()}
    assert {tuple(sorted(row)) for row in found.ids.tolist()} == expected
    np.testing.assert_allclose(found.sliding, 0, atol=1e-18)


def test_share_near_segments():
    position = 2 * R * np.array([(k, 0) for k in range(8)])
    contacts = [(k, k + 1, 50.0, -35.0) for k in range(7)]
    before = build(position, R, contacts)
    after = replace(before, rotation=np.full(8, -1e-4))  # every contact slides by 2 R 1e-4 against its force
    found = dissipation(before, after)
    assert (found.sliding > 0).all()
    assert share_near(found, before, [[0, 1, 2]]) == pytest.approx(4 / 7)  # 0-1-2 and neighbour 3: contacts 0 to 3-4
    assert share_near(found, before, np.zeros((0, 3), dtype=int)) == 0
    with pytest.raises(ValueError, match="dissipated: expected a total above 0, found 0 J"):
        share_near(dissipation(before, before), before, [[0, 1, 2]])


def test_other_particles():
    one, other = random_packing(0), random_packing(0, side=5)
    for function in (strain_map, nonaffine_motion, dissipation):
        with pytest.raises(ValueError, match="after: expected 144 particles, found 25"):
            function(one, other)
    two = build([(0, 0), (1, 1)], R, [])
    with pytest.raises(ValueError, match="before: expected at least 3 particles, found 2"):
        strain_map(two, two)
    still = strain_map(one, one)
    with pytest.raises(ValueError, match="strains: expected some shear strain, found none"):
        localisation(still)
    with pytest.raises(ValueError, match="share: expected between 0 and 1, found 1"):
        localisation(still, 1.0)
