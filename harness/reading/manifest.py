"""A run's manifest, run.json: reading it, and asking whether the files it vouches for are there and unchanged."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from harness.errors import InputError
from harness.reading.stored import read_stored, stored
from yade_scripts import export_format

REDUCED = "reduced"  # entry of a manifest whose folder keeps some of the run's files: what the others amounted to
DIGITS = 16  # of a hash: enough to tell versions apart, and to read


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number")


def _finite(text: str) -> float:
    value = float(text)
    return value if math.isfinite(value) else _no_number(text)


def read_json(path: Path, where: str) -> dict[str, Any]:
    """Return the object in the JSON file `path`; InputError in one line when it is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"), parse_constant=_no_number, parse_float=_finite)
    except FileNotFoundError:
        raise InputError(f"{where}: no such file: {path}") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{where}: {path.name} cannot be read: {error}") from None
    except ValueError as error:
        raise InputError(f"{where}: {path.name} is not JSON ({error}); it was cut short or edited") from None
    except RecursionError:
        raise InputError(f"{where}: {path.name} is not JSON of ours: it is nested too deeply") from None
    if not isinstance(content, dict):
        raise InputError(f"{where}: {path.name}: expected a JSON object, found {type(content).__name__}")
    return content


def _expect(content: Mapping[str, Any], name: str, kind: type | tuple[type, ...], where: str) -> Any:
    if not isinstance(content.get(name), kind):
        words = " or ".join(k.__name__ for k in kind) if isinstance(kind, tuple) else kind.__name__
        found = repr(content[name])[:60] if name in content else "nothing"
        raise InputError(f"{where}: {export_format.MANIFEST}: expected {name!r} to be of kind {words}, found {found}")
    return content[name]


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of the run in `folder`, its format and outline checked.

    InputError when it is missing, no JSON, of an unknown format number, or without the parts every reader needs.
    """
    where = f"run {folder.name}"
    manifest = read_json(folder / export_format.MANIFEST, where)
    number = manifest.get("format")
    if number != export_format.FORMAT or isinstance(number, bool):
        raise InputError(
            f"{where}: {export_format.MANIFEST}: expected format {export_format.FORMAT}, found {number!r}; "
            "read it with the version of forcechain that wrote it, or run the study again"
        )
    status = manifest.get("status")
    if status not in (export_format.STATUS_DONE, export_format.STATUS_FAILED):
        raise InputError(
            f"{where}: {export_format.MANIFEST}: expected status {export_format.STATUS_DONE!r} or "
            f"{export_format.STATUS_FAILED!r}, found {status!r}"
        )
    _expect(manifest, "parameters", dict, where)
    if REDUCED in manifest:
        _expect(manifest, REDUCED, dict, where)
    if status == export_format.STATUS_DONE:
        products = _expect(manifest, "products", dict, where)
        for name, entry in _expect(products, "files", dict, where).items():
            if not isinstance(entry, dict):
                raise InputError(f"{where}: {export_format.MANIFEST}: {name}: expected its bytes and sha256")
        _expect(products, "snapshots", list, where)
    return manifest


def parameter_values(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a run as name: value, without their units."""
    return {
        name: entry["value"] if isinstance(entry, dict) and "value" in entry else entry
        for name, entry in manifest["parameters"].items()
    }


def _inside(folder: Path, name: str) -> bool:
    return (folder / name).resolve().is_relative_to(folder.resolve())


def file_disagreement(folder: Path, name: str, entry: Mapping[str, Any], content: bytes | None = None) -> str | None:
    """Return how the file `name` differs from what the manifest's `entry` says of it, or None when it agrees.

    `content` spares a second reading of a file that was just read.
    """
    if not _inside(folder, name):
        return f"{name} lies outside the run's folder"
    try:
        found = read_stored(folder / name) if content is None else content
    except FileNotFoundError:
        return f"{name} is missing"
    except OSError as error:
        return f"{name} cannot be read: {error.strerror}"
    if len(found) != entry.get("bytes"):
        return f"{name}: expected {entry.get('bytes')} bytes, found {len(found)}"
    if hashlib.sha256(found).hexdigest() != entry.get("sha256"):
        return f"{name}: its content has changed since the run (sha256 differs)"
    return None


def products_disagreement(folder: Path, manifest: Mapping[str, Any], *, thorough: bool = True) -> str | None:
    """Return the first difference between the files of a done run and its manifest, or None when all agree.

    Their sizes are compared, and, if `thorough`, their checksums, for which every file has to be read.
    A run that vouches for no snapshot, or for one that is not among its files, disagrees as well: it would be complete
    with nothing to show; only a reduced one says openly that its snapshots are left out.
    """
    products = manifest["products"]
    files = products["files"]
    if not products["snapshots"]:
        return "its manifest names no snapshot"
    if export_format.HISTORY not in files:
        return f"its manifest does not vouch for {export_format.HISTORY}"
    for row in products["snapshots"] if REDUCED not in manifest else ():
        index = row.get("index") if isinstance(row, dict) else None
        if not isinstance(index, int) or isinstance(index, bool):
            return f"its manifest has a snapshot without an index: {row!r}"
        stem = f"{export_format.SNAPSHOTS}/{export_format.snapshot_name(index)}"
        tables = {f"{stem}.particles.csv", f"{stem}.contacts.csv"}
        if f"{stem}.npz" not in files and not tables <= files.keys():
            return f"its manifest does not vouch for snapshot {index}"
    for name, entry in files.items():
        difference = file_disagreement(folder, name, entry) if thorough else _size_disagreement(folder, name, entry)
        if difference is not None:
            return difference
    return None


def tables_digest(manifest: Mapping[str, Any]) -> str:
    """Digest of a done run's tables: of the checksums its manifest holds; of a reduced run, that of the whole one."""
    if REDUCED in manifest:
        return str(manifest[REDUCED].get("tables"))
    files = {name: entry.get("sha256") for name, entry in manifest["products"]["files"].items()}
    return hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _size_disagreement(folder: Path, name: str, entry: Mapping[str, Any]) -> str | None:
    if stored(folder / name) != folder / name:
        return file_disagreement(folder, name, entry)  # packed: its size says nothing
    try:
        size = (folder / name).stat().st_size
    except OSError:
        return f"{name} is missing"
    return None if size == entry.get("bytes") else f"{name}: expected {entry.get('bytes')} bytes, found {size}"
