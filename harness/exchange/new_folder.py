"""A folder that appears whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from harness.errors import InputError


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder to write into; it becomes `folder` when all went well and vanishes when something did not.

    InputError when `folder` cannot be made, or is there already with something in it: files of two origins in one
    folder could not be told apart.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: expected a new folder, found one with files; remove it, or name another by --out")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: expected a new folder, found a file; name another by --out")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        making = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}") from None
    try:
        yield making
        making.chmod(0o755)
        making.replace(folder)
    except BaseException:
        shutil.rmtree(making, ignore_errors=True)
        raise
