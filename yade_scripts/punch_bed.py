"""A bed of discs for the punch: an isotropic packing found as a minimum of enthalpy, without simulating its making.

Tens of thousands of discs without friction take hours to come to rest by themselves at a low pressure. What they come
to rest in is a minimum of elastic energy + pressure x area, and FIRE (Bitzek et al., Phys. Rev. Lett. 97, 170201,
2006) finds one in minutes: molecular dynamics that turns the velocities towards the forces and stops when it goes
uphill. Positions and the box's two sides are the unknowns; plain numpy, no YADE.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from yade_scripts import materials

ASPECT = "bed_width_over_height"  # a parameter that beds have and square packings have not
RECIPE = "bed 1"  # another one whenever the making changes, so that old beds are not taken for new ones
START_SOLID_FRACTION = 0.87  # above that of the result: compressed discs find their pressure sooner than loose ones
# When a bed is settled: mean resultant force over mean contact force, and error of the pressure. Both are brought down
# further, with friction and under the surcharge, before the punch moves.
UNBALANCED_FORCE = 3e-2
PRESSURE_ERROR = 5e-2
MOST_STEPS = 40_000
BOX_INERTIA = 10  # of a logarithmic strain of the box, over its side: light, or the box lags behind the discs
SKIN = 0.3  # of the largest radius: how much further than touching pairs are listed
# FIRE's own constants, but for the time steps, which are over sqrt(mass/stiffness)
FIRST_STEP, LARGEST_STEP = 0.1, 0.5
FASTER, SLOWER, MIXING, LESS_MIXING, PATIENCE = 1.1, 0.5, 0.1, 0.99, 5
LARGEST_MOVE = 0.1  # of the mean radius, in one step: points thrown at random overlap without limit

Pairs = tuple[np.ndarray, np.ndarray]


class Bed(NamedTuple):
    """A bed at rest between four walls.

    Attributes:
        positions: (n, 2) centres [m], the lower left corner being the origin.
        extents: (2,) width and height [m].
        facts: solid fraction, coordination, unbalanced force, pressure error, steps, and whether it settled.
    """

    positions: np.ndarray
    extents: np.ndarray
    facts: dict[str, Any]


class Forces(NamedTuple):
    """Forces over stiffness [m] of one state: on the discs (n, 2), the box's virial (2,), contacts' mean and number."""

    on_discs: np.ndarray
    virial: np.ndarray
    mean_contact: float
    contact_ends: int


def settle(
    radii: np.ndarray,
    aspect: float,
    pressure_over_stiffness: float,
    generator: np.random.Generator,
    report: Callable[[int], None] = lambda _: None,
) -> Bed:
    """Throw discs of radii (n,) [m] into a box of width/height `aspect` at random, and let them find their places."""
    count, mean_radius = len(radii), float(radii.mean())
    disc_area = math.pi * float((radii**2).sum())
    height = math.sqrt(disc_area / START_SOLID_FRACTION / aspect)
    extents = np.array((aspect * height, height))
    position = radii[:, None] + (extents - 2 * radii[:, None]) * generator.random((count, 2))
    measure = extents * BOX_INERTIA
    velocity, box_velocity = np.zeros((count, 2)), np.zeros(2)
    step, mixing, uphill_ago = FIRST_STEP, MIXING, 0
    pairs, listed_at = _pairs(position, radii), position
    skin = SKIN * float(radii.max())
    settled = False
    for number in range(1, MOST_STEPS + 1):
        forces = _forces(position, radii, extents, pairs)
        area = float(extents.prod())
        box_force = (forces.virial - pressure_over_stiffness * area) / measure
        resultant = float(np.hypot(*forces.on_discs.T).mean())
        error = float(np.abs(forces.virial / (pressure_over_stiffness * area) - 1).max())
        unbalanced = resultant / forces.mean_contact if forces.mean_contact > 0 else math.inf
        settled = unbalanced <= UNBALANCED_FORCE and error <= PRESSURE_ERROR
        if settled:
            break
        power = float((forces.on_discs * velocity).sum() + (box_force * box_velocity).sum())
        speed = math.sqrt(float((velocity**2).sum() + (box_velocity**2).sum()))
        force = math.sqrt(float((forces.on_discs**2).sum() + (box_force**2).sum()))
        if power > 0:
            velocity = (1 - mixing) * velocity + mixing * speed / force * forces.on_discs
            box_velocity = (1 - mixing) * box_velocity + mixing * speed / force * box_force
            uphill_ago += 1
            if uphill_ago > PATIENCE:
                step, mixing = min(FASTER * step, LARGEST_STEP), LESS_MIXING * mixing
        else:
            velocity, box_velocity = np.zeros((count, 2)), np.zeros(2)
            step, mixing, uphill_ago = SLOWER * step, MIXING, 0
        velocity = velocity + step * forces.on_discs
        box_velocity = box_velocity + step * box_force
        fastest = float(np.abs(velocity).max()) * step
        if fastest > LARGEST_MOVE * mean_radius:
            velocity *= LARGEST_MOVE * mean_radius / fastest
        stretch = np.exp(step * box_velocity / measure)
        extents = extents * stretch
        position = (position + step * velocity) * stretch
        if float(np.abs(position - listed_at).max()) > skin / (2 * math.sqrt(2)):
            pairs, listed_at = _pairs(position, radii), position
        if number % 20 == 0:
            report(number)
    facts = {
        "settled": settled,
        "solid_fraction": disc_area / float(extents.prod()),
        "coordination": forces.contact_ends / count,
        "unbalanced_force": unbalanced,
        "servo_error": error,
        "steps": number,
    }
    return Bed(position, extents, facts)


def bed_of(values: Mapping[str, Any], report: Callable[[int], None] = lambda _: None) -> tuple[np.ndarray, Bed]:
    """Radii (n,) [m] and bed of a run's parameters."""
    generator = np.random.default_rng(values["seed"])
    radii = materials.radii_of(values, generator)
    pressure = values["confining_stress"] / values["normal_stiffness"]
    return radii, settle(radii, values[ASPECT], pressure, generator, report)


