"""The pictures of the report, each with its caption and words for those who cannot see it."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from forcechain.arrays import BoolArray, IntArray
from forcechain.observe.filters import potential_energy
from forcechain.observe.snapshot import Snapshot
from harness.analysing.analysis import Analysis
from harness.comparing.comparison import ModelCurves
from harness.figures.buckling import plot_buckling, plot_force
from harness.figures.macroscopic import plot_stress_ratio, plot_volume_change
from harness.figures.packing import plot_discs, plot_filters, plot_forces, plot_segments
from harness.figures.style import style
from harness.reading.exports import Run
from harness.text_table import number

MOST_LINES = 6  # runs of one figure
VECTOR_LIMIT = 1500  # discs; above, a picture of the packing is a bitmap, or it would weigh tens of megabytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure of the report: how to draw it, its caption, and what it says to those who cannot see it.

    Attributes:
        name: stem of its file and its place on the page.
        caption, alternative: words below it, and instead of it.
        size: width and height [inch].
        draw: draws on an empty figure.
        kind: "svg", or "png" where lines would be too many.
    """

    name: str
    caption: str
    alternative: str
    size: tuple[float, float]
    draw: Callable[[Figure], None]
    kind: str = "svg"

    def render(self, kind: str) -> bytes:
        """Return the figure as a file of `kind` ("svg", "png" or "pdf"), the same bytes each time."""
        buffer = io.BytesIO()
        metadata: Mapping[str, dict[str, None]] = {
            "svg": {"Date": None, "Creator": None},
            "png": {"Software": None},
            "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
        }
        with style():
            figure = plt.figure(figsize=self.size)
            try:
                self.draw(figure)
                figure.savefig(buffer, format=kind, metadata=metadata[kind])
            finally:
                plt.close(figure)
        return buffer.getvalue()

    @property
    def uri(self) -> str:
        """The figure as a data URI."""
        media = {"svg": "image/svg+xml", "png": "image/png"}[self.kind]
        return f"data:{media};base64,{base64.b64encode(self.render(self.kind)).decode()}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The packing at the start of one drop, with what the analysis found in it."""

    where: str
    counts: str
    start: Snapshot
    in_chain: BoolArray
    lost_energy: BoolArray
    segments: IntArray
    classes: IntArray

    @property
    def aspect(self) -> float:
        """Height over width."""
        width, height = np.ptp(self.start.position, axis=0)
        return float(height / width)

    @property
    def kind(self) -> str:
        """File format for a picture of every disc."""
        return "png" if self.start.n_particles > VECTOR_LIMIT else "svg"

    def draw_network(self, ax: Axes) -> None:
        """Discs of chains, buckled segments and contact forces."""
        plot_discs(self.start, ax=ax, members=self.in_chain, colour="#BBD7EA")
        plot_segments(self.start, self.segments, self.classes, ax=ax)
        plot_forces(self.start, ax=ax)


def busiest_drop(case: str, analysis: Analysis, runs: Mapping[str, Run]) -> Scene | None:
    """Return the drop of a case with the most buckled segments; None if it has no drop."""
    counted = [record for record in analysis.ledger if record["case"] == case]
    if not counted:
        return None
    record = max(counted, key=lambda entry: entry["buckled_segments"])
    name, drop = record["run"], record["drop"]

    def of_drop(table: pd.DataFrame) -> pd.DataFrame:
        chosen: pd.DataFrame = table[(table["run"] == name) & (table["drop"] == drop)]
        return chosen

    row = of_drop(analysis.drops).iloc[0]
    start, end = (runs[name].snapshot(int(row[which])) for which in ("first_snapshot", "last_snapshot"))
    yielding = of_drop(analysis.yielding)
    in_chain = np.zeros(start.n_particles, dtype=np.bool_)
    in_chain[of_drop(analysis.members)["particle"].to_numpy(dtype=np.int64)] = True
    terms = analysis.options["energy_terms"]["value"]
    return Scene(
        where=f"{case}, {name}, drop {drop}, axial strain {start.axial_strain:.4f} to {end.axial_strain:.4f}",
        counts=f"{record['in_chains']} of {record['particles']} discs are in force chains, {record['lost_energy']} of "
        f"them lost potential energy, {record['buckled_segments']} three-particle segments buckled.",
        start=start,
        in_chain=in_chain,
        lost_energy=potential_energy(end, terms) < potential_energy(start, terms),
        segments=yielding[["particle_1", "particle_2", "particle_3"]].to_numpy(dtype=np.int64),
        classes=yielding["buckling_class"].to_numpy(dtype=np.int64),
    )


