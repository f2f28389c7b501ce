"""The paper's figures in our own drawing: packing, stress ratio, buckling data on the model's curves, the model."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from PIL import Image as Bitmap

from harness.analysing.buckling_data import Analysis
from harness.analysing.sensitivity import sensitivity_picture
from harness.comparing.comparison import ModelCurves
from harness.figures.style import style
from harness.figures.theory import configurations_figure, sweeps_figure
from harness.reading.exports import Run
from harness.report.pictures import Picture, behaviour_picture, buckling_picture, packing_pictures
from harness.report.scenes import busiest_scene

KIND = "png"  # a page of text shows it anywhere
COLOURS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Image:
    """A picture as a file beside the page: its name, content, caption, and words instead of it."""

    name: str
    content: bytes
    caption: str
    alternative: str


def first_figures(case: str, analysis: Analysis, runs: Mapping[str, Run]) -> list[Image]:
    """Fig. 1(a)-(c), of the case's drop with the most buckled segments; none without its snapshots."""
    scene = busiest_scene(analysis, runs, case)
    return [] if scene is None else [_image(packing_pictures(case, analysis, scene)[0], "filters")]


def case_figures(
    case: str, place: int, analysis: Analysis, runs: Mapping[str, Run], curves: Mapping[str, ModelCurves]
) -> list[Image]:
    """Stress ratio with its drops, and Fig. 4 where there are buckled segments."""
    found = [_image(behaviour_picture(case, analysis, runs), f"behaviour-{place}")]
    if case in curves:
        found.append(_image(buckling_picture(case, analysis, curves[case]), f"buckling-{place}"))
    return found


def sweep_figure(case: str, sweep: pd.DataFrame) -> Image:
    """What each choice of the analysis moves, of one case's rows."""
    return _image(sensitivity_picture(sweep[sweep["case"] == case], case), "choices")


def model_figures() -> list[Image]:
    """Figs. 5 and 6, with the parameters of Table 3."""
    return [
        Image(
            name=f"configurations.{KIND}",
            content=_drawn(configurations_figure),
            caption="The paper's Fig. 5: from the straight chain to the unloaded one, with the void that opens.",
            alternative="Five configurations of a chain of three discs and its neighbours.",
        ),
        Image(
            name=f"sweeps.{KIND}",
            content=_drawn(sweeps_figure),
            caption="The paper's Fig. 6: axial force against displacement, one parameter varied a panel; arrows are "
            "snapdowns, dotted lines start with an imperfection of 2 degrees.",
            alternative="Six panels of axial force against axial displacement, each with three or four curves.",
        ),
    ]


def _image(picture: Picture, name: str) -> Image:
    return Image(
        name=f"{name}.{KIND}",
        content=_few_colours(picture.render(KIND)),
        caption=picture.caption,
        alternative=picture.alternative,
    )


def _drawn(make: Callable[[], Figure]) -> bytes:
    buffer = io.BytesIO()
    with style():
        figure = make()
        figure.savefig(buffer, format=KIND, metadata={"Software": None})
        plt.close(figure)
    return _few_colours(buffer.getvalue())


def _few_colours(png: bytes) -> bytes:
    buffer = io.BytesIO()
    with Bitmap.open(io.BytesIO(png)) as bitmap:  # by coverage: by frequency, rare colours that mean something merge
        few = bitmap.convert("RGB").quantize(COLOURS, Bitmap.Quantize.MAXCOVERAGE, dither=Bitmap.Dither.NONE)
        few.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
