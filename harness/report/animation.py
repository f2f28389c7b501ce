"""A drop as an animation: its packing beside the stress ratio and the force of its segments, an increment a frame."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.figure import Figure
from PIL import Image

from forcechain.observe.chains import find_chains
from harness.analysing.buckling_data import Analysis
from harness.comparing.comparison import ModelCurves
from harness.errors import InputError
from harness.figures.drop_frames import DropFrames
from harness.figures.style import style
from harness.reading.exports import Run
from harness.report.scenes import Scene, busiest_drops, is_there, of_drop, options_of, scene_of
from yade_scripts.run_folder import write

FORMATS = (".gif", ".mp4")
FRAME_MS = 140
HOLD_MS = 1200  # the last frame, before it begins anew
DPI = 100
COLOURS = 128


def animation_format(path: Path) -> str:
    """Return ".gif" or ".mp4"; InputError for another ending, or for an MP4 without ffmpeg."""
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise InputError(f"--animate {path}: expected a name that ends in .gif or .mp4, found {kind or 'no ending'}")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        raise InputError(
            f"--animate {path}: an MP4 needs ffmpeg, found none; apt-get install ffmpeg, or ask for a .gif"
        )
    return kind


def write_animation(
    analysis: Analysis,
    runs: Mapping[str, Run],
    curves: Mapping[str, ModelCurves],
    path: Path,
    *,
    run: str | None = None,
    drop: int | None = None,
    dark: bool = False,
) -> Path:
    """Write one drop as an animation to `path` (.gif or .mp4), whole or not at all, and return it.

    Without `run` and `drop` it is the drop with the most buckled segments (of the run). InputError for a run without
    such a drop, snapshots that were not kept, or a format that cannot be had.
    """
    kind = animation_format(path)
    scene = _chosen(analysis, runs, run, drop)
    path.parent.mkdir(parents=True, exist_ok=True)
    with style(dark=dark):
        figure = plt.figure(figsize=(9.0, max(4.2, 5.2 * scene.aspect + 0.7)), dpi=DPI)
        try:
            frames = _frames(figure, analysis, runs[scene.run], scene, curves.get(scene.case))
            if kind == ".gif":
                write(path.parent, path.name, _gif(figure, frames))
            else:
                _mp4(figure, frames, path)
        finally:
            plt.close(figure)
    return path


def _chosen(analysis: Analysis, runs: Mapping[str, Run], run: str | None, drop: int | None) -> Scene:
    there = [key for key in busiest_drops(analysis) if run in (None, key[0])]
    fitting = [key for key in there if drop in (None, key[1])]
    if not fitting:
        known = f"drops 1 to {len(there)}" if there else "no drop"
        wanted = "a drop" if drop is None else f"drop {drop}"
        raise InputError(f"{'the study' if run is None else f'run {run}'}: expected {wanted} to animate, found {known}")
    for name, number in fitting:
        scene = scene_of(analysis, runs, name, number)
        if scene is not None:
            return scene
    raise InputError(f"{analysis.directory}: these reduced results keep no snapshots of that drop; run its study")


def _frames(figure: Figure, analysis: Analysis, run: Run, scene: Scene, model: ModelCurves | None) -> Iterator[None]:
    """Draw one increment after the other on `figure`."""
    options = options_of(analysis)
    segments = of_drop(analysis.segments, scene.run, scene.drop)
    drawn = DropFrames(
        figure,
        segments=scene.segments,
        classes=scene.classes,
        averages=segments.groupby("increment")[["buckling_angle_deg", "axial_force_N"]].mean()
        if len(scene.segments)
        else None,
        history=run.history,
        ends=(scene.start, scene.end),
        parameters=None if model is None else model.parameters,
    )
    for step, row in enumerate(scene.rows):
        if is_there(run, int(row)):
            snapshot = run.snapshot(int(row))
            drawn.show(step, snapshot, find_chains(snapshot, options).in_chain)
            if row == scene.rows[0]:
                figure.canvas.draw()  # the layout settles when drawn a second time
            yield
            figure.set_layout_engine("none")  # drawn once, everything keeps its place


def _gif(figure: Figure, frames: Iterator[None]) -> bytes:
    """Frames as a GIF of one palette, which is smaller and does not flicker."""
    images = []
    for _ in frames:
        figure.canvas.draw()
        images.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()))  # type: ignore[attr-defined]
    palette = images[len(images) // 2].quantize(COLOURS, Image.Quantize.FASTOCTREE)
    few = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    buffer = io.BytesIO()
    times = [FRAME_MS] * (len(few) - 1) + [HOLD_MS]
    few[0].save(buffer, "GIF", save_all=True, append_images=few[1:], duration=times, loop=0, optimize=True)
    return buffer.getvalue()


def _mp4(figure: Figure, frames: Iterator[None], path: Path) -> None:
    writer = FFMpegWriter(fps=round(1000 / FRAME_MS), codec="libx264", extra_args=["-pix_fmt", "yuv420p", "-crf", "20"])
    temporary = path.with_name(f".{path.stem}.part.mp4")
    try:
        width, height = figure.get_size_inches()  # the codec wants even numbers of pixels
        figure.set_size_inches(2 * round(width * DPI / 2) / DPI, 2 * round(height * DPI / 2) / DPI)
        with writer.saving(figure, str(temporary), DPI):
            for _ in frames:
                writer.grab_frame()
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
