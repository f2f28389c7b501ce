"""`forcechain studies`: study files to start from, and everything that a study file can say."""

from __future__ import annotations

import argparse
import inspect
import itertools
import json
import re
import shutil
import textwrap
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from forcechain.observe.options import AnalysisOptions
from forcechain.theory.parameters import TABLE_3_RATIOS, ChainParameters
from harness.analysing.analysis_options import describe_options
from harness.bundled import bundled_results, bundled_studies, bundled_study
from harness.comparing.comparison import CALIBRATED
from harness.errors import EXIT_GOOD, InputError
from harness.exchange.new_folder import new_folder
from harness.study import RunSettings
from yade_scripts import parameters

HELP = "print a study file to start from, or everything that a study file can say"
EXAMPLE = "forcechain studies demo > mine.toml"
WIDTH = 79
TABLES = {
    "parameters": "[parameters], or with a list of values [grid]: the runs of the biaxial test",
    "punch": '[parameters] or [grid] where script = "punch": the runs of the flat punch',
    "run": "[run]: how to run, and when a run is valid",
    "analysis": "[analysis]: from tables to buckled segments",
    "compare": "[compare]: calibrated parameters of the model; forcechain calibrate finds them",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One name of a study file's table: its default as TOML has it (empty: none), unit and meaning."""

    name: str
    default: str
    unit: str
    meaning: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's arguments to `parser`."""
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument("name", nargs="?", metavar="NAME", help="a study to print (default: the list of them)")
    asked.add_argument(
        "--keys",
        choices=list(TABLES),
        metavar="TABLE",
        help=f"every name a table of a study file can have, with its default: {', '.join(TABLES)}",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="copy the results of NAME that come along to FOLDER: reduced, to compare, check and report without YADE",
    )
    parser.add_argument("--json", action="store_true", help="the list, or the keys, for machines")


def execute(options: argparse.Namespace) -> int:
    """Print a study, copy its results, print the names of one of its tables, or the list of studies."""
    if options.out is not None:
        if not options.name:
            raise InputError("--out: expected the name of a study as well, found none; forcechain studies lists them")
        source = bundled_results(options.name)
        with new_folder(options.out) as folder:
            shutil.copytree(source, folder, dirs_exist_ok=True)
        print(f"written: {options.out}")
        return EXIT_GOOD
    if options.keys:
        entries = keys(options.keys)
        print(json.dumps([asdict(entry) for entry in entries], indent=1) if options.json else toml(options.keys))
    elif options.name:
        print(bundled_study(options.name).read_text(encoding="utf-8"), end="")
    else:
        told = {name: _comment(file.read_text(encoding="utf-8")) for name, file in bundled_studies().items()}
        print(json.dumps(told, indent=1) if options.json else "\n".join(_described(*item) for item in told.items()))
    return EXIT_GOOD


def toml(table: str) -> str:
    """Return `table` with every name at its default and a comment to each, to be cut and pasted into a study file."""
    lines = [f"# {TABLES[table]}", f"[{'parameters' if table in parameters.TESTS else table}]"]
    for entry in keys(table):
        unit = f" [{entry.unit}]" if entry.unit != "-" else ""
        told = textwrap.wrap(f"{entry.meaning}{unit}", WIDTH, initial_indent="# ", subsequent_indent="# ")
        given = f"{entry.name} = {entry.default}" if entry.default else f"# {entry.name} = (no default)"
        lines += ["", *told, given]
    return "\n".join(lines)


def keys(table: str) -> tuple[Entry, ...]:
    """Return every name that `table` of a study file can have.

    >>> next(entry.default for entry in keys("parameters") if entry.name == "rolling_friction")
    '0.2'
    """
    if table in ("parameters", "punch"):
        return _parameters(parameters.TESTS["biaxial" if table == "parameters" else table])
    return {"run": _run, "analysis": _analysis, "compare": _compare}[table]()


def _parameters(known: Iterable[parameters.Parameter]) -> tuple[Entry, ...]:
    return tuple(
        Entry(
            name=parameter.name,
            default=_toml(parameter.default),
            unit=parameter.unit or "-",
            meaning=f"{parameter.meaning}; {parameter.expected().partition(' [')[0]}",
        )
        for parameter in known
        if parameter.name != "seed"  # the seeds stand at the top of the file
    )


def _run() -> tuple[Entry, ...]:
    meanings = _attributes(RunSettings)
    return tuple(
        Entry(
            name=field.name,
            default=_toml(field.default),
            unit="-",
            meaning=meanings[field.name].rstrip("."),
        )
        for field in fields(RunSettings)
    )


def _analysis() -> tuple[Entry, ...]:
    described = describe_options(AnalysisOptions())
    given = Entry(
        name="drops",
        default="",
        unit="-",
        meaning="axial strains [[start, end], ...] of the drops, instead of finding them",
    )
    limits: dict[str, Any] = {item.name: item.metadata for item in fields(AnalysisOptions)}
    entries = []
    for name, told in described.items():
        choices = limits.get(name.removesuffix("_deg"), {}).get("choices", ())
        one_of = f"; one of {', '.join(map(repr, choices))}" if choices else ""
        entries.append(
            Entry(name=name, default=_toml(told["value"]), unit=told["unit"], meaning=told["meaning"] + one_of)
        )
    return (*entries, given)


def _compare() -> tuple[Entry, ...]:
    meanings = _attributes(ChainParameters)
    return tuple(
        Entry(
            name=name,
            default=_toml(TABLE_3_RATIOS[name]),
            unit="-",
            meaning=f"{meanings[name].replace(' [N/m]', '')}, over the normal stiffness",
        )
        for name in CALIBRATED
    )


def _attributes(record: type) -> dict[str, str]:
    """Meanings of a record's fields, as its docstring lists them under "Attributes:"."""
    listed = (inspect.getdoc(record) or "").partition("Attributes:\n")[2]
    lines = re.sub(r"\n {8,}", " ", listed).splitlines()
    meanings: dict[str, str] = {}
    for line in lines:
        names, colon, meaning = line.strip().partition(": ")
        if colon:
            meanings |= dict.fromkeys(names.split(", "), meaning)
    return meanings


def _toml(value: Any) -> str:
    return "" if value is None else json.dumps(value)


def _comment(text: str) -> str:
    """Return the comment a study begins with, as one line."""
    lines = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    return " ".join(line.lstrip("# ") for line in lines)


def _described(name: str, told: str) -> str:
    return textwrap.fill(told, WIDTH, initial_indent=f"{name}: ", subsequent_indent="    ")
