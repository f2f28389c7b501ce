"""Text dumps of LAMMPS and LIGGGHTS (`dump custom`, `dump local`): frames of named columns, by their time step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from harness.errors import InputError
from harness.reading.tables import Table

ATOMS, PAIRS = "atoms", "pairs"
SECTIONS = {"ITEM: ATOMS": ATOMS, "ITEM: ENTRIES": PAIRS}
COUNT = "ITEM: NUMBER OF"  # ATOMS or ENTRIES
MOST_ROWS = 100_000_000  # a larger count is a damaged line; no such dump would be text


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One frame of a dump: where it is, and its header.

    Attributes:
        path: the file.
        kind: "atoms" or "pairs".
        time_step: its number.
        time: as the dump tells it [s], or None.
        box: (lower, upper) of x and of y [m].
        columns: names as in the file.
        n_rows: number of rows.
        offset: position of the first row in the file.
    """

    path: Path
    kind: str
    time_step: int
    time: float | None
    box: tuple[tuple[float, float], tuple[float, float]]
    columns: tuple[str, ...]
    n_rows: int
    offset: int

    @property
    def where(self) -> str:
        """Words that say which frame this is."""
        return f"{self.path.name}: time step {self.time_step}: {self.kind}"

    def read(self, names: Sequence[str] | None = None) -> Table:
        """Return the columns (n_rows,) of the frame, called by `names` in order, or as in the file.

        Raises InputError when the names are not as many as the columns, or rows are missing or of another length.
        """
        called = tuple(names) if names is not None else self.columns
        if len(called) != len(self.columns):
            raise InputError(
                f"{self.where}: expected {len(self.columns)} names of columns, one for each of "
                f"{' '.join(self.columns)}, found {len(called)}"
            )
        repeated = next((name for name, count in Counter(called).items() if count > 1), None)
        if repeated is not None:
            raise InputError(f"{self.where}: column {repeated!r} is there twice; name every column once")
        with self.path.open(encoding="utf-8", errors="replace") as file:
            file.seek(self.offset)
            rows = [file.readline().split() for _ in range(self.n_rows)]
        for number, row in enumerate(rows):
            if len(row) != len(called):
                raise InputError(
                    f"{self.where} row {number}: expected {len(called)} values, found {len(row)}; "
                    "the dump was cut short or is still being written"
                )
        columns = zip(*rows, strict=True) if rows else [()] * len(called)
        return {name: _numbers_or_words(column) for name, column in zip(called, columns, strict=True)}


def find_frames(source: Path) -> tuple[dict[int, Frame], dict[int, Frame]]:
    """Return the frames of atoms and of pairs in the dumps in the folder `source`, each by its time step.

    A file that does not begin with "ITEM:" is no dump and passed over. Raises InputError when there is no dump, one is
    broken, or a time step is there twice.
    """
    if not source.is_dir():
        what = "a file" if source.exists() else "nothing of that name"
        raise InputError(f"{source}: expected a folder with dumps of atoms and of pairs, found {what}")
    found: dict[str, dict[int, Frame]] = {ATOMS: {}, PAIRS: {}}
    for path in sorted(path for path in source.iterdir() if path.is_file()):
        for frame in _frames(path):
            other = found[frame.kind].setdefault(frame.time_step, frame)
            if other is not frame:
                raise InputError(f"{frame.where}: this time step is in {other.path.name} as well")
    for kind, section in ((ATOMS, "ITEM: ATOMS"), (PAIRS, "ITEM: ENTRIES")):
        if not found[kind]:
            raise InputError(f"{source}: expected text dumps of {kind} ({section!r} in their header), found none")
    return found[ATOMS], found[PAIRS]


def _frames(path: Path) -> Iterator[Frame]:
    with path.open("rb") as start:
        if not start.read(64).lstrip().startswith(b"ITEM:"):
            return
    with path.open(encoding="utf-8", errors="replace") as file:
        header: dict[str, list[str]] = {}
        while line := file.readline():
            if not line.startswith("ITEM:"):
                if line.strip():
                    raise InputError(f"{path.name}: expected a line with ITEM:, found {line.strip()[:40]!r}")
                continue
            section = next((name for name in SECTIONS if line.startswith(name)), None)
            if section is None:
                header[" ".join(line.split()[:3])] = _header_lines(file, line)
                continue
            frame = _frame(path, SECTIONS[section], header, tuple(line.split()[2:]), file.tell())
            for _ in range(frame.n_rows):
                if not file.readline():
                    raise InputError(
                        f"{frame.where}: expected {frame.n_rows} rows, found fewer; the dump was cut short"
                    )
            yield frame
            header = {}
        if header:
            raise InputError(f"{path.name}: its last frame has no rows; the dump was cut short")


def _header_lines(file: TextIO, line: str) -> list[str]:
    if line.startswith("ITEM: BOX BOUNDS"):
        return [line, *(file.readline() for _ in range(3))]
    return [line, file.readline()]


def _frame(path: Path, kind: str, header: Mapping[str, list[str]], columns: tuple[str, ...], offset: int) -> Frame:
    units = header.get("ITEM: UNITS", ["", "si"])[1].strip()
    if units != "si":
        raise InputError(f"{path.name}: expected a dump in SI units (units si), found units {units[:20]!r}")

    def number(name: str, what: type[int] | type[float]) -> Any:
        try:
            return what(header[name][1])
        except (KeyError, ValueError):
            found = header[name][1].strip()[:40] if name in header else "nothing"
            raise InputError(f"{path.name}: expected a number below {name!r}, found {found!r}") from None

    n_rows = number(COUNT, int)
    if not 0 <= n_rows <= MOST_ROWS:
        raise InputError(f"{path.name}: expected a number of rows from 0 to {MOST_ROWS}, found {n_rows}")
    return Frame(
        path=path,
        kind=kind,
        time_step=number("ITEM: TIMESTEP", int),
        time=number("ITEM: TIME", float) if "ITEM: TIME" in header else None,
        box=_box(path, header),
        columns=columns,
        n_rows=n_rows,
        offset=offset,
    )


def _box(path: Path, header: Mapping[str, list[str]]) -> tuple[tuple[float, float], tuple[float, float]]:
    lines = header.get("ITEM: BOX BOUNDS", [])
    if lines and "xy" in lines[0].split():
        raise InputError(f"{path.name}: expected a rectangular box, found one that is tilted")
    try:
        (left, right), (bottom, top) = (map(float, line.split()[:2]) for line in lines[1:3])
    except ValueError:
        raise InputError(f"{path.name}: expected the bounds of the box below 'ITEM: BOX BOUNDS'") from None
    return (left, right), (bottom, top)


def _numbers_or_words(column: Sequence[str]) -> Any:
    try:
        return np.array(column, dtype=np.float64)
    except ValueError:
        return np.array(column, dtype=object)
