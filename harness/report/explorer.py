"""A drop as data for the explorer: the discs, forces and chains of each increment packed, the numbers plain."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from forcechain.arrays import FloatArray, IntArray
from forcechain.observe.chains import find_chains
from forcechain.observe.snapshot import Snapshot
from forcechain.theory.states import Status
from forcechain.theory.three_particle import loading
from harness.analysing.averages import MEASURES
from harness.analysing.buckling_data import Analysis
from harness.comparing.comparison import ModelCurves
from harness.figures.packing import CLASS_NAMES
from harness.reading.exports import Run
from harness.report.scenes import Scene, is_there, of_drop, options_of

QUANTA_A_RADIUS = 50  # steps a mean radius: no more than half a pixel until a disc fills 50
FORCE_LEVELS = 255
FULL_WIDTH_PERCENTILE = 99.5  # of the forces: drawn as wide as a line becomes, as in the still pictures
MODEL_POINTS = 61
DIGITS = 4


def explorer_view(analysis: Analysis, run: Run, scene: Scene, model: ModelCurves | None) -> dict[str, Any]:
    """Return one drop as plain values: its packed states, its buckled segments and their measures.

    A snapshot that reduced results do not keep is left out of the steps; the first and the last are there.
    """
    there = [step for step, row in enumerate(scene.rows) if is_there(run, int(row))]
    snapshots = [run.snapshot(int(scene.rows[step])) for step in there]
    options = options_of(analysis)
    chains = [find_chains(snapshot, options).in_chain for snapshot in snapshots]
    return {
        "case": scene.case,
        "run": scene.run,
        "drop": scene.drop,
        "increments": len(scene.rows) - 1,
        "steps": there,
        "strain": _rounded([snapshot.axial_strain for snapshot in snapshots]),
        "stress_ratio": _stress_ratio(run, snapshots),
        **_packed_states(snapshots),
        "chain": _packed(np.packbits(np.array(chains), axis=1, bitorder="little")),
        "segments": _segments(analysis, scene),
        "measures": _measures(analysis, scene, there),
        "model": _model_curve(model),
    }


def page_data(view: Mapping[str, Any]) -> dict[str, Any]:
    """Return a view as it stands on the page: its measures packed as well, as the bytes of their JSON."""
    measures = np.frombuffer(json.dumps(view["measures"], separators=(",", ":")).encode(), dtype=np.uint8)
    return {**view, "measures": _packed(measures)}


def script_json(value: Any) -> str:
    """Return JSON that may stand in a script element: it holds no character that HTML takes for markup.

    >>> script_json({"run": "</script>&"})
    '{"run":"\\\\u003c/script\\\\u003e\\\\u0026"}'
    """
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def _rounded(values: Any) -> Any:
    """Numbers, however nested, to `DIGITS` significant digits; None for those that are not finite."""
    if isinstance(values, np.ndarray | pd.Series):
        values = values.tolist()
    if isinstance(values, list):
        return [_rounded(value) for value in values]
    return float(f"{values:.{DIGITS}g}") if np.isfinite(values) else None


def _packed(array: NDArray[Any]) -> dict[str, Any]:
    """Array as text: little endian, its bytes sorted by significance (which packs better), deflated, base64."""
    little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    planes = little.reshape(-1).view(np.uint8).reshape(-1, little.itemsize).T
    content = base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode()
    return {"type": little.dtype.str[1:], "shape": list(array.shape), "content": content}


def _packed_states(snapshots: list[Snapshot]) -> dict[str, Any]:
    """Positions, radii and contacts with their normal forces; positions and forces as changes since the step before."""
    quantum = float(snapshots[0].radius.mean()) / QUANTA_A_RADIUS
    radius: FloatArray = np.rint(snapshots[0].radius / quantum)
    position = np.array([np.rint(snapshot.position / quantum) for snapshot in snapshots])
    low = (position.min(axis=0) - radius[:, None]).min(axis=0)
    high = (position.max(axis=0) + radius[:, None]).max(axis=0)
    position -= low
    contacts, force = _forces(snapshots)
    full = float(np.percentile(force[force > 0], FULL_WIDTH_PERCENTILE)) if (force > 0).any() else 1.0
    largest = max(float(force.max(initial=0.0)), full)
    level = np.rint(FORCE_LEVELS * force / largest)
    return {
        "quantum_mm": 1e3 * quantum,
        "quanta_a_radius": QUANTA_A_RADIUS,
        "corner_mm": _rounded(1e3 * quantum * low),
        "size": [int(side) for side in high - low],
        "radius": _packed(radius.astype(np.int32)),
        "position": _packed(_changes(position.transpose(0, 2, 1)).astype(np.int32)),
        "contacts": _packed(_changes(contacts).astype(np.int32)),
        "force": _packed(_changes(level).astype(np.int16)),
        "force_unit_N": _rounded(largest / FORCE_LEVELS),
        "full_width_force_N": _rounded(full),
    }


def _changes(values: NDArray[Any]) -> NDArray[Any]:
    """Return differences along the first axis, the first row as it is."""
    return np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))


def _forces(snapshots: list[Snapshot]) -> tuple[IntArray, FloatArray]:
    """Return every pair in contact at any step (n_pairs, 2), sorted, and its normal force (n_steps, n_pairs) [N]."""
    pairs = np.unique(np.concatenate([snapshot.contact_ids for snapshot in snapshots]), axis=0)
    key = _pair_key(pairs, snapshots[0].n_particles)
    force = np.zeros((len(snapshots), len(pairs)))
    for row, snapshot in zip(force, snapshots, strict=True):
        found = np.searchsorted(key, _pair_key(snapshot.contact_ids, snapshot.n_particles))
        row[found] = np.maximum(snapshot.normal_force, 0.0)  # a cohesive contact that pulls has no width
    return pairs, force


def _pair_key(pairs: IntArray, n_particles: int) -> IntArray:
    return pairs[:, 0] * (n_particles + 8) + pairs[:, 1] + 7  # walls are numbered down to -5; order is kept


def _stress_ratio(run: Run, snapshots: list[Snapshot]) -> Any:
    if run.history is None or "stress_ratio" not in run.history:
        return None
    strain = np.array([snapshot.axial_strain for snapshot in snapshots])
    return _rounded(np.interp(strain, run.history["axial_strain"], run.history["stress_ratio"]))


def _segments(analysis: Analysis, scene: Scene) -> list[dict[str, Any]]:
    """Particles, class and chain of every buckled segment, in the order of the tables."""
    members = of_drop(analysis.members, scene.run, scene.drop)
    chain_of = dict(zip(members["particle"].tolist(), members["chain"].tolist(), strict=True))
    chains = of_drop(analysis.chains, scene.run, scene.drop)
    length = dict(zip(chains["chain"].tolist(), chains["length"].tolist(), strict=True))
    found = []
    for number, (particles, buckling_class) in enumerate(zip(scene.segments.tolist(), scene.classes, strict=True)):
        chain = chain_of[particles[1]]
        found.append(
            {
                "segment": number,
                "particles": particles,
                "class": int(buckling_class),
                "order": CLASS_NAMES[int(buckling_class)],
                "chain": chain,
                "chain_length": length[chain],
            }
        )
    return found


def _measures(analysis: Analysis, scene: Scene, steps: list[int]) -> dict[str, Any]:
    """Every measure of the buckled segments (n_steps, n_buckled), by its name in segments.csv."""
    if not len(scene.segments):
        return {name: [[] for _ in steps] for name in MEASURES}
    table = of_drop(analysis.segments, scene.run, scene.drop)
    wide = {name: table.pivot_table(index="increment", columns="segment", values=name) for name in MEASURES}
    return {name: _rounded(values.to_numpy()[steps]) for name, values in wide.items()}


def _model_curve(model: ModelCurves | None) -> Mapping[str, Any] | None:
    """Return the model's axial force against the angle, of a straight column; None without a model."""
    if model is None:
        return None
    angle = np.radians(np.linspace(0.0, 45.0, MODEL_POINTS))
    state = loading(model.parameters, angle)
    kept = state.status <= Status.BEYOND_FOLD
    return {
        "angle_deg": _rounded(np.degrees(angle[kept])),
        "axial_force_N": _rounded(np.asarray(state.axial_force)[kept]),
    }
