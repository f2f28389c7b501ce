"""Figures of the three-particle model alone: its curves, configurations, sweeps, and maps of its parameters.

`plot_*` draw data on given axes and return them; `*_figure` compute the data for a parameter set and lay out a figure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from forcechain.arrays import FloatArray
from forcechain.theory.classes import buckling_class, largest_lateral_stiffness
from forcechain.theory.cluster import LEFT_LOWER, LEFT_UPPER, Cluster, cluster
from forcechain.theory.history import follow
from forcechain.theory.parameters import TABLE_3, ChainParameters
from forcechain.theory.response import Snapdown, snapdowns
from forcechain.theory.states import ChainState
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement, yield_angles
from harness.figures.style import CLASS_COLOURS, label

ANGLE = label(r"buckling angle $\theta$", "deg")
FORCE = label("axial force $F$", "N")
DISPLACEMENT = r"axial displacement $\Delta/R$"
SHADES = ("#9ecae1", "#4292c6", "#08519c", "#08306b")  # a parameter growing: light to dark
CLASS_NAMES = {1: "1 both elastic", 2: "2 together", 3: "3 lateral support first", 4: "4 chain moment first"}

# Fig. 6 of Tordesillas and Muthuswamy (2009): panel, parameter, symbol, values as printed.
FIGURE_6: tuple[tuple[str, str, str, tuple[float, ...]], ...] = (
    ("a", "normal_stiffness", r"$k^n$ [N/m]", (7.00e4, 1.05e5, 1.40e5)),
    ("b", "chain_tangential_stiffness", r"$k^t_{FC}/k^n$", (0.009, 0.014, 0.03)),
    ("c", "rolling_stiffness", r"$k^r/k^n$", (0.0, 0.01, 0.1, 0.5)),
    ("d", "rolling_friction", r"$\mu_r$", (0.02, 0.2, 0.3, 0.45)),
    ("e", "lateral_stiffness", r"$k^s/k^n$", (0.04, 0.06, 0.09)),
    ("f", "lateral_strength", r"$\mu_s\sigma_s/k^n$", (0.01, 0.024, 0.04, 0.06)),
)
IMPERFECTION_DEG = 2.0  # of Fig. 6's dotted lines
LARGEST_DISPLACEMENT = 0.65  # D/R, where the paper's figures end


def path_curve(parameters: ChainParameters, largest_angle: float = np.radians(60)) -> dict[str, FloatArray]:
    """Angle [deg], force, D/R, d and rotation [deg] from the unloaded column on: stage 1a, then the buckled path."""
    angle = np.unique(
        np.concatenate(
            (
                np.linspace(float(parameters.imperfection), largest_angle, 600),
                [
                    float(corner)
                    for corner in (yield_angles(parameters).lateral, yield_angles(parameters).moment)
                    if corner < largest_angle
                ],
            )
        )
    )
    states = [loading(parameters, angle)]
    if parameters.imperfection == 0:
        states.insert(0, straight(parameters, [0.0, float(critical_displacement(parameters))]))
    return as_curve(states)


def as_curve(states: Sequence[ChainState]) -> dict[str, FloatArray]:
    """Join states into the columns the plots take."""
    return {
        "angle": np.degrees(np.concatenate([state.angle for state in states])),
        "force": np.concatenate([state.axial_force for state in states]),
        "displacement": np.concatenate([state.axial_displacement_over_R for state in states]),
        "overlap": np.concatenate([state.normal_displacement_over_R for state in states]),
        "rotation": np.degrees(np.concatenate([state.rotation for state in states])),
    }


def plot_curve(curve: Mapping[str, FloatArray], horizontal: str, vertical: str, *, ax: Axes, **line: Any) -> Axes:
    """Draw one quantity of a curve against another."""
    ax.plot(curve[horizontal], curve[vertical], **{"color": "black", **line})
    return ax


def plot_snapdowns(jumps: Sequence[Snapdown], *, ax: Axes, **line: Any) -> Axes:
    """Draw each snapdown in the plane of force and displacement: an arrow down at constant displacement."""
    for jump in jumps:
        if jump.force_before - jump.force_after < 0.02 * jump.force_before:
            continue  # too small to be seen
        at = jump.axial_displacement_over_R
        ax.annotate(
            "",
            xy=(at, jump.force_after),
            xytext=(at, jump.force_before),
            arrowprops={"arrowstyle": "-|>", "linestyle": "--", "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0, **line},
        )
    return ax


def curves_figure(parameters: ChainParameters, unload_from: float | None = None) -> Figure:
    """Model curves of the paper's Fig. 4: F, D/R, w and d against the angle, and F against D/R; stages by colour."""
    largest = np.radians(45) if unload_from is None else unload_from
    curve = path_curve(parameters, largest)
    fig = Figure(figsize=(7.2, 4.6))
    grid = fig.subplots(2, 3)
    panels = (
        ("angle", "force", ANGLE, FORCE),
        ("angle", "displacement", ANGLE, DISPLACEMENT),
        ("angle", "rotation", ANGLE, label(r"rotation $\omega$", "deg")),
        ("angle", "overlap", ANGLE, r"normal displacement $\Delta^n/R$"),
        ("displacement", "force", DISPLACEMENT, FORCE),
    )
    back = None
    if unload_from is not None:
        path = follow(parameters, [unload_from, 0.0])
        chosen = path.leg == 1
        names = ("angle", "axial_force", "axial_displacement_over_R", "normal_displacement_over_R", "rotation")
        angle, force, displacement, overlap, rotation = (getattr(path.state, name)[chosen] for name in names)
        back = {
            "angle": np.degrees(angle),
            "force": force,
            "displacement": displacement,
            "overlap": overlap,
            "rotation": np.degrees(rotation),
        }
    corners = yield_angles(parameters)
    marks = [("lateral support yields", corners.lateral, "s"), ("chain moment yields", corners.moment, "o")]
    for (horizontal, vertical, across, up), ax, letter in zip(panels, grid.flat, "abcde", strict=False):
        plot_curve(curve, horizontal, vertical, ax=ax, label="loading")
        if back is not None:
            plot_curve(back, horizontal, vertical, ax=ax, color="#0072B2", linestyle="-", label="unloading")
        for name, corner, marker in marks:
            if corner <= largest:
                point = as_curve([loading(parameters, np.array([float(corner)]))])
                ax.plot(point[horizontal], point[vertical], marker, color="#D55E00", label=name, linestyle="none")
        ax.set(xlabel=across, ylabel=up, title=f"({letter})")
        ax.set_xlim(left=0)
        ax.set_ylim(bottom=0)
    handles, names = grid.flat[0].get_legend_handles_labels()
    jumps = [jump for jump in snapdowns(parameters) if jump.angle_after <= largest]
    if jumps:
        plot_snapdowns(jumps, ax=grid.flat[4], color="#CC79A7")
        handles.append(Line2D([], [], color="#CC79A7", linestyle="--", linewidth=0.9))
        names.append("snapdown")
    legend = grid.flat[5]
    legend.axis("off")
    legend.legend(handles, names, loc="center")
    return fig


