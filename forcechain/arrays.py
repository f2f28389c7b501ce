"""The gatekeeper: turns input into arrays of known shape and kind, or says what was expected and what came."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def _shape_words(shape: tuple[int | None, ...]) -> str:
    return (
        "(" + ", ".join("any" if size is None else str(size) for size in shape) + ("," if len(shape) == 1 else "") + ")"
    )


def _shaped(array: NDArray[Any], name: str, shape: tuple[int | None, ...]) -> None:
    if array.ndim != len(shape) or any(
        want is not None and got != want for got, want in zip(array.shape, shape, strict=True)
    ):
        raise ValueError(f"{name}: expected an array of shape {_shape_words(shape)}, found {array.shape}")


def float_array(value: Any, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return `value` as a contiguous float64 array of `shape` (None: any size), every entry finite.

    Raises ValueError naming the array, what was expected, what was found and, for a value that is no number, its row.

    >>> float_array([1, 2], "radius", (None,))
    array([1., 2.])
    >>> float_array([1, float("nan")], "radius", (None,))
    Traceback (most recent call last):
        ...
    ValueError: radius, row 1: expected a finite number, found nan
    """
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, found {np.asarray(value).dtype}") from None
    _shaped(array, name, shape)
    finite = np.isfinite(array)
    if not finite.all():
        row = tuple(int(i) for i in np.argwhere(~finite)[0])
        raise ValueError(f"{name}, row {row[0]}: expected a finite number, found {array[row]}")
    return array


def int_array(value: Any, name: str, shape: tuple[int | None, ...]) -> IntArray:
    """Return `value` as a contiguous int64 array of `shape` (None: any size).

    Whole numbers stored as floats are accepted. Raises ValueError as `float_array` does.
    """
    array = np.asarray(value)
    if array.dtype.kind not in "iu":
        as_float = float_array(value, name, shape)
        broken = as_float != np.round(as_float)
        if broken.any():
            row = tuple(int(i) for i in np.argwhere(broken)[0])
            raise ValueError(f"{name}, row {row[0]}: expected a whole number, found {as_float[row]}")
        array = as_float
    array = np.ascontiguousarray(array, dtype=np.int64)
    _shaped(array, name, shape)
    return array


def freeze(*arrays: NDArray[Any]) -> None:
    """Make arrays read-only, so that a frozen result is frozen to its last number."""
    for array in arrays:
        array.setflags(write=False)


def columns(array: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the two columns of an array (n, 2), each contiguous: gathering from them is several times faster.

    >>> columns(np.array([[1, 2], [3, 4]]))
    (array([1, 3]), array([2, 4]))
    """
    return np.ascontiguousarray(array[:, 0]), np.ascontiguousarray(array[:, 1])


def sum_at(index: IntArray, values: FloatArray, size: int) -> FloatArray:
    """Return the sums (size,) of the `values` (n,) that share an `index` (n,) of 0 to size - 1.

    >>> sum_at(np.array([0, 2, 0]), np.array([1.0, 5.0, 2.0]), 4)
    array([3., 0., 5., 0.])
    """
    return np.bincount(index, weights=values, minlength=size).astype(np.float64, copy=False)
