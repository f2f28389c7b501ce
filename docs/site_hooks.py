"""What the site's pages take from the code when the site is built: help texts of commands, names of study files."""

from __future__ import annotations

import contextlib
import io
import os
import re
from typing import Any

from harness import cli
from harness.commands import studies


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace `<!-- help of every command -->` and `<!-- keys of TABLE -->` by what the code says."""
    markdown = re.sub("<!-- help of every command -->", lambda _: help_texts(), markdown)
    return re.sub(r"<!-- keys of (\w+) -->", lambda found: key_table(found[1]), markdown)


def help_texts() -> str:
    """Return a section a command with its help, as a terminal of 80 columns shows it."""
    os.environ["COLUMNS"] = "80"
    parts = []
    for name in cli.command_names():
        told = io.StringIO()
        with contextlib.redirect_stdout(told):
            cli.main([name, "--help"])
        parts.append(f"## {name}\n\n```text\n{told.getvalue().strip()}\n```\n")
    return "\n".join(parts)


def key_table(table: str) -> str:
    """Return the names of one table of a study file as a table of the page."""
    rows = ["| name | default | unit | meaning |", "|---|---|---|---|"]
    for entry in studies.keys(table):
        default = f"`{entry.default}`" if entry.default else "none"
        rows.append(f"| `{entry.name}` | {default} | {entry.unit} | {entry.meaning} |")
    return "\n".join(rows)
