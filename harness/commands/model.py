"""The analytic curves: `forcechain model` prints them as CSV or JSON, or draws them."""

from __future__ import annotations

import argparse
import csv
import difflib
import json
import math
import sys
from typing import Any

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.theory.parameters import TABLE_3_RATIOS, ChainParameters
from forcechain.theory.states import ChainState, Stability, Status
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement, yield_angles
from harness.errors import EXIT_GOOD, InputError

HELP = "the analytic model's curves as CSV, JSON or a plot"
EXAMPLE = "forcechain model --set rolling_friction=0.05 --angles 5,14,25"

COLUMNS = (
    "buckling_angle_deg",
    "stage",
    "axial_force_N",
    "axial_displacement_over_R",
    "normal_displacement_over_R",
    "rotation_deg",
)
LARGEST_ANGLE_DEG = 60.0  # of the default grid; the paper's figures end at D/R = 0.6, near 30 degrees
GRID_STEP_DEG = 0.5
STRAIGHT_POINTS = 11


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `forcechain model`."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a parameter: " + ", ".join(TABLE_3_RATIOS) + "; stiffnesses and strength but the first over "
        "normal_stiffness; the rest is Table 3",
    )
    parser.add_argument("--angles", metavar="A,B,...", help="buckling angles in degrees (default: a grid, all stages)")
    parser.add_argument("--sweep", metavar="NAME=A,B,...", help="one curve for each value; adds the name as a column")
    parser.add_argument("--json", action="store_true", help="JSON with yield angles, status and stability")


def execute(args: argparse.Namespace) -> int:
    """Print or draw the curves; returns the exit status."""
    given = parse_settings(args.set)
    angles_deg = None if args.angles is None else parse_numbers("--angles", args.angles)
    name, values = parse_sweep(args.sweep) if args.sweep else (None, [None])
    if name in given:
        raise InputError(f"--sweep {name}: expected a parameter that --set does not fix, found {name}={given[name]:g}")
    curves = []
    for value in values:
        parameters = chain_parameters(given if name is None else {**given, name: value})
        curves.append((value, parameters, curve(parameters, angles_deg)))
    if args.json:
        json.dump([as_record(name, *entry) for entry in curves], sys.stdout, indent=1, allow_nan=False)
        sys.stdout.write("\n")
    else:
        write_csv(name, curves)
    return EXIT_GOOD


def parse_settings(settings: list[str]) -> dict[str, float]:
    """Turn NAME=VALUE texts into values; InputError names what is wrong and what was probably meant."""
    given: dict[str, float] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise InputError(f"--set {setting}: expected NAME=VALUE, for example --set rolling_friction=0.05")
        name = name.strip()
        check_name("--set", name)
        if name in given:
            raise InputError(f"--set {name}: given twice")
        given[name] = parse_numbers(f"--set {name}", text, most=1)[0]
    return given


def parse_sweep(text: str) -> tuple[str, list[float]]:
    """Turn NAME=A,B,... into the name and its values."""
    name, equals, values = text.partition("=")
    if not equals:
        raise InputError(f"--sweep {text}: expected NAME=A,B,..., for example --sweep rolling_friction=0.02,0.2")
    check_name("--sweep", name.strip())
    return name.strip(), parse_numbers(f"--sweep {name.strip()}", values)


def check_name(option: str, name: str) -> None:
    """Raise InputError unless `name` is a parameter of the model."""
    if name in TABLE_3_RATIOS:
        return
    close = difflib.get_close_matches(name, TABLE_3_RATIOS, 1)
    hint = f"did you mean {close[0]}?" if close else "known: " + ", ".join(TABLE_3_RATIOS)
    raise InputError(f"{option} {name}: no such parameter; {hint}")


def parse_numbers(option: str, text: str, most: int | None = None) -> list[float]:
    """Turn "A,B,..." into finite numbers."""
    numbers = []
    for part in text.split(","):
        try:
            number = float(part)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"{option}: expected a finite number, found {part.strip()!r}")
        numbers.append(number)
    if most is not None and len(numbers) > most:
        raise InputError(f"{option}: expected one number, found {len(numbers)}; several are for --sweep")
    return numbers


