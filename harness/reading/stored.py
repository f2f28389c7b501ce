"""A file as it was written, or packed by xz beside its place, as reduced results keep it."""

from __future__ import annotations

import errno
import lzma
from pathlib import Path

PACKED = ".xz"


def stored(path: Path) -> Path:
    """Return where the content of `path` is kept: there, or packed beside it."""
    packed = path.with_name(path.name + PACKED)
    return packed if not path.exists() and packed.exists() else path


def read_stored(path: Path) -> bytes:
    """Return the content of `path`, unpacked where it is kept packed. Raises OSError when it cannot be read."""
    place = stored(path)
    content = place.read_bytes()
    if place == path:
        return content
    try:
        return lzma.decompress(content)
    except lzma.LZMAError:
        raise OSError(errno.EIO, f"{place.name} is no whole xz file") from None


def pack(content: bytes) -> bytes:
    """Return `content` packed, for a file whose name ends in `PACKED`."""
    return lzma.compress(content, preset=9)
