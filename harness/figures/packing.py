"""Pictures of the packing: discs, contact forces, force chains, buckled segments."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.patches import Rectangle

from forcechain.arrays import BoolArray, FloatArray, IntArray
from forcechain.observe.snapshot import Snapshot
from harness.figures.style import CLASS_COLOURS, STRONG, look

CLASS_NAMES = {0: "not classed", 1: "both elastic", 2: "together", 3: "support first", 4: "chain moment first"}
PUNCH = -5
STRAIGHT_UP = 1 - 1e-9  # normal of a contact with the punch's face; at its edges it leans
PUNCH_HEIGHT = 0.04  # of the bed's, in a picture


def plot_discs(snapshot: Snapshot, *, ax: Axes, members: BoolArray | None = None, colour: str = STRONG) -> Axes:
    """Draw every disc, those in `members` (n_particles,) filled with `colour`, and a punch's face. In millimetres."""
    if members is None:
        members = np.zeros(snapshot.n_particles, dtype=bool)
    _fill(snapshot, ~members, ax=ax, facecolors=look().disc, edgecolors=look().disc_edge)
    _fill(snapshot, members, ax=ax, facecolors=colour, edgecolors=look().chain_edge)
    _plot_punch_face(snapshot, ax)
    return _frame(snapshot, ax)


def _plot_punch_face(snapshot: Snapshot, ax: Axes) -> None:
    """Draw the face of the punch, if there is one, as a bar over the discs that touch it from below."""
    touching = (snapshot.contact_ids[:, 1] == PUNCH) & (snapshot.contact_normal[:, 1] > STRAIGHT_UP)
    if not touching.any():
        return
    disc = snapshot.contact_ids[touching, 0]
    x, reach = snapshot.position[disc, 0], snapshot.radius[disc]
    face = float((snapshot.position[disc, 1] + reach - snapshot.overlap[touching]).mean())
    left, right = float((x - reach).min()), float((x + reach).max())
    size = (1e3 * (right - left), PUNCH_HEIGHT * float(np.ptp(snapshot.position[:, 1])) * 1e3)
    ax.add_patch(Rectangle((1e3 * left, 1e3 * face), *size, facecolor=look().soft, edgecolor="none", clip_on=False))


def full_width_force(snapshot: Snapshot) -> float:
    """Return the normal force [N] drawn as wide as a line becomes, the 99.5th percentile; 0 without contacts."""
    return float(np.percentile(snapshot.normal_force, 99.5)) if snapshot.n_contacts else 0.0


def plot_forces(
    snapshot: Snapshot,
    *,
    ax: Axes,
    colour: str | None = None,
    full_width: float = 3.0,
    full_force: float | None = None,
) -> Axes:
    """Draw every contact's normal force as a line between the centres, as wide as the force is large.

    `full_width` is the width in points of a force `full_force` [N] in a packing of 600 discs; it shrinks with the discs
    of a larger one. Without a `full_force` it is the snapshot's own; pictures to be compared need a common one.
    Without a `colour` lines have that of the writing.
    """
    if snapshot.n_contacts == 0:
        return _frame(snapshot, ax)
    first, second = snapshot.contact_ids[:, 0], snapshot.contact_ids[:, 1]
    end = np.where((second >= 0)[:, None], snapshot.position[np.maximum(second, 0)], snapshot.contact_point)
    lines = 1e3 * np.stack((snapshot.position[first], end), axis=1)
    scale = full_width_force(snapshot) if full_force is None else full_force
    full_width *= min(1.0, np.sqrt(600 / snapshot.n_particles))
    width = full_width * snapshot.normal_force / scale if scale > 0 else np.zeros(snapshot.n_contacts)
    ax.add_collection(LineCollection(list(lines), linewidths=width, colors=colour or look().ink, capstyle="round"))
    return _frame(snapshot, ax)


def plot_segments(snapshot: Snapshot, segments: IntArray, classes: IntArray, *, ax: Axes) -> Axes:
    """Draw three-particle segments (n_segments, 3) as bent lines with their discs, coloured by class (0: none)."""
    # Lines of a fixed width would cover the discs of a large packing, and with them the colours.
    width = min(1.6, 1.6 * np.sqrt(600 / snapshot.n_particles))
    for number, name in CLASS_NAMES.items():
        of_class = segments[classes == number]
        if len(of_class) == 0:
            continue
        colour = CLASS_COLOURS.get(number, "0.4")
        _fill(snapshot, np.unique(of_class), ax=ax, facecolors=colour, edgecolors=look().chain_edge, alpha=0.75)
        lines = list(1e3 * snapshot.position[of_class])
        ax.add_collection(LineCollection(lines, linewidths=width, colors=look().ink, capstyle="round"))
        ax.plot([], [], "o", color=colour, markersize=6, label=f"{name} ({len(of_class)})")
    return _frame(snapshot, ax)


def plot_filters(
    snapshot: Snapshot,
    in_chain: BoolArray,
    lost_energy: BoolArray,
    segments: IntArray,
    classes: IntArray,
    *,
    axes: tuple[Axes, Axes, Axes],
) -> tuple[Axes, Axes, Axes]:
    """Draw the three successive filters side by side, as the paper's Fig. 1 does.

    (a) particles in force chains, (b) those of them that lost potential energy over the drop, (c) buckled segments.
    """
    stored = in_chain & lost_energy
    plot_discs(snapshot, ax=axes[0], members=in_chain)
    axes[0].set_title(f"(a) in force chains: {int(in_chain.sum())} of {snapshot.n_particles} discs")
    plot_discs(snapshot, ax=axes[1], members=stored)
    axes[1].set_title(f"(b) of these, lost potential energy: {int(stored.sum())}")
    plot_discs(snapshot, ax=axes[2])
    plot_segments(snapshot, segments, classes, ax=axes[2])
    axes[2].set_title(f"(c) buckled segments: {len(segments)}")
    return axes


def _fill(snapshot: Snapshot, which: BoolArray | IntArray, *, ax: Axes, **look: Any) -> None:
    """Draw the discs `which`, a mask or numbers, each as large as it is."""
    diameter = 2e3 * snapshot.radius[which]
    ax.add_collection(
        EllipseCollection(
            diameter,
            diameter,
            np.zeros(len(diameter)),
            units="xy",
            offsets=1e3 * snapshot.position[which],
            offset_transform=ax.transData,
            linewidths=0.3,
            **look,
        )
    )


def _frame(snapshot: Snapshot, ax: Axes) -> Axes:
    reach: FloatArray = snapshot.radius[:, None]
    low = 1e3 * (snapshot.position - reach).min(axis=0)
    high = 1e3 * (snapshot.position + reach).max(axis=0)
    margin = 0.01 * float((high - low).max())
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_aspect("equal")
    ax.set_xlabel("x [mm]")
    ax.set_ylabel("y [mm]")
    return ax
