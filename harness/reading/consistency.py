"""Do the tables of a run agree with themselves? Figures that any one column changed by a few per cent would move."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.observe.snapshot import Snapshot
from harness.reading.exports import Run
from harness.reading.tested import PUNCH, test_of

MEANINGS: Mapping[str, str] = {
    "normal_law": "normal force against stiffness times overlap, over the mean normal force",
    "geometry": "overlap against radii and distance, over the mean overlap",
    "sliding_excess": "tangential force above its limit, over the mean normal force",
    "rolling_excess": "moment above its limit, over mean normal force and mean radius",
    "history": "stress ratio of the history against its stresses",
}


def run_consistency(run: Run) -> dict[str, float]:
    """Return the largest of each figure over the first, middle and last snapshot of a run, and over its history.

    For tables of our own script all are zero to rounding; what they are for other contact laws is a matter of record.
    """
    figures = dict.fromkeys(MEANINGS, 0.0)
    for row in sorted({0, run.n_snapshots // 2, run.n_snapshots - 1}):
        for name, value in snapshot_consistency(run.snapshot(row)).items():
            figures[name] = max(figures[name], value)
    history = run.history
    if history is not None and {"stress_ratio", "axial_stress", "lateral_stress"} <= set(history.columns):
        axial, lateral = history["axial_stress"].to_numpy(float), history["lateral_stress"].to_numpy(float)
        ratio = history["stress_ratio"].to_numpy(float)
        if test_of(run.manifest) == PUNCH:
            figures["history"] = _largest(ratio - axial / float(run.parameters["confining_stress"]))
            return figures
        total = axial + lateral
        known = total > 0
        expected = (axial[known] - lateral[known]) / total[known]
        figures["history"] = _largest(ratio[known] - expected)
    return figures


def snapshot_consistency(snapshot: Snapshot) -> dict[str, float]:
    """Return the figures of one snapshot; zero where it has no contact that bears a force."""
    force = snapshot.normal_force
    level = float(force.mean()) if len(force) else 0.0
    if not level > 0:
        return {}
    inside = snapshot.contact_ids[:, 1] >= 0
    first, second = snapshot.contact_ids[inside].T
    branch = snapshot.position[second] - snapshot.position[first]
    geometric = snapshot.radius[first] + snapshot.radius[second] - np.hypot(branch[:, 0], branch[:, 1])
    radius, depth = float(snapshot.radius.mean()), float(np.abs(geometric).mean()) if inside.any() else 0.0
    sliding = np.abs(snapshot.tangential_force) - snapshot.friction * force
    rolling = np.abs(snapshot.moment) - snapshot.rolling_limit * force
    return {
        "normal_law": _largest(force - snapshot.normal_stiffness * snapshot.overlap) / level,
        "geometry": _largest(snapshot.overlap[inside] - geometric) / depth if depth > 0 else 0.0,
        "sliding_excess": _largest(np.maximum(sliding, 0.0)) / level,
        "rolling_excess": _largest(np.maximum(rolling, 0.0)) / (level * radius),
    }


def _largest(values: FloatArray) -> float:
    return float(np.abs(values).max()) if len(values) else 0.0
