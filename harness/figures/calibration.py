"""A calibration, looked at: data with the calibrated and the paper's curve, how well each measure is met, profiles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from forcechain.calibration import Calibration, Estimate, Identified, LongColumn
from forcechain.theory.parameters import ChainParameters
from forcechain.theory.three_particle import loading
from harness.figures.buckling import ANGLE_PANELS
from harness.figures.style import PAPER, THEORY, label, look

COUNTED_FROM_START = ("axial_displacement_over_R", "rotation_deg")
POINTS = 200
SYMBOLS = {
    "chain_tangential_stiffness": r"$k_{FC}/k_n$",
    "lateral_stiffness": r"$k_s/k_n$",
    "lateral_strength": r"$l_s/k_n$",
}
MEASURE_SYMBOLS = {
    "axial_force": "$F$",
    "normal_displacement_over_R": r"$\Delta^n/R$",
    "axial_displacement_over_R": r"$\Delta/R$",
    "rotation": "$w$",
}
LEGEND_ROOM = 300.0  # of a logarithmic axis, above the profile
LEAST_RISE = 1e-2  # of the sum of squares that is drawn: below, the profile is at its foot


def calibration_figure(
    averages: pd.DataFrame,
    calibration: Calibration,
    reference: ChainParameters,
    columns: Mapping[int, LongColumn] | None = None,
) -> Figure:
    """Draw one case: four measures against the angle, their differences, two profiles, and columns by length if any.

    Args:
        averages: the case's rows of `averages.csv`.
        calibration: of the perfect column.
        reference: the parameters it is compared with: the paper's, or the study's own.
        columns: N -> the column of N particles fitted to stretches of that length.
    """
    figure = Figure(figsize=(11, 5.4), layout="constrained")
    axes = figure.subplots(2, 4).ravel()
    for ax, (column, attribute, factor, symbol, unit) in zip(axes[:4], ANGLE_PANELS, strict=True):
        plot_measure(averages, calibration.parameters, reference, column, attribute, factor, ax=ax)
        since = ", since the start" if column in COUNTED_FROM_START else ""
        ax.set_ylabel(label(symbol, unit) + since)
    axes[0].set_ylim(top=1.45 * axes[0].get_ylim()[1])  # room for the legend
    axes[0].legend(fontsize=7, loc="upper right")
    plot_deviations(calibration, ax=axes[4])
    chain, lateral, _ = calibration.estimates
    plot_profile(chain, float(reference.chain_tangential_stiffness / reference.normal_stiffness), ax=axes[5])
    plot_profile(lateral, float(reference.lateral_stiffness / reference.normal_stiffness), ax=axes[6])
    if columns:
        plot_lengths(columns, ax=axes[7])
    else:
        axes[7].set_axis_off()
    for ax, letter in zip(axes, "abcdefgh", strict=True):
        if ax.axison:
            ax.set_title(f"({letter})")
    return figure


def plot_measure(
    averages: pd.DataFrame,
    calibrated: ChainParameters,
    reference: ChainParameters,
    column: str,
    attribute: str,
    factor: float,
    *,
    ax: Axes,
) -> Axes:
    """Draw a measure against the buckling angle: data with two standard errors, calibrated and reference curve."""
    angle = averages["buckling_angle_deg"].to_numpy(dtype=np.float64)
    values = averages[column].to_numpy(dtype=np.float64)
    error = averages[f"{column}_se"].fillna(0).to_numpy(dtype=np.float64)
    ax.errorbar(
        angle,
        values,
        yerr=2 * error,
        fmt="o",
        color=look().data,
        ecolor=look().data_soft,
        markersize=3,
        elinewidth=0.8,
        label=f"data ± 2 s.e., {int(averages['segments'].iloc[0])} segments",
    )
    along = np.linspace(angle[0], angle.max(), POINTS)
    theory = THEORY | {"color": look().ink}
    for parameters, drawn in (
        (calibrated, theory | {"linestyle": "-", "label": "model, calibrated"}),
        (reference, theory | {"color": PAPER, "label": "model, the paper's parameters"}),
    ):
        curve = factor * getattr(loading(parameters, np.radians(along)), attribute)
        if column in COUNTED_FROM_START:
            curve = curve - curve[0]
        ax.plot(along, curve, **drawn)
    ax.set_xlabel(label(r"buckling angle $\theta$", "deg"))
    ax.set_ylim(bottom=0)
    return ax


def plot_deviations(calibration: Calibration, *, ax: Axes) -> Axes:
    """Draw the normalised root-mean-square difference of each measure with its interval: calibrated, and reference."""
    goodness = calibration.goodness
    place = np.arange(len(goodness))
    for offset, name, colour, marker in ((-0.12, "calibrated", look().ink, "o"), (0.12, "reference", PAPER, "s")):
        value = np.array([getattr(one, name) for one in goodness])
        ends = [getattr(one, f"{name}_interval") for one in goodness]
        reach = np.array([[v - e.low for v, e in zip(value, ends, strict=True)], [e.high for e in ends] - value])
        ax.errorbar(
            place + offset,
            value,
            yerr=np.maximum(reach, 0),
            fmt=marker,
            color=colour,
            markersize=4,
            capsize=2,
            label=name if name == "calibrated" else "the paper's",
        )
    ax.set_xticks(place, [MEASURE_SYMBOLS[one.measure] for one in goodness])
    ax.set_ylabel("n.r.m.s. difference [-]")
    ax.set_ylim(bottom=0)
    ax.set_xlim(-0.5, len(goodness) - 0.5)
    ax.legend(fontsize=7)
    return ax


def plot_profile(estimate: Estimate, reference: float, *, ax: Axes) -> Axes:
    """Draw how much the least sum of squares rises with the parameter held, its interval and the reference's value."""
    ax.axvspan(estimate.interval.low, estimate.interval.high, color=look().data_soft, alpha=0.35, label="95 % interval")
    if len(estimate.profile_value):
        rise = estimate.profile_sum - estimate.profile_sum.min()
        ax.semilogy(estimate.profile_value, np.maximum(rise, LEAST_RISE), "-", color=look().data)
    if estimate.identified is not Identified.NO:
        ax.axvline(estimate.value, color=look().ink, linewidth=1.2, label=f"calibrated {estimate.value:.3g}")
    ax.axvline(reference, color=PAPER, linewidth=1.2, linestyle="--", label=f"the paper's {reference:.3g}")
    ax.set_xlabel(SYMBOLS[estimate.name])
    ax.set_ylabel("rise of the sum of squares")
    ax.set_yscale("log")
    ax.set_ylim(LEAST_RISE, LEGEND_ROOM * max(ax.get_ylim()[1], 1.0))
    ax.set_title(estimate.identified.value, loc="right", fontsize=8)
    ax.legend(fontsize=7, loc="upper right")
    return ax


