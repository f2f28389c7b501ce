"""The bed of a punch and its surcharge, without YADE: what both must be, counted anew by loops."""

from __future__ import annotations

import math

import numpy as np
import pytest

from yade_scripts import parameters, punch_bed
from yade_scripts.punch_surcharge import seen_from_above

PRESSURE = 2e-3  # over stiffness


@pytest.fixture(scope="module")
def radii() -> np.ndarray:
    return np.random.default_rng(1).permutation(np.where(np.arange(200) < 100, 1.52e-3, 0.76e-3))


@pytest.fixture(scope="module")
def bed(radii: np.ndarray) -> punch_bed.Bed:
    return punch_bed.settle(radii, 2.0, PRESSURE, np.random.default_rng(2))


def forces_by_loops(bed: punch_bed.Bed, radii: np.ndarray) -> tuple[np.ndarray, list[float], np.ndarray]:
    """Resultants (n, 2) and sizes of the contact forces over stiffness [m], and force of each wall (4,)."""
    total, sizes, walls = np.zeros((len(radii), 2)), [], np.zeros(4)
    for one in range(len(radii)):
        for other in range(one):
            branch = bed.positions[one] - bed.positions[other]
            overlap = radii[one] + radii[other] - math.hypot(*branch)
            if overlap > 0:
                force = overlap * branch / math.hypot(*branch)
                total[one] += force
                total[other] -= force
                sizes.append(overlap)
        for axis in (0, 1):
            low = radii[one] - bed.positions[one, axis]
            high = bed.positions[one, axis] + radii[one] - bed.extents[axis]
            for overlap, sign, wall in ((low, 1, 2 * axis), (high, -1, 2 * axis + 1)):
                if overlap > 0:
                    total[one, axis] += sign * overlap
                    walls[wall] += overlap
                    sizes.append(overlap)
    return total, sizes, walls


def test_a_bed_rests_at_its_pressure(bed: punch_bed.Bed, radii: np.ndarray) -> None:
    resultant, sizes, walls = forces_by_loops(bed, radii)
    assert bed.facts["settled"]
    assert np.hypot(*resultant.T).mean() / np.mean(sizes) <= punch_bed.UNBALANCED_FORCE
    assert bed.facts["unbalanced_force"] == pytest.approx(np.hypot(*resultant.T).mean() / np.mean(sizes), rel=1e-9)
    pressure = walls / bed.extents[[1, 1, 0, 0]]
    np.testing.assert_allclose(pressure, PRESSURE, rtol=0.15)  # what each wall bears, with the rest of unbalance
    assert bed.extents[0] / bed.extents[1] == pytest.approx(2.0, rel=0.1)
    assert 0.8 < bed.facts["solid_fraction"] < 0.88
    area = math.pi * (radii**2).sum() / bed.extents.prod()
    assert bed.facts["solid_fraction"] == pytest.approx(area, rel=1e-12)
    inside = (bed.positions > 0) & (bed.positions < bed.extents)
    assert inside.all()


def test_a_bed_that_has_no_time_says_so(radii: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(punch_bed, "MOST_STEPS", 30)
    assert not punch_bed.settle(radii, 2.0, PRESSURE, np.random.default_rng(2)).facts["settled"]


def test_seeds_make_beds() -> None:
    def positions(seed: int) -> np.ndarray:
        few = {"particle_count": 50, "punch_width_over_bed_width": 0.5, "confining_stress": 700.0, "seed": seed}
        values = parameters.check(few, parameters.PUNCH)
        return punch_bed.bed_of(values)[1].positions

    np.testing.assert_array_equal(positions(1), positions(1))
    assert not np.array_equal(positions(1), positions(2))


def test_every_near_pair_is_listed_once() -> None:
    generator = np.random.default_rng(3)
    position, radii = generator.random((150, 2)) * (30, 12), generator.choice((0.5, 1.0), 150)
    one, other = punch_bed._pairs(position, radii)
    found = {frozenset(pair) for pair in zip(one.tolist(), other.tolist(), strict=True)}
    assert len(found) == len(one)
    reach = radii[:, None] + radii + punch_bed.SKIN
    near = np.hypot(*(position[:, None] - position).transpose(2, 0, 1)) < reach
    assert found == {frozenset((int(i), int(j))) for i, j in zip(*np.nonzero(np.triu(near, 1)), strict=True)}


def test_the_surcharge_goes_to_what_is_seen_from_above() -> None:
    generator = np.random.default_rng(4)
    x, y, radius = generator.random(80) * 20, generator.random(80) * 6, generator.choice((0.5, 1.0), 80)
    spans, spacing = [(2.0, 8.0), (11.0, 18.5)], 0.01
    surface = seen_from_above(x, y, radius, spans, spacing)
    seen = np.zeros(80)
    heights = []
    for begin, end in spans:
        count = round((end - begin) / spacing)
        for column in begin + (end - begin) / count * (np.arange(count) + 0.5):
            over = np.flatnonzero(np.abs(x - column) < radius)
            height = y[over] + np.sqrt(radius[over] ** 2 - (x[over] - column) ** 2)
            seen[over[np.argmax(height)]] += (end - begin) / count
            heights.append(height.max())
    np.testing.assert_array_equal(surface.numbers, np.flatnonzero(seen))
    np.testing.assert_allclose(surface.widths, seen[seen > 0], rtol=1e-9)
    assert surface.widths.sum() == pytest.approx(13.5, rel=1e-9)
    assert surface.mean_height == pytest.approx(np.mean(heights), rel=1e-3)


def test_a_hole_in_the_surface_shows() -> None:
    x, ones = np.array([1.0, 5.0]), np.ones(2)
    surface = seen_from_above(x, ones, ones, [(0.0, 6.0)], 0.01)
    assert surface.widths.sum() == pytest.approx(4.0, abs=0.03)
