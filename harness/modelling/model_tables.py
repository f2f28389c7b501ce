"""What `forcechain model` prints: rows and records of states and of column paths, as CSV and JSON."""

from __future__ import annotations

import csv
import json
import sys
from typing import Any

import numpy as np

from forcechain.theory.column_path import ColumnPath
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import ChainState, Stability, Status
from forcechain.theory.yielding import yield_angles

COLUMNS = (
    "buckling_angle_deg",
    "stage",
    "axial_force_N",
    "axial_displacement_over_R",
    "normal_displacement_over_R",
    "rotation_deg",
)


def rows(state: ChainState) -> list[tuple[Any, ...]]:
    """One tuple a point, in the order of COLUMNS; plain Python numbers, so that they print shortest and whole."""
    return list(
        zip(
            np.round(np.degrees(state.angle), 12).tolist(),  # 14, not 14.000000000000002
            state.stage.tolist(),
            state.axial_force.tolist(),
            state.axial_displacement_over_R.tolist(),
            state.normal_displacement_over_R.tolist(),
            np.degrees(state.rotation).tolist(),
            strict=True,
        )
    )


def print_csv(table: list[tuple[Any, ...]]) -> None:
    """Write a table to standard output."""
    csv.writer(sys.stdout, lineterminator="\n").writerows(table)


def print_json(record: Any) -> None:
    """Write plain data to standard output."""
    json.dump(record, sys.stdout, indent=1, allow_nan=False)
    sys.stdout.write("\n")


def degrees_or_none(angle: Any) -> float | None:
    """Return an angle in degrees, None (null) for one that is never reached."""
    return float(np.degrees(angle)) if np.isfinite(angle) else None


def as_record(name: str | None, value: Any, parameters: ChainParameters, states: list[ChainState]) -> dict[str, Any]:
    """One curve as plain data: parameters as given on the command line, yield angles (null: never), points."""
    angles = yield_angles(parameters)
    points = [
        dict(zip(COLUMNS, row, strict=True))
        | {"status": Status(status).name.lower(), "stability": Stability(stability).name.lower()}
        for state in states
        for row, status, stability in zip(rows(state), state.status, state.stability, strict=True)
    ]
    return {
        **({} if name is None else {"sweep": {name: value}}),
        "parameters": {key: float(number) for key, number in parameters.ratios().items()},
        "lateral_yield_deg": degrees_or_none(angles.lateral),
        "moment_yield_deg": degrees_or_none(angles.moment),
        "points": points,
    }


def column_rows(path: ColumnPath) -> list[tuple[Any, ...]]:
    """One tuple a point, in the order of COLUMNS, taken at the contact with the largest buckling angle."""
    contact = np.abs(path.angles).argmax(axis=1)
    point = np.arange(len(contact))
    moment, lateral = path.moment_plastic.any(axis=1), path.lateral_plastic.any(axis=1)
    stage = np.array(["1b", "2", "2'", "3"])[lateral + 2 * moment]
    stage[path.unloading] = "4"
    angles = np.round(np.degrees(np.abs(path.angles[point, contact])), 12)
    if path.axial_force[0] > 0:
        stage[0] = "1a"  # the perfect column at its critical load
    return list(
        zip(
            angles.tolist(),
            stage.tolist(),
            path.axial_force.tolist(),
            path.axial_displacement_over_R.tolist(),
            path.normal_displacement_over_R[point, contact].tolist(),
            np.degrees(np.abs(path.rotations).max(axis=1)).tolist(),
            strict=True,
        )
    )


def column_record(parameters: ChainParameters, path: ColumnPath) -> dict[str, Any]:
    """One column's path as plain data, with the angles, rotations and slips of every particle."""
    points = [
        dict(zip(COLUMNS, row, strict=True))
        | {
            "buckling_angles_deg": np.degrees(path.angles[i]).tolist(),
            "rotations_deg": np.degrees(path.rotations[i]).tolist(),
            "lateral_displacements_over_R": path.lateral_displacement_over_R[i].tolist(),
            "moment_plastic": path.moment_plastic[i].tolist(),
            "lateral_plastic": path.lateral_plastic[i].tolist(),
        }
        for i, row in enumerate(column_rows(path))
    ]
    return {
        "parameters": {key: float(number) for key, number in parameters.ratios().items()},
        "particles": path.rotations.shape[1],
        "ending": path.ending.name.lower(),
        "points": points,
    }
