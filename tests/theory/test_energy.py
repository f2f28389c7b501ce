"""The energy balance (18) of monotonic loading, by quadrature, against the definition of work and of slip."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from test_three_particle import random_parameters

from forcechain.theory.energy import energies
from forcechain.theory.parameters import TABLE_3
from forcechain.theory.states import Status
from forcechain.theory.three_particle import loading
from forcechain.theory.yielding import critical_force, yield_angles


def test_balance_closes_for_a_thousand_random_chains():
    p = random_parameters(1000, seed=77)
    t = np.array([0.05, 0.3, 0.8, 1.4])[:, None]
    e = energies(p, t)
    good = e.status == Status.EQUILIBRIUM
    assert good.mean() > 0.7
    gap = np.abs(e.work - e.stored - e.moment_dissipation - e.lateral_dissipation) / e.work
    assert gap[good].max() < 1e-12
    assert (e.moment_dissipation[good] >= -1e-14 * e.work[good]).all()
    assert (e.lateral_dissipation[good] >= 0).all()
    for name in ("moment_dissipation", "lateral_dissipation"):
        steps = np.diff(np.where(good, getattr(e, name), np.nan), axis=0)
        assert (steps[good[1:] & good[:-1]] >= -1e-13 * e.work[good].max()).all()
    assert np.isnan(e.work[~good]).all()


@pytest.mark.parametrize("changes", [{}, {"rolling_friction": 0.02}, {"imperfection_deg": 2}, {"rolling_friction": 0}])
def test_work_and_dissipation_are_the_integrals_they_claim_to_be(changes):
    """Work against F dD, dissipation against m dwp, by differences and adaptive quadrature."""
    p = TABLE_3.with_ratios(**changes)
    start, end = float(p.imperfection), 0.6
    yields = yield_angles(p)
    corners = sorted({start, *(float(a) for a in (yields.lateral, yields.moment) if start < a < end), end})

    def integral(force: str, motion: str, factor: float) -> float:
        def integrand(t):
            ahead, behind = (getattr(loading(p, t + s), motion) for s in (1e-7, -1e-7))
            return float(getattr(loading(p, t), force) * (ahead - behind) / 2e-7)

        parts = (quad(integrand, a + 2e-7, b - 2e-7)[0] for a, b in pairwise(corners))
        return factor * sum(parts)

    e = energies(p, end)
    before = float(critical_force(p) ** 2 / p.normal_stiffness) if start == 0 else 0.0
    work = before + integral("axial_force", "axial_displacement_over_R", p.radius)
    assert e.work == pytest.approx(work, rel=1e-4)
    slip = integral("contact_moment", "plastic_rotation", 2.0)
    assert e.moment_dissipation == pytest.approx(slip, rel=1e-4, abs=1e-12)
    slide = integral("lateral_force", "plastic_support", 2 * p.radius)
    assert e.lateral_dissipation == pytest.approx(slide, rel=1e-4)
