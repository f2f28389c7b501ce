"""Macroscopic curves of a study: stress ratio with the chosen drops, and volume change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from harness.figures.style import label
from harness.reading.tested import BIAXIAL, WORDS, Words


def volumetric_strain(history: pd.DataFrame) -> pd.Series:
    """Volume change of the sample over its initial volume, dilation positive (two dimensions: of its area)."""
    return (1 - history["axial_strain"]) * (1 - history["lateral_strain"]) - 1


def plot_stress_ratio(
    histories: Sequence[pd.DataFrame],
    drops: Sequence[pd.DataFrame],
    names: Sequence[str],
    *,
    ax: Axes,
    words: Words = WORDS[BIAXIAL],
) -> Axes:
    """Draw stress ratio against axial strain, a line a run, each run's drops marked on its own line.

    `drops` holds, for each run, a frame with `start` and `end` (axial strains); `words` what the axes are in this test.
    """
    for number, (history, chosen, name) in enumerate(zip(histories, drops, names, strict=True)):
        colour = f"C{number % 6}"
        strain, ratio = history["axial_strain"].to_numpy(), history["stress_ratio"].to_numpy()
        ax.plot(strain, ratio, color=colour, linewidth=0.9, label=name)
        for start, end in zip(chosen["start"], chosen["end"], strict=True):
            inside = (strain >= start) & (strain <= end)
            ax.plot(strain[inside], ratio[inside], color=colour, linewidth=3.2, alpha=0.45, solid_capstyle="butt")
            ax.plot([start], [np.interp(start, strain, ratio)], "v", color=colour, markersize=5)
    ax.set_xlabel(label(words.strain))
    ax.set_ylabel(label(words.ratio_axis))
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    ax.legend(ncols=2 if len(names) > 3 else 1)
    return ax


def plot_volume_change(histories: Sequence[pd.DataFrame], names: Sequence[str], *, ax: Axes) -> Axes:
    """Draw the volumetric strain (dilation positive) against axial strain, a line a run."""
    for number, (history, name) in enumerate(zip(histories, names, strict=True)):
        ax.plot(history["axial_strain"], 100 * volumetric_strain(history), color=f"C{number % 6}", label=name)
    ax.axhline(0, color="0.6", linewidth=0.6)
    ax.set_xlabel(label("axial strain"))
    ax.set_ylabel(label("volume change", "%"))
    ax.set_xlim(left=0)
    return ax


def plot_solid_fraction(
    histories: Sequence[pd.DataFrame], names: Sequence[str], *, ax: Axes, words: Words = WORDS[BIAXIAL]
) -> Axes:
    """Draw the solid fraction against axial strain, a line a run; `words` says what the strain is in this test."""
    for number, (history, name) in enumerate(zip(histories, names, strict=True)):
        ax.plot(history["axial_strain"], history["solid_fraction"], color=f"C{number % 6}", label=name)
    ax.set_xlabel(label(words.strain))
    ax.set_ylabel(label("solid fraction"))
    ax.set_xlim(left=0)
    return ax
