"""Settings of an import: what the files of another code do not say, given as --set NAME=VALUE."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence

from harness.errors import InputError


def read_settings(given: Sequence[str], known: Mapping[str, str]) -> dict[str, float]:
    """Return the settings by name; InputError for an unknown name, one given twice, or a value that is no number.

    >>> read_settings(["friction=0.5"], {"friction": "coefficient of sliding friction [-]"})
    {'friction': 0.5}
    """
    found: dict[str, float] = {}
    for setting in given:
        name, equals, text = (part.strip() for part in setting.partition("="))
        if not equals:
            raise InputError(f"--set {setting}: expected NAME=VALUE, for example --set friction=0.5")
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {close[0]}?" if close else "known: " + (", ".join(known) or "none with this format")
            raise InputError(f"--set {name}: no such setting; {hint}")
        if name in found:
            raise InputError(f"--set {name}: given twice")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f"--set {name}: expected a finite number, found {text!r}")
        found[name] = value
    return found
