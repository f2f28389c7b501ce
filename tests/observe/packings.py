"""Synthetic packings: built by hand, or random and dense, with forces that need not balance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from forcechain.observe.snapshot import CONTACT_SCALARS, Snapshot

NORMAL_STIFFNESS = 1.05e5
FRICTION = 0.7
ROLLING_FRICTION = 0.2


def build(
    position, radius, contacts: Sequence[tuple], *, rotation=None, axial_strain=0.0, stiffness=NORMAL_STIFFNESS
) -> Snapshot:
    """Contacts are (id1, id2, fn[, ft[, moment]]); for a wall id2 is (wall, direction to it in degrees)."""
    position = np.asarray(position, dtype=float)
    radius = np.broadcast_to(np.asarray(radius, dtype=float), len(position)).copy()
    ids, point, normal, overlap, loads, radii = [], [], [], [], [], []
    for one, other, *load in contacts:
        if isinstance(other, tuple):
            wall, degrees = other
            direction = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
            depth = 0.0
            ids.append((one, wall))
            radii.append((radius[one], radius[one]))
        else:
            branch = position[other] - position[one]
            depth = radius[one] + radius[other] - np.linalg.norm(branch)
            direction = branch / np.linalg.norm(branch)
            ids.append((one, other))
            radii.append((radius[one], radius[other]))
        normal.append(direction)
        point.append(position[one] + (radius[one] - depth / 2) * direction)
        overlap.append(depth)
        loads.append((*load, *[0.0] * (3 - len(load))))
    count = len(contacts)
    normal_force, tangential_force, moment = np.array(loads, dtype=float).reshape(count, 3).T
    is_wall = np.array(ids).reshape(count, 2)[:, 1] < 0
    radii = np.array(radii).reshape(count, 2)
    return Snapshot(
        axial_strain=axial_strain,
        time=0.0,
        iteration=0,
        radius=radius,
        position=position,
        rotation=np.zeros(len(position)) if rotation is None else rotation,
        velocity=np.zeros((len(position), 2)),
        spin=np.zeros(len(position)),
        contact_ids=np.array(ids, dtype=int).reshape(count, 2),
        contact_point=np.array(point).reshape(count, 2),
        contact_normal=np.array(normal).reshape(count, 2),
        overlap=np.array(overlap),
        normal_force=normal_force,
        tangential_force=tangential_force,
        moment=moment,
        normal_stiffness=np.full(count, stiffness),
        tangential_stiffness=np.full(count, 0.5 * stiffness),
        rolling_stiffness=np.where(is_wall, 0.0, 0.5 * stiffness * radii.prod(axis=1)),
        friction=np.where(is_wall, 0.0, FRICTION),
        rolling_limit=np.where(is_wall, 0.0, ROLLING_FRICTION * radii.min(axis=1)),
    )


def column(angles_deg: Sequence[float], force=10.0, radius=1e-3) -> Snapshot:
    """A column of touching discs, the i-th branch turned by the i-th angle from the vertical, pressed at both ends."""
    steps = [(np.sin(np.radians(a)), np.cos(np.radians(a))) for a in angles_deg]
    position = 2 * radius * np.concatenate(([(0.0, 0.0)], np.cumsum(steps, axis=0)))
    last = len(angles_deg)
    contacts = [(i, i + 1, force) for i in range(last)]
    contacts += [(0, (-3, -90), force), (last, (-4, 90), force)]
    return build(position, radius, contacts)


def branched(radius=1e-3) -> Snapshot:
    """A trunk 0-1-2 up from the wall; from 2 two branches, 3-4 straight on and 5-6 at 30 degrees to the right."""
    tilt = np.radians(30)
    step = np.array((np.sin(tilt), np.cos(tilt)))
    up = np.array((0.0, 1.0))
    position = 2 * radius * np.array([0 * up, up, 2 * up, 3 * up, 4 * up, 2 * up + step, 2 * up + 2 * step])
    contacts = [(0, (-3, -90), 18.7), (0, 1, 18.7), (1, 2, 18.7), (2, 3, 10.0), (3, 4, 10.0), (4, (-4, 90), 10.0)]
    contacts += [(2, 5, 10.0), (5, 6, 10.0), (6, (-4, 60), 10.0)]
    return build(position, radius, contacts)


def random_packing(seed: int, side: int = 12, radius=1e-3) -> Snapshot:
    """About side x side bidisperse discs, dense, in a box, with broad random forces, some at their limits."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2).astype(float)
    grid[:, 0] += 0.5 * (grid[:, 1] % 2)
    position = 2 * radius * (grid * (1.0, np.sqrt(3) / 2) + rng.uniform(-0.12, 0.12, grid.shape))
    sizes = radius * rng.choice((0.8, 1.2), len(position))
    pairs = cKDTree(position).query_pairs(2.6 * radius, output_type="ndarray")
    gap = np.linalg.norm(position[pairs[:, 0]] - position[pairs[:, 1]], axis=1) - sizes[pairs].sum(axis=1)
    pairs = pairs[gap < 0.1 * radius]
    flip = rng.random(len(pairs)) < 0.5
    pairs[flip] = pairs[flip, ::-1]
    contacts: list[tuple] = [(int(i), int(j), rng.gamma(0.8, 10.0)) for i, j in pairs]
    low, high = position.min(axis=0), position.max(axis=0)
    for axis, (near, far) in enumerate((((-1, 180), (-2, 0)), ((-3, -90), (-4, 90)))):
        for particle in np.flatnonzero(position[:, axis] < low[axis] + 0.8 * radius):
            contacts.append((int(particle), near, rng.gamma(0.8, 10.0)))
        for particle in np.flatnonzero(position[:, axis] > high[axis] - 0.8 * radius):
            contacts.append((int(particle), far, rng.gamma(0.8, 10.0)))
    order = rng.permutation(len(contacts))
    snapshot = build(position, sizes, [contacts[i] for i in order], rotation=rng.normal(0, 0.3, len(position)))
    return with_random_loads(snapshot, rng)


