"""Files of tables of records: CSV, Parquet, AIS, ASTERIX and ROS 2 bags."""

import csv
import hashlib
import io
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from vedette.errors import InputError
from vedette.internal.extras import require_packages
from vedette.internal.reading import error_summary
from vedette.internal.text import elided, printable
from vedette.recorded.ais import AIS_ENDINGS, read_ais
from vedette.recorded.asterix import ASTERIX_ENDINGS, CAPTURE_ENDINGS, read_asterix
from vedette.recorded.bags import BAG_ENDINGS, read_bag
from vedette.recorded.tables import Table, column_names

ENDINGS = (".csv", ".parquet", *AIS_ENDINGS, *ASTERIX_ENDINGS, *BAG_ENDINGS)
_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}
# Larger files would fill the memory before they could be checked.
_MOST_BYTES = 500_000_000
_MOST_REPORTS = 5_000_000


def read_table(path: str | Path, *, reports: bool = False, sha256: str | None = None) -> Table:
    """Return a table from a .csv file with a header line, or from a .parquet, AIS, ASTERIX or ROS 2 bag file.

    These are AIS messages (.nmea, .ais), plots and tracks of radars (.ast, .asterix, .raw), and ROS 2 bags (.db3,
    .mcap).

    Args:
        path: of the file.
        reports: True to read positions that targets report, from a file that may have scans, too.
        sha256: SHA-256 that the file must have, in hexadecimal digits. None: any.

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
        raise InputError(f"{file}: cannot be read: {printable(error_summary(error))}") from error


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
        raise InputError(f"{file}: cannot be read as CSV in UTF-8: {printable(error_summary(error))}") from error
    if len(set(header)) != len(header):
        raise InputError(f"{file}, row 1: expected each column name once; got {column_names(header)}")
    for line, cells in rows:
        if len(cells) != len(header):
            raise InputError(f"{file}, row {line}: expected {len(header)} cells, as in the header; got {len(cells)}")
    columns = {name: [cells[i] for _, cells in rows] for i, name in enumerate(header)}
    return Table(columns, [line for line, _ in rows], str(file))


def header_of(reader: Iterator[list[str]], file: Path) -> list[str]:
    """Return the names of the columns of a CSV file. Raises `InputError` if the separators are not commas."""
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
        raise InputError(f"{file}: cannot be read as Parquet: {printable(error_summary(error))}") from error
    return Table(columns, range(1, table.num_rows + 1), str(file))
