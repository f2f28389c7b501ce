"""Tables from files: CSV and npz to arrays of known columns, each number checked, or one line that says why not."""

from __future__ import annotations

import csv
import difflib
import io
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forcechain.arrays import float_array, int_array
from harness.errors import InputError
from harness.reading.stored import read_stored
from yade_scripts.export_format import Column

Table = dict[str, NDArray[Any]]
LARGEST_ARCHIVE = 16 * 2**30  # bytes unpacked: forty times a million discs; more comes of a damaged or hostile file


def read_bytes(path: Path, where: str) -> bytes:
    """Return the content of `path`; InputError when it cannot be read."""
    try:
        return read_stored(path)
    except FileNotFoundError:
        raise InputError(f"{where}: no such file: {path}") from None
    except OSError as error:
        raise InputError(f"{where}: cannot be read: {error.strerror}") from None


def read_csv(content: bytes, where: str) -> Table:
    """Return the columns of a CSV text with a header line, each a (n_rows,) array of numbers, or of words.

    InputError for an empty text, a column named twice, a row longer or shorter than the header, or bytes that are no
    text. Rows are counted from 0, the header apart; empty lines are passed over.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{where}: expected CSV text in UTF-8, found other bytes at {error.start}") from None
    try:
        header, *rows = [row for row in csv.reader(io.StringIO(text), skipinitialspace=True) if row] or [[]]
    except csv.Error as error:
        raise InputError(f"{where}: not a table: {error}") from None
    header = [name.strip() for name in header]
    if not any(header):
        raise InputError(f"{where}: the table is empty; expected a line of column names, then rows")
    for name, count in Counter(header).items():
        if count > 1:
            raise InputError(f"{where}: column {name!r} is there twice; name every column once")
    for number, row in enumerate(rows):
        if len(row) != len(header):
            raise InputError(f"{where}: row {number}: expected {len(header)} values as in the header, found {len(row)}")
    columns = zip(*rows, strict=True) if rows else [()] * len(header)
    return {name: _numbers_or_words(column) for name, column in zip(header, columns, strict=True)}


def _numbers_or_words(column: Sequence[str]) -> NDArray[Any]:
    try:
        return np.array(column, dtype=np.float64)
    except ValueError:
        return np.array(column, dtype=object)


def read_npz(content: bytes, where: str) -> Table:
    """Return the arrays of an npz archive; nothing is unpickled. InputError for a broken or foreign file."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as packed:
            size = sum(member.file_size for member in packed.infolist())
        if size > LARGEST_ARCHIVE:
            raise InputError(
                f"{where}: expected at most {LARGEST_ARCHIVE} bytes of numbers, found an archive that unpacks to {size}"
            )
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except MemoryError:
        raise InputError(
            f"{where}: it claims more numbers than memory holds ({len(content)} bytes on disk); export it anew"
        ) from None
    except (zipfile.BadZipFile, EOFError, zlib.error, KeyError, OSError):
        raise InputError(
            f"{where}: expected an npz archive, found a broken one ({len(content)} bytes); "
            "it was cut short: run the study again or export it anew"
        ) from None
    except (ValueError, TypeError, AttributeError) as error:
        # numpy refuses an array of objects, and takes a file that is no zip for a pickle or a bare array
        reason = "an array of Python objects" if "Object arrays" in str(error) else "another kind of file"
        raise InputError(f"{where}: expected an npz archive of plain numbers, found {reason}") from None


def checked(table: Mapping[str, Any], columns: Iterable[Column], kind: str, where: str, prefix: str = "") -> Table:
    """Return the `columns` of `table`: there, of one length, finite numbers, whole where they have to be.

    `prefix` stands before each column's name in `table` only. `kind` (particles, contacts, ...) names the table in the
    InputError, one line with the column, the row, what was expected and what was found.
    """
    columns = tuple(columns)
    result: Table = {}
    for column in columns:
        key = prefix + column.name
        if key not in table:
            raise InputError(f"{where}: {kind}: {_missing(column, key, table)}")
        result[column.name] = _numbers(table[key], column, kind, where)
    lengths = {name: len(values) for name, values in result.items()}
    first = columns[0].name
    for name, length in lengths.items():
        if length != lengths[first]:
            raise InputError(
                f"{where}: {kind}: expected {lengths[first]} rows in column {name!r}, as in {first!r}, found {length}"
            )
    return result


def _missing(column: Column, key: str, table: Mapping[str, Any]) -> str:
    close = difflib.get_close_matches(key, table, 1, 0.75)
    hint = f"; did you mean it by {close[0]!r}?" if close else ""
    unit = "" if column.unit == "-" else f" [{column.unit}]"
    return f"column {key!r}{unit} ({column.meaning}) is missing{hint}"


def _numbers(values: Any, column: Column, kind: str, where: str) -> NDArray[Any]:
    array = np.asarray(values)
    if array.dtype == object:
        row, found = _first_word(array)
        raise InputError(f"{where}: {kind} row {row}, column {column.name!r}: expected a number, found {found!r}")
    if array.dtype.kind not in "iuf":
        raise InputError(f"{where}: {kind}: column {column.name!r}: expected numbers, found {array.dtype}")
    check = int_array if column.integer else float_array
    try:
        return check(array, column.name, (None,))
    except ValueError as error:
        name, _, rest = str(error).partition(", row ")
        if rest:
            place, _, fault = rest.partition(": ")
            raise InputError(f"{where}: {kind} row {place}, column {name!r}: {fault}") from None
        raise InputError(f"{where}: {kind}: column {error}") from None


def _first_word(array: NDArray[Any]) -> tuple[int, Any]:
    for row, value in enumerate(array.ravel()):
        try:
            float(value)
        except (TypeError, ValueError):
            return row, value
    return 0, array.ravel()[0]
