"""Do the options of the physics reach the simulation?"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from yade_run_files import history_of, manifest_of, snapshot_of

pytestmark = pytest.mark.yade

SMALL = {"particle_count": 100, "final_axial_strain": 0.01, "snapshot_strain_interval": 1e-3}


@pytest.fixture(scope="module")
def unusual(make_run: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run in which most options have another value than by default."""
    return make_run(
        tmp_path_factory.mktemp("unusual") / "run",
        **SMALL,
        size_distribution="uniform",
        mass="equal",
        shape="cylinder",
        density=1000.0,
        time_step_factor=0.5,
        friction=0.4,
        wall_friction=0.3,
        rolling_friction=0.05,
        rolling_stiffness_ratio=0.3,
        rolling_stiffness_radius="mean",
        tangential_stiffness_ratio=0.8,
        normal_stiffness=2e5,
        confining_stress=500.0,
        strain_rate=0.8,
        preparation_friction=0.2,
    )


def test_contacts_follow_the_options(unusual: Path) -> None:
    snapshot = snapshot_of(unusual, 10)
    contact = {name.removeprefix("contact_"): values for name, values in snapshot.items() if "contact_" in name}
    radius = snapshot["particle_radius"]
    between = contact["id2"] >= 0
    smaller = np.minimum(radius[contact["id1"][between]], radius[contact["id2"][between]])
    np.testing.assert_allclose(contact["kn"], 2e5, rtol=1e-12)
    np.testing.assert_allclose(contact["kt"], 1.6e5, rtol=1e-12)
    np.testing.assert_allclose(contact["kr"][between], 0.3 * 2e5 * radius.mean() ** 2, rtol=1e-12)
    np.testing.assert_allclose(contact["rolling_limit"][between], 0.05 * smaller, rtol=1e-12)
    np.testing.assert_allclose(contact["friction"][between], 0.4, rtol=1e-12)
    np.testing.assert_allclose(contact["friction"][~between], 0.3, rtol=1e-12)
    assert np.abs(contact["ft"][~between]).max() > 0
    share = np.abs(contact["ft"][between]) / (0.4 * contact["fn"][between])
    assert share.max() == pytest.approx(1, rel=1e-9)


def test_sizes_are_uniform(unusual: Path) -> None:
    radius = np.sort(snapshot_of(unusual, 0)["particle_radius"])
    np.testing.assert_allclose(np.diff(radius), (1.52e-3 - 0.76e-3) / 100, rtol=1e-9)


def test_masses_are_equal_ones_of_cylinders(unusual: Path) -> None:
    snapshot, derived = snapshot_of(unusual, 10), manifest_of(unusual)["derived"]
    radius = snapshot["particle_radius"]
    mass = 1000 * np.pi * (radius**2).mean() * 2 * radius.mean()
    assert derived["mean_mass"]["value"] == pytest.approx(mass, rel=1e-12)
    assert derived["strain_rate"]["value"] == 0.8
    assert derived["time_step"]["value"] == pytest.approx(0.5 * np.sqrt(mass / 2e5), rel=0.02)
    speed = np.hypot(snapshot["particle_vx"], snapshot["particle_vy"])
    kinetic = mass / 2 * (speed**2 + (radius * snapshot["particle_spin"]) ** 2 / 2).sum()
    assert history_of(unusual)["kinetic_energy"][-1] == pytest.approx(kinetic, rel=1e-9)


def test_confining_stress_is_held(unusual: Path) -> None:
    history = history_of(unusual)
    assert history["lateral_stress"][1:].mean() == pytest.approx(500, rel=2e-3)
    assert manifest_of(unusual)["validity"]["servo_error_max"] < 0.02


def test_friction_in_the_preparation_leaves_it_looser(
    make_run: Callable[..., Path], unusual: Path, tmp_path: Path
) -> None:
    short = SMALL | {"final_axial_strain": 0.0005}
    dense = make_run(tmp_path / "dense", **short)
    loose = make_run(tmp_path / "loose", **short, preparation_friction=0.5)
    fractions = [manifest_of(run)["preparation"]["solid_fraction"] for run in (dense, loose)]
    assert fractions[1] < fractions[0] - 0.005
    assert manifest_of(unusual)["preparation"]["settled"]
