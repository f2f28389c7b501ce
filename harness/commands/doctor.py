"""`forcechain doctor`: what is installed, which YADE, what is missing and the command that mends it."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import re
import shutil
import subprocess
import sys
from dataclasses import asdict, dataclass

import forcechain
from harness.errors import EXIT_GOOD, EXIT_RUN, RunError
from harness.running.engines import available_cores
from harness.running.yade_environment import COMMAND_VARIABLE, INSTALL, Yade, find_yade

HELP = "what is installed and what is missing: which YADE, which libraries, and the command that mends it"
EXAMPLE = "forcechain doctor"
DISTRIBUTION = "forcechain"
IMPORT_TIMEOUT_S = 60
SMALLEST_VERSION = (2023, 2)  # the oldest YADE the scripts were run with


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing looked at: what was found, whether it will do, and the remedy when it will not.

    What is `optional` and missing does no harm: its remedy says how to have it.
    """

    name: str
    found: str
    good: bool
    remedy: str | None = None
    optional: bool = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add this command's arguments to `parser`."""
    parser.add_argument("--json", action="store_true", help="for machines")


def execute(options: argparse.Namespace) -> int:
    """Run the command: exit status 0 when all is well, 3 when something is missing."""
    findings = findings_here()
    good = all(finding.good or finding.optional for finding in findings)
    if options.json:
        print(json.dumps({"good": good, "findings": [asdict(finding) for finding in findings]}, indent=1))
        return EXIT_GOOD if good else EXIT_RUN
    width = max(len(finding.name) for finding in findings)
    for finding in findings:
        mark = "ok " if finding.good else "-  " if finding.optional else "NO "
        print(f"{mark} {finding.name:<{width}}  {finding.found}")
        if finding.remedy:
            print(f"    {'':<{width}}  {'have it' if finding.optional else 'mend it'} with: {finding.remedy}")
    if good:
        print("all is well: try forcechain demo")
    else:
        print("without YADE nothing can be run; analyse, compare, report and model do work on exported tables")
    return EXIT_GOOD if good else EXIT_RUN


def findings_here() -> list[Finding]:
    """Look at everything the commands need."""
    return [
        Finding(name="forcechain", found=forcechain.__version__, good=True),
        Finding(name="Python", found=f"{platform.python_version()} ({sys.executable})", good=True),
        *_libraries(),
        Finding(name="cores", found=f"{available_cores()} of {os.cpu_count()}", good=True),
        *_yade(),
        *_optional(),
    ]


def _optional() -> list[Finding]:
    """What only some commands need, and most users do not."""
    findings = []
    for requirement in importlib.metadata.requires(DISTRIBUTION) or []:
        if re.search(r"""extra == ['"]dask['"]""", requirement):
            wanted = requirement.partition(";")[0].strip()
            name = re.split(r"[^\w.-]", wanted, maxsplit=1)[0]
            findings.append(_optional_library(name, wanted, "for run --engine dask, past one machine"))
    command = shutil.which("ffmpeg")
    if command:
        findings.append(Finding(name="ffmpeg", found=command, good=True, optional=True))
    else:
        remedy = _as_root("apt-get install --no-install-recommends ffmpeg")
        found = "not there, for report --animate FILE.mp4 (.gif needs nothing)"
        findings.append(Finding(name="ffmpeg", found=found, good=False, remedy=remedy, optional=True))
    return findings


def _optional_library(name: str, wanted: str, purpose: str) -> Finding:
    try:
        return Finding(name=name, found=importlib.metadata.version(name), good=True, optional=True)
    except importlib.metadata.PackageNotFoundError:
        remedy = f"{sys.executable} -m pip install '{wanted}'"
        return Finding(name=name, found=f"not there, {purpose}", good=False, remedy=remedy, optional=True)


def _libraries() -> list[Finding]:
    findings = []
    for requirement in importlib.metadata.requires(DISTRIBUTION) or []:
        if "extra ==" in requirement:
            continue
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        try:
            findings.append(Finding(name=name, found=importlib.metadata.version(name), good=True))
        except importlib.metadata.PackageNotFoundError:
            remedy = f"{sys.executable} -m pip install '{requirement}'"
            findings.append(Finding(name=name, found="missing", good=False, remedy=remedy))
    return findings


def _yade() -> list[Finding]:
    try:
        yade = find_yade()
    except RunError as error:
        return [Finding(name="YADE", found=str(error), good=False, remedy=f"unset {COMMAND_VARIABLE}")]
    if yade is None:
        return [Finding(name="YADE", found="not found", good=False, remedy=_as_root(INSTALL))]
    findings = [_version(yade)]
    if yade.library is None:
        way = "by the yade command itself: its text does not tell where its Python package is"
        return [*findings, Finding(name="YADE runs", found=way, good=True)]
    fault = _import_fault(yade)
    way = f"{' '.join(yade.python)} with {yade.library}, which opens no ports"
    findings.append(
        Finding(
            name="YADE runs",
            found=f"{way}: {fault}" if fault else way,
            good=fault is None,
            remedy=_as_root(INSTALL.replace("install", "install --reinstall")) if fault else None,
        )
    )
    return findings


def _version(yade: Yade) -> Finding:
    found = f"{yade.version} ({yade.command})"
    numbers = re.match(r"(\d+)\.(\d+)", yade.version)
    if numbers is not None and (int(numbers[1]), int(numbers[2])) < SMALLEST_VERSION:
        return Finding(name="YADE", found=f"{found}, older than 2023.02", good=False, remedy=_as_root(INSTALL))
    return Finding(name="YADE", found=found, good=True)


def _import_fault(yade: Yade) -> str | None:
    try:
        tried = subprocess.run(
            [*yade.python, "-c", "import numpy, yade"],
            env=yade.environment(),
            capture_output=True,
            text=True,
            timeout=IMPORT_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"it cannot be started ({error})"
    if tried.returncode == 0:
        return None
    lines = [line for line in tried.stderr.splitlines() if line.strip()]
    return f"importing it fails ({lines[-1] if lines else f'exit status {tried.returncode}'})"


def _as_root(command: str) -> str:
    return command if os.geteuid() == 0 else f"sudo {command}"
