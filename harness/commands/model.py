"""The analytic curves: `forcechain model` prints them as CSV or JSON, or draws them."""

from __future__ import annotations

import argparse
import math
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from forcechain.arrays import FloatArray
from forcechain.theory.column_path import ColumnPath
from forcechain.theory.continuation import follow_column
from forcechain.theory.history import Ending, follow, unloading
from forcechain.theory.parameters import TABLE_3_RATIOS, ChainParameters
from forcechain.theory.response import displacement_controlled
from forcechain.theory.states import ChainState, Status
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement, yield_angles
from harness.errors import EXIT_GOOD, InputError
from harness.modelling.model_arguments import (
    chain_parameters,
    guarded,
    parse_count,
    parse_numbers,
    parse_settings,
    parse_sweep,
)
from harness.modelling.model_tables import COLUMNS, as_record, column_record, column_rows, print_csv, print_json, rows

HELP = "the analytic model's curves as CSV, JSON or a plot"
EXAMPLE = "forcechain model --set rolling_friction=0.05 --angles 5,14,25"

LARGEST_ANGLE_DEG = 60.0  # of the default grid; the paper's figures end at D/R = 0.6, near 30 degrees
LARGEST_COLUMN_ANGLE_DEG = 40.0
GRID_STEP_DEG = 0.5
STRAIGHT_POINTS = 11
PLOT_SUFFIXES = (".png", ".svg", ".pdf")
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
        "--displacements",
        metavar="A,B,...",
        help="prescribed axial displacements over R instead of angles: past a snapdown, the branch it arrives on",
    )
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
        (args.displacements is not None and args.angles is not None, "--displacements: not with --angles"),
        (args.displacements is not None and args.unload_from is not None, "--displacements: not with --unload-from"),
        (args.displacements is not None and args.particles is not None, "--displacements: only for three particles"),
        (args.displacements is not None and args.plot is not None, "--displacements: a plot has its own grid"),
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
    displacements = None if args.displacements is None else parse_numbers("--displacements", args.displacements)
    unload_deg = None if args.unload_from is None else parse_numbers("--unload-from", args.unload_from, most=1)[0]
    sliders = "held" if args.hold_sliders else "free"
    name, values = parse_sweep(args.sweep) if args.sweep else (None, [None])
    if name in given:
        raise InputError(f"--sweep {name}: expected a parameter that --set does not fix, found {name}={given[name]:g}")
    curves = []
    for value in values:
        parameters = chain_parameters(given if name is None else {**given, name: value})
        if displacements is None:
            states = guarded(partial(curve, parameters, angles_deg, unload_deg, sliders))
        else:
            states = [checked(guarded(partial(displacement_controlled, parameters, displacements)))]
        curves.append((value, parameters, states))
    if args.json:
        print_json([as_record(name, *entry) for entry in curves])
        return
    table = [COLUMNS if name is None else (name, *COLUMNS)]
    for value, _, states in curves:
        table += [row if name is None else (value, *row) for state in states for row in rows(state)]
    print_csv(table)


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
    largest = unload_deg
    if largest is None:
        first = np.degrees(float(parameters.imperfection))
        largest = LARGEST_ANGLE_DEG if first < LARGEST_ANGLE_DEG else (first + 90) / 2
    back = [] if unload_deg is None else unloading_leg(parameters, unload_deg, sliders)
    states.append(checked(loading(parameters, default_angles(parameters, largest))))
    return states + back


def unloading_leg(parameters: ChainParameters, unload_deg: float, sliders: Any) -> list[ChainState]:
    """States from the angle of unloading to zero force."""
    path = follow(parameters, [math.radians(unload_deg), 0.0], sliders=sliders)
    chosen = path.leg == 1
    if not chosen.any():
        last = np.degrees(path.state.angle[-1])
        raise InputError(f"--unload-from {unload_deg:g}: loading ends at {last:g} deg ({path.ending.name})")
    states = [ChainState(**{n: getattr(path.state, n)[chosen] for n in ChainState.__dataclass_fields__})]
    if path.ending == Ending.STRAIGHT:  # from there the column unloads as it was loaded
        states.append(straight(parameters, np.linspace(float(critical_displacement(parameters)), 0, STRAIGHT_POINTS)))
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


def write_column(args: argparse.Namespace, given: dict[str, float]) -> None:
    """Print the path of a column of N particles."""
    parameters = chain_parameters(given)
    path = column_path(args, parameters)
    if not args.json:
        print_csv([COLUMNS, *column_rows(path)])
        return
    print_json(column_record(parameters, path))


def draw(args: argparse.Namespace, given: dict[str, float]) -> None:
    """Draw what was asked for into a file."""
    file = Path(args.plot)
    if file.suffix.lower() not in PLOT_SUFFIXES:
        raise InputError(f"--plot {file}: expected a name that ends in {', '.join(PLOT_SUFFIXES)}")
    # matplotlib: not before a figure is wanted
    from harness.figures import column as column_figures
    from harness.figures import theory as theory_figures
    from harness.figures.style import style

    parameters = chain_parameters(given)
    with style():
        if args.particles is not None:
            figure = column_figures.column_figure(column_path(args, parameters))
        elif args.sweep is not None:
            name, values = parse_sweep(args.sweep)
            figure = guarded(lambda: theory_figures.sweep_figure(name, values, parameters))
        elif args.figure == "curves":
            unload = None
            if args.unload_from is not None:
                unload = math.radians(parse_numbers("--unload-from", args.unload_from, most=1)[0])
            figure = guarded(lambda: theory_figures.curves_figure(parameters, unload))
        else:
            makers = {
                "configurations": theory_figures.configurations_figure,
                "sweeps": theory_figures.sweeps_figure,
                "modes": column_figures.modes_figure,
                "classes": theory_figures.class_map_figure,
                "bound": theory_figures.overlap_bound_figure,
            }
            figure = guarded(lambda: makers[args.figure](parameters))
        try:
            figure.savefig(file)
        except OSError as error:
            raise InputError(f"--plot {file}: cannot be written: {error.strerror}") from None
    print(f"model: wrote {file}", file=sys.stderr)
