"""Figures of columns of many particles: buckling modes, and the path along which a column yields and localises."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from forcechain.theory.column import BucklingModes, buckling_modes
from forcechain.theory.column_path import ColumnPath
from forcechain.theory.parameters import TABLE_3, ChainParameters
from harness.figures.style import label
from harness.figures.theory import DISPLACEMENT, FORCE

MOST_SEEN = 24  # particles of a longer column that are drawn, about its largest angle


def plot_modes(modes: BucklingModes, *, ax: Axes, most: int = 3) -> Axes:
    """Draw the lowest modes of a column side by side: the line of centres and the particles, with critical loads."""
    shapes = modes.lateral_displacement[:most]
    n = shapes.shape[1]
    height = 2.0 * np.arange(n)
    for k, shape in enumerate(shapes):
        at = 5.0 * k + 1.6 * shape / np.abs(shape).max()
        for x, y in zip(at, height, strict=True):
            ax.add_patch(Circle((x, y), 1.0, facecolor="#cfe3f1", edgecolor="#0072B2", linewidth=0.6))
        ax.plot(at, height, color="black", linewidth=1.0)
        ax.axvline(5.0 * k, color="0.8", linewidth=0.6, zorder=0)
        force = modes.critical_force[k]
        ax.text(5.0 * k, -2.2, f"{force:.2f}" if np.isfinite(force) else "none", ha="center", va="top", fontsize=7)
    ax.set(xlim=(-3.2, 5.0 * len(shapes) - 1.8), ylim=(-5.0, height[-1] + 1.6), aspect="equal")
    ax.axis("off")
    return ax


def modes_figure(parameters: ChainParameters = TABLE_3, counts: Sequence[int] = (3, 4, 5, 10, 20)) -> Figure:
    """Lowest buckling modes of straight columns of several lengths, with their critical loads."""
    all_modes = [buckling_modes(parameters, n) for n in counts]
    widths = [min(3, n - 2) for n in counts]
    fig = Figure(figsize=(7.2, 3.6))
    axes = np.atleast_1d(fig.subplots(1, len(counts), width_ratios=widths))
    for n, modes, ax in zip(counts, all_modes, axes, strict=True):
        plot_modes(modes, ax=ax)
        ax.set_anchor("S")
        ax.set_title(f"N = {n}", loc="center")
    fig.supxlabel(label("below each mode: critical force", "N"), fontsize=8)
    return fig


def plot_column_path(path: ColumnPath, *, ax: Axes, **line: Any) -> Axes:
    """Draw F against D/R along a column's path: loading in black, unloading in blue."""
    D, F = path.axial_displacement_over_R, path.axial_force
    up = ~path.unloading
    start = [0.0] if F[0] > 0 else []  # stage 1a of a perfect column is the line from nothing to the first point
    ax.plot([*start, *D[up]], [*start, *F[up]], **{"color": "black", "label": "loading", **line})
    if path.unloading.any():
        last = int(np.flatnonzero(up)[-1])
        ax.plot([D[last], *D[~up]], [F[last], *F[~up]], **{"color": "#0072B2", "label": "unloading", **line})
    ax.set(xlabel=DISPLACEMENT, ylabel=FORCE)
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    return ax


def plot_column(path: ColumnPath, index: int, *, ax: Axes, at: float = 0.0) -> Axes:
    """Draw the particles of a column at one point of its path, in their true places; filled where a support slipped."""
    t, d = path.angles[index], path.normal_displacement_over_R[index]
    height = np.concatenate(([0.0], np.cumsum((2 - d) * np.cos(t))))
    for x, y, slipped in zip(path.lateral_displacement_over_R[index], height, path.lateral_plastic[index], strict=True):
        colour = "#E69F00" if slipped else "#cfe3f1"
        ax.add_patch(Circle((at + x, y), 1.0, facecolor=colour, edgecolor="#0072B2", linewidth=0.5))
    x, y = (at + path.lateral_displacement_over_R[index]), height
    middle = np.column_stack(((x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2))[path.moment_plastic[index]]
    ax.plot(*middle.T, ".", color="#D55E00", markersize=5)
    return ax


def column_figure(path: ColumnPath) -> Figure:
    """Force and shapes of a column of any length along its path: where it yields, it localises."""
    n = path.rotations.shape[1]
    fig = Figure(figsize=(7.2, 3.6))
    left, right = fig.subplots(1, 2, width_ratios=[1, 1.1])
    plot_column_path(path, ax=left)
    loaded = np.flatnonzero(~path.unloading)
    largest = np.abs(path.angles[loaded]).max(axis=1)
    chosen = [int(loaded[np.argmin(np.abs(largest - share * largest[-1]))]) for share in (0.0, 0.25, 0.5, 1.0)]
    seen = min(n, MOST_SEEN)
    width = max(5.0, seen / 4)
    site = int(np.abs(path.angles[chosen[-1]]).argmax())
    first = min(max(site - seen // 2, 0), n - seen)
    for k, index in enumerate(chosen):
        plot_column(path, index, ax=right, at=k * width)
        D, F = path.axial_displacement_over_R[index], path.axial_force[index]
        left.plot(D, F, "o", color="#D55E00")
        left.annotate(str(k + 1), (D, F), xytext=(5, 3), textcoords="offset points", fontsize=8)
        right.text(k * width, 2 * first - 1.6, str(k + 1), ha="center", va="top", fontsize=8, backgroundcolor="white")
    if path.unloading.any():
        left.legend()
    right.set(
        xlim=(-width / 2, (len(chosen) - 0.5) * width), ylim=(2 * first - 4.5, 2 * (first + seen)), aspect="equal"
    )
    right.axis("off")
    right.set_title("orange: lateral support slips; dots: moment slips", loc="center")
    left.set_title(f"N = {n}")
    return fig