def plot_lengths(columns: Mapping[int, LongColumn], *, ax: Axes) -> Axes:
    """Draw kFC and ks by the number of particles, with intervals; hollow where the data do not bound them."""
    for offset, index, colour, marker in ((-0.06, 0, look().data, "o"), (0.06, 1, PAPER, "s")):
        for k, (n_particles, column) in enumerate(columns.items()):
            estimate = column.estimates[index]
            bounds = np.array([[estimate.value - estimate.interval.low], [estimate.interval.high - estimate.value]])
            ax.errorbar(
                [n_particles + offset],
                [estimate.value],
                yerr=np.maximum(bounds, 0),
                fmt=marker,
                color=colour,
                markerfacecolor=look().page if estimate.identified is Identified.NO else colour,
                markersize=4,
                capsize=2,
                label=SYMBOLS[estimate.name] if k == 0 else None,
            )
    ax.set_xticks(list(columns), [f"{n}\n({column.n_stretches})" for n, column in columns.items()])
    ax.set_xlabel("particles of a stretch (stretches)")
    ax.set_ylabel("over $k_n$ [-]")
    ax.set_xlim(min(columns) - 0.4, max(columns) + 0.4)
    ax.set_ylim(bottom=0)
    ax.legend(fontsize=7)
    return ax
