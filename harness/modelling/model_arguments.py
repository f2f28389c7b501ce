"""What stands on the command line of `forcechain model`: names, numbers, parameters."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from typing import Any, TypeVar

from forcechain.theory.parameters import TABLE_3_RATIOS, ChainParameters
from harness.errors import InputError

Result = TypeVar("Result")


def parse_settings(settings: list[str]) -> dict[str, float]:
    """Turn NAME=VALUE texts into values; InputError names what is wrong and what was probably meant."""
    given: dict[str, float] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise InputError(f"--set {setting}: expected NAME=VALUE, for example --set rolling_friction=0.05")
        name = name.strip()
        check_name("--set", name)
        if name in given:
            raise InputError(f"--set {name}: given twice")
        given[name] = parse_numbers(f"--set {name}", text, most=1)[0]
    return given


def parse_sweep(text: str) -> tuple[str, list[float]]:
    """Turn NAME=A,B,... into the name and its values."""
    name, equals, values = text.partition("=")
    if not equals:
        raise InputError(f"--sweep {text}: expected NAME=A,B,..., for example --sweep rolling_friction=0.02,0.2")
    check_name("--sweep", name.strip())
    return name.strip(), parse_numbers(f"--sweep {name.strip()}", values)


def check_name(option: str, name: str) -> None:
    """Raise InputError unless `name` is a parameter of the model."""
    if name in TABLE_3_RATIOS:
        return
    close = difflib.get_close_matches(name, TABLE_3_RATIOS, 1)
    hint = f"did you mean {close[0]}?" if close else "known: " + ", ".join(TABLE_3_RATIOS)
    raise InputError(f"{option} {name}: no such parameter; {hint}")


def parse_numbers(option: str, text: str, most: int | None = None) -> list[float]:
    """Turn "A,B,..." into finite numbers."""
    numbers = []
    for part in text.split(","):
        try:
            number = float(part)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"{option}: expected a finite number, found {part.strip()!r}")
        numbers.append(number)
    if most is not None and len(numbers) > most:
        raise InputError(f"{option}: expected one number, found {len(numbers)}")
    return numbers


def parse_count(option: str, text: str) -> int:
    """Turn a text into a whole number."""
    number = parse_numbers(option, text, most=1)[0]
    if not number.is_integer():
        raise InputError(f"{option}: expected a whole number, found {text}")
    return int(number)


def guarded(work: Callable[[], Result]) -> Result:
    """Return what `work` returns; the theory's ValueError, one line already, becomes an InputError."""
    try:
        return work()
    except ValueError as error:
        raise InputError(f"model: {error}") from None


def chain_parameters(values: dict[str, Any]) -> ChainParameters:
    """Table 3 with `values`; InputError for what the model does not admit."""
    return guarded(lambda: ChainParameters.from_ratios(**values))
