"""Code blocks of a page: found, run, and what they print held against what the page says they print."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FENCE = re.compile(
    r"^(?P<marks>`{3,})(?P<language>[\w+-]*)[ ]*(?P<rest>[^\n`]*)\n(?P<text>.*?)^(?P=marks)[ ]*$", re.M | re.S
)
TITLE = re.compile(r'title="([^"]*)"')
TIMEOUT_S = 600
# A failed verdict is a finding, not a fault of the page: what it shows goes on.
TOLERANT = 'forcechain() { command forcechain "$@" || { [ $? = 1 ] && [[ $1 =~ ^(compare|check|demo)$ ]]; }; }\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """One fenced block: its language, its title, its text, and the line it begins in."""

    language: str
    title: str
    text: str
    line: int

    @property
    def not_run(self) -> str:
        """Why it is not run, as the page says it; empty where it is run."""
        return self.title.partition("not run in the tests: ")[2]


def blocks_of(page: Path) -> list[Block]:
    """Return the fenced blocks of `page` in their order."""
    text = page.read_text(encoding="utf-8")
    blocks = []
    for found in FENCE.finditer(text):
        title = TITLE.search(found["rest"])
        blocks.append(
            Block(
                language=found["language"],
                title=title[1] if title else "",
                text=found["text"],
                line=text.count("\n", 0, found.start()) + 1,
            )
        )
    return blocks


def expected_prints(text: str) -> list[str]:
    """Return what the comments behind `print(...)` say is printed.

    >>> expected_prints("x = 1  # one\\nprint(x)  # 1\\n")
    ['1']
    """
    return re.findall(r"^print\(.*\)  # (.*)$", text, re.M)


def console_steps(text: str) -> list[tuple[str, str]]:
    """Split a console block into its commands, each with the output that stands below it.

    >>> console_steps("$ a b\\nout\\n$ c \\\\\\n  d\\n")
    [('a b', 'out\\n'), ('c \\\\\\n  d', '')]
    """
    steps: list[tuple[str, str]] = []
    for line in text.splitlines(keepends=True):
        if steps and steps[-1][0].endswith("\\"):
            steps[-1] = (f"{steps[-1][0]}\n{line.rstrip()}", "")
        elif line.startswith("$ "):
            steps.append((line[2:].rstrip(), ""))
        else:
            command, output = steps[-1]
            steps[-1] = (command, output + line)
    return steps


def pattern(expected: str, *, any_numbers: bool = False) -> re.Pattern[str]:
    """Return what an output has to match: "..." is anything, spaces are as good as one; numbers may be others.

    >>> bool(pattern("a  1\\n...\\nb\\n").fullmatch(squeezed("a 1\\nx\\ny\\nb\\n")))
    True
    >>> bool(pattern("peak 0.7 pass\\n", any_numbers=True).fullmatch(squeezed("peak  0.65  FAIL\\n")))
    True
    >>> bool(pattern("peak 0.7 pass\\n").fullmatch(squeezed("peak 0.65 pass\\n")))
    False
    """
    parts = []
    for line in squeezed(expected).splitlines():
        if line == "...":
            parts.append(r"(?:.*\n)*?")
            continue
        literal = re.escape(line).replace(r"\.\.\.", ".*")
        if any_numbers:
            literal = re.sub(r"\d+(?:\\\.\d+)?", r"\\d+(?:\\.\\d+)?", literal)
            literal = re.sub(r"pass|FAIL", "(?:pass|FAIL)", literal)
        parts.append(f"{literal}\n")
    return re.compile("".join(parts))


def squeezed(text: str) -> str:
    """Return `text` with runs of spaces as one, and no spaces at the ends of lines."""
    return "".join(f"{' '.join(line.split())}\n" for line in text.splitlines())


def run_shell(command: str, folder: Path, environment: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    """Run `command` in bash, ending at the first failure; a verdict that fails is none, unless the command asks."""
    prelude = "" if "||" in command else TOLERANT
    return subprocess.run(
        ["bash", "--norc", "-euo", "pipefail", "-c", prelude + command],
        cwd=folder,
        env=dict(environment),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )


def run_python(block: Block, page: Path, namespace: dict[str, Any]) -> None:
    """Run a block in the page's own namespace; a fault names page and line."""
    shifted = "\n" * block.line + block.text
    exec(compile(shifted, str(page), "exec"), namespace)