def _forces(position: np.ndarray, radii: np.ndarray, extents: np.ndarray, pairs: Pairs) -> Forces:
    one, other = pairs
    x, y = position[:, 0].copy(), position[:, 1].copy()
    dx, dy = x[other] - x[one], y[other] - y[one]
    reach = radii[one] + radii[other]
    squared = dx * dx + dy * dy
    touch = np.flatnonzero(squared < reach * reach)
    one, other, dx, dy, reach = one[touch], other[touch], dx[touch], dy[touch], reach[touch]
    distance = np.sqrt(squared[touch])
    size = reach - distance
    away = np.maximum(distance, 1e-9 * reach)  # two points thrown at the very same place push nowhere
    fx, fy = size * dx / away, size * dy / away
    count = len(radii)
    on_discs = np.stack(
        [
            np.bincount(other, weights=f, minlength=count) - np.bincount(one, weights=f, minlength=count)
            for f in (fx, fy)
        ],
        axis=1,
    )
    virial = np.array((float((fx * dx).sum()), float((fy * dy).sum())))
    total, ends = float(size.sum()), 2 * len(size)
    low, high = np.maximum(radii[:, None] - position, 0), np.maximum(position + radii[:, None] - extents, 0)
    on_discs += low - high
    virial += (low * position).sum(axis=0) + (high * (extents - position)).sum(axis=0)
    at_walls = int(np.count_nonzero(low) + np.count_nonzero(high))
    total, contacts = total + float(low.sum() + high.sum()), len(size) + at_walls
    return Forces(on_discs, virial, total / contacts if contacts else 0.0, ends + at_walls)


def _pairs(position: np.ndarray, radii: np.ndarray) -> Pairs:
    """Numbers of the discs of every pair closer than touching and a skin: each pair once."""
    largest = float(radii.max())
    skin = SKIN * largest
    cell = 2 * largest + skin
    place = np.floor((position - position.min(axis=0)) / cell).astype(np.int64)
    columns = int(place[:, 0].max()) + 3  # an empty column on either side: no cell of one row neighbours the next row's
    index = place[:, 1] * columns + place[:, 0] + 1
    order = np.argsort(index, kind="stable")
    in_order = index[order]
    found = []
    for offset in (0, 1, columns - 1, columns, columns + 1):
        first = np.searchsorted(in_order, in_order + offset, "left")
        last = np.searchsorted(in_order, in_order + offset, "right")
        if offset == 0:
            first = np.arange(len(order)) + 1  # of one cell, those that come later
        number = last - first
        one = np.repeat(np.arange(len(order)), number)
        other = np.arange(len(one)) - np.repeat(np.cumsum(number) - number - first, number)
        one, other = order[one], order[other]
        away = position[other] - position[one]
        near = (away**2).sum(axis=1) < (radii[one] + radii[other] + skin) ** 2
        found.append((one[near], other[near]))
    return np.concatenate([one for one, _ in found]), np.concatenate([other for _, other in found])
