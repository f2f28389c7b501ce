"""The analytic curves: `forcechain model` prints them as CSV or JSON, or draws them."""

from __future__ import annotations

import argparse
import csv
import difflib
import json
import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.theory.continuation import ColumnPath, follow_column
from forcechain.theory.history import Ending, follow, unloading
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
LARGEST_COLUMN_ANGLE_DEG = 40.0
GRID_STEP_DEG = 0.5
STRAIGHT_POINTS = 11
PLOT_SUFFIXES = (".png", ".svg", ".pdf")
Result = TypeVar("Result")
FIGURES = ("curves", "configurations", "sweeps", "modes", "classes", "bound")


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
    parser.add_argument(
        "--unload-from",
        metavar="A",
        help="unload from this buckling angle in degrees; with --angles, the states at these angles while unloading",
    )
    parser.add_argument(
        "--hold-sliders",
        action="store_true",
        help="let neither slider slip while unloading, as the paper's stage 4 is printed",
    )
    parser.add_argument("--sweep", metavar="NAME=A,B,...", help="one curve for each value; adds the name as a column")
    parser.add_argument(
        "--particles",
        metavar="N",
        help="a column of N particles (3 to 200): its largest buckling angle, the overlap there and the largest "
        "rotation",
    )
    parser.add_argument(
        "--mode", metavar="K", help="with --particles: buckling mode, 1 has the lowest load (default 1)"
    )
    parser.add_argument("--plot", metavar="FILE", help="draw instead of printing: " + ", ".join(PLOT_SUFFIXES))
    parser.add_argument("--figure", choices=FIGURES, default="curves", help="what --plot draws (default: curves)")
    parser.add_argument("--json", action="store_true", help="JSON with yield angles, status and stability")


def execute(args: argparse.Namespace) -> int:
    """Print or draw the curves; returns the exit status."""
    given = parse_settings(args.set)
    check_combination(args)
    if args.plot is not None:
        draw(args, given)
    elif args.particles is not None:
        write_column(args, given)
    else:
        write_curves(args, given)
    return EXIT_GOOD


def check_combination(args: argparse.Namespace) -> None:
    """Raise InputError for arguments that exclude each other."""
    wrong = [
        (args.particles is not None and args.angles is not None, "--angles: only for three particles, not --particles"),
        (args.particles is not None and args.sweep is not None, "--sweep: only for three particles, not --particles"),
        (args.particles is None and args.mode is not None, "--mode: only with --particles"),
        (args.hold_sliders and args.unload_from is None, "--hold-sliders: only with --unload-from"),
        (args.hold_sliders and args.particles is not None, "--hold-sliders: only for three particles"),
        (args.plot is None and args.figure != "curves", "--figure: only with --plot FILE"),
        (args.plot is not None and args.angles is not None, "--angles: a plot has its own grid; leave it out"),
        (args.plot is not None and args.json, "--json: with --plot there is nothing to print"),
        (args.sweep is not None and args.unload_from is not None, "--unload-from: not with --sweep"),
    ]
    for condition, message in wrong:
        if condition:
            raise InputError(message)


def write_curves(args: argparse.Namespace, given: dict[str, float]) -> None:
    """Print the curves of three particles."""
    angles_deg = None if args.angles is None else parse_numbers("--angles", args.angles)
    unload_deg = None if args.unload_from is None else parse_numbers("--unload-from", args.unload_from, most=1)[0]
    sliders = "held" if args.hold_sliders else "free"
    name, values = parse_sweep(args.sweep) if args.sweep else (None, [None])
    if name in given:
        raise InputError(f"--sweep {name}: expected a parameter that --set does not fix, found {name}={given[name]:g}")
    curves = []
    for value in values:
        parameters = chain_parameters(given if name is None else {**given, name: value})
        states = guarded(partial(curve, parameters, angles_deg, unload_deg, sliders))
        curves.append((value, parameters, states))
    if args.json:
        print_json([as_record(name, *entry) for entry in curves])
        return
    table = [COLUMNS if name is None else (name, *COLUMNS)]
    for value, _, states in curves:
        table += [row if name is None else (value, *row) for state in states for row in rows(state)]
    print_csv(table)


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
        raise InputError(f"{option}: expected one number, found {len(numbers)}")
    return numbers


def parse_count(option: str, text: str) -> int:
    """Turn a text into a whole number."""
    number = parse_numbers(option, text, most=1)[0]
    if not number.is_integer():
        raise InputError(f"{option}: expected a whole number, found {text}")
    return int(number)


def guarded(work: Callable[[], Result]) -> Result:
    """Return what `work` returns; the theory's ValueError, one line already, becomes an InputError."""
    try:
        return work()
    except ValueError as error:
        raise InputError(f"model: {error}") from None


def chain_parameters(values: dict[str, Any]) -> ChainParameters:
    """Table 3 with `values`; InputError for what the model does not admit."""
    return guarded(lambda: ChainParameters.from_ratios(**values))


def default_angles(parameters: ChainParameters, largest_deg: float = LARGEST_ANGLE_DEG) -> FloatArray:
    """Angles [rad] over all stages in even steps, with the angles of yielding among them."""
    first = float(parameters.imperfection)
    angles = yield_angles(parameters)
    steps = np.arange(math.ceil(np.degrees(first) / GRID_STEP_DEG) * GRID_STEP_DEG, largest_deg, GRID_STEP_DEG)
    corners = [first, float(angles.lateral), float(angles.moment), math.radians(largest_deg)]
    corners = [corner for corner in corners if first <= corner <= math.radians(largest_deg)]
    return np.unique(np.concatenate((np.radians(steps), corners)))


