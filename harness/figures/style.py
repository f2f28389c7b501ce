"""One look for every figure: the style sheet, the colours by meaning, and labels of the form "symbol [unit]"."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
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


@contextmanager
def style() -> Iterator[None]:
    """Draw within this context to get the project's look."""
    with as_file(files("harness.figures") / "forcechain.mplstyle") as sheet:
        parameters = mpl.rc_params_from_file(sheet, use_default_template=False)
    with mpl.rc_context(parameters):
        yield


def label(symbol: str, unit: str = "") -> str:
    """Text of an axis: "symbol [unit]"; no bracket for a number without a unit.

    >>> label("axial strain"), label("$F$", "N")
    ('axial strain', '$F$ [N]')
    """
    return f"{symbol} [{unit}]" if unit not in ("", "-") else symbol
