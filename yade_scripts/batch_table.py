"""Parameter tables of yade-batch: a run a line, read as they are and never evaluated. No YADE.

A table is text: the first line that is not blank names the columns, every further one is a run.

    # comments run to the end of the line
    rolling_friction   seed   size_distribution   !THREADS
    0.2                1      'bidisperse'        1
    =                  2      =                   =
    0.05               1      *                   1

`=` is the value of the line before, `*` the parameter's default. Columns whose names begin with `!` are yade-batch's
own and `description` names its log, so that neither is a parameter; a `!` at a name's end is dropped.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from yade_scripts import parameters

VARIABLE = "YADE_BATCH"  # the environment's variable by which yade-batch tells a script its table and line
DESCRIPTION = "description"
SAME, DEFAULT = "=", "*"


class Row(NamedTuple):
    """One run of a table: its line, as an editor counts, and the parameters that the line gives.

    `varied` are those of them that are not the same in every line of the table, but for the seed.
    """

    line: int
    values: dict[str, Any]
    varied: dict[str, Any]


class TableError(ValueError):
    """A table that cannot be read; the message is one line."""


def read(path: Path) -> list[Row]:
    """Read every run of a table, in order; TableError in one line where it is wrong.

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder) / "runs.table"
    ...     _ = table.write_text("friction seed  # two runs\\n0.7 1\\n= 2\\n")
    ...     [(row.line, row.values) for row in read(table)]
    [(2, {'friction': 0.7, 'seed': 1}), (3, {'friction': 0.7, 'seed': 2})]
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TableError(f"{path}: expected a table of yade-batch, which cannot be read: {error}") from None
    lines = [(number, line.partition("#")[0].split()) for number, line in enumerate(text.splitlines(), 1)]
    lines = [(number, words) for number, words in lines if words]
    if len(lines) < 2:
        raise TableError(f"{path}: expected a line of column names and at least one run, found {len(lines)} lines")
    names = [word if word.startswith("!") else word.removesuffix("!") for word in lines[0][1]]
    for name in names:
        if names.count(name) > 1:
            raise TableError(f"{path}:{lines[0][0]}: column {name!r} stands there twice; keep one")
    rows: list[tuple[int, dict[str, Any]]] = []
    before: list[str] | None = None
    for number, words in lines[1:]:
        where = f"{path}:{number}"
        if len(words) != len(names):
            raise TableError(
                f"{where}: expected {len(names)} values, one a column, found {len(words)}; values have no blanks"
            )
        if SAME in words and before is None:
            raise TableError(f"{where}: {SAME!r} is the value of the line before, and this is the first; write it out")
        words = [old if word == SAME else word for word, old in zip(words, before or words, strict=True)]
        rows.append((number, _values(names, words, where)))
        before = words
    one = rows[0][1]
    fixed = {name for name in one if all(name in values and values[name] == one[name] for _, values in rows)}
    return [
        Row(number, values, {name: value for name, value in values.items() if name not in fixed and name != "seed"})
        for number, values in rows
    ]


def runs(path: Path, table: tuple[parameters.Parameter, ...]) -> list[Row]:
    """Read every run of a table and check its parameters against `table`; TableError in one line where one is wrong."""
    rows = read(path)
    for row in rows:
        try:
            parameters.check(row.values, table)
        except parameters.ParameterError as error:
            raise TableError(f"{path}:{row.line}: {error}") from None
    return rows


def asked_for(environment: Mapping[str, str] = os.environ) -> tuple[Path, int] | None:
    """Table and line of which yade-batch has started this run, or None; TableError when it names no line.

    >>> asked_for({"YADE_BATCH": "runs.table:7"})[1]
    7
    """
    text = environment.get(VARIABLE, "")
    if not text:  # there, but empty: yade-batch runs the script alone, without a table
        return None
    path, _, line = text.rpartition(":")
    if not path or not line.isdecimal():
        raise TableError(f"{VARIABLE}={text}: expected TABLE:LINE, as yade-batch sets it; unset it to run by hand")
    return Path(path), int(line)


def _values(names: list[str], words: list[str], where: str) -> dict[str, Any]:
    values = {}
    for name, word in zip(names, words, strict=True):
        if name.startswith("!") or name == DESCRIPTION or word == DEFAULT:
            continue
        try:
            values[name] = _value(word)
        except ValueError:
            raise TableError(
                f"{where}: {name}: expected a number, 'text' in quotes, True or False, found {word}; "
                "a table is read, not evaluated"
            ) from None
    return values


def _value(word: str) -> bool | int | float | str:
    if word in ("True", "False"):
        return word == "True"
    quoted = re.fullmatch(r"(['\"])([^'\"\\]*)\1", word)
    if quoted:
        return quoted[2]
    with contextlib.suppress(ValueError):
        return int(word)
    return float(word)
