"""The observation on a real run: agreement with the plain implementation, and what mechanics demands of the tables."""

from __future__ import annotations

import math

import numpy as np
import pytest
from agreement import assert_window_agrees

from forcechain.observe.dissipation import dissipation, share_near
from forcechain.observe.kinematics import localisation, nonaffine_motion, strain_map
from forcechain.observe.macroscopic import (
    box_of,
    contact_stress,
    coordination,
    solid_fraction,
    stress_ratio,
    unbalanced_forces,
    wall_stress,
)
from forcechain.observe.options import AnalysisOptions
from forcechain.observe.plasticity import rolling, sliding
from forcechain.observe.transitions import find_drops, given_drops, snapshots_of_drop

pytestmark = pytest.mark.yade
CHOICES = (
    {},
    {"already_plastic": "count", "neighbour_ring": "all"},
    {"neighbours_at": "start", "neighbour_ring": "chain", "alignment_rule": "180/Z"},
    {"segment_rule": "every", "stress_weight": "none", "wall_segments": "drop"},
)


def curve(run):
    return run.history["axial_strain"].to_numpy(), run.history["stress_ratio"].to_numpy()


@pytest.fixture(scope="module")
def window(real_run):
    """Fifteen snapshots over the last 0.007 of the test: the sample softens by then."""
    options = AnalysisOptions(increments=14)
    last = float(real_run.axial_strain[-1])
    drop = given_drops(*curve(real_run), [(last - 0.0071, last - 0.0001)], options)[0]
    return [real_run.snapshot(int(row)) for row in snapshots_of_drop(real_run.axial_strain, drop, options)]


@pytest.mark.parametrize("choice", CHOICES, ids=str)
def test_fast_and_plain_agree(window, choice):
    drop = assert_window_agrees(
        window, AnalysisOptions(increments=14, minimum_angle_growth=math.radians(0.3), **choice)
    )
    assert drop.ledger.candidate_segments > 30
    assert drop.n_buckled >= 3


def test_the_test_has_a_peak_and_drops_are_found(real_run):
    options = AnalysisOptions(drop_fall=0.002, drop_prominence=0.0)
    drops = find_drops(*curve(real_run), options)
    assert all(0.02 < drop.start < 0.07 for drop in drops)
    assert all(0.5 < drop.peak < 0.8 for drop in drops)


def test_forces_and_moments_balance(real_run, window):
    """Resultants are as small as YADE's own unbalanced force says, disc by disc and about every centre."""
    for snapshot in (real_run.snapshot(0), window[0], window[-1]):
        force, moment = unbalanced_forces(snapshot)
        mean_force = np.linalg.norm(snapshot.contact_force, axis=1).mean()
        row = int(np.argmin(np.abs(real_run.history["axial_strain"] - snapshot.axial_strain)))
        at_sample = real_run.history["unbalanced_force"].to_numpy()[row]
        assert np.linalg.norm(force, axis=1).mean() / mean_force == pytest.approx(at_sample, rel=0.05)
        assert np.abs(moment).mean() < 2 * max(at_sample, 1e-6) * mean_force * snapshot.radius.mean()


def test_stress_from_contacts_and_walls_and_history(real_run, window):
    for snapshot in (window[0], window[-1]):
        box = box_of(snapshot)
        row = real_run.history.iloc[int(np.argmin(np.abs(real_run.history["axial_strain"] - snapshot.axial_strain)))]
        assert solid_fraction(snapshot, box.area) == pytest.approx(row["solid_fraction"], abs=1e-6)
        assert coordination(snapshot).every_particle == pytest.approx(row["coordination"], abs=1e-6)
        from_contacts, from_walls = contact_stress(snapshot, box.area), wall_stress(snapshot, box.area)
        # They differ by the moment of what is out of balance, which is nothing else than inertia and damping.
        force, _ = unbalanced_forces(snapshot)
        moment = force.T @ (snapshot.position - snapshot.position.mean(axis=0))
        inertia = 0.5 * (moment + moment.T) / box.area
        np.testing.assert_allclose(from_contacts - from_walls, inertia, atol=1e-9 * from_walls.max())
        assert np.abs(inertia).max() < 0.02 * from_walls.max()
        assert from_walls[1, 1] == pytest.approx(row["axial_stress"], rel=0.01)
        assert from_walls[0, 0] == pytest.approx(row["lateral_stress"], rel=0.01)
        assert stress_ratio(from_walls) == pytest.approx(row["stress_ratio"], abs=0.01)


def test_at_rest_both_stresses_are_one(real_run):
    start = real_run.snapshot(0)
    area = box_of(start).area
    from_walls = wall_stress(start, area)
    np.testing.assert_allclose(contact_stress(start, area), from_walls, atol=1e-3 * from_walls.max())


def test_some_contacts_are_exactly_at_their_limits(window):
    """No flag says so, but the forces do: to rounding, and the next below them is far away."""
    for snapshot in window[::7]:
        for plastic in (sliding, rolling):
            exact, loose = plastic(snapshot, 1e-12).sum(), plastic(snapshot, 1e-6).sum()
            assert exact > 10
            assert loose - exact <= max(1, 0.02 * exact)  # one may be that near by chance


def test_the_energy_balance_closes(real_run):
    """Work of the walls = change of elastic energy + dissipation at contacts + what damping takes and pairs lost."""
    history = real_run.history
    start = real_run.snapshot(0)
    box = box_of(start)
    height = box.height * (1 - history["axial_strain"].to_numpy())
    width = box.width * (1 - history["lateral_strain"].to_numpy())
    work = -np.trapezoid(history["axial_stress"] * width, height) - np.trapezoid(
        history["lateral_stress"] * height, width
    )
    stored = history["elastic_energy"].iloc[-1] - history["elastic_energy"].iloc[0]
    slid = rolled = 0.0
    before = start
    for row in range(1, len(real_run.axial_strain)):
        after = real_run.snapshot(row)
        lost = dissipation(before, after)
        slid, rolled, before = slid + lost.sliding.sum(), rolled + lost.rolling.sum(), after
    assert slid > 0.05 * work
    assert rolled > 0.05 * work
    assert 0.85 * work < stored + slid + rolled < 1.02 * work


def test_the_strain_map_adds_up_to_the_walls_motion(window):
    strains = strain_map(window[0], window[-1])
    axial = (window[-1].axial_strain - window[0].axial_strain) / (1 - window[0].axial_strain)
    # The map ends at the outermost centres: what the layer at the walls takes less, it has more.
    assert strains.mean_strain[1, 1] == pytest.approx(axial, rel=0.15)
    assert strains.mean_strain[0, 0] < 0  # it widens
    assert localisation(strains) < 0.4
    nonaffine = nonaffine_motion(window[0], window[-1])
    assert np.nanmedian(nonaffine) < (0.1 * window[0].radius.mean()) ** 2
    drop = assert_window_agrees(window[::14], AnalysisOptions(increments=1, minimum_angle_growth=0.0))
    near = share_near(dissipation(window[0], window[-1]), window[0], drop.buckled)
    particles = np.unique(drop.buckled)
    assert near > len(particles) / window[0].n_particles