def plot_configuration(one: Cluster, index: int, *, ax: Axes) -> Axes:
    """Draw the particles of a cluster at one state, with a line through each end particle that turns with it."""
    R = one.radius
    for particle in range(7):
        x, y = one.position[index, particle] / R
        chain = particle < 3
        moved = particle in (LEFT_UPPER, LEFT_LOWER)
        ax.add_patch(
            Circle(
                (x, y),
                1.0,
                facecolor="#cfe3f1" if chain else ("#f4f4f4" if moved else "white"),
                edgecolor="#0072B2" if chain else "0.4",
                linestyle="-" if chain or moved else "--",
                linewidth=1.0 if chain else 0.7,
            )
        )
        if chain:
            w = one.rotation[index, particle]
            dx, dy = -np.sin(w), np.cos(w)
            ax.plot([x - dx, x + dx], [y - dy, y + dy], color="#D55E00", linewidth=1.2)
    ax.set(xlim=(-4.6, 2.9), ylim=(-3.2, 3.2), aspect="equal")
    ax.axis("off")
    return ax


def configurations_figure(parameters: ChainParameters = TABLE_3) -> Figure:
    """Sequence of configurations of the paper's Fig. 5, from the straight chain to the unloaded one, with the void."""
    corners = yield_angles(parameters)
    first, second = sorted((float(corners.lateral), float(corners.moment)))
    largest = min(second + np.radians(6), np.radians(60))
    names, states = ["1a"], [straight(parameters, [0.999 * float(critical_displacement(parameters))])]
    for angle in (0.8 * first, (first + second) / 2, largest):
        state = loading(parameters, np.array([angle]))
        names.append(str(state.stage[0]))
        states.append(state)
    back = follow(parameters, [largest, 0.0])
    last = {name: getattr(back.state, name)[-1:] for name in ChainState.__dataclass_fields__}
    names.append("4")
    states.append(ChainState(**last))
    fig = Figure(figsize=(7.2, 1.9))
    axes = fig.subplots(1, len(states))
    for name, state, ax in zip(names, states, axes, strict=True):
        one = cluster(parameters, state)
        plot_configuration(one, 0, ax=ax)
        ax.set_title(
            f"stage {name}\n$\\theta$ {np.degrees(state.angle[0]):.1f}°, $F$ {abs(state.axial_force[0]):.2f} N\n"
            f"void {one.void_area[0] / one.radius**2:.2f} $R^2$",
            loc="center",
            fontsize=8,
        )
    return fig


