"""The tables of a snapshot of our own discs, read quickly: what follows from positions and rules is not read from YADE.

Reading a number from YADE costs a tenth of a microsecond and more, and a snapshot has 200 000 of them at the paper's
size. Between our discs normal, overlap, contact point, normal force and all stiffnesses follow from ids and positions;
left to read, one Python object each, are the tangential force and the moment: two thirds of what a snapshot costs.
`export.tables` gives the same tables, three times slower.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from yade_scripts import export, materials

try:
    import yade
except ImportError:
    yade = None

# Among position, velocity, angular velocity (three numbers each) and orientation (four).
STATE_PLACES = (0, 1, 3, 4, 8, 11, 12)


def particle_table(radii: np.ndarray, previous_rotation: np.ndarray | None) -> export.Table:
    """Particle table of the discs of radii (n,) [m] that are bodies 0 to n-1; see `export.particle_table`."""
    count = len(radii)
    x, y, vx, vy, spin, sine, cosine = _states(count)
    return {
        "id": np.arange(count),
        "radius": radii.copy(),
        "x": x,
        "y": y,
        "rotation": export.unwrapped(2 * np.arctan2(sine, cosine), previous_rotation),
        "vx": vx,
        "vy": vy,
        "spin": spin,
    }


def _states(count: int) -> np.ndarray:
    """(7, count) position, velocity, spin, and sine and cosine of half the rotation, of bodies 0 to count-1."""
    if hasattr(yade, "Subdomain"):  # what YADE sends from one MPI process to another: all numbers in one call
        numbers = yade.Subdomain().getStateValuesFromIds(list(range(count)))
        values = np.fromiter(numbers, np.float64, 13 * count).reshape(count, 13)
        return values[:, STATE_PLACES].T.copy()
    rows = []
    for body in range(count):
        state = yade.O.bodies[body].state
        position, velocity, turn = state.pos, state.vel, state.ori
        rows.append((position[0], position[1], velocity[0], velocity[1], state.angVel[2], turn[2], turn[3]))
    return np.array(rows, dtype=np.float64).reshape(count, 7).T.copy()


def contact_table(
    particles: export.Table, walls: Mapping[int, int], rules: materials.ContactRules, mean_radius: float | None
) -> export.Table:
    """Contact table of discs that are bodies 0 to n-1 under our contact rules; see `export.contact_table`.

    `walls` maps body numbers to wall numbers. `mean_radius` [m] replaces the pair's radii in the rolling stiffness.
    """
    count = len(particles["id"])
    moments = rules.bears_moment
    numbers: list[float] = []
    at_walls, add = [], numbers.extend
    for interaction in yade.O.interactions:
        one, other = interaction.id1, interaction.id2
        if one >= count or other >= count:
            at_walls.append(interaction)
            continue
        physics = interaction.phys
        shear = physics.shearForce
        add((one, other, shear[0], shear[1], physics.moment_bending[2] if moments else 0.0))
    values = np.fromiter(numbers, np.float64, len(numbers)).reshape(-1, 5).T.copy()
    one, other = values[0].astype(np.int64), values[1].astype(np.int64)
    radius, x, y = particles["radius"], particles["x"], particles["y"]
    branch_x, branch_y = x[other] - x[one], y[other] - y[one]
    distance = np.hypot(branch_x, branch_y)
    nx, ny = branch_x / distance, branch_y / distance
    overlap = radius[one] + radius[other] - distance
    arm = radius[one] - overlap / 2
    smaller = np.minimum(radius[one], radius[other])
    squared = radius[one] * radius[other] if mean_radius is None else np.full(len(one), mean_radius**2)
    between = {
        "id1": one,
        "id2": other,
        "x": x[one] + arm * nx,
        "y": y[one] + arm * ny,
        "nx": nx,
        "ny": ny,
        "overlap": overlap,
        "fn": rules.normal_stiffness * overlap,
        "ft": values[3] * nx - values[2] * ny,
        "moment": values[4],
        "kn": np.full(len(one), rules.normal_stiffness),
        "kt": np.full(len(one), rules.normal_stiffness * rules.tangential_stiffness_ratio),
        "kr": rules.normal_stiffness * rules.rolling_stiffness_ratio * squared * moments,
        "friction": np.full(len(one), math.tan(math.atan(rules.friction))),  # as YADE keeps it
        "rolling_limit": rules.rolling_friction * smaller * moments,
    }
    touching = {number: number for contact in at_walls for number in (contact.id1, contact.id2) if number < count}
    with_walls = export.contact_table({**touching, **walls}, at_walls)
    return export.in_order({name: np.concatenate((column, with_walls[name])) for name, column in between.items()})
