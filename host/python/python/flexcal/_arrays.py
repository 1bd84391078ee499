"""Arrays on their way between Python and the library: the bytes of 64-bit floats."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError

__all__ = ["FloatArray", "column_bytes", "from_columns", "read_only"]

FloatArray = NDArray[np.float64]


def read_only(data: bytes) -> FloatArray:
    """The numbers, without a copy; such an array cannot be written to."""
    return np.frombuffer(data, dtype=np.float64)


def from_columns(columns: list[bytes], rows: int) -> FloatArray:
    """Columns side by side, shape (rows, columns)."""
    if not columns:
        return np.empty((rows, 0))
    return np.stack([read_only(column) for column in columns], axis=1)


def column_bytes(name: str, values: ArrayLike, width: int | None) -> list[bytes]:
    """The columns of an array, each as bytes.

    `width` is the number of columns of an array of two dimensions; `None` wants one dimension.
    """
    array = np.asarray(values, dtype=np.float64)
    if width == 1 and array.ndim == 1:
        array = array[:, np.newaxis]
    wanted = "(samples,)" if width is None else f"(samples, {width})"
    if array.ndim != (1 if width is None else 2) or (width is not None and array.shape[1] != width):
        raise DataError(f"`{name}` has the shape {array.shape}", f"give an array of the shape {wanted}, one row a tick")
    if width is None:
        return [np.ascontiguousarray(array).tobytes()]
    return [np.ascontiguousarray(array[:, i]).tobytes() for i in range(width)]
