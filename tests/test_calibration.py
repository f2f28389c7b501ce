"""Calibration on data made from the model: parameters come back within their intervals, flat directions are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration_data import LATE, TRUTH, WIDE, coverage, synthetic

from forcechain.arrays import FloatArray
from forcechain.calibration import (
    CALIBRATED,
    Calibration,
    Column,
    Estimate,
    Identified,
    calibrate,
)
from forcechain.calibration.bounded_fit import fit_many
from forcechain.calibration.column_fit import ColumnFit
from forcechain.theory.classes import overlap_margin
from forcechain.theory.parameters import TABLE_3


def estimate(result: Calibration, name: str) -> Estimate:
    return result.estimates[CALIBRATED.index(name)]


@pytest.mark.parametrize("column", list(Column))
def test_data_without_noise_give_the_parameters_back(column: Column) -> None:
    truth = TABLE_3.with_ratios(imperfection_deg=np.degrees(WIDE[0])) if column is Column.IMPERFECT else TABLE_3
    result = calibrate(synthetic(WIDE, 0.0, parameters=truth), TABLE_3, column=column, samples=40, profile_points=0)
    for name, value in TRUTH.items():
        assert estimate(result, name).value == pytest.approx(value, rel=1e-4)
    assert result.sum_of_squares < 1e-3
    assert max(goodness.calibrated for goodness in result.goodness) < 1e-4
    assert float(np.asarray(result.parameters.imperfection)) == pytest.approx(
        WIDE[0] if column is Column.IMPERFECT else 0
    )


@pytest.mark.parametrize("column", list(Column))
def test_intervals_hold_the_truth_in_90_to_99_of_100_trials(column: Column) -> None:
    held = coverage(column, 100)
    assert {name: 90 <= count <= 99 for name, count in held.items()} == dict.fromkeys(CALIBRATED, True), held


def test_coverage_would_see_intervals_that_are_too_narrow() -> None:
    held = coverage(Column.PERFECT, 30, truth=TRUTH | {"chain_tangential_stiffness": 1.3 * 0.014})
    assert held["chain_tangential_stiffness"] < 27
    assert held["lateral_strength"] >= 27


def test_data_from_14_degrees_only_bound_the_lateral_stiffness_from_below() -> None:
    result = calibrate(synthetic(LATE, 0.0), TABLE_3, samples=40, profile_points=20)
    lateral = estimate(result, "lateral_stiffness")
    edge = TRUTH["lateral_strength"] / (2 * np.sin(LATE[0]))  # theta_s = asin(ls/2ks) below 14 degrees
    assert lateral.identified is Identified.BOUNDED_BELOW
    assert lateral.interval.low == pytest.approx(edge, rel=1e-6)
    series = 2 * 0.014 * 0.5 / 0.514
    assert lateral.interval.high == pytest.approx(result.bound - series, rel=1e-3)
    assert lateral.interval.low < lateral.value < lateral.interval.high
    assert not lateral.determined_by
    # the profile says the same: flat from there on to where (30) crowds kFC, and steep below
    flat = (lateral.profile_value > edge) & (lateral.profile_value < 0.06)
    assert lateral.profile_sum[flat].max() < 1e-2
    assert lateral.profile_sum[lateral.profile_value < 0.9 * edge].min() > 1
    chain = estimate(result, "chain_tangential_stiffness")
    assert chain.identified is Identified.YES
    assert chain.value == pytest.approx(0.014, rel=1e-4)
    assert abs(chain.profile_value[chain.profile_sum.argmin()] - 0.014) < 0.06 / 20


def test_with_noise_the_lower_bound_still_admits_the_truth() -> None:
    result = calibrate(synthetic(LATE, seed=3), TABLE_3, samples=60, profile_points=0)
    lateral = estimate(result, "lateral_stiffness")
    assert lateral.identified is Identified.BOUNDED_BELOW
    assert lateral.interval.low < TRUTH["lateral_stiffness"] < lateral.interval.high


def test_without_rolling_friction_nothing_is_known_of_the_chain_stiffness() -> None:
    frictionless = TABLE_3.with_ratios(rolling_friction=0.0)
    result = calibrate(synthetic(LATE, parameters=frictionless), frictionless, samples=40, profile_points=0)
    chain = estimate(result, "chain_tangential_stiffness")
    assert chain.identified is Identified.NO
    assert not chain.determined_by
    assert chain.interval.low == 0
    assert chain.interval.high == pytest.approx(0.095 / 2 * 0.5 / (0.5 - 0.095 / 2))  # all that (30) admits


def test_without_a_rolling_spring_the_fit_still_ends() -> None:
    bare = TABLE_3.with_ratios(rolling_stiffness=0.0)
    result = calibrate(synthetic(WIDE, parameters=bare), bare, samples=40, profile_points=10)
    assert estimate(result, "chain_tangential_stiffness").identified is Identified.NO
    assert estimate(result, "lateral_stiffness").value == pytest.approx(0.06, rel=0.1)


def test_a_force_too_high_for_the_bound_stands_at_it() -> None:
    runs = [replace(run, axial_force=3 * run.axial_force) for run in synthetic(WIDE)]
    result = calibrate(runs, TABLE_3, samples=40, profile_points=0)
    assert overlap_margin(result.parameters) >= -1e-12
    assert overlap_margin(result.parameters) < 1e-4
    assert estimate(result, "lateral_stiffness").identified is Identified.AT_BOUND
    assert result.sum_of_squares > 100
    force = next(goodness for goodness in result.goodness if goodness.measure == "axial_force")
    assert force.calibrated > 0.2
    assert force.calibrated_interval.low <= force.calibrated <= force.calibrated_interval.high


@pytest.mark.parametrize("rolling", [0.0, 0.01, 0.0475, 0.3, 0.5, 1.7])
def test_every_point_of_the_search_is_admissible(rolling: float) -> None:
    fixed = TABLE_3.with_ratios(rolling_stiffness=rolling)
    fit = ColumnFit(fixed=fixed, imperfect=False, bound=0.095, errors=np.ones(4))
    corner = np.linspace(0, 1, 33)
    stiffness = fit.stiffnesses(np.stack(np.meshgrid(corner, corner), axis=-1).reshape(-1, 2))
    assert stiffness[:, 0].min() > 0
    assert stiffness[:, 1].min() >= 0
    chosen = fixed.with_ratios(chain_tangential_stiffness=stiffness[:, 0], lateral_stiffness=stiffness[:, 1])
    assert overlap_margin(chosen).min() > -1e-12
    assert overlap_margin(chosen).min() < 1e-12  # and the search reaches the bound


def test_calibrated_parameters_fit_better_than_wrong_ones() -> None:
    wrong = TABLE_3.with_ratios(lateral_strength=0.04, chain_tangential_stiffness=0.03)
    result = calibrate(synthetic(WIDE), wrong, samples=40, profile_points=0)
    for goodness in result.goodness:
        assert goodness.calibrated < goodness.reference
    shares = estimate(result, "lateral_stiffness").determined_by
    assert sum(shares.values()) == pytest.approx(1)
    assert shares["rotation"] < 0.01  # before the moment yields the rotation is set by kFC and kr alone


def test_a_single_run_has_an_interval_over_segments_alone() -> None:
    result = calibrate(synthetic(WIDE, n_runs=1), TABLE_3, samples=40, profile_points=0)
    for found in result.estimates:
        assert found.by_runs is None
        assert found.interval == found.by_segments
    assert result.n_runs == 1
    assert result.correlation.shape == (3, 3)


def test_two_runs_know_less_than_five() -> None:
    two = calibrate(synthetic(WIDE, n_runs=2), TABLE_3, samples=40, profile_points=0)
    five = calibrate(synthetic(WIDE, n_runs=5), TABLE_3, samples=40, profile_points=0)
    strength = [estimate(result, "lateral_strength").interval.width for result in (two, five)]
    assert strength[0] > strength[1]


def test_the_same_data_give_the_same_result() -> None:
    one, other = (calibrate(synthetic(WIDE), TABLE_3, samples=40, profile_points=0) for _ in range(2))
    assert [e.interval for e in one.estimates] == [e.interval for e in other.estimates]


def test_many_fits_agree_with_one_by_one_and_stay_in_the_box() -> None:
    targets = np.random.default_rng(2).uniform(-0.5, 1.5, (50, 2))

    def residuals(x: FloatArray) -> FloatArray:
        return np.stack([x[:, 0] - targets[:, 0], 3 * (x[:, 1] - targets[:, 1])], axis=1)

    found = fit_many(residuals, np.full((50, 2), 0.5))
    assert found.coordinates == pytest.approx(np.clip(targets, 0, 1), abs=1e-5)
    assert found.converged.all()
    with pytest.raises(ValueError, match="within 0 and 1"):
        fit_many(residuals, np.full((50, 2), 1.5))


def test_input_that_cannot_be_calibrated_says_why() -> None:
    runs = synthetic(WIDE)
    with pytest.raises(ValueError, match="at least 2 segments"):
        calibrate([], TABLE_3)
    with pytest.raises(ValueError, match="increments"):
        calibrate([runs[0], synthetic(WIDE[:5])[0]], TABLE_3)
    with pytest.raises(ValueError, match="one parameter set"):
        calibrate(runs, TABLE_3.with_ratios(rolling_friction=[0.1, 0.2]))
    with pytest.raises(ValueError, match="samples"):
        calibrate(runs, TABLE_3, samples=3)
    with pytest.raises(ValueError, match="largest_overlap"):
        calibrate(runs, TABLE_3, largest_overlap=1.0)
    with pytest.raises(ValueError, match="in degrees"):
        replace(runs[0], buckling_angle=np.degrees(runs[0].buckling_angle))
    with pytest.raises(ValueError, match="rotation: expected an array of shape"):
        replace(runs[0], rotation=runs[0].rotation[:3])