def plot_sweep(
    name: str,
    symbol: str,
    values: Sequence[float],
    base: ChainParameters,
    *,
    ax: Axes,
    imperfection_deg: float | None = None,
) -> Axes:
    """Draw F against D/R for each value of a parameter, the rest as in `base`, with snapdowns; dotted: imperfect."""
    for value, shade in zip(values, SHADES[-len(values) :] if len(values) <= 4 else _shades(len(values)), strict=True):
        parameters = base.with_ratios(**{name: value})
        plot_curve(path_curve(parameters), "displacement", "force", ax=ax, color=shade, label=f"{value:g}")
        if parameters.imperfection == 0:
            plot_snapdowns(snapdowns(parameters), ax=ax, color=shade)
        if imperfection_deg is not None:
            imperfect = path_curve(parameters.with_ratios(imperfection_deg=imperfection_deg))
            plot_curve(imperfect, "displacement", "force", ax=ax, color=shade, linestyle=":")
    ax.set(xlabel=DISPLACEMENT, ylabel=FORCE, xlim=(0, LARGEST_DISPLACEMENT))
    ax.set_ylim(bottom=0)
    ax.legend(
        title=symbol,
        title_fontsize=8,
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(values),
        columnspacing=0.9,
        handlelength=1.1,
        handletextpad=0.4,
        borderaxespad=0.1,
    )
    return ax


def sweep_figure(name: str, values: Sequence[float], base: ChainParameters = TABLE_3) -> Figure:
    """F against D/R for several values of one parameter."""
    fig = Figure(figsize=(4.8, 3.6))
    plot_sweep(name, name.replace("_", " "), values, base, ax=fig.subplots())
    return fig


def _shades(n: int) -> list[tuple[float, float, float]]:
    light, dark = np.array([0.62, 0.79, 0.88]), np.array([0.03, 0.19, 0.42])
    return [tuple(light + (dark - light) * share) for share in np.linspace(0, 1, n)]


def sweeps_figure(base: ChainParameters = TABLE_3) -> Figure:
    """The six panels of the paper's Fig. 6."""
    fig = Figure(figsize=(7.2, 7.6))
    for (letter, name, symbol, values), ax in zip(FIGURE_6, fig.subplots(3, 2).flat, strict=True):
        plot_sweep(name, symbol, values, base, ax=ax, imperfection_deg=IMPERFECTION_DEG if letter == "d" else None)
        ax.set_title(f"({letter})")
        if letter == "d":
            ax.text(
                0.98, 0.97, f"dotted: imperfection {IMPERFECTION_DEG:g}°", ha="right", va="top", transform=ax.transAxes
            )
    return fig


