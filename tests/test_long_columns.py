"""Columns of more than three particles: stretches in the data, the model's measures, and parameters that come back."""

from __future__ import annotations

import numpy as np
import pytest

from forcechain.arrays import FloatArray
from forcechain.calibration import CALIBRATED, MEASURES, Identified, SegmentHistories, calibrate_long
from forcechain.calibration.long_columns import column_measures, largest_lateral_stiffness
from forcechain.observe.stretches import find_stretches
from forcechain.theory.column import buckling_modes
from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.three_particle import loading

ANGLE = np.radians(np.linspace(6, 18, 7))
NOISE = {
    "buckling_angle": np.radians(0.5),
    "axial_force": 0.5,
    "normal_displacement_over_R": 0.004,
    "axial_displacement_over_R": 0.01,
    "rotation": np.radians(0.5),
    "lateral_force": 0.2,
}
TRUTH = {name: float(np.asarray(value)) for name, value in TABLE_3.ratios().items() if name in CALIBRATED}


def stretches_of(
    n_particles: int, noise: float, seed: int = 0, parameters: ChainParameters = TABLE_3
) -> list[SegmentHistories]:
    """Three packings of 15 stretches that follow the model, each with a departure of its own that grows from zero."""
    rng = np.random.default_rng(seed)
    exact: dict[str, FloatArray] = column_measures(parameters, n_particles, ANGLE)
    exact |= {"buckling_angle": ANGLE}
    exact["lateral_force"] = np.full(len(ANGLE), float(parameters.lateral_strength * parameters.radius))
    runs = []
    for _ in range(3):
        arrays = {}
        for name in MEASURES:
            counted = name in ("axial_displacement_over_R", "rotation")
            start = exact[name][0] if counted else 0.0
            growth = np.linspace(0, 1, len(ANGLE)) if counted else np.ones(len(ANGLE))
            own = noise * NOISE[name] * rng.normal(size=15)
            arrays[name] = (exact[name] - start)[:, None] + growth[:, None] * own
        runs.append(SegmentHistories(**arrays))
    return runs


def test_segments_that_overlap_make_a_stretch() -> None:
    line = [[0, 1, 2], [1, 2, 3], [2, 3, 4]]
    alone = [[10, 11, 12]]
    one_sided = [[11, 12, 20]]  # 12 is an end of the one above, and 11 one of this: they overlap
    not_mutual = [[30, 31, 32], [33, 32, 34]]  # 32 is an end of the first, but 31 is none of the second
    found = find_stretches(np.array(line + alone + one_sided + not_mutual))
    assert found.n_particles.tolist() == [5, 4, 3, 3]
    assert found.label.tolist() == [0, 0, 0, 1, 1, 2, 3]
    assert found.is_line.all()
    assert find_stretches(np.zeros((0, 3), dtype=np.int64)).n_particles.size == 0


def test_the_order_of_segments_and_ends_does_not_matter() -> None:
    segments = np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4], [7, 8, 9]])
    order = np.array([3, 1, 0, 2])
    turned = segments[order][:, [2, 1, 0]]
    assert sorted(find_stretches(turned).n_particles) == sorted(find_stretches(segments).n_particles)


def test_branches_and_rings_are_no_columns() -> None:
    branch = np.array([[0, 1, 2], [1, 2, 3], [1, 2, 4], [2, 3, 5], [2, 4, 6]])
    assert find_stretches(branch).is_line.tolist() == [False]
    ring = np.array([[2, 0, 1], [0, 1, 2], [1, 2, 0]])
    assert find_stretches(ring).is_line.tolist() == [False]


def test_three_particles_are_the_three_particle_column() -> None:
    found = column_measures(TABLE_3, 3, np.radians([2.0, 9.0, 14.0, 21.0, 25.0]))
    state = loading(TABLE_3, np.radians([2.0, 9.0, 14.0, 21.0, 25.0]))
    for name, values in found.items():
        # the path comes in steps: between them it is a chord
        assert values == pytest.approx(getattr(state, name), rel=0.01, abs=4e-3), name


@pytest.mark.parametrize("n_particles", [3, 4, 5, 8])
def test_the_bound_is_on_the_overlap_at_the_critical_load(n_particles: int) -> None:
    chain = np.array([0.005, 0.014, 0.02])
    lateral = largest_lateral_stiffness(chain, 0.5, n_particles, 0.1)
    for kFC, ks in zip(chain, lateral, strict=True):
        stiff = TABLE_3.with_ratios(chain_tangential_stiffness=kFC, lateral_stiffness=ks)
        force = buckling_modes(stiff, n_particles).critical_force[0]
        assert force == pytest.approx(0.1 * float(TABLE_3.normal_stiffness * TABLE_3.radius))


def test_exact_data_give_the_parameters_back() -> None:
    exact = calibrate_long(stretches_of(4, 0.0), TABLE_3, 4)
    for estimate in exact.estimates:
        assert estimate.value == pytest.approx(TRUTH[estimate.name], rel=0.03)
    assert max(exact.deviation.values()) < 0.01


@pytest.mark.parametrize("n_particles", [4, 5])
def test_parameters_come_back_within_their_intervals(n_particles: int) -> None:
    noisy = calibrate_long(stretches_of(n_particles, 1.0, seed=1), TABLE_3, n_particles, three=TABLE_3)
    for estimate in noisy.estimates:
        assert estimate.interval.low <= TRUTH[estimate.name] <= estimate.interval.high, estimate
        assert estimate.identified in (Identified.YES, Identified.MEASURED)
    assert noisy.of_three is not None
    assert noisy.n_stretches == 45
    assert noisy.critical_force == pytest.approx(buckling_modes(TABLE_3, n_particles).critical_force[0], rel=0.1)


def test_data_of_one_length_do_not_pass_for_another() -> None:
    runs = stretches_of(3, 1.0, seed=2)
    wrong = calibrate_long(runs, TABLE_3, 4, three=TABLE_3)
    chain, lateral, _ = wrong.estimates
    inside = [e.interval.low <= TRUTH[e.name] <= e.interval.high for e in (chain, lateral)]
    assert not all(inside)
    assert wrong.of_three is not None
    assert wrong.of_three["axial_force"] > 0.1


def test_too_few_stretches_say_so() -> None:
    (run, *_) = stretches_of(4, 1.0)
    few = SegmentHistories(**{name: getattr(run, name)[:, :5] for name in MEASURES})
    with pytest.raises(ValueError, match="at least 8 stretches of 4 particles, found 5"):
        calibrate_long([few], TABLE_3, 4)
