"""The pictures of the report, each with its caption and words for those who cannot see it."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from forcechain.arrays import BoolArray, IntArray
from forcechain.observe.chains import find_chains
from forcechain.observe.snapshot import Snapshot
from harness.analysing.buckling_data import Analysis
from harness.comparing.comparison import ModelCurves
from harness.errors import InputError
from harness.figures.buckling import plot_buckling, plot_force
from harness.figures.macroscopic import plot_solid_fraction, plot_stress_ratio, plot_volume_change
from harness.figures.packing import plot_discs, plot_filters, plot_forces, plot_segments
from harness.figures.style import look, style
from harness.reading.exports import Run
from harness.reading.tested import BIAXIAL, WORDS
from harness.report.scenes import Scene, of_drop, options_of
from harness.text_table import number

MOST_LINES = 6  # runs of one figure
WIDE = 0.7  # height over width below which pictures of a packing stand one below the other
COLOURS = 256  # of a bitmap on the page: a quarter of the bytes, no difference to the eye
MM_AN_INCH = 25.4
LEAST_HEIGHT = 2.5  # inch
PAGE_DPI = 110  # of a bitmap on the page, which is 10 inch wide at most
LONG_DECIMALS = re.compile(rb"(\.\d\d)\d+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure of the report: how to draw it, its caption, and what it says to those who cannot see it.

    Attributes:
        name: stem of its file and its place on the page.
        caption, alternative: words below it, and instead of it.
        size: width and height [inch].
        draw: draws on an empty figure.
        kind: on the page: "svg", or "png" where lines would be too many.
    """

    name: str
    caption: str
    alternative: str
    size: tuple[float, float]
    draw: Callable[[Figure], None]
    kind: str = "svg"

    def render(self, kind: str, *, dark: bool = False, width_mm: float | None = None, dpi: float = 150.0) -> bytes:
        """Return the figure as a file of `kind` ("svg", "png" or "pdf"), the same bytes each time.

        `width_mm` changes its size but not that of its letters, so its height shrinks to `LEAST_HEIGHT` at most;
        `dpi` is that of a PNG.
        """
        buffer = io.BytesIO()
        metadata: Mapping[str, dict[str, None]] = {
            "svg": {"Date": None, "Creator": None},
            "png": {"Software": None},
            "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
        }
        factor = 1.0 if width_mm is None else width_mm / MM_AN_INCH / self.size[0]
        with style(dark=dark):
            width, height = self.size
            figure = plt.figure(figsize=(factor * width, max(factor * height, min(height, LEAST_HEIGHT))))
            try:
                self.draw(figure)
                figure.savefig(buffer, format=kind, metadata=metadata[kind], dpi=dpi)
            finally:
                plt.close(figure)
        return buffer.getvalue()

    def uri(self, *, dark: bool = False) -> str:
        """Return the figure as a data URI for the page, as light as can be without a visible loss."""
        if self.kind == "svg":
            media, content = "image/svg+xml", _short_svg(self.render("svg", dark=dark))
        else:
            media, content = "image/png", _few_colours(self.render("png", dark=dark, dpi=PAGE_DPI))
        return f"data:{media};base64,{base64.b64encode(content).decode()}"


def _short_svg(svg: bytes) -> bytes:
    """SVG without what nothing refers to, its places to a hundredth of a point."""
    svg = re.sub(rb"<!--.*?-->", b"", svg, flags=re.DOTALL)
    svg = re.sub(rb' id="(?:[a-z]+\d?d?|matplotlib\.axis|LineCollection|PathCollection|FillBetween\w*)_\d+"', b"", svg)
    svg = re.sub(rb' (?:d|x|y)="[^"]*"|translate\([^)]*\)', lambda found: LONG_DECIMALS.sub(rb"\1", found[0]), svg)
    return re.sub(rb">\s+<", b"><", re.sub(rb"\s+", b" ", svg))


def _few_colours(png: bytes) -> bytes:
    buffer = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        few = image.convert("RGB").quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def draw_network(snapshot: Snapshot, in_chain: BoolArray, segments: IntArray, classes: IntArray, ax: Axes) -> None:
    """Discs, those of chains pale; buckled segments; contact forces."""
    plot_discs(snapshot, ax=ax, members=in_chain, colour=look().chain)
    plot_segments(snapshot, segments, classes, ax=ax)
    plot_forces(snapshot, ax=ax)


