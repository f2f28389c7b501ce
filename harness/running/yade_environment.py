"""Where YADE is, and how to run a script with it without the ports its command opens."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.errors import RunError

COMMAND_VARIABLE = "YADE_COMMAND"
INSTALL = "apt-get install --no-install-recommends yade"
VERSION_TIMEOUT_S = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Yade:
    """One installation of YADE.

    Attributes:
        command: path of the command `yade`.
        version: as it tells it.
        python: the interpreter it was built for, with its arguments; empty when the command does not tell.
        library: the folder that holds the package `yade`; None when the command does not tell.
    """

    command: str
    version: str
    python: tuple[str, ...]
    library: Path | None

    def invocation(self, script: Path, arguments: Sequence[str]) -> list[str]:
        """Return the command line that runs `script`.

        Every run of the `yade` command opens a Python prompt on a local port, and an information port on all
        interfaces. Importing YADE's package from the interpreter it was built for opens neither, so that is the way
        wherever the command's text tells where both are.
        """
        if self.python and self.library:
            return [*self.python, str(script), *arguments]
        return [self.command, "-n", "-x", "-j1", str(script), *arguments]

    def environment(self) -> dict[str, str]:
        """Return the environment for a run: one thread, no display, no packages of another Python."""
        environment = bare_environment() | {
            "OMP_NUM_THREADS": "1",  # more threads do not repeat bit for bit
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONNOUSERSITE": "1",
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONUNBUFFERED": "1",  # a killed run's log tells all it had to say
        }
        if self.library:
            environment["PYTHONPATH"] = str(self.library)
        return environment


def bare_environment() -> dict[str, str]:
    """Return this process's environment without what belongs to its own Python or to a display."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PYTHON") and name not in ("VIRTUAL_ENV", "DISPLAY")
    }
    environment.setdefault("HOME", "/tmp")  # YADE needs one to be set
    return environment


def find_yade() -> Yade | None:
    """Return the YADE of the environment variable YADE_COMMAND or of the PATH, or None when there is none.

    Raises RunError when YADE_COMMAND names no command.
    """
    asked = os.environ.get(COMMAND_VARIABLE)
    command = shutil.which(asked or "yade")
    if command is None:
        if asked:
            raise RunError(f"{COMMAND_VARIABLE}={asked}: expected a command, found none; correct it or unset it")
        return None
    with open(command, "rb") as file:  # noqa: PTH123  a compiled command is not read whole
        text = file.read(200_000).decode("utf-8", "replace")
    shebang = re.match(r"#!\s*(\S[^\n]*)", text)
    python = tuple(shlex.split(shebang[1])) if shebang else ()
    inserted = re.search(r"""sys\.path\.insert\(\s*\d+\s*,\s*(['"])(.+?)\1\s*\)""", text)
    library = Path(inserted[2]) if inserted else None
    told = python and "python" in Path(python[-1]).name and library is not None
    if not told or library is None or not (library / "yade" / "__init__.py").is_file():
        python, library = (), None
    version = re.search(r"""\bversion\b[^=\n]*=[^\n]*\.split\(' '\),\s*'([^']+)'""", text)
    return Yade(
        command=command,
        version=version[1] if version else _told_version(command),
        python=python,
        library=library,
    )


def need_yade() -> Yade:
    """Return the YADE to use; RunError that says how to install it when there is none."""
    yade = find_yade()
    if yade is None:
        raise RunError(
            f"YADE is not found; install it ({INSTALL}) or name its command in {COMMAND_VARIABLE}. "
            "Exported tables can be analysed without it"
        )
    return yade


def _told_version(command: str) -> str:
    try:
        told = subprocess.run(
            [command, "--version"], capture_output=True, text=True, timeout=VERSION_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return "of unknown version"
    found = re.search(r"\d{4}\.\d+\w*", told.stdout + told.stderr)
    return found[0] if found else "of unknown version"
