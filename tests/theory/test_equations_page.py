"""docs/equations.md is complete and true: every equation has a row, every row an existing function and test."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "equations.md"
NUMBERS = [*(str(number) for number in range(1, 31)), "A.1", "A.2"]
ROW = re.compile(r"^\| \(([^)]+)\) \| .+ \| `([\w.]+)` \| `(\w+)\.(\w+)` \|$")


def problems(page: str) -> list[str]:
    """Say what is missing or untrue in the page's table."""
    found, numbers = [], []
    for line in page.splitlines():
        if not line.startswith("| ("):
            continue
        row = ROW.match(line)
        if row is None:
            found.append(f"not a row: {line}")
            continue
        number, function, file, test = row.groups()
        numbers.append(number)
        if not function_exists(function):
            found.append(f"({number}): no function {function}")
        if test not in names_in(file):
            found.append(f"({number}): no test {file}.{test}")
    found += [f"({number}): no row" for number in NUMBERS if number not in numbers]
    found += [f"({number}): two rows" for number in set(numbers) if numbers.count(number) > 1]
    return found


def function_exists(path: str) -> bool:
    module, *names = path.split(".")
    try:
        thing = importlib.import_module(f"forcechain.theory.{module}")
    except ModuleNotFoundError:
        return False
    for name in names:
        if not hasattr(thing, name):
            return False
        thing = getattr(thing, name)
    return callable(thing)


def names_in(file: str) -> set[str]:
    path = ROOT / "tests" / "theory" / f"{file}.py"
    if not path.is_file():
        return set()
    return {node.name for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)}


def test_every_equation_has_a_function_and_a_test():
    assert problems(PAGE.read_text()) == []


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("| (17) |", "| 17 |", "(17): no row"),
        ("| (A.2) |", "| (A.3) |", "(A.2): no row"),
        ("`response.snapdowns`", "`response.snapups`", "no function response.snapups"),
        ("`energy.energies`", "`enrgy.energies`", "no function enrgy.energies"),
        ("`test_history.test_states", "`test_history.test_no_states", "no test test_history.test_no_states"),
        ("`test_cluster.", "`test_clusters.", "no test test_clusters."),
        ("| (2) | moment", "| (3) | moment", "(3): two rows"),
        ("| (9) | straight", "| (9) straight", "not a row"),
    ],
)
def test_a_page_with_a_slip_fails(old, new, complaint):
    page = PAGE.read_text()
    assert old in page
    assert any(complaint in problem for problem in problems(page.replace(old, new)))
