"""Do the options of the physics reach the simulation?"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from yade_run_files import ROOT, RunScript, history_of, manifest_of, snapshot_of

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


SETS: tuple[dict[str, Any], ...] = (
    {},
    {"damping": 0.05, "strain_rate": 0.3, "confining_stress": 50.0},
    {"inertial_number": 5e-4, "mass": "true", "density": 1000.0, "shape": "sphere"},
    {"mass": "true", "shape": "cylinder"},
    {"smallest_radius": 1e-3, "largest_radius": 3e-3, "size_distribution": "uniform", "time_step_factor": 0.1},
    {"normal_stiffness": 4 * 1.05e5},
)


@pytest.fixture(scope="module")
def probed(run_script: RunScript, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What a few discs have in the simulation, for each of SETS."""
    file = tmp_path_factory.mktemp("probe") / "sets.json"
    file.write_text(json.dumps(SETS))
    done = run_script(ROOT / "tests" / "yade_runs" / "options_probe.py", ROOT, file)
    assert done.returncode == 0, done.stderr
    (line,) = (text for text in done.stdout.splitlines() if text.startswith("found "))
    return json.loads(line.removeprefix("found "))


def test_damping_and_loading_reach_the_engines(probed: list[dict[str, Any]]) -> None:
    default, slow, fast = probed[:3]
    assert {entry["engine"] for entry in probed} == {"NewtonIntegrator"}
    assert [entry["damping"] for entry in probed[:2]] == [0.2, 0.05]
    assert slow["top_velocity"] == pytest.approx(-0.3 * slow["height"] / 2, rel=1e-12)
    for entry, number, stress in ((default, 1e-4, 700), (fast, 5e-4, 700)):
        rate = number / np.sqrt(np.mean(entry["masses"]) / stress)
        assert entry["top_velocity"] == pytest.approx(-rate * entry["height"] / 2, rel=1e-12)
    assert default["push"] == pytest.approx(-700 * default["height"], rel=1e-12)
    assert slow["push"] == pytest.approx(-50 * slow["height"], rel=1e-12)


def test_sizes_masses_and_inertias_reach_the_bodies(probed: list[dict[str, Any]]) -> None:
    default, _, spheres, cylinders, uniform, _ = probed
    assert {entry["count"] for entry in probed} == {16}
    assert default["radii"] == [0.76e-3] * 8 + [1.52e-3] * 8
    np.testing.assert_allclose(uniform["radii"], 1e-3 + 2e-3 * (np.arange(16) + 0.5) / 16, rtol=1e-12)
    assert len(set(default["masses"])) == 1
    radii = np.array(spheres["radii"])
    np.testing.assert_allclose(np.sort(spheres["masses"]), 1000 * 4 / 3 * np.pi * radii**3, rtol=1e-12)
    np.testing.assert_allclose(np.sort(cylinders["masses"]), 2650 * np.pi * radii**2 * 2 * radii.mean(), rtol=1e-12)
    for entry, ratio in ((default, 0.5), (spheres, 0.4), (cylinders, 0.5)):
        np.testing.assert_allclose(entry["inertia_ratios"], ratio, rtol=1e-12)


def test_the_time_step_follows_masses_and_stiffness(probed: list[dict[str, Any]]) -> None:
    for entry, factor, stiffness in zip(probed, (0.5, 0.5, 0.3, 0.3, 0.1, 0.5), [1.05e5] * 5 + [4.2e5], strict=True):
        longest = factor * np.sqrt(min(entry["masses"]) / stiffness)
        assert 0.93 * longest < entry["time_step"] <= longest * (1 + 1e-12)
