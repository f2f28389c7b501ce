"""Plain text tables for the terminal, and numbers written with no more digits than their uncertainty bears."""

from __future__ import annotations

import math
from collections.abc import Sequence


def number(value: float | None, digits: int = 3) -> str:
    """Write a number with `digits` significant digits; a dash for none.

    >>> number(0.66), number(10.9424), number(None)
    ('0.66', '10.9', '-')
    """
    if value is None:
        return "-"
    if not math.isfinite(value):
        return str(value)
    return f"{value:.{digits}g}"


def with_error(value: float | None, standard_error: float | None) -> str:
    """Write a mean with two standard errors, both to the second digit of the error.

    >>> with_error(14.0589, 1.2), with_error(0.8476, None), with_error(None, None)
    ('14.1 ± 2.4', '0.848', '-')
    """
    if value is None or standard_error is None or not standard_error > 0:
        return number(value)
    decimals = max(0, 1 - math.floor(math.log10(2 * standard_error)))
    return f"{value:.{decimals}f} ± {2 * standard_error:.{decimals}f}"


def render(header: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Lay out a table in columns two spaces apart; columns whose numbers are in `right` are set to the right.

    >>> print(render(("a", "b"), (("x", "1"), ("yy", "22")), right=(1,)))
    a    b
    --  --
    x    1
    yy  22
    """
    table = [list(header), *[list(row) for row in rows]]
    widths = [max(len(row[column]) for row in table) for column in range(len(header))]
    table.insert(1, ["-" * width for width in widths])
    lines = []
    for row in table:
        cells = [
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
