"""Tables of records, and the values of their cells."""

import numbers
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from decimal import Decimal
from typing import Any, Literal

import numpy as np

from vedette.errors import InputError
from vedette.internal.text import elided, printable, shown
from vedette.kernels.base.types import Floats
from vedette.recorded.turns import RadarService

# Beyond these values, differences and speeds of reports are meaningless.
FARTHEST = 1e9  # m, m/s
LATEST = 1e12  # s
DAY = 86_400.0  # s
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # units of times
_IN_ORDER = 60.0  # s; largest step back of rows in order of time
_MOST_NAMES = 20


@dataclass(frozen=True, slots=True)
class Table:
    """Unchanged columns, the row number of each entry in its file, and a name for messages.

    bearings: their zero in the format, "north" or "east". None: not defined. notes: warnings. sha256: of the file, in
    hexadecimal digits, or "" for columns in memory. service: turns of sensors by their service messages.
    """

    columns: Mapping[str, Sequence[Any]]
    rows: Sequence[int]
    source: str
    bearings: Literal["east", "north"] | None = None
    notes: tuple[str, ...] = ()
    sha256: str = ""
    service: Mapping[str, RadarService] = field(default_factory=dict)

    def column(self, name: str) -> Sequence[Any]:
        """Return the cells of a column. Raises `InputError` with the names of all columns if it is missing."""
        if name not in self.columns:
            have = column_names(self.columns) or "none"
            raise InputError(f"{self.source}: expected a column {shown(name)}; got columns {have}")
        return self.columns[name]

    def fault(self, index: int, name: str, expected: str) -> InputError:
        """Return an error that names file, row and column of a cell."""
        place = f"{self.source}, row {self.rows[index]}, column {shown(name)}"
        return InputError(f"{place}: expected {expected}; got {shown(self.columns[name][index])}")

    def numbers(self, name: str, largest: float) -> Floats:
        """Return a column of numbers of at most that size."""
        values = np.array([attempt(number, cell) for cell in self.column(name)], np.float64)
        if not np.isfinite(values).all():
            raise self.fault(int(np.argmin(np.isfinite(values))), name, "a finite number")
        if (wrong := np.abs(values) > largest).any():
            raise self.fault(int(np.argmax(wrong)), name, f"a number from {-largest:g} to {largest:g}")
        return values

    def times(self, name: str) -> Floats:
        """Return a column as seconds: numbers, in the unit at the end of its name, or ISO 8601, as most cells are."""
        cells = self.column(name)
        if not are_dates(cells):
            unit = TIMES.get(name.rpartition("_")[2], 1.0)
            return across_midnight(unit * self.numbers(name, LATEST / unit))
        values = np.array([attempt(seconds, cell) for cell in cells], np.float64)
        if not (usable := np.abs(values) <= LATEST).all():
            raise self.fault(int(np.argmin(usable)), name, "an ISO 8601 time")
        return values

    def labels(self, name: str) -> list[str]:
        """Return a column of names or numbers, none empty."""
        labels = ["" if cell is None else str(cell).strip() for cell in self.column(name)]
        if "" in labels:
            raise self.fault(labels.index(""), name, "a name or number")
        return labels


def across_midnight(times: Floats) -> Floats:
    """Return seconds of the day that pass midnight as times that increase over it, and other times unchanged.

    times: (num,) s, in the order of rows, which must be that of time if they span more than half a day.
    """
    if not len(times) or times.min() < 0.0 or times.max() > DAY or np.ptp(times) <= 0.5 * DAY:
        return times
    steady = np.unwrap(times, period=DAY)
    if np.ptp(steady) > 0.5 * DAY and np.diff(steady).min() < -_IN_ORDER:
        return times
    return np.asarray(steady - DAY * np.floor(steady.min() / DAY))


def as_table(frame: Any, source: str = "table") -> Table:
    """Return a table of columns in memory: a mapping, or a data frame of pandas or Polars. Messages count rows from 1.

    Raises `InputError` for something else, or columns of different lengths.
    """
    names = frame if isinstance(frame, Mapping) else getattr(frame, "columns", None)
    if names is None or isinstance(names, str):
        raise InputError(f"{source}: expected columns by name, or a data frame; got {type(frame).__name__}")
    columns = {str(name): list(frame[name]) for name in names}
    lengths = {name: len(cells) for name, cells in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"{source}: expected columns of one length; got {shown(str(lengths))}")
    return Table(columns, range(1, max(lengths.values(), default=0) + 1), source)


def column_names(names: Iterable[str]) -> str:
    """Return names of columns for a message."""
    listed = [elided(printable(name)) for name in names]
    return ", ".join(listed[:_MOST_NAMES]) + (f" and {len(listed) - _MOST_NAMES} more" * (len(listed) > _MOST_NAMES))


def number(cell: Any) -> float:
    """Return the number in a cell, or in its text. Raises `TypeError` or `ValueError` for anything else."""
    if isinstance(cell, str):
        if "_" in cell or not cell.isascii():  # Python would read 1_000 and digits of any script
            raise ValueError(cell)
    elif isinstance(cell, bool) or not isinstance(cell, numbers.Real | Decimal):
        raise TypeError(cell)
    return float(cell)


def is_empty(cell: Any) -> bool:
    """Return True for an empty cell: None, an empty text, or the missing value of data frames."""
    return cell is None or cell != cell or str(cell).strip() == ""


def attempt(read: Callable[[Any], float], cell: Any) -> float | None:
    """Return what `number` or `seconds` reads in a cell, or None for a cell that it does not accept."""
    try:
        return read(cell)
    except (TypeError, ValueError, OverflowError):
        return None


def is_number(cell: Any) -> bool:
    """Return True if `number` accepts the cell."""
    return attempt(number, cell) is not None


def are_dates(cells: Sequence[Any]) -> bool:
    """Return True if more of the cells are ISO 8601 times than numbers. For equal numbers the first cell decides.

    The majority decides, so that a single bad cell is reported as the bad one.
    """
    num_numbers = sum(map(is_number, cells))
    if num_numbers == 0 or 2 * num_numbers > len(cells):
        return num_numbers == 0 and len(cells) > 0
    dates = sum(attempt(seconds, cell) is not None for cell in cells if not is_number(cell))
    return dates > num_numbers or (dates == num_numbers and not is_number(cells[0]))


def seconds(time: Any) -> float:
    """Return a number, or the seconds from 1970 UTC to an ISO 8601 time or `datetime`. The default zone is UTC."""
    if is_number(time):
        return number(time)
    moment = time if isinstance(time, datetime) else datetime.fromisoformat(str(time).strip())
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
