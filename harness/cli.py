"""The command line: one subcommand a module of `harness.commands`; expected failures end in one line, not a trace."""

from __future__ import annotations

import argparse
import importlib
import keyword
import os
import pkgutil
import re
import sys
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, cast

import shtab

import forcechain
from harness import commands
from harness.errors import EXIT_INPUT, HarnessError, Terminated

ORDER = (
    "doctor",
    "demo",
    "studies",
    "run",
    "status",
    "analyse",
    "calibrate",
    "compare",
    "check",
    "approve",
    "report",
    "reference",
    "model",
    "export",
    "import",
)
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells have it
DESCRIPTION = (
    "Do force chains buckle as the theory says? Tests in YADE, buckled segments, the analytic model, compared."
)
EXITS = (
    "exit status: 0 good, 1 a verdict failed, 2 bad input or usage,\n             3 a run is invalid, failed or missing"
)
VERSION = "--version"
WIDTH = 78  # characters of a line of help
LONGEST_USAGE = 3  # lines; the options are listed below it anyway


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


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Help that fits a screen: where the usage takes many lines, "[options]" stands for those listed below it."""

    def _format_usage(self, usage: Any, actions: Any, groups: Any, prefix: Any) -> str:
        told = super()._format_usage(usage, actions, groups, prefix)
        if len(told.strip().splitlines()) <= LONGEST_USAGE:
            return told
        must = [action for action in actions if action.required or not action.option_strings]
        short = " ".join(["%(prog)s [options]", *map(_in_usage, must)])
        return super()._format_usage(short, actions, groups, prefix)


def _in_usage(action: argparse.Action) -> str:
    value = str(action.metavar or "{" + ",".join(map(str, action.choices or ())) + "}")
    return f"{action.option_strings[0]} {value}" if action.option_strings else value


def _example(command: str) -> str:
    """Return `command` in lines that fit a screen and can be cut and pasted as they are."""
    lines = textwrap.wrap(
        f"example: {command}", WIDTH - 2, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )
    return " \\\n".join(lines)


def _complete_paths(parser: argparse.ArgumentParser) -> None:
    """Tell the shell's completion which arguments are files or folders."""
    for action in parser._actions:
        if action.type is Path:
            folder = any(word in str(action.metavar) for word in ("DIR", "FOLDER", "SOURCE"))
            action.complete = shtab.DIRECTORY if folder else shtab.FILE  # type: ignore[attr-defined]


def build_parser(arguments: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser for `arguments`: every command by name, but only the one in use (or all, for help) loaded."""
    names = command_names()
    parser = argparse.ArgumentParser(
        prog="forcechain",
        description=textwrap.fill(DESCRIPTION, WIDTH),
        epilog=EXITS,
        formatter_class=lambda prog: HelpFormatter(prog, max_help_position=15),
        allow_abbrev=False,
    )
    parser.add_argument(VERSION, action=_Version, nargs=0, help="versions of this package and of YADE, and exit")
    shtab.add_argument_to(parser, "--print-completion", help="print the script that completes commands in a shell")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    chosen = arguments[0] if arguments else None
    for name in names:
        if chosen in (*names, VERSION) and name != chosen:
            subparsers.add_parser(name)
            continue
        module = load(name)
        subparser = subparsers.add_parser(
            name,
            help=re.split("[:;] ", module.HELP)[0],
            description=textwrap.fill(module.HELP, WIDTH),
            epilog=f"{_example(module.EXAMPLE)}\n{EXITS}",
            formatter_class=HelpFormatter,
            allow_abbrev=False,
        )
        module.add_arguments(subparser)
        _complete_paths(subparser)
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
