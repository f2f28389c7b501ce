"""Classes of buckling from the parameters, and the bound on the overlap."""

from __future__ import annotations

import numpy as np
import pytest

from forcechain.theory.classes import (
    BOTH_ELASTIC,
    LATERAL_FIRST,
    MOMENT_FIRST,
    NO_BUCKLING,
    TOGETHER,
    buckling_class,
    largest_lateral_stiffness,
    overlap_bound_holds,
    overlap_margin,
)
from forcechain.theory.parameters import TABLE_3
from forcechain.theory.three_particle import loading
from forcechain.theory.yielding import critical_displacement, yield_angles


def test_each_class_is_found_from_the_parameters():
    assert buckling_class(TABLE_3) == LATERAL_FIRST
    assert buckling_class(TABLE_3.with_ratios(rolling_friction=0.02)) == MOMENT_FIRST
    assert buckling_class(TABLE_3, largest_angle=np.radians(10)) == BOTH_ELASTIC
    assert buckling_class(TABLE_3.with_ratios(lateral_stiffness=0.6)) == NO_BUCKLING
    angles = yield_angles(TABLE_3)
    apart = float(abs(angles.lateral - angles.moment))
    assert buckling_class(TABLE_3, together_within=apart * 1.001) == TOGETHER
    assert buckling_class(TABLE_3, together_within=apart * 0.999) == LATERAL_FIRST


def test_class_agrees_with_the_first_plastic_stage_of_the_path():
    p = TABLE_3.with_ratios(
        rolling_friction=np.array([0.02, 0.1, 0.2, 0.45])[:, None], lateral_strength=np.linspace(0.005, 0.08, 30)
    )
    classes = buckling_class(p)
    stages = loading(p, np.linspace(1e-3, 1.5, 800)[:, None, None]).stage
    first = np.array([[next(s for s in stages[:, i, j] if s != "1b") for j in range(30)] for i in range(4)])
    assert ((first == "2") == (classes == LATERAL_FIRST)).all()
    assert ((first == "2'") == (classes == MOMENT_FIRST)).all()
    assert {LATERAL_FIRST, MOMENT_FIRST} <= set(classes.ravel().tolist())


def test_bound_on_the_overlap_is_the_overlap_at_the_critical_load():
    stiffness = np.linspace(0, 0.15, 50)
    p = TABLE_3.with_ratios(lateral_stiffness=stiffness)
    holds = overlap_bound_holds(p, 0.1)
    assert (holds == (critical_displacement(p) / 2 < 0.1)).all()
    assert 0 < holds.sum() < 50
    assert overlap_bound_holds(TABLE_3)
    printed = (2 * 0.014 * 0.5 + 0.06 * 0.014 + 0.06 * 0.5) / (0.514) < (0.2 - 0.01) / 2
    assert printed


def test_edge_of_the_admitted_region():
    edge = largest_lateral_stiffness(TABLE_3)
    inside = TABLE_3.with_ratios(lateral_stiffness=float(edge) / TABLE_3.normal_stiffness * (1 - 1e-9))
    outside = TABLE_3.with_ratios(lateral_stiffness=float(edge) / TABLE_3.normal_stiffness * (1 + 1e-9))
    assert overlap_margin(inside) > 0 > overlap_margin(outside)


@pytest.mark.parametrize("overlap", [0, 1, -0.1, np.nan])
def test_overlaps_that_are_none(overlap):
    with pytest.raises(ValueError, match="largest_overlap"):
        overlap_margin(TABLE_3, overlap)


@pytest.mark.parametrize("option", ["largest_angle", "together_within"])
def test_class_options_that_are_none(option):
    with pytest.raises(ValueError, match=option):
        buckling_class(TABLE_3, **{option: -1.0})
