"""Macroscopic facts of a drop, from its snapshots: state at its start, what it dissipates and where it deforms."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from forcechain.arrays import IntArray
from forcechain.observe.dissipation import dissipation, share_near
from forcechain.observe.kinematics import localisation, nonaffine_motion, strain_map
from forcechain.observe.macroscopic import (
    box_of,
    contact_stress,
    coordination,
    solid_fraction,
    stress_ratio,
    wall_stress,
)
from forcechain.observe.snapshot import Snapshot

COLUMNS = (
    "solid_fraction_start",
    "solid_fraction_end",
    "coordination_start",
    "coordination_without_rattlers_start",
    "rattler_share_start",
    "stress_ratio_contacts_start",
    "stress_ratio_walls_start",
    "dissipated_sliding_J",
    "dissipated_rolling_J",
    "dissipated_near_buckled_share",
    "near_buckled_particle_share",
    "area_of_half_the_shear",
    "nonaffine_buckled_over_all",
)


def drop_facts(snapshots: Sequence[Snapshot], buckled: IntArray) -> dict[str, float]:
    """Return the facts named in `COLUMNS` for the snapshots of one drop and its buckled segments (n_buckled, 3).

    Not a number where the tables do not tell: no walls, nothing dissipated, no buckled segment. Dissipation is summed
    from snapshot to snapshot over contacts between particles that exist in both. `dissipated_near_buckled_share` is
    that at contacts of the buckled segments' particles and their neighbours, to be held against the share of particles
    these are; `area_of_half_the_shear` the smallest share of the area that holds half of the shear strain (0.5 if it
    were even); the last the mean non-affine motion of the buckled segments' particles over that of all.
    """
    start, end = snapshots[0], snapshots[-1]
    counted = coordination(start)
    losses = [dissipation(one, other) for one, other in pairwise(snapshots)]
    energy = np.array([loss.sliding.sum() + loss.rolling.sum() for loss in losses])
    shares = [_told(partial(share_near, loss, start, buckled)) for loss in losses]
    near = [share * total for share, total in zip(shares, energy, strict=True) if math.isfinite(share)]
    moved = nonaffine_motion(start, end)
    known = np.isfinite(moved)
    members = np.zeros(start.n_particles, dtype=np.bool_)
    members[buckled.ravel()] = True
    any_buckled = bool((members & known).any())
    return {
        "solid_fraction_start": _told(lambda: solid_fraction(start, box_of(start).area)),
        "solid_fraction_end": _told(lambda: solid_fraction(end, box_of(end).area)),
        "coordination_start": counted.every_particle,
        "coordination_without_rattlers_start": counted.without_rattlers,
        "rattler_share_start": counted.rattler_share,
        "stress_ratio_contacts_start": _told(lambda: stress_ratio(contact_stress(start, box_of(start).area))),
        "stress_ratio_walls_start": _told(lambda: stress_ratio(wall_stress(start, box_of(start).area))),
        "dissipated_sliding_J": float(sum(loss.sliding.sum() for loss in losses)),
        "dissipated_rolling_J": float(sum(loss.rolling.sum() for loss in losses)),
        "dissipated_near_buckled_share": float(sum(near) / energy.sum()) if near and energy.sum() > 0 else math.nan,
        "near_buckled_particle_share": _near_share(start, members),
        "area_of_half_the_shear": _told(lambda: localisation(strain_map(start, end))),
        "nonaffine_buckled_over_all": float(moved[members & known].mean() / moved[known].mean())
        if any_buckled and moved[known].mean() > 0
        else math.nan,
    }


def _near_share(snapshot: Snapshot, members: np.ndarray) -> float:
    near = members.copy()
    first, second = snapshot.contact_ids[snapshot.contact_ids[:, 1] >= 0].T
    near[second[members[first]]] = True
    near[first[members[second]]] = True
    return float(near.mean())


def _told(fact: Callable[[], float]) -> float:
    """Return a fact, or not a number where the tables leave it undefined."""
    try:
        return float(fact())
    except ValueError:
        return math.nan
