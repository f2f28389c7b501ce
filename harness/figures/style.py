"""One look for every figure: the style sheet, the colours by meaning, and labels of the form "symbol [unit]"."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from importlib.resources import as_file, files
from typing import Any

import matplotlib as mpl

mpl.use("Agg", force=False)  # figures are written to files; a library never opens a window

THEORY: dict[str, Any] = {"color": "black", "linestyle": "--", "linewidth": 1.4}
DATA = "#0072B2"
PAPER = "#D55E00"
STRONG = "#0072B2"  # force chains
WEAK = "0.75"  # everything else
# The four classes of buckled segments, by the order in which supports and chain moments yield.
CLASS_COLOURS = {1: "#56B4E9", 2: "#E69F00", 3: "#009E73", 4: "#D55E00"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """The colours that follow the background: of what is written, of discs, of data."""

    dark: bool
    page: str
    ink: str
    soft: str
    disc: str
    disc_edge: str
    chain: str
    chain_edge: str
    data: str
    data_soft: str


LIGHT = Look(
    dark=False,
    page="white",
    ink="black",
    soft="0.45",
    disc="0.93",
    disc_edge="0.78",
    chain="#BBD7EA",
    chain_edge="white",
    data=DATA,
    data_soft="#9CC5E3",
)
DARK = Look(
    dark=True,
    page="#12171D",
    ink="#E6EDF3",
    soft="0.62",
    disc="#222A33",
    disc_edge="#39434E",
    chain="#23506F",
    chain_edge="#12171D",
    data="#56B4E9",
    data_soft="#2F6C90",
)
_look: ContextVar[Look] = ContextVar("look", default=LIGHT)


def look() -> Look:
    """Return the colours of the style in force: light outside of any."""
    return _look.get()


@contextmanager
def style(*, dark: bool = False) -> Iterator[None]:
    """Draw within this context to get the project's look, on a light or a dark ground."""
    with as_file(files("harness.figures") / "forcechain.mplstyle") as sheet:
        parameters = mpl.rc_params_from_file(sheet, use_default_template=False)
    if dark:
        with as_file(files("harness.figures") / "forcechain-dark.mplstyle") as sheet:
            parameters.update(mpl.rc_params_from_file(sheet, use_default_template=False))
    token = _look.set(DARK if dark else LIGHT)
    try:
        with mpl.rc_context(parameters):
            yield
    finally:
        _look.reset(token)


def label(symbol: str, unit: str = "") -> str:
    """Text of an axis: "symbol [unit]"; no bracket for a number without a unit.

    >>> label("axial strain"), label("$F$", "N")
    ('axial strain', '$F$ [N]')
    """
    return f"{symbol} [{unit}]" if unit not in ("", "-") else symbol