def draw_scene(scene: Scene, ax: Axes) -> None:
    """The network at the start of a drop."""
    draw_network(scene.start, scene.in_chain, scene.segments, scene.classes, ax)


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

    test = analysis.test(case)
    words = WORDS[test]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2)
        plot_stress_ratio(histories, drops, shown, ax=left, words=words)
        if test != BIAXIAL:
            plot_solid_fraction(histories, shown, ax=right, words=words)
        elif all("lateral_strain" in history for history in histories):
            plot_volume_change(histories, shown, ax=right)
        else:
            right.axis("off")

    more = f" {len(names) - len(shown)} more runs are not drawn." if len(names) > len(shown) else ""
    return Picture(
        name=f"behaviour-{analysis.cases.index(case)}",
        caption=f"{case}: {words.ratio} (left) and {words.other} (right). A triangle marks the start "
        f"of a drop, the thick band its length. Peaks: {peaks}.{more}",
        alternative=f"Two curves against {words.strain} for {case}. Peaks of {words.ratio} and where: {peaks}.",
        size=(10, 3.8),
        draw=draw,
    )


def packing_pictures(case: str, analysis: Analysis, scene: Scene) -> list[Picture]:
    """The three filters one after the other, and the chains among the contact forces."""
    place = analysis.cases.index(case)
    wide = scene.aspect < WIDE

    def legend(figure: Figure, ax: Axes) -> None:
        if len(scene.segments):
            figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)

    def draw_filters(figure: Figure) -> None:
        one, two, three = figure.subplots(3, 1) if wide else figure.subplots(1, 3)
        plot_filters(
            scene.start, scene.in_chain, scene.lost_energy, scene.segments, scene.classes, axes=(one, two, three)
        )
        legend(figure, three)

    def draw_forces(figure: Figure) -> None:
        ax = figure.subplots()
        draw_scene(scene, ax)
        legend(figure, ax)

    return [
        Picture(
            name=f"filters-{place}",
            caption=f"{scene.where}: the three filters one after the other. {scene.counts}",
            alternative=f"Three pictures of the packing. {scene.counts}",
            size=(7.5, 3 * (6.7 * scene.aspect + 0.7) + 0.4) if wide else (11, 3.2 * scene.aspect + 1.0),
            draw=draw_filters,
            kind="png",
        ),
        Picture(
            name=f"forces-{place}",
            caption=f"{scene.where}, at its start: contact forces as lines, as wide as the force is large; discs of "
            "force chains in blue; buckled segments in the colour of their class.",
            alternative=f"Contact-force network with force chains and buckled segments marked. {scene.counts}",
            size=(7.5, 6.9 * scene.aspect + 0.8),
            draw=draw_forces,
            kind="png",
        ),
    ]


def summary_picture(case: str, analysis: Analysis, scene: Scene, model: ModelCurves) -> Picture:
    """The question and the answer side by side: chains that buckle, and their force against the model's."""
    averages = analysis.averages[analysis.averages["case"] == case]

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=(1.05, 1))
        draw_scene(scene, left)
        left.set_title("force chains (blue) and segments that buckle")
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
        kind="png",
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


def network_picture(analysis: Analysis, run: Run, strain: float) -> Picture:
    """The network of one run at the snapshot nearest to an axial strain: its chains then, and what buckles in a drop.

    Within a drop the segments that buckle in it are coloured; elsewhere there are none. InputError for a strain the
    run does not reach.
    """
    low, high = float(run.axial_strain[0]), float(run.axial_strain[-1])
    if not low <= strain <= high:
        raise InputError(f"run {run.name}: expected an axial strain from {low:g} to {high:g}, found {strain:g}")
    snapshot = run.snapshot(int(np.abs(run.axial_strain - strain).argmin()))
    drops = analysis.drops[analysis.drops["run"] == run.name]
    around = drops[(drops["start"] <= strain) & (strain <= drops["end"])]
    segments, classes = np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64)
    if len(around):
        yielding = of_drop(analysis.yielding, run.name, int(around["drop"].iloc[0]))
        if len(yielding):
            segments = yielding[["particle_1", "particle_2", "particle_3"]].to_numpy(dtype=np.int64)
            classes = yielding["buckling_class"].to_numpy(dtype=np.int64)
    in_chain = find_chains(snapshot, options_of(analysis)).in_chain
    width, height = np.ptp(snapshot.position, axis=0)

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        draw_network(snapshot, in_chain, segments, classes, ax)
        ax.set_title(f"axial strain {snapshot.axial_strain:.4f}")
        if len(segments):
            figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)

    told = (
        f"{run.name}, axial strain {snapshot.axial_strain:.4f}: {int(in_chain.sum())} of {len(in_chain)} discs are in "
    )
    return Picture(
        name=f"network-{run.name}-{snapshot.axial_strain:.4f}",
        caption=told + "force chains.",
        alternative=told + "force chains.",
        size=(7.5, 6.9 * float(height / width) + 0.8),
        draw=draw,
        kind="png",
    )
