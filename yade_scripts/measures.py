"""A row of the history from a snapshot's tables: for scripts of one's own. Plain numpy, no YADE."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

Table = Mapping[str, np.ndarray]

LEFT, RIGHT, BOTTOM, TOP = -1, -2, -3, -4


def contact_forces(contacts: Table) -> np.ndarray:
    """(n_contacts, 2) force on id2 of every contact [N]."""
    normal = np.stack((contacts["nx"], contacts["ny"]), axis=1)
    turned = np.stack((-contacts["ny"], contacts["nx"]), axis=1)
    return np.asarray(contacts["fn"][:, None] * normal + contacts["ft"][:, None] * turned)


def resultants(contacts: Table, count: int) -> np.ndarray:
    """(count, 2) sum of the contact forces on each disc [N]."""
    total = np.zeros((count, 2))
    force = contact_forces(contacts)
    np.add.at(total, contacts["id1"], -force)
    between = contacts["id2"] >= 0
    np.add.at(total, contacts["id2"][between], force[between])
    return total


def elastic_energy(contacts: Table) -> float:
    """Energy in the normal, tangential and rolling springs of all contacts [J]."""
    springs = contacts["fn"] ** 2 / contacts["kn"] + contacts["ft"] ** 2 / contacts["kt"]
    rolling = contacts["kr"] > 0
    turned = contacts["moment"][rolling] ** 2 / contacts["kr"][rolling]
    return float(springs.sum() + turned.sum()) / 2


def history_row(
    particles: Table,
    contacts: Table,
    faces: Sequence[float],
    start_faces: Sequence[float],
    masses: np.ndarray,
    inertias: np.ndarray,
    time: float,
    iteration: int,
    confining_stress: float | None = None,
    body_forces: np.ndarray | None = None,
) -> dict[str, float]:
    """One row of `history.csv`.

    Args:
        particles, contacts: the tables of one instant, as `export.tables` gives them.
        faces, start_faces: positions of the left, right, bottom and top wall now and at the start [m]; a side without
            a wall has the position that bounds the sample, and bears no force.
        masses, inertias: (n,) [kg], [kg m^2].
        time: simulated time [s].
        iteration: step number.
        confining_stress: stress the side walls are meant to keep [N/m]; None: there is no such thing.
        body_forces: (n, 2) forces on the discs that are no contacts, such as their weight [N].
    """
    count = len(particles["id"])
    (left, right, bottom, top), (left_0, right_0, bottom_0, top_0) = faces, start_faces
    width, height = right - left, top - bottom
    force = contact_forces(contacts)
    on_wall = {wall: force[contacts["id2"] == wall].sum(axis=0) for wall in (LEFT, RIGHT, BOTTOM, TOP)}
    lateral = float(on_wall[RIGHT][0] - on_wall[LEFT][0]) / (2 * height)
    axial = float(on_wall[TOP][1] - on_wall[BOTTOM][1]) / (2 * width)
    both = axial + lateral
    resultant = resultants(contacts, count) + (0 if body_forces is None else body_forces)
    mean_force = float(np.hypot(force[:, 0], force[:, 1]).mean()) if len(force) else 0.0
    speed_squared = particles["vx"] ** 2 + particles["vy"] ** 2
    disc_ends = count and (len(force) + int((contacts["id2"] >= 0).sum())) / count
    return {
        "axial_strain": 1 - height / (top_0 - bottom_0),
        "lateral_strain": 1 - width / (right_0 - left_0),
        "axial_stress": axial,
        "lateral_stress": lateral,
        "stress_ratio": (axial - lateral) / both if both else 0.0,
        "solid_fraction": math.pi * float((particles["radius"] ** 2).sum()) / (width * height),
        "coordination": float(disc_ends),
        "unbalanced_force": float(np.hypot(*resultant.T).mean()) / mean_force if mean_force else 0.0,
        "kinetic_energy": float((masses * speed_squared + inertias * particles["spin"] ** 2).sum()) / 2,
        "elastic_energy": elastic_energy(contacts),
        "servo_error": lateral / confining_stress - 1 if confining_stress else 0.0,
        "time": float(time),
        "iteration": int(iteration),
    }
