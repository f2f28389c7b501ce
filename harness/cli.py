"""The command line: one subcommand a module of `harness.commands`; expected failures end in one line, not a trace."""

from __future__ import annotations

import argparse
import importlib
import keyword
import os
import pkgutil
import sys
from collections.abc import Callable, Sequence
from typing import Protocol, cast

import forcechain
from harness import commands
from harness.errors import EXIT_INPUT, HarnessError, Terminated

ORDER = (
    "doctor",
    "demo",
    "run",
    "status",
    "analyse",
    "calibrate",
    "compare",
    "check",
    "approve",
    "report",
    "model",
    "export",
    "import",
)
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells have it
DESCRIPTION = (
    "Do force chains buckle as the theory says? Tests in YADE, buckled segments, the analytic model, compared."
)
EXITS = "exit status: 0 good, 1 a verdict failed, 2 bad input or usage, 3 a run is invalid, failed or missing"


class Command(Protocol):
    """What a module of `harness.commands` offers."""

    HELP: str
    EXAMPLE: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    execute: Callable[[argparse.Namespace], int]


def command_names() -> tuple[str, ...]:
    """Return the names of all commands: one for every module there, in the order of use."""
    there = {module.name.rstrip("_") for module in pkgutil.iter_modules(commands.__path__)}
    return (*(name for name in ORDER if name in there), *sorted(there.difference(ORDER)))


def load(name: str) -> Command:
    """Import the command module `name`: alone, so that a quick command starts quickly."""
    module = f"{name}_" if keyword.iskeyword(name) else name  # a module cannot be called `import`
    return cast(Command, importlib.import_module(f"harness.commands.{module}"))


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from harness.running.yade_environment import find_yade  # reads a file: not before it is asked for

        yade = find_yade()
        found = f"YADE {yade.version} ({yade.command})" if yade else "YADE not found"
        print(f"forcechain {forcechain.__version__}, {found}")
        parser.exit()


def build_parser(arguments: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser for `arguments`: every command by name, but only the one in use (or all, for help) loaded."""
    names = command_names()
    parser = argparse.ArgumentParser(prog="forcechain", description=DESCRIPTION, epilog=EXITS, allow_abbrev=False)
    parser.add_argument("--version", action=_Version, nargs=0, help="versions of this package and of YADE, and exit")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    chosen = arguments[0] if arguments else None
    for name in names:
        if chosen in names and name != chosen:
            subparsers.add_parser(name)
            continue
        module = load(name)
        subparser = subparsers.add_parser(
            name,
            help=module.HELP,
            description=module.HELP,
            epilog=f"example: {module.EXAMPLE}\n{EXITS}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        module.add_arguments(subparser)
        subparser.set_defaults(execute=module.execute)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        options = build_parser(arguments).parse_args(arguments)
        status: int = options.execute(options)
        sys.stdout.flush()
    except HarnessError as error:
        print(f"forcechain: {_one_line(str(error))}", file=sys.stderr)
        return error.exit_status
    except Terminated as end:
        print(f"forcechain: ended by {end}", file=sys.stderr)
        return end.exit_status
    except KeyboardInterrupt:
        print("forcechain: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # the reader of our output (head, less) has left: nothing more to say, and nothing went wrong
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SystemExit as end:  # argparse: help, version or a usage error it has already reported
        return end.code if isinstance(end.code, int) else EXIT_INPUT
    return status


def _one_line(message: str) -> str:
    return " ".join(message.split())
