"""Tables of numbers as CSV text, without loss: every float is written so that it reads back as itself."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence

import numpy as np

from vedette.errors import InputError
from vedette.kernels.types import Floats, Ints


def write_columns(columns: Mapping[str, Ints | Floats]) -> str:
    """CSV text with a header line, from columns of equal length; one of shape (num_rows, n) is written as n columns."""
    names: list[str] = []
    values: list[list[float]] = []
    for name, column in columns.items():
        names += [name] if column.ndim == 1 else [f"{name}_{index}" for index in range(column.shape[1])]
        values += [column.tolist()] if column.ndim == 1 else column.T.tolist()
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*values, strict=True))  # str() of a float is the shortest text that reads back as it
    return out.getvalue()


class ColumnReader:
    """Columns of a CSV text, by name.

    Raises `InputError`, with the name of the file, for text that is no table, a column that is missing, and an entry
    that is not a number.
    """

    def __init__(self, text: str, file: str) -> None:
        self._file = file
        rows = list(csv.reader(io.StringIO(text)))
        if not rows or any(len(row) != len(rows[0]) for row in rows):
            raise InputError(f"{file}: expected a header line and rows as long as it")
        self._columns: dict[str, Sequence[str]] = {
            name: [row[index] for row in rows[1:]] for index, name in enumerate(rows[0])
        }

    def ints(self, name: str) -> Ints:
        """(num_rows,) whole numbers."""
        try:
            return np.array([int(entry) for entry in self._column(name)], np.int64)
        except ValueError as error:
            raise InputError(f"{self._file}, column {name}: expected whole numbers; {error}") from error

    def floats(self, name: str) -> Floats:
        """(num_rows,) numbers."""
        try:
            return np.array([float(entry) for entry in self._column(name)], np.float64)
        except ValueError as error:
            raise InputError(f"{self._file}, column {name}: expected numbers; {error}") from error

    def vectors(self, name: str) -> Floats:
        """(num_rows, n) from the columns `name_0` to `name_(n - 1)`."""
        count = 0
        while f"{name}_{count}" in self._columns:
            count += 1
        if count == 0:
            self._column(f"{name}_0")
        return np.ascontiguousarray(np.stack([self.floats(f"{name}_{index}") for index in range(count)], axis=1))

    def _column(self, name: str) -> Sequence[str]:
        if name not in self._columns:
            raise InputError(f"{self._file}: expected a column {name}; got {', '.join(self._columns)}")
        return self._columns[name]
