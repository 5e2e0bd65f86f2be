"""Tables of records: files of several formats and columns in memory, and the values of their cells."""

from __future__ import annotations

import csv
import hashlib
import io
import numbers
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

import numpy as np

from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.text import elided, printable, shown
from vedette.kernels.base.types import Floats
from vedette.recorded.ais import AIS_ENDINGS, read_ais
from vedette.recorded.asterix import ASTERIX_ENDINGS, CAPTURE_ENDINGS, read_asterix
from vedette.recorded.bags import BAG_ENDINGS, read_bag
from vedette.recorded.turns import RadarService

# Beyond these values, differences and speeds of reports are meaningless.
FARTHEST = 1e9  # m, m/s
LATEST = 1e12  # s
_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}
# Larger files would fill the memory before they could be checked.
_MOST_BYTES = 500_000_000
_MOST_REPORTS = 5_000_000
_MOST_NAMES = 20
ENDINGS = (".csv", ".parquet", *AIS_ENDINGS, *ASTERIX_ENDINGS, *BAG_ENDINGS)


@dataclass(frozen=True, slots=True)
class Table:
    """Unchanged columns, the row number of each entry in its file, and a name for messages.

    bearings: their zero in the format, "north" or "east"; None: not defined. notes: warnings. sha256: of the file, in
    hexadecimal digits; "" for columns in memory. service: turns of sensors by their service messages.
    """

    columns: Mapping[str, Sequence[Any]]
    rows: Sequence[int]
    source: str
    bearings: Literal["east", "north"] | None = None
    notes: tuple[str, ...] = ()
    sha256: str = ""
    service: Mapping[str, RadarService] = field(default_factory=dict)

    def column(self, name: str) -> Sequence[Any]:
        """Return the cells of a column; raises `InputError` with the names of all columns if it is missing."""
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
        cells = self.column(name)
        values = np.empty(len(cells))
        for i, cell in enumerate(cells):
            try:
                values[i] = number(cell)
            except (TypeError, ValueError, OverflowError):
                raise self.fault(i, name, "a finite number") from None
        if not np.isfinite(values).all():
            raise self.fault(int(np.argmin(np.isfinite(values))), name, "a finite number")
        if (wrong := np.abs(values) > largest).any():
            raise self.fault(int(np.argmax(wrong)), name, f"a number from {-largest:g} to {largest:g}")
        return values

    def times(self, name: str) -> Floats:
        """Return a column of times as seconds; its cells are numbers or ISO 8601 times, as most of them are."""
        cells = self.column(name)
        if not are_dates(cells):
            return self.numbers(name, LATEST)
        values = np.empty(len(cells))
        for i, cell in enumerate(cells):
            try:
                values[i] = seconds(cell)
            except (TypeError, ValueError, OverflowError):
                raise self.fault(i, name, "an ISO 8601 time") from None
            if not abs(values[i]) <= LATEST:  # a number, infinite or not, among times
                raise self.fault(i, name, "an ISO 8601 time")
        return values

    def labels(self, name: str) -> list[str]:
        """Return a column of names or numbers, none empty."""
        labels = ["" if cell is None else str(cell).strip() for cell in self.column(name)]
        if "" in labels:
            raise self.fault(labels.index(""), name, "a name or number")
        return labels