def curve(
    parameters: ChainParameters, angles_deg: list[float] | None, unload_deg: float | None, sliders: Any
) -> list[ChainState]:
    """States to show, in order: at the angles given, or stage 1a, a grid of angles and the unloading if asked for."""
    if unload_deg is not None and not np.degrees(float(parameters.imperfection)) < unload_deg < 90:
        raise InputError(
            f"--unload-from: expected an angle above the imperfection, "
            f"{np.degrees(float(parameters.imperfection)):g} deg, and below 90, found {unload_deg:g}"
        )
    highest = 90 if unload_deg is None else unload_deg
    for angle in angles_deg or ():
        if not 0 <= angle <= highest:
            limit = "below 90 deg" if unload_deg is None else f"at most the angle of unloading, {unload_deg:g} deg"
            raise InputError(f"--angles: expected at least 0 and {limit}, found {angle:g}")
    if angles_deg is not None and unload_deg is not None:
        return [checked(unloading(parameters, math.radians(unload_deg), np.radians(angles_deg), sliders=sliders))]
    if angles_deg is not None:
        return [checked(loading(parameters, np.radians(angles_deg)))]
    states = []
    if parameters.imperfection == 0:
        critical = float(critical_displacement(parameters))
        if math.isnan(critical):
            raise InputError(f"model: {Status.TOO_STIFF.meaning}")
        states.append(straight(parameters, np.linspace(0, critical, STRAIGHT_POINTS)[:-1]))
    largest = LARGEST_ANGLE_DEG if unload_deg is None else unload_deg
    if unload_deg is None and np.degrees(float(parameters.imperfection)) >= largest:
        largest = (np.degrees(float(parameters.imperfection)) + 90) / 2
    states.append(checked(loading(parameters, default_angles(parameters, largest))))
    if unload_deg is not None:
        path = follow(parameters, [math.radians(unload_deg), 0.0], sliders=sliders)
        chosen = path.leg == 1
        states.append(ChainState(**{n: getattr(path.state, n)[chosen] for n in ChainState.__dataclass_fields__}))
    return states


def checked(state: ChainState) -> ChainState:
    """Return the state; InputError where it has no numbers, a note on standard error where it needs one."""
    for angle, status in zip(state.angle, state.status, strict=True):
        if status not in (Status.EQUILIBRIUM, Status.BEYOND_FOLD):
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


def column_path(args: argparse.Namespace, parameters: ChainParameters) -> ColumnPath:
    """Follow the column asked for."""
    n = parse_count("--particles", args.particles)
    mode = 1 if args.mode is None else parse_count("--mode", args.mode)
    if mode < 1:
        raise InputError(f"--mode: expected 1 or more, found {mode}")
    largest = LARGEST_COLUMN_ANGLE_DEG
    if args.unload_from is not None:
        largest = parse_numbers("--unload-from", args.unload_from, most=1)[0]
    path = guarded(
        lambda: follow_column(
            parameters,
            n,
            mode=mode - 1,
            largest_angle=math.radians(largest),
            unload=args.unload_from is not None,
        )
    )
    if path.ending not in (Ending.REACHED, Ending.SEPARATED, Ending.STRAIGHT):
        print(f"model: the path ends early, at point {len(path.axial_force)}: {path.ending.name}", file=sys.stderr)
    return path


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


def write_column(args: argparse.Namespace, given: dict[str, float]) -> None:
    """Print the path of a column of N particles."""
    parameters = chain_parameters(given)
    path = column_path(args, parameters)
    if not args.json:
        print_csv([COLUMNS, *column_rows(path)])
        return
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
    print_json(
        {
            "parameters": {key: float(number) for key, number in parameters.ratios().items()},
            "particles": path.rotations.shape[1],
            "ending": path.ending.name.lower(),
            "points": points,
        }
    )


def draw(args: argparse.Namespace, given: dict[str, float]) -> None:
    """Draw what was asked for into a file."""
    file = Path(args.plot)
    if file.suffix.lower() not in PLOT_SUFFIXES:
        raise InputError(f"--plot {file}: expected a name that ends in {', '.join(PLOT_SUFFIXES)}")
    from harness import theory_figures as figures  # matplotlib: not before a figure is wanted
    from harness.figure_style import style

    parameters = chain_parameters(given)
    with style():
        if args.particles is not None:
            figure = figures.column_figure(column_path(args, parameters))
        elif args.sweep is not None:
            name, values = parse_sweep(args.sweep)
            figure = guarded(lambda: figures.sweep_figure(name, values, parameters))
        elif args.figure == "curves":
            unload = None
            if args.unload_from is not None:
                unload = math.radians(parse_numbers("--unload-from", args.unload_from, most=1)[0])
            figure = guarded(lambda: figures.curves_figure(parameters, unload))
        else:
            makers = {
                "configurations": figures.configurations_figure,
                "sweeps": figures.sweeps_figure,
                "modes": figures.modes_figure,
                "classes": figures.class_map_figure,
                "bound": figures.overlap_bound_figure,
            }
            figure = guarded(lambda: makers[args.figure](parameters))
        try:
            figure.savefig(file)
        except OSError as error:
            raise InputError(f"--plot {file}: cannot be written: {error.strerror}") from None
    print(f"model: wrote {file}", file=sys.stderr)