def chain_parameters(values: dict[str, Any]) -> ChainParameters:
    """Table 3 with `values`; InputError for what the model does not admit."""
    try:
        return ChainParameters.from_ratios(**values)
    except ValueError as error:
        raise InputError(f"model: {error}") from None


def default_angles(parameters: ChainParameters, largest_deg: float = LARGEST_ANGLE_DEG) -> FloatArray:
    """Angles [rad] over all stages in even steps, with the angles of yielding among them."""
    first = float(parameters.imperfection)
    angles = yield_angles(parameters)
    steps = np.arange(math.ceil(np.degrees(first) / GRID_STEP_DEG) * GRID_STEP_DEG, largest_deg, GRID_STEP_DEG)
    corners = [first, float(angles.lateral), float(angles.moment), math.radians(largest_deg)]
    corners = [corner for corner in corners if first <= corner <= math.radians(largest_deg)]
    return np.unique(np.concatenate((np.radians(steps), corners)))


def curve(parameters: ChainParameters, angles_deg: list[float] | None) -> list[ChainState]:
    """States to show, in order: at the angles given, or the straight column and then a grid of angles."""
    if angles_deg is not None:
        return [checked(loading_at(parameters, np.radians(angles_deg)))]
    states = []
    if parameters.imperfection == 0:
        critical = float(critical_displacement(parameters))
        if math.isnan(critical):
            raise InputError(f"model: {Status.TOO_STIFF.meaning}")
        states.append(straight(parameters, np.linspace(0, critical, STRAIGHT_POINTS)[:-1]))
    states.append(checked(loading_at(parameters, default_angles(parameters))))
    return states


def loading_at(parameters: ChainParameters, angles: FloatArray) -> ChainState:
    """States under loading; InputError for angles that are none."""
    try:
        return loading(parameters, angles)
    except ValueError as error:
        raise InputError(f"model: {error}") from None


def checked(state: ChainState) -> ChainState:
    """Return the state; InputError where it has no numbers, a note on standard error where it needs one."""
    for angle, status in zip(state.angle, state.status, strict=True):
        if np.isin(status, (Status.EQUILIBRIUM, Status.BEYOND_FOLD)):
            continue
        raise InputError(f"model: angle {np.degrees(angle):g} deg: {Status(status).meaning}")
    beyond = state.status == Status.BEYOND_FOLD
    if beyond.any():
        first = np.degrees(state.angle[beyond].min())
        print(f"model: from {first:g} deg on: {Status.BEYOND_FOLD.meaning}", file=sys.stderr)
    return state


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


def write_csv(name: str | None, curves: list[tuple[Any, ChainParameters, list[ChainState]]]) -> None:
    """Write all curves to standard output."""
    writer = csv.writer(sys.stdout, lineterminator="\n")
    writer.writerow(COLUMNS if name is None else (name, *COLUMNS))
    for value, _, states in curves:
        for state in states:
            for row in rows(state):
                writer.writerow(row if name is None else (value, *row))


def as_record(name: str | None, value: Any, parameters: ChainParameters, states: list[ChainState]) -> dict[str, Any]:
    """One curve as plain data: parameters as given on the command line, yield angles (null: never), points."""
    angles = yield_angles(parameters)

    def degrees(angle: Any) -> float | None:
        return float(np.degrees(angle)) if np.isfinite(angle) else None

    points = [
        dict(zip(COLUMNS, row, strict=True))
        | {"status": Status(status).name.lower(), "stability": Stability(stability).name.lower()}
        for state in states
        for row, status, stability in zip(rows(state), state.status, state.stability, strict=True)
    ]
    return {
        **({} if name is None else {"sweep": {name: value}}),
        "parameters": {key: float(number) for key, number in parameters.ratios().items()},
        "lateral_yield_deg": degrees(angles.lateral),
        "moment_yield_deg": degrees(angles.moment),
        "points": points,
    }
