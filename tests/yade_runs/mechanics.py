"""Mechanics rebuilt from exported tables by plain sums, to hold against what YADE says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

Arrays = Mapping[str, np.ndarray]


def contact_forces(snapshot: Arrays) -> np.ndarray:
    """(n_contacts, 2) force on id2 [N]."""
    normal = np.stack((snapshot["contact_nx"], snapshot["contact_ny"]), axis=1)
    turned = np.stack((-normal[:, 1], normal[:, 0]), axis=1)
    return snapshot["contact_fn"][:, None] * normal + snapshot["contact_ft"][:, None] * turned


def ends(snapshot: Arrays) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Disc, arm, force and moment of every contact's end on a disc: first those of id1, then those of id2."""
    centre = np.stack((snapshot["particle_x"], snapshot["particle_y"]), axis=1)
    point = np.stack((snapshot["contact_x"], snapshot["contact_y"]), axis=1)
    force, moment = contact_forces(snapshot), snapshot["contact_moment"]
    result = []
    for name, sign in (("contact_id1", -1), ("contact_id2", 1)):
        on_disc = snapshot[name] >= 0
        disc = snapshot[name][on_disc]
        result.append((disc, point[on_disc] - centre[disc], sign * force[on_disc], sign * moment[on_disc]))
    return result


def resultants(snapshot: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) resultant force [N] and (n,) resultant moment about the centre [N m] of each disc."""
    count = len(snapshot["particle_id"])
    total_force, total_moment = np.zeros((count, 2)), np.zeros(count)
    for disc, arm, force, moment in ends(snapshot):
        np.add.at(total_force, disc, force)
        np.add.at(total_moment, disc, arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0] + moment)
    return total_force, total_moment


def unbalanced(snapshot: Arrays) -> tuple[float, float]:
    """Mean resultant force over mean contact force, and mean resultant moment over mean contact force and radius."""
    force, moment = resultants(snapshot)
    mean = np.hypot(*contact_forces(snapshot).T).mean()
    return (
        float(np.hypot(*force.T).mean() / mean),
        float(np.abs(moment).mean() / mean / snapshot["particle_radius"].mean()),
    )


def force_moment_tensors(snapshot: Arrays) -> np.ndarray:
    """(n, 2, 2) sum over each disc's contacts of force times arm [N m]."""
    total = np.zeros((len(snapshot["particle_id"]), 2, 2))
    for disc, arm, force, _ in ends(snapshot):
        np.add.at(total, disc, force[:, :, None] * arm[:, None, :])
    return total