def with_random_loads(snapshot: Snapshot, rng: np.random.Generator, *, at_limit=0.15) -> Snapshot:
    """The same contacts with new tangential forces and moments, a share of them exactly at their limits."""
    count = snapshot.n_contacts
    sign = rng.choice((-1.0, 1.0), (2, count))
    share = np.where(rng.random((2, count)) < at_limit, 1.0, rng.uniform(0, 0.95, (2, count)))
    return replace(
        snapshot,
        tangential_force=sign[0] * share[0] * snapshot.friction * snapshot.normal_force,
        moment=sign[1] * share[1] * snapshot.rolling_limit * snapshot.normal_force,
    )


def random_window(seed: int, length: int = 5, side: int = 12, *, at_limit=0.15) -> list[Snapshot]:
    """A packing that moves a little from one snapshot to the next, loads redrawn, contacts lost and found."""
    rng = np.random.default_rng(seed + 1000)
    whole = random_packing(seed, side)
    window = []
    position, rotation = whole.position.copy(), whole.rotation.copy()
    scale = np.ones(whole.n_contacts)
    for step in range(length):
        kept = np.sort(rng.permutation(whole.n_contacts)[: int(0.95 * whole.n_contacts)])
        moved = _at(whole, position, rotation, 1e-3 * step)
        loaded = replace(moved, normal_force=whole.normal_force * scale)
        window.append(with_random_loads(take_contacts(loaded, kept), rng, at_limit=at_limit))
        position = position + rng.normal(0, 2e-5, position.shape)
        rotation = rotation + rng.normal(0, 0.02, rotation.shape)
        scale = scale * rng.uniform(0.8, 1.05, len(scale))
    return window


def _at(snapshot: Snapshot, position, rotation, axial_strain: float) -> Snapshot:
    """Move the particles; contact normals and points follow the centres."""
    first, second = snapshot.contact_ids.T
    inside = second >= 0
    branch = position[np.maximum(second, 0)] - position[first]
    length = np.linalg.norm(branch, axis=1)
    length[length == 0] = 1
    normal = np.where(inside[:, None], branch / length[:, None], snapshot.contact_normal)
    point = position[first] + snapshot.radius[first, None] * normal
    return replace(
        snapshot,
        position=position,
        rotation=rotation,
        axial_strain=axial_strain,
        contact_normal=normal,
        contact_point=point,
    )


def take_contacts(snapshot: Snapshot, rows) -> Snapshot:
    """Only these contacts, in this order."""
    names = (*CONTACT_SCALARS, "contact_ids", "contact_point", "contact_normal")
    return replace(snapshot, **{name: getattr(snapshot, name)[rows] for name in names})


def turned(snapshot: Snapshot, angle: float, *, reflected=False, scale=1.0, shift=(0.3, -0.2)) -> Snapshot:
    """Rotate, mirror (x to -x first), move and magnify: lengths and forces by `scale`, N/m stays."""
    matrix = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    hand = -1.0 if reflected else 1.0
    matrix = matrix @ np.diag([hand, 1.0])
    return replace(
        snapshot,
        radius=snapshot.radius * scale,
        position=scale * snapshot.position @ matrix.T + shift,
        contact_point=scale * snapshot.contact_point @ matrix.T + shift,
        contact_normal=snapshot.contact_normal @ matrix.T,
        rotation=hand * snapshot.rotation,
        overlap=snapshot.overlap * scale,
        normal_force=scale * snapshot.normal_force,
        tangential_force=hand * scale * snapshot.tangential_force,
        moment=hand * scale**2 * snapshot.moment,
        rolling_stiffness=scale**2 * snapshot.rolling_stiffness,
        rolling_limit=scale * snapshot.rolling_limit,
    )


def relabelled(snapshot: Snapshot, rng: np.random.Generator) -> tuple[Snapshot, np.ndarray]:
    """Renumber the particles, shuffle the contacts, exchange id1 and id2 of some; new number of each old particle."""
    n = snapshot.n_particles
    new_number = rng.permutation(n)
    old_of_new = np.argsort(new_number)
    particle = ("radius", "position", "rotation", "velocity", "spin")
    changed = replace(snapshot, **{name: getattr(snapshot, name)[old_of_new] for name in particle})
    ids = snapshot.contact_ids.copy()
    ids[ids >= 0] = new_number[ids[ids >= 0]]
    swap = (ids[:, 1] >= 0) & (rng.random(len(ids)) < 0.5)
    ids[swap] = ids[swap, ::-1]
    changed = replace(
        changed,
        contact_ids=ids,
        contact_normal=np.where(swap[:, None], -snapshot.contact_normal, snapshot.contact_normal),
        # The moment acts on the second; exchanging the two turns it round. The tangential force keeps its sign: both
        # the force on the second and the turned normal change theirs.
        moment=np.where(swap, -snapshot.moment, snapshot.moment),
    )
    return take_contacts(changed, rng.permutation(len(ids))), new_number
