"""The five panels of buckling data against the model, as the paper's Fig. 4: lines are theory, points are data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from forcechain.theory.history import unloading
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.states import ChainState, Status
from forcechain.theory.three_particle import loading, straight
from forcechain.theory.yielding import critical_displacement
from harness.figures.style import THEORY, label, look

IMPERFECTION_DEG = 2.0  # of the second line, as in the paper's Fig. 4
POINTS = 400
# column of the averages, attribute of the model's state, axis: the panels against the buckling angle
ANGLE_PANELS = (
    ("axial_force_N", "axial_force", 1.0, "$F$", "N"),
    ("axial_displacement_over_R", "axial_displacement_over_R", 1.0, r"$\Delta/R$", ""),
    ("rotation_deg", "rotation", np.degrees(1.0), "rotation $w$", "deg"),
    ("normal_displacement_over_R", "normal_displacement_over_R", 1.0, r"$\Delta^n/R$", ""),
)


def _defined(state: ChainState, values: np.ndarray) -> np.ndarray:
    return np.where(state.status <= Status.BEYOND_FOLD, values, np.nan)


def theory_curves(parameters: ChainParameters, largest_angle: float) -> dict[str, ChainState]:
    """The model's states: straight, loaded up to `largest_angle` [rad] from perfect and imperfect, and unloaded."""
    imperfect = parameters.with_ratios(imperfection_deg=IMPERFECTION_DEG)
    start = np.radians(IMPERFECTION_DEG)
    unloading_from = 0.93 * largest_angle
    return {
        "straight": straight(parameters, np.linspace(0, float(critical_displacement(parameters)), 20)),
        "perfect": loading(parameters, np.linspace(0, largest_angle, POINTS)),
        "imperfect": loading(imperfect, np.linspace(start, largest_angle, POINTS)),
        "unloading": unloading(parameters, unloading_from, np.linspace(unloading_from, 0, POINTS), sliders="held"),
    }


def plot_buckling(
    averages: pd.DataFrame, parameters: ChainParameters, shift: float, *, axes: Sequence[Axes], name: str
) -> Sequence[Axes]:
    """Draw the five panels: F, D/R, w and Dn/R against the buckling angle, and F against D/R.

    Args:
        averages: one case's rows of `averages.csv`.
        parameters: of the model.
        shift: added to the data's D/R: the model's at the mean initial angle.
        axes: five.
        name: what the data are, for the legend.
    """
    data = averages.assign(axial_displacement_over_R=averages["axial_displacement_over_R"] + shift)
    largest = max(30.0, 1.15 * float(data["buckling_angle_deg"].max()))
    curves = theory_curves(parameters, np.radians(largest))
    for ax, (column, attribute, factor, symbol, unit) in zip(axes, ANGLE_PANELS, strict=False):
        _draw_theory(curves, "angle", np.degrees(1.0), attribute, factor, ax=ax)
        _draw_data(data, "buckling_angle_deg", column, ax=ax, name=name)
        ax.set_xlabel(label(r"buckling angle $\theta$", "deg"))
        ax.set_ylabel(label(symbol, unit))
        ax.set_xlim(-1, largest)
        ax.set_ylim(bottom=0)
    last = axes[4]
    _draw_theory(curves, "axial_displacement_over_R", 1.0, "axial_force", 1.0, ax=last)
    _draw_data(data, "axial_displacement_over_R", "axial_force_N", ax=last, name=name)
    last.set_xlabel(label(r"$\Delta/R$"))
    last.set_ylabel(label("$F$", "N"))
    last.set_xlim(left=0)
    last.set_ylim(bottom=0)
    for ax, letter in zip(axes, "abcde", strict=True):
        ax.set_title(f"({letter})")
    return axes


def plot_force(averages: pd.DataFrame, parameters: ChainParameters, *, ax: Axes, name: str) -> Axes:
    """Draw the axial force against the buckling angle alone, on the loading curve of the straight column."""
    largest = max(30.0, 1.15 * float(averages["buckling_angle_deg"].max()))
    plot_model_force(parameters, largest, ax=ax)
    _draw_data(averages, "buckling_angle_deg", "axial_force_N", ax=ax, name=name)
    ax.set_xlabel(label(r"buckling angle $\theta$", "deg"))
    ax.set_ylabel(label("axial force $F$", "N"))
    ax.set_xlim(-1, largest)
    ax.set_ylim(bottom=0)
    return ax


def plot_model_force(parameters: ChainParameters, largest_angle_deg: float, *, ax: Axes) -> Axes:
    """Draw the model's axial force against the buckling angle: the straight column, loaded until it buckles and on."""
    curves = theory_curves(parameters, np.radians(largest_angle_deg))
    chosen = {name: curves[name] for name in ("straight", "perfect")}
    return _draw_theory(chosen, "angle", np.degrees(1.0), "axial_force", 1.0, ax=ax)


def _draw_theory(curves: dict[str, ChainState], x: str, x_factor: float, y: str, y_factor: float, *, ax: Axes) -> Axes:
    theory = THEORY | {"color": look().ink}
    looks = {
        "straight": theory,
        "perfect": theory | {"label": "model, straight column"},
        "imperfect": theory
        | {
            "color": look().soft,
            "linestyle": ":",
            "linewidth": 1.2,
            "label": f"model, imperfection {IMPERFECTION_DEG:g}°",
        },
    }
    looks["unloading"] = theory | {"linewidth": 0.8, "linestyle": "-.", "label": "model, unloading (4)"}
    for name, state in curves.items():
        ax.plot(
            _defined(state, x_factor * getattr(state, x)), _defined(state, y_factor * getattr(state, y)), **looks[name]
        )
    perfect = curves["perfect"]
    changes = np.flatnonzero(perfect.stage[1:] != perfect.stage[:-1]) + 1
    for row in changes:
        if perfect.stage[row - 1] == "1a":
            continue
        ax.plot(x_factor * getattr(perfect, x)[row], y_factor * getattr(perfect, y)[row], "|", color=look().ink, ms=8)
    for first, last in zip([0, *changes], [*changes, len(perfect.stage)], strict=True):
        if last - first < POINTS // 20:
            continue
        middle = (first + last) // 2
        ax.annotate(
            str(perfect.stage[middle]),
            (x_factor * getattr(perfect, x)[middle], y_factor * getattr(perfect, y)[middle]),
            xytext=(-9, 4),
            textcoords="offset points",
            fontsize=8,
            ha="center",
            bbox={"facecolor": look().page, "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
        )
    return ax


def _draw_data(data: pd.DataFrame, x: str, y: str, *, ax: Axes, name: str) -> Axes:
    ax.errorbar(
        data[x],
        data[y],
        yerr=2 * data[f"{y}_se"].fillna(0),
        fmt="o",
        color=look().data,
        ecolor=look().data_soft,
        markersize=3.5,
        elinewidth=0.8,
        zorder=3,
        label=f"{name}, {_count(data)}",
    )
    # Along x the points share one error, that of the initial value, so it is drawn at the two ends alone.
    ends = data.iloc[[0, -1]]
    ax.errorbar(
        ends[x], ends[y], xerr=2 * ends[f"{x}_se"].fillna(0), fmt="none", ecolor=look().data, elinewidth=0.6, zorder=2
    )
    return ax


def _count(data: pd.DataFrame) -> str:
    low, high = int(data["segments"].min()), int(data["segments"].max())
    return f"n = {low}" if low == high else f"n = {low} to {high}"