def as_table(frame: Any, source: str = "table") -> Table:
    """Return a table of columns in memory: a mapping, or a data frame of pandas or Polars; messages count rows from 1.

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
    """Return the number in a cell, or in its text; raises `TypeError` or `ValueError` for anything else."""
    if isinstance(cell, str):
        if "_" in cell or not cell.isascii():  # Python would read 1_000 and digits of any script
            raise ValueError(cell)
    elif isinstance(cell, bool) or not isinstance(cell, numbers.Real | Decimal):
        raise TypeError(cell)
    return float(cell)


def is_empty(cell: Any) -> bool:
    """Return True for an empty cell: None, an empty text, or the missing value of data frames."""
    return cell is None or cell != cell or str(cell).strip() == ""


def is_number(cell: Any) -> bool:
    """Return True if `number` accepts the cell."""
    try:
        number(cell)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def are_dates(cells: Sequence[Any]) -> bool:
    """Return True if more of the cells are ISO 8601 times than numbers; for equal numbers the first cell decides.

    The majority decides, so that a single bad cell is reported as the bad one.
    """
    num_numbers = sum(map(is_number, cells))
    if num_numbers == 0 or 2 * num_numbers > len(cells):
        return num_numbers == 0 and len(cells) > 0
    dates = sum(_is_date(cell) for cell in cells if not is_number(cell))
    return dates > num_numbers or (dates == num_numbers and not is_number(cells[0]))


def _is_date(cell: Any) -> bool:
    try:
        seconds(cell)
    except (TypeError, ValueError, OverflowError):
        return False
    return True


def seconds(time: Any) -> float:
    """Return a number, or the seconds from 1970 UTC to an ISO 8601 time or `datetime`; the default zone is UTC."""
    if is_number(time):
        return number(time)
    moment = time if isinstance(time, datetime) else datetime.fromisoformat(str(time).strip())
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def read_table(path: str | Path, *, reports: bool = False, sha256: str | None = None) -> Table:
    """Return a table from a .csv file with a header line, or from a .parquet, AIS, ASTERIX or ROS 2 bag file.

    These are AIS messages (.nmea, .ais), plots and tracks of radars (.ast, .asterix, .raw), and ROS 2 bags (.db3,
    .mcap).

    Args:
        path: of the file.
        reports: True to read positions that targets report, from a file that may have scans, too.
        sha256: SHA-256 that the file must have, in hexadecimal digits; None: any.

    Raises:
        MissingPackageError: the package that reads the format is not installed.
        InputError: no such file, another ending, another `sha256`, content that does not match the format, or rows of
            another length than the header.
    """
    file = Path(path)
    named = elided(printable(str(file)), 200)
    if file.suffix.lower() in CAPTURE_ENDINGS:
        command = f"tshark -r {file.name} -T fields -e udp.payload | xxd -r -p > {file.stem}.ast"
        raise InputError(f"{named}: expected ASTERIX without network headers; got a capture; write it by `{command}`")
    if file.suffix.lower() not in ENDINGS:
        raise InputError(f"{named}: expected a file that ends with {', '.join(ENDINGS)}")
    if not os.path.isfile(file):  # pathlib raises for a name that is too long or has forbidden characters
        raise InputError(f"{named}: no such file; expected a table of records")
    if (size := file.stat().st_size) > _MOST_BYTES:
        raise InputError(f"{named}: expected a file of at most {_MOST_BYTES} bytes; got {size}")
    content, digest = _content(file)
    if sha256 not in (None, digest):
        expected = f"the file of which sha256 was kept ({sha256[:12]}...)"
        raise InputError(f"{file}: expected {expected}; got another ({digest[:12]}...), as it was changed since")
    return replace(_parsed(file, content, reports), sha256=digest)


def _content(file: Path) -> tuple[bytes, str]:
    """Return the bytes of a file (empty if a package reads it by its name) and their SHA-256 in hexadecimal digits."""
    try:
        with file.open("rb") as source:
            if file.suffix.lower() in (".csv", ".parquet"):
                content = source.read()
                return content, hashlib.sha256(content).hexdigest()
            return b"", hashlib.file_digest(source, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {_reason(error)}") from error


def _parsed(file: Path, content: bytes, reports: bool) -> Table:
    """Return the table of a file with an ending of `ENDINGS`."""
    ending = file.suffix.lower()
    if ending in AIS_ENDINGS:
        columns, rows, notes = read_ais(file)
        return Table(columns, rows, str(file), notes=notes)
    if ending in ASTERIX_ENDINGS:
        columns, rows, notes, service = read_asterix(file, reports=reports)
        return Table(columns, rows, str(file), "north", notes, service=service)
    if ending in BAG_ENDINGS:
        return Table(*read_bag(file, reports=reports), str(file))
    return _csv(file, content) if ending == ".csv" else _parquet(file, content)


def _csv(file: Path, content: bytes) -> Table:
    try:
        reader = csv.reader(io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig", newline=""), strict=True)
        header = header_of(reader, file)
        rows = [(reader.line_num, cells) for cells in reader if cells]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: cannot be read as CSV in UTF-8: {_reason(error)}") from error
    if len(set(header)) != len(header):
        raise InputError(f"{file}, row 1: expected each column name once; got {column_names(header)}")
    for line, cells in rows:
        if len(cells) != len(header):
            raise InputError(f"{file}, row {line}: expected {len(header)} cells, as in the header; got {len(cells)}")
    columns = {name: [cells[i] for _, cells in rows] for i, name in enumerate(header)}
    return Table(columns, [line for line, _ in rows], str(file))


def header_of(reader: Iterator[list[str]], file: Path) -> list[str]:
    """Return the names of the columns of a CSV file; raises `InputError` if the separators are not commas."""
    header = [name.strip() for name in next(reader, [])]
    other = next((letter for letter in _SEPARATORS if letter in header[0]), None) if len(header) == 1 else None
    if other is not None:
        separators = f"{_SEPARATORS[other]}; write it anew with commas, and with a point in numbers"
        raise InputError(f"{file}, row 1: expected columns separated by commas; got them separated by {separators}")
    return header


def _parquet(file: Path, content: bytes) -> Table:
    require_packages(f"{file}, which is a Parquet file,", "pyarrow")
    from pyarrow import ArrowException, parquet  # here, as most programs never need it

    try:
        with parquet.ParquetFile(io.BytesIO(content)) as source:
            if source.metadata.num_rows > _MOST_REPORTS:
                raise InputError(f"{file}: expected at most {_MOST_REPORTS} rows; got {source.metadata.num_rows}")
            table = source.read()
        columns = {name: table.column(name).to_pylist() for name in dict.fromkeys(table.column_names)}
    except InputError:
        raise
    except (OSError, ValueError, KeyError, OverflowError, ArrowException) as error:
        raise InputError(f"{file}: cannot be read as Parquet: {_reason(error)}") from error
    return Table(columns, range(1, table.num_rows + 1), str(file))


def _reason(error: Exception) -> str:
    """Return the error message of another library, on one line."""
    return elided(printable(" ".join(str(error).split())), 300)
