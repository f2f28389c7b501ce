"""What each choice of the analysis moves, as one figure: a line a variation, a panel an outcome."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from harness.figures.style import CLASS_COLOURS, DATA, label

PANELS = (
    ("initial_angle_deg", "initial angle", "deg"),
    ("lateral_force_N", "lateral force", "N"),
    ("segments", "buckled segments", ""),
)
N_PANELS = len(PANELS) + 1  # and the classes
CLASSES = (1, 2, 3, 4)


def plot_sensitivity(table: pd.DataFrame, *, axes: Sequence[Axes]) -> Sequence[Axes]:
    """Draw one case's rows of `sensitivity`: means with 2 standard errors, counts, and the classes as bars.

    `axes` are four, side by side, sharing the vertical axis. The band is what the choices in use give.
    """
    shown = table[table["fault"].fillna("") == ""].reset_index(drop=True)
    height = np.arange(len(shown))[::-1]
    names = [
        "as set" if used else f"{option.removesuffix('_deg').replace('_', ' ')}: {value}"
        for used, option, value in zip(shown["in_use"], shown["option"], shown["value"], strict=True)
    ]
    for ax, (column, words, unit) in zip(axes, PANELS, strict=False):
        error = 2 * shown[f"{column}_se"].to_numpy() if f"{column}_se" in shown else np.zeros(len(shown))
        value = shown[column].to_numpy(dtype=np.float64)
        reference, spread = value[0], error[0]
        if np.isfinite(spread):
            ax.axvspan(reference - spread, reference + spread, color=DATA, alpha=0.15, linewidth=0)
        ax.axvline(reference, color=DATA, linewidth=0.8)
        ax.errorbar(value, height, xerr=np.nan_to_num(error), fmt="o", color=DATA, markersize=3.5, capsize=2)
        ax.set_xlabel(label(words, unit))
    bars = axes[-1]
    left = np.zeros(len(shown))
    for number in CLASSES:
        width = shown[f"class_{number}_percent"].fillna(0).to_numpy()
        bars.barh(height, width, left=left, color=CLASS_COLOURS[number], height=0.8, label=f"{number}")
        left = left + width
    bars.set_xlim(0, 100)
    bars.set_xlabel(label("class", "%"))
    bars.legend(ncols=len(CLASSES), loc="lower center", bbox_to_anchor=(0.5, 1.0), title=None)
    axes[0].set_yticks(height, names)
    axes[0].set_ylim(-0.7, len(shown) - 0.3)
    for ax in axes:
        for border in np.flatnonzero(shown["option"].to_numpy()[1:] != shown["option"].to_numpy()[:-1]):
            ax.axhline(height[border] - 0.5, color="0.85", linewidth=0.6, zorder=0)
    return axes
