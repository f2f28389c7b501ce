"""TOML from plain values: what `tomllib` reads back unchanged."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
DELETE = "\x7f"  # a control character that JSON writes as it is and TOML does not take


def dumps(content: Mapping[str, Any]) -> str:
    """Write a mapping of numbers, words, truths, lists, mappings and lists of mappings; None is left out.

    Raises ValueError for a value of another kind, or a number that is not finite.

    >>> print(dumps({"format": 1, "cases": [{"name": "a", "values": [1.5, 2.0]}]}), end="")
    format = 1
    <BLANKLINE>
    [[cases]]
    name = "a"
    values = [1.5, 2.0]
    """
    return "\n".join(_lines(content, ())).lstrip("\n") + "\n"


def _lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    plain, tables, lists = [], [], []
    for name, value in table.items():
        if isinstance(value, Mapping):
            tables.append((name, value))
        elif _is_list_of_tables(value):
            lists.append((name, value))
        elif value is not None:
            plain.append(f"{_key(name)} = {_value(value, name)}")
    lines = plain
    for name, value in tables:
        here = (*path, _key(name))
        lines += ["", f"[{'.'.join(here)}]", *_lines(value, here)]
    for name, values in lists:
        here = (*path, _key(name))
        for value in values:
            lines += ["", f"[[{'.'.join(here)}]]", *_lines(value, here)]
    return lines


def _is_list_of_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) > 0 and all(isinstance(item, Mapping) for item in value)


def _key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else _text(name)


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False).replace(DELETE, "\\u007f")


def _value(value: Any, name: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ValueError(f"{name}: expected a finite number, found {value}")
        return repr(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Sequence):
        return "[" + ", ".join(_value(item, name) for item in value) + "]"
    raise ValueError(f"{name}: expected a number, words, true or false, a list or a table, found {value!r}")