def plot_class_map(friction: FloatArray, strength: FloatArray, classes: Any, *, ax: Axes) -> Axes:
    """Draw which class the model predicts over rolling friction and lateral strength, (n_strength, n_friction)."""
    colours = ListedColormap(["0.85", *(CLASS_COLOURS[code] for code in (1, 2, 3, 4))])
    ax.pcolormesh(friction, strength, classes, cmap=colours, vmin=-0.5, vmax=4.5, shading="nearest", rasterized=True)
    ax.set(xlabel=r"rolling friction $\mu_r$", ylabel=r"lateral strength $\mu_s\sigma_s/k^n$")
    return ax


def class_map_figure(
    parameters: ChainParameters = TABLE_3,
    largest_angle: float = np.radians(24),
    together_within: float = np.radians(1),
) -> Figure:
    """Map of the predicted class over (mu_r, ls), for chains that start straight and at 14 degrees.

    A segment counts as elastic when nothing yields up to `largest_angle`, as together when both yield within
    `together_within` of each other.
    """
    friction, strength = np.linspace(0.002, 0.5, 250), np.linspace(0.001, 0.1, 220)
    fig = Figure(figsize=(7.2, 3.9))
    for imperfection, ax in zip((0.0, 14.0), fig.subplots(1, 2, sharey=True), strict=True):
        swept = parameters.with_ratios(
            rolling_friction=friction[None, :], lateral_strength=strength[:, None], imperfection_deg=imperfection
        )
        classes = buckling_class(swept, largest_angle=largest_angle, together_within=together_within)
        plot_class_map(friction, strength, classes, ax=ax)
        ratios = parameters.ratios()
        for mu in (0.02, 0.05, 0.2):  # the tests of Table 1
            (dot,) = ax.plot(mu, float(ratios["lateral_strength"]), "o", color="black", markersize=4)
        ax.text(
            0.98,
            0.97,
            "straight at first" if imperfection == 0 else f"imperfection {imperfection:g}°",
            ha="right",
            va="top",
            transform=ax.transAxes,
        )
        if imperfection:
            ax.set_ylabel("")
    dot.set_label("tests of the paper's Table 1")
    patches = [Patch(facecolor=CLASS_COLOURS[code], label=name) for code, name in CLASS_NAMES.items()]
    fig.legend(handles=[*patches, dot], loc="outside upper center", ncols=5, columnspacing=1.2, handlelength=1.4)
    return fig


def plot_overlap_bound(parameters: ChainParameters, *, ax: Axes, overlaps: Sequence[float] = (0.05, 0.1, 0.15)) -> Axes:
    """Draw the region of (kFC, ks) that bound (30) admits, for each largest overlap over the radius."""
    ratio = np.linspace(1e-4, 0.05, 200)
    swept = parameters.with_ratios(chain_tangential_stiffness=ratio)
    for overlap, shade in zip(overlaps, _shades(len(overlaps)), strict=True):
        edge = np.maximum(largest_lateral_stiffness(swept, overlap) / float(parameters.normal_stiffness), 0.0)
        ax.fill_between(ratio, edge, color=shade, alpha=0.25, linewidth=0)
        ax.plot(ratio, edge, color=shade, label=f"{overlap:g}")
    own = parameters.ratios()
    ax.plot(
        float(own["chain_tangential_stiffness"]),
        float(own["lateral_stiffness"]),
        "o",
        color="#D55E00",
        label="these parameters",
    )
    ax.set(xlabel=r"chain tangential stiffness $k^t_{FC}/k^n$", ylabel=r"lateral stiffness $k^s/k^n$")
    ax.set_xlim(0, 0.05)
    ax.set_ylim(bottom=0)
    ax.legend(title=r"largest overlap $\lambda$")
    return ax


def overlap_bound_figure(parameters: ChainParameters = TABLE_3) -> Figure:
    """Region of (kFC, ks) that keeps overlaps small, (30)."""
    fig = Figure(figsize=(4.2, 3.2))
    plot_overlap_bound(parameters, ax=fig.subplots())
    return fig
