"""Tables of numbers by column, as CSV text and as one NumPy array, both without loss."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from enum import Enum
from typing import Any, TypeAlias

import numpy as np

from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.reading import said

# Columns of equal length by name; one of shape (num_rows, n) stands for n columns of CSV, `name_0` to `name_(n - 1)`.
Columns: TypeAlias = dict[str, Ints | Floats]


class Kind(Enum):
    """What a column holds: (num_rows,) int64, (num_rows,) float64, or (num_rows, n) float64 for any n."""

    INTEGER = "whole numbers"
    NUMBER = "numbers"
    VECTOR = "vectors"


def flatten(columns: Mapping[str, Ints | Floats]) -> Columns:
    """The columns of shape (num_rows, n) as n columns each."""
    flat: Columns = {}
    for name, column in columns.items():
        if column.ndim == 1:
            flat[name] = column
        else:
            flat |= {f"{name}_{index}": column[:, index] for index in range(column.shape[1])}
    return flat


def write_csv(columns: Mapping[str, Ints | Floats]) -> str:
    """CSV text with a header line. Every float is written so that it reads back as itself."""
    flat = flatten(columns)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(flat)
    # str() of a float is the shortest text that reads back as it
    writer.writerows(zip(*(column.tolist() for column in flat.values()), strict=True))
    return out.getvalue()


def read_csv(text: str, kinds: Mapping[str, Kind], file: str) -> Columns:
    """The columns named in `kinds`.

    Raises `InputError`, with the name of the file, for text that is no table, a column that is missing, and an entry
    that is not a number.
    """
    try:
        rows = list(csv.reader(io.StringIO(text)))
    except csv.Error as error:
        raise InputError(f"{file}: expected a table of comma-separated values; {error}") from None
    if not rows or any(len(row) != len(rows[0]) for row in rows):
        raise InputError(f"{file}: expected a header line and rows as long as it")
    texts = {name: [row[index] for row in rows[1:]] for index, name in enumerate(rows[0])}
    return {name: _read_column(texts, name, kind, file) for name, kind in kinds.items()}


def csv_header(text: str) -> list[str]:
    """Names of the columns of a CSV text."""
    return next(csv.reader(io.StringIO(text)), [])


def _read_column(texts: Mapping[str, list[str]], name: str, kind: Kind, file: str) -> Ints | Floats:
    if kind is Kind.VECTOR:
        width = 0
        while f"{name}_{width}" in texts:
            width += 1
        parts = [_read_column(texts, f"{name}_{index}", Kind.NUMBER, file) for index in range(max(width, 1))]
        return np.stack(parts, axis=1).astype(np.float64)
    if name not in texts:
        raise InputError(f"{file}: expected a column {name}; got {', '.join(texts)}")
    try:
        if kind is Kind.INTEGER:
            return np.array([int(entry) for entry in texts[name]], np.int64)
        return np.array([float(entry) for entry in texts[name]], np.float64)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{file}, column {name}: expected {kind.value}; {said(error)}") from error


def pack(columns: Mapping[str, np.ndarray[Any, Any]]) -> np.ndarray[Any, Any]:
    """One structured array of (num_rows,), a field a column, little-endian and without gaps."""
    rows = {len(column) for column in columns.values()}
    if len(rows) != 1:
        raise InputError(f"columns: expected equal lengths; got {sorted(rows)}")
    fields = [(name, column.dtype.newbyteorder("<"), column.shape[1:]) for name, column in columns.items()]
    packed = np.empty(rows.pop(), np.dtype(fields))
    for name, column in columns.items():
        packed[name] = column
    return packed


def unpack(packed: np.ndarray[Any, Any]) -> dict[str, np.ndarray[Any, Any]]:
    """The columns of a structured array, C-contiguous and in this machine's byte order."""
    return {
        name: np.ascontiguousarray(packed[name], packed[name].dtype.newbyteorder("="))
        for name in packed.dtype.names or ()
    }


def check_columns(columns: Mapping[str, np.ndarray[Any, Any]], kinds: Mapping[str, Kind], place: str) -> None:
    """Raise `InputError`, with the place, unless every column named in `kinds` is there and of its kind."""
    for name, kind in kinds.items():
        if name not in columns:
            raise InputError(f"{place}: expected a column {name}; got {', '.join(columns)}")
        column = columns[name]
        dtype = np.int64 if kind is Kind.INTEGER else np.float64
        if column.dtype != dtype or column.ndim != (2 if kind is Kind.VECTOR else 1):
            raise InputError(
                f"{place}, column {name}: expected {kind.value}; got {column.dtype} of shape {column.shape}"
            )
