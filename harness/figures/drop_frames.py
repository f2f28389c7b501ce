"""One drop increment by increment: the packing, and beside it where the sample and its segments have come to."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from forcechain.arrays import BoolArray, FloatArray, IntArray
from forcechain.observe.snapshot import Snapshot
from forcechain.theory.parameters import ChainParameters
from harness.figures.buckling import plot_model_force
from harness.figures.packing import full_width_force, plot_discs, plot_forces, plot_segments
from harness.figures.style import label, look

ROOM_DEG = 5.0  # beyond the largest mean angle


class DropFrames:
    """A figure that shows one snapshot of a drop after the other, its frame standing still.

    Left: discs, force chains of the moment, contact forces, the segments that buckle in this drop. Right: the stress
    ratio, and the mean axial force of these segments against their mean angle, on the model's curve.
    """

    def __init__(
        self,
        figure: Figure,
        *,
        segments: IntArray,
        classes: IntArray,
        averages: pd.DataFrame | None,
        history: pd.DataFrame | None,
        ends: tuple[Snapshot, Snapshot],
        parameters: ChainParameters | None,
    ) -> None:
        """Lay out the figure.

        Args:
            figure: an empty one.
            segments: (n_buckled, 3) particles of the segments that buckle.
            classes: (n_buckled,) their classes, 0 to 4.
            averages: `buckling_angle_deg` and `axial_force_N` of the segments, a row an increment; None without any.
            history: the run's, with `axial_strain` and `stress_ratio`; None where it has none.
            ends: the first snapshot and the last: both, and so what is between, fit into the frame.
            parameters: of the model; None to leave its curve out.
        """
        self.segments, self.classes = segments, classes
        self.averages, self.history = averages, history
        self.figure, self.limits = figure, _limits(ends)
        self.full_force = full_width_force(ends[0])  # of all frames, or the fall of the forces could not be seen
        strains = ends[0].axial_strain, ends[1].axial_strain
        grid = figure.add_gridspec(2, 2, width_ratios=(1.7, 1))
        self.packing = figure.add_subplot(grid[:, 0])
        ratio, force = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
        (self.ratio_now,) = ratio.plot([], [], "o", color=look().data, markersize=7, zorder=3)
        (self.force_now,) = force.plot([], [], "o", color=look().data, markersize=7, zorder=3)
        if history is None:
            ratio.axis("off")
        else:
            length = strains[1] - strains[0]
            near = history[history["axial_strain"].between(strains[0] - length, strains[1] + length)]
            ratio.plot(near["axial_strain"], near["stress_ratio"], color=look().soft, linewidth=1.0)
            ratio.axvspan(*strains, color=look().data, alpha=0.12, linewidth=0)
            ratio.set_xlabel(label("axial strain"))
            ratio.set_title("stress ratio")
        if averages is None:
            force.axis("off")
        else:
            largest = float(averages["buckling_angle_deg"].max()) + ROOM_DEG
            if parameters is not None:
                plot_model_force(parameters, largest, ax=force)
            force.plot(averages["buckling_angle_deg"], averages["axial_force_N"], color=look().data_soft, linewidth=1.6)
            force.set_xlim(0, largest)
            force.set_ylim(0, 1.12 * float(averages["axial_force_N"].max()))
            force.set_xlabel(label(r"mean buckling angle $\theta$", "deg"))
            force.set_title("mean axial force [N]; dashed: the model")

    def show(self, increment: int, snapshot: Snapshot, in_chain: BoolArray) -> None:
        """Draw the packing of one increment with the discs `in_chain` (n_particles,), and move the points."""
        self.packing.clear()
        plot_discs(snapshot, ax=self.packing, members=in_chain, colour=look().chain)
        plot_segments(snapshot, self.segments, self.classes, ax=self.packing)
        plot_forces(snapshot, ax=self.packing, full_force=self.full_force)
        (left, bottom), (right, top) = self.limits
        self.packing.set_xlim(left, right)
        self.packing.set_ylim(bottom, top)
        self.packing.set_title(f"axial strain {snapshot.axial_strain:.4f}")
        if len(self.segments) and not self.figure.legends:
            self.figure.legend(*self.packing.get_legend_handles_labels(), loc="outside lower left", ncols=4)
        if self.history is not None:
            strain = snapshot.axial_strain
            ratio = np.interp(strain, self.history["axial_strain"], self.history["stress_ratio"])
            self.ratio_now.set_data([strain], [ratio])
        if self.averages is not None:
            row = self.averages.loc[increment]
            self.force_now.set_data([row["buckling_angle_deg"]], [row["axial_force_N"]])


def _limits(ends: tuple[Snapshot, Snapshot]) -> tuple[FloatArray, FloatArray]:
    """Return the corners (2,) that hold every disc of both snapshots, with a little room [mm]."""
    low = np.min([(one.position - one.radius[:, None]).min(axis=0) for one in ends], axis=0)
    high = np.max([(one.position + one.radius[:, None]).max(axis=0) for one in ends], axis=0)
    room = 0.01 * float((high - low).max())
    return 1e3 * (low - room), 1e3 * (high + room)