def behaviour_picture(case: str, analysis: Analysis, runs: Mapping[str, Run]) -> Picture:
    """Stress ratio with the chosen drops, and volume change, of the first runs of a case."""
    names = [name for name in analysis.runs.loc[analysis.runs["case"] == case, "run"] if runs[name].history is not None]
    shown = names[:MOST_LINES]
    frames = [runs[name].history for name in shown]
    histories = [frame for frame in frames if frame is not None]
    drops = [analysis.drops[analysis.drops["run"] == name] for name in shown]
    facts = analysis.runs[analysis.runs["run"].isin(shown)]
    peaks = "; ".join(
        f"{row['run']}: {number(row['peak_stress_ratio'])} at {number(row['strain_at_peak'])}"
        for row in facts.to_dict("records")
    )

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        plot_stress_ratio(histories, drops, shown, ax=left)
        if all("lateral_strain" in history for history in histories):
            plot_volume_change(histories, shown, ax=right)
        else:
            right.axis("off")

    more = f" {len(names) - len(shown)} more runs are not drawn." if len(names) > len(shown) else ""
    return Picture(
        name=f"behaviour-{analysis.cases.index(case)}",
        caption=f"{case}: stress ratio (left) and volume change, dilation positive (right). A triangle marks the start "
        f"of a drop, the thick band its length. Peaks: {peaks}.{more}",
        alternative=f"Two curves against axial strain for {case}. Peak stress ratios and their strains: {peaks}.",
        size=(10, 3.8),
        draw=draw,
    )


def packing_pictures(case: str, analysis: Analysis, scene: Scene) -> list[Picture]:
    """The three filters one after the other, and the chains among the contact forces."""
    place = analysis.cases.index(case)

    def legend(figure: Figure, ax: Axes) -> None:
        if len(scene.segments):
            figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)

    def draw_filters(figure: Figure) -> None:
        one, two, three = figure.subplots(1, 3)
        plot_filters(
            scene.start, scene.in_chain, scene.lost_energy, scene.segments, scene.classes, axes=(one, two, three)
        )
        legend(figure, three)

    def draw_forces(figure: Figure) -> None:
        ax = figure.subplots()
        scene.draw_network(ax)
        legend(figure, ax)

    return [
        Picture(
            name=f"filters-{place}",
            caption=f"{scene.where}: the three filters one after the other. {scene.counts}",
            alternative=f"Three pictures of the packing. {scene.counts}",
            size=(11, 3.2 * scene.aspect + 1.0),
            draw=draw_filters,
            kind=scene.kind,
        ),
        Picture(
            name=f"forces-{place}",
            caption=f"{scene.where}, at its start: contact forces as lines, as wide as the force is large; discs of "
            "force chains in pale blue; buckled segments in the colour of their class.",
            alternative=f"Contact-force network with force chains and buckled segments marked. {scene.counts}",
            size=(7.5, 6.9 * scene.aspect + 0.8),
            draw=draw_forces,
            kind=scene.kind,
        ),
    ]


def summary_picture(case: str, analysis: Analysis, scene: Scene, model: ModelCurves) -> Picture:
    """The question and the answer side by side: chains that buckle, and their force against the model's."""
    averages = analysis.averages[analysis.averages["case"] == case]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(1.05, 1))
        scene.draw_network(left)
        left.set_title("force chains (pale blue) and segments that buckle")
        plot_force(averages, model.parameters, ax=right, name="simulations, 2 s.e.")
        right.set_title("axial force while the chains buckle")
        right.set_ylim(top=1.3 * right.get_ylim()[1])  # room for the legend above the error bars
        right.legend(loc="upper right")
        if len(scene.segments):
            figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=4)

    return Picture(
        name=f"summary-{analysis.cases.index(case)}",
        caption=f"{scene.where}: left, the contact forces at its start; right, the axial force of all buckled "
        f"segments, averaged, on the model's curve. {scene.counts}",
        alternative=f"Left: contact-force network with buckled segments marked. Right: axial force against buckling "
        f"angle, model and data. {scene.counts}",
        size=(10.5, 5.0 * scene.aspect + 0.9),
        draw=draw,
        kind=scene.kind,
    )


def buckling_picture(case: str, analysis: Analysis, model: ModelCurves) -> Picture:
    """Averaged buckling data of one case on the model's curves: the paper's Fig. 4."""
    averages = analysis.averages[analysis.averages["case"] == case]

    def draw(figure: Figure) -> None:
        axes = figure.subplots(2, 3).ravel()
        plot_buckling(averages, model.parameters, model.shift, axes=axes[:5], name="data, 2 s.e.")
        axes[5].axis("off")
        axes[5].legend(*axes[0].get_legend_handles_labels(), loc="center")

    first, last = averages.iloc[0], averages.iloc[-1]
    told = (
        f"Over the drops the mean buckling angle grows from {first['buckling_angle_deg']:.1f} to "
        f"{last['buckling_angle_deg']:.1f} degrees while the axial force falls from {first['axial_force_N']:.1f} to "
        f"{last['axial_force_N']:.1f} N; the model gives {model.at_data.axial_force[0]:.1f} and "
        f"{model.at_data.axial_force[-1]:.1f} N at these angles."
    )
    return Picture(
        name=f"buckling-{analysis.cases.index(case)}",
        caption=f"{case}: axial force F (a), axial displacement (b), rotation (c) and normal displacement (d) against "
        f"the buckling angle, and force against displacement (e). Lines: the model, its stages numbered; points: "
        f"averages over all buckled segments at each increment, the displacement starting from the model's at the "
        f"first angle. {told}",
        alternative=told,
        size=(10, 6),
        draw=draw,
    )
