"""Facts of one run that the comparison asks for: its contacts, its preparation, its peak."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from forcechain.observe.snapshot import Snapshot
from harness.reading.exports import Run
from harness.reading.tested import test_of


def contact_facts(snapshot: Snapshot) -> dict[str, Any]:
    """Particle-scale properties as the tables have them: medians over the contacts between particles.

    So a foreign export needs no parameter file. Rolling stiffness is taken over kn Ra Rb, rolling friction over the
    smaller radius. Empty of contacts between particles, the properties are None.
    """
    facts: dict[str, Any] = {
        "particle_count": snapshot.n_particles,
        "mean_radius": float(snapshot.radius.mean()),
        "smallest_radius": float(snapshot.radius.min()),
        "largest_radius": float(snapshot.radius.max()),
    }
    inside = snapshot.contact_ids[:, 1] >= 0
    if not inside.any():
        names = ("normal_stiffness", "tangential_stiffness_ratio", "rolling_stiffness_ratio", "friction")
        return facts | dict.fromkeys((*names, "rolling_friction"))
    first, second = snapshot.contact_ids[inside].T
    one, other = snapshot.radius[first], snapshot.radius[second]
    stiffness = snapshot.normal_stiffness[inside]
    return facts | {
        "normal_stiffness": float(np.median(stiffness)),
        "tangential_stiffness_ratio": float(np.median(snapshot.tangential_stiffness[inside] / stiffness)),
        "rolling_stiffness_ratio": float(np.median(snapshot.rolling_stiffness[inside] / (stiffness * one * other))),
        "friction": float(np.median(snapshot.friction[inside])),
        "rolling_friction": float(np.median(snapshot.rolling_limit[inside] / np.minimum(one, other))),
    }


def run_facts(run: Run) -> dict[str, Any]:
    """Return the facts of a run as plain values; None for what its folder does not tell."""
    preparation: Mapping[str, Any] = (run.manifest or {}).get("preparation", {})
    facts = contact_facts(run.snapshot(0)) | {
        "test": test_of(run.manifest),
        "seed": run.parameters.get("seed"),
        "confining_stress": run.parameters.get("confining_stress"),
        "inertial_number": run.parameters.get("inertial_number"),
        "solid_fraction": preparation.get("solid_fraction"),
        "coordination": preparation.get("coordination"),
        "peak_stress_ratio": None,
        "strain_at_peak": None,
    }
    if run.history is not None and "stress_ratio" in run.history:
        peak = int(run.history["stress_ratio"].to_numpy().argmax())
        facts["peak_stress_ratio"] = float(run.history["stress_ratio"].iloc[peak])
        facts["strain_at_peak"] = float(run.history["axial_strain"].iloc[peak])
    return facts
