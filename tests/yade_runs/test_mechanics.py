"""Do the exported tables describe mechanics: balance, stress, contact law, wall forces, energies?"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mechanics import contact_forces, force_moment_tensors, unbalanced
from yade_run_files import ROOT, RunScript, history_of, manifest_of, snapshot_of

pytestmark = pytest.mark.yade

SNAPSHOTS = (0, 1, 10, 30)


def kinetic_energy(snapshot: dict[str, np.ndarray], mass: np.ndarray, inertia: float) -> float:
    """Kinetic energy of discs with these masses, (n,), and inertia over mass and radius squared [J]."""
    speed = np.hypot(snapshot["particle_vx"], snapshot["particle_vy"])
    turning = snapshot["particle_radius"] * snapshot["particle_spin"]
    return float((mass * (speed**2 + inertia * turning**2)).sum() / 2)


def row_of(run: Path, index: int) -> np.void:
    """Row of the history that belongs to a snapshot."""
    return history_of(run)[10 * index]


@pytest.mark.parametrize("index", SNAPSHOTS)
def test_forces_balance_on_every_disc(rough: Path, index: int) -> None:
    snapshot = snapshot_of(rough, index)
    force, moment = unbalanced(snapshot)
    assert force == pytest.approx(row_of(rough, index)["unbalanced_force"], rel=1e-9, abs=1e-12)
    assert force < 0.01
    assert moment < 0.01


@pytest.mark.parametrize(
    ("column", "change"),
    [
        ("contact_ft", lambda values: -values),
        ("contact_moment", lambda values: -values),
        ("contact_fn", lambda values: np.roll(values, 1)),
        ("contact_nx", lambda values: -values),
        ("contact_x", lambda values: values + np.resize([2e-4, -2e-4], len(values))),
        ("contact_id1", lambda values: np.roll(values, 1)),
    ],
)
def test_a_tampered_table_does_not_balance(rough: Path, column: str, change) -> None:
    snapshot = snapshot_of(rough, 30)
    force, moment = unbalanced({**snapshot, column: change(snapshot[column])})
    assert max(force, moment) > 0.02


def test_stress_agrees_with_yades_own(run_script: RunScript, rough: Path, tmp_path: Path) -> None:
    done = run_script(
        ROOT / "tests" / "yade_runs" / "stress_probe.py", ROOT, rough.parent.parent / "packings", tmp_path
    )
    assert done.returncode == 0, done.stderr
    snapshot = snapshot_of(tmp_path, 0)
    theirs = np.load(tmp_path / "tensors.npy")
    ours = force_moment_tensors(snapshot)
    scale = np.abs(theirs).max()
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * scale)
    # The wall contacts of this run bear friction: the comparison sees wrong ones.
    at_wall = snapshot["contact_id2"] < 0
    assert np.abs(snapshot["contact_ft"][at_wall]).max() > 0
    wrong = {**snapshot, "contact_ft": np.where(at_wall, -snapshot["contact_ft"], snapshot["contact_ft"])}
    assert np.abs(force_moment_tensors(wrong) - theirs).max() > 1e-6 * scale
    # What our own test reads quickly is what the export for any script reads from YADE number by number.
    quick = snapshot_of(tmp_path / "quick", 0)
    assert sorted(quick) == sorted(snapshot)
    for name, values in snapshot.items():
        np.testing.assert_allclose(
            quick[name], values, rtol=1e-10, atol=1e-12 * np.abs(values).max(initial=0), err_msg=name
        )
    # It reads memory, unless that is not found, or not what YADE's interface or the positions say; to the same bytes.
    ways = json.loads((tmp_path / "ways.json").read_text())
    assert ways.pop("quick") == "memory"
    assert len(ways) == 11
    assert manifest_of(rough)["tables_from"] == ["memory"]
    assert set(ways.values()) == {"interface"}
    expected = (tmp_path / "quick" / "snapshots" / "000000.npz").read_bytes()
    for name in ways:
        assert (tmp_path / name / "snapshots" / "000000.npz").read_bytes() == expected, name


@pytest.mark.parametrize("index", SNAPSHOTS)
def test_contact_law(rough: Path, index: int) -> None:
    snapshot = snapshot_of(rough, index)
    contact = {name.removeprefix("contact_"): values for name, values in snapshot.items() if "contact_" in name}
    radius = snapshot["particle_radius"]
    between = contact["id2"] >= 0
    pair = radius[np.stack((contact["id1"][between], contact["id2"][between]))]
    np.testing.assert_allclose(contact["kn"], 1.05e5, rtol=1e-12)
    np.testing.assert_allclose(contact["kt"], 0.5 * 1.05e5, rtol=1e-12)
    np.testing.assert_allclose(contact["kr"][between], 0.5 * 1.05e5 * pair[0] * pair[1], rtol=1e-12)
    np.testing.assert_allclose(contact["rolling_limit"][between], 0.2 * pair.min(axis=0), rtol=1e-12)
    np.testing.assert_allclose(contact["friction"][between], 0.7, rtol=1e-12)
    for name in ("kr", "rolling_limit", "friction", "ft", "moment"):
        assert not contact[name][~between].any(), name
    np.testing.assert_allclose(contact["fn"], contact["kn"] * contact["overlap"], rtol=1e-9, atol=1e-12)
    assert (contact["fn"] >= 0).all()
    assert (np.abs(contact["ft"]) <= contact["friction"] * contact["fn"] * (1 + 1e-9)).all()
    assert (np.abs(contact["moment"]) <= contact["rolling_limit"] * contact["fn"] * (1 + 1e-9)).all()
    np.testing.assert_allclose(np.hypot(contact["nx"], contact["ny"]), 1, rtol=1e-12)


def test_contact_geometry(rough: Path) -> None:
    snapshot = snapshot_of(rough, 20)
    between = snapshot["contact_id2"] >= 0
    one, other = snapshot["contact_id1"][between], snapshot["contact_id2"][between]
    centre = np.stack((snapshot["particle_x"], snapshot["particle_y"]), axis=1)
    branch = centre[other] - centre[one]
    length = np.hypot(*branch.T)
    radius = snapshot["particle_radius"]
    np.testing.assert_allclose(radius[one] + radius[other] - length, snapshot["contact_overlap"][between], atol=1e-15)
    np.testing.assert_allclose(branch[:, 0] / length, snapshot["contact_nx"][between], atol=1e-12)
    np.testing.assert_allclose(branch[:, 1] / length, snapshot["contact_ny"][between], atol=1e-12)


def test_rolling_resistance_acts(rough: Path, smooth: Path) -> None:
    with_it, without = snapshot_of(rough, 30), snapshot_of(smooth, 30)
    assert not without["contact_moment"].any()
    assert not without["contact_kr"].any()
    limit = with_it["contact_rolling_limit"] * with_it["contact_fn"]
    between = limit > 0
    share = np.abs(with_it["contact_moment"][between]) / limit[between]
    assert 0.05 < (share > 1 - 1e-9).mean() < 0.95  # some roll, some resist
    ratios = [history_of(run)["stress_ratio"][-1] for run in (rough, smooth)]
    assert ratios[0] > ratios[1] + 0.05


@pytest.mark.parametrize("index", SNAPSHOTS)
def test_walls_feel_what_their_contacts_bear(rough: Path, index: int) -> None:
    snapshot, row, derived = snapshot_of(rough, index), row_of(rough, index), manifest_of(rough)["derived"]
    width = derived["initial_width"]["value"] * (1 - row["lateral_strain"])
    height = derived["initial_height"]["value"] * (1 - row["axial_strain"])
    on_wall = {wall: contact_forces(snapshot)[snapshot["contact_id2"] == wall].sum(axis=0) for wall in (-1, -2, -3, -4)}
    assert on_wall[-1][0] < 0 < on_wall[-2][0]
    assert on_wall[-3][1] < 0 < on_wall[-4][1]
    assert (on_wall[-2][0] - on_wall[-1][0]) / (2 * height) == pytest.approx(row["lateral_stress"], rel=1e-9)
    assert (on_wall[-4][1] - on_wall[-3][1]) / (2 * width) == pytest.approx(row["axial_stress"], rel=1e-9)
    expected = (row["axial_stress"] - row["lateral_stress"]) / (row["axial_stress"] + row["lateral_stress"])
    assert row["stress_ratio"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("index", SNAPSHOTS)
def test_history_agrees_with_the_tables(rough: Path, index: int) -> None:
    snapshot, row, derived = snapshot_of(rough, index), row_of(rough, index), manifest_of(rough)["derived"]
    kr = snapshot["contact_kr"]
    rolling = np.divide(snapshot["contact_moment"] ** 2, kr, out=np.zeros_like(kr), where=kr > 0)
    springs = (
        snapshot["contact_fn"] ** 2 / snapshot["contact_kn"] + snapshot["contact_ft"] ** 2 / snapshot["contact_kt"]
    )
    assert row["elastic_energy"] == pytest.approx((springs + rolling).sum() / 2, rel=1e-9)
    radius = snapshot["particle_radius"]
    disc_ends = (snapshot["contact_id1"] >= 0).sum() + (snapshot["contact_id2"] >= 0).sum()
    assert row["coordination"] == pytest.approx(disc_ends / len(radius), rel=1e-12)
    width = derived["initial_width"]["value"] * (1 - row["lateral_strain"])
    height = derived["initial_height"]["value"] * (1 - row["axial_strain"])
    assert row["solid_fraction"] == pytest.approx(np.pi * (radius**2).sum() / (width * height), rel=1e-12)
    assert snapshot["axial_strain"] == row["axial_strain"]
    assert snapshot["time"] == row["time"]


@pytest.mark.parametrize(("run", "inertia", "factor"), [("rough", 0.5, 0.5), ("smooth", 0.4, 0.3)])
def test_masses_are_equal_by_default_or_by_size_when_asked(
    request: pytest.FixtureRequest, run: str, inertia: float, factor: float
) -> None:
    folder: Path = request.getfixturevalue(run)
    snapshot, derived = snapshot_of(folder, 30), manifest_of(folder)["derived"]
    mass = 2650 * 4 / 3 * np.pi * snapshot["particle_radius"] ** 3
    other = np.full(len(mass), mass.mean())
    if run == "rough":
        mass, other = other, mass
    found = row_of(folder, 30)["kinetic_energy"]
    assert found == pytest.approx(kinetic_energy(snapshot, mass, inertia), rel=1e-9)
    assert found != pytest.approx(kinetic_energy(snapshot, other, inertia), rel=1e-3)
    assert derived["mean_mass"]["value"] == pytest.approx(mass.mean(), rel=1e-12)
    # A little shorter than the safe one, so that samples fall on whole numbers of steps.
    assert 0.95 < derived["time_step"]["value"] / (factor * np.sqrt(mass.min() / 1.05e5)) <= 1
