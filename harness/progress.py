"""How far long work is, and how long it will take: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

Item = TypeVar("Item")
BAR = "{desc}: {n}/{total} [{elapsed}, {remaining} left]"
SHOWN_AFTER_S = 0.5  # what is done by then needs no bar


def watched(items: Iterable[Item], doing: str, total: int) -> Iterator[Item]:
    """Yield `items`, `total` of them, while a terminal on standard error shows how many are done and the time left.

    The bar goes when the work is done: what was found is on standard output.
    """
    yield from tqdm(
        items,
        desc=doing,
        total=total,
        file=sys.stderr,
        bar_format=BAR,
        disable=not sys.stderr.isatty(),
        delay=SHOWN_AFTER_S,
        leave=False,
    )
