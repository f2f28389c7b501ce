"""The pictures of the report, each as a data URI with its caption and words for those who cannot see it."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from forcechain.observe.filters import potential_energy
from harness.analysis import Analysis
from harness.buckling_figures import plot_buckling
from harness.comparison import ModelCurves
from harness.exports import Run
from harness.packing_figures import plot_discs, plot_filters, plot_forces, plot_segments
from harness.study_figures import plot_stress_ratio, plot_volume_change
from harness.text_table import number

MOST_LINES = 6  # runs of one figure
VECTOR_LIMIT = 1500  # discs; above, a picture of the packing is a bitmap, or it would weigh tens of megabytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure of the page as a data URI, with its caption and what it says to those who cannot see it."""

    name: str
    uri: str
    caption: str
    alternative: str


def _picture(
    name: str,
    caption: str,
    alternative: str,
    size: tuple[float, float],
    draw: Callable[[Figure], None],
    *,
    bitmap: bool,
) -> Picture:
    figure = plt.figure(figsize=size)
    try:
        draw(figure)
        buffer = io.BytesIO()
        if bitmap:
            figure.savefig(buffer, format="png", metadata={"Software": None})
        else:
            figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    finally:
        plt.close(figure)
    kind = "png" if bitmap else "svg+xml"
    uri = f"data:image/{kind};base64,{base64.b64encode(buffer.getvalue()).decode()}"
    return Picture(name=name, uri=uri, caption=caption, alternative=alternative)


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
    return _picture(
        f"behaviour-{analysis.cases.index(case)}",
        f"{case}: stress ratio (left) and volume change, dilation positive (right). A triangle marks the start of a "
        f"drop, the thick band its length. Peaks: {peaks}.{more}",
        f"Two curves against axial strain for {case}. Peak stress ratios and their strains: {peaks}.",
        (10, 3.8),
        draw,
        bitmap=False,
    )


def packing_pictures(case: str, analysis: Analysis, runs: Mapping[str, Run]) -> list[Picture]:
    """Draw the drop with the most buckled segments: the three filters, and chains among the contact forces."""
    counted = [record for record in analysis.ledger if record["case"] == case]
    if not counted:
        return []
    record = max(counted, key=lambda entry: entry["buckled_segments"])
    name, drop = record["run"], record["drop"]
    of_drop = (analysis.drops["run"] == name) & (analysis.drops["drop"] == drop)
    first, last = (int(analysis.drops.loc[of_drop, which].iloc[0]) for which in ("first_snapshot", "last_snapshot"))
    start, end = runs[name].snapshot(first), runs[name].snapshot(last)
    yielding = analysis.yielding[(analysis.yielding["run"] == name) & (analysis.yielding["drop"] == drop)]
    segments = yielding[["particle_1", "particle_2", "particle_3"]].to_numpy(dtype=np.int64)
    classes = yielding["buckling_class"].to_numpy(dtype=np.int64)
    members = analysis.members[(analysis.members["run"] == name) & (analysis.members["drop"] == drop)]
    in_chain = np.zeros(start.n_particles, dtype=np.bool_)
    in_chain[members["particle"].to_numpy(dtype=np.int64)] = True
    terms = analysis.options["energy_terms"]["value"]
    lost = potential_energy(end, terms) < potential_energy(start, terms)
    width, height = np.ptp(start.position, axis=0)
    bitmap = start.n_particles > VECTOR_LIMIT
    where = f"{case}, {name}, drop {drop}, axial strain {start.axial_strain:.4f} to {end.axial_strain:.4f}"

    def draw_filters(figure: Figure) -> None:
        one, two, three = figure.subplots(1, 3)
        plot_filters(start, in_chain, lost, segments, classes, axes=(one, two, three))
        if len(segments):
            figure.legend(*three.get_legend_handles_labels(), loc="outside lower center", ncols=4)

    def draw_forces(figure: Figure) -> None:
        ax = figure.subplots()
        plot_discs(start, ax=ax, members=in_chain, colour="#BBD7EA")
        plot_segments(start, segments, classes, ax=ax)
        plot_forces(start, ax=ax)
        if len(segments):
            figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)

    counts = (
        f"{record['in_chains']} of {record['particles']} discs are in force chains, {record['lost_energy']} of them "
        f"lost potential energy, {record['buckled_segments']} three-particle segments buckled."
    )
    return [
        _picture(
            f"filters-{analysis.cases.index(case)}",
            f"{where}: the three filters one after the other. {counts}",
            f"Three pictures of the packing. {counts}",
            (11, 3.2 * height / width + 1.0),
            draw_filters,
            bitmap=bitmap,
        ),
        _picture(
            f"forces-{analysis.cases.index(case)}",
            f"{where}, at its start: contact forces as lines, as wide as the force is large; discs of force chains in "
            "pale blue; buckled segments in the colour of their class.",
            f"Contact-force network of the packing with force chains and buckled segments marked. {counts}",
            (7.5, 6.9 * height / width + 0.8),
            draw_forces,
            bitmap=bitmap,
        ),
    ]


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
    return _picture(
        f"buckling-{analysis.cases.index(case)}",
        f"{case}: axial force F (a), axial displacement (b), rotation (c) and normal displacement (d) against the "
        f"buckling angle, and force against displacement (e). Lines: the model, its stages numbered; points: averages "
        f"over all buckled segments at each increment, the displacement starting from the model's at the "
        f"first angle. {told}",
        told,
        (10, 6),
        draw,
        bitmap=False,
    )
