"""SQLite file of a results folder: its tables, locking, reading, and translation of SQLite errors.

It uses a rollback journal, not a write-ahead log: see docs/decisions/0004-results-store.md.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vedette.campaigns.rows import Entry, verified
from vedette.errors import InputError
from vedette.internal.files import locked
from vedette.internal.reading import error_summary
from vedette.internal.text import printable, shown

DATABASE, LOCK = "campaign.sqlite", "campaign.lock"

WAIT = 60.0  # s, for another reader or writer, which holds the file for milliseconds
_AT_ONCE = 256  # rows per query
TABLES = (
    "CREATE TABLE campaign (contents TEXT NOT NULL)",
    "CREATE TABLE runs (cell TEXT NOT NULL, run INTEGER NOT NULL, session INTEGER NOT NULL, "
    "payload BLOB NOT NULL, payload_sha256 TEXT NOT NULL, metrics BLOB NOT NULL, metrics_sha256 TEXT NOT NULL, "
    "timings BLOB NOT NULL, timings_sha256 TEXT NOT NULL, PRIMARY KEY (cell, run))",
    "CREATE TABLE failures (cell TEXT NOT NULL, run INTEGER NOT NULL, session INTEGER NOT NULL, "
    "message TEXT NOT NULL, PRIMARY KEY (cell, run))",
)
ALTERED = "expected the run as it was written; it is cut short or altered"
COLUMNS = "cell, run, session, payload, payload_sha256, metrics, metrics_sha256, timings, timings_sha256"


@dataclass(frozen=True, slots=True)
class Failure:
    """A run that could not be finished: its session (from 1), and the reason and place where it stopped."""

    cell: str
    run: int
    session: int
    message: str


class Reader:
    """Reader of the SQLite file of a folder, also while a writer adds to it. Reopens the file for every query."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / DATABASE

    def __str__(self) -> str:
        return str(self._path)

    def check(self, contents: str) -> None:
        """Raise `InputError` unless the file is intact and belongs to the campaign whose manifest has that checksum."""
        check_contents(self._path, self._ask("SELECT contents FROM campaign"), contents)

    def finished(self) -> list[tuple[str, int]]:
        """Return cell and number of every run in the file, sorted."""
        return checked_keys(self._path, self._ask("SELECT cell, run FROM runs ORDER BY cell, run"))

    def failures(self) -> list[Failure]:
        """Return the runs that could not be finished, sorted."""
        rows = self._ask("SELECT cell, run, session, message FROM failures ORDER BY cell, run")
        checked_keys(self._path, [row[:2] for row in rows])
        for _, _, session, message in rows:
            if not isinstance(session, int) or not isinstance(message, str):
                raise InputError(f"{self._path}: expected why a run failed; got {shown(message)}")
        return [Failure(*row) for row in rows]

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield every stored row, by cell and number. Raises `InputError` at the first damaged one."""
        with translated_errors(self._path), closing(_opened(self._path)) as database:
            for row in database.execute(f"SELECT {COLUMNS} FROM runs ORDER BY cell, run"):
                if verified(row) is None:
                    raise InputError(f"{self._path}: {place_of(*map(printable, map(str, row[:2])))}{ALTERED}")
                yield row

    def entry(self, cell: str, run: int) -> Entry:
        """Return a finished run with verified checksums. Raises `InputError` if it is missing or damaged."""
        (entry,) = self.entries(cell, [run])
        return entry

    def entries(self, cell: str, runs: Sequence[int]) -> Iterator[Entry]:
        """Yield finished runs of a cell, read a few hundred at a time. Raises as `entry`."""
        for start in range(0, len(runs), _AT_ONCE):
            batch = runs[start : start + _AT_ONCE]
            question = f"SELECT {COLUMNS} FROM runs WHERE cell = ? AND run IN ({', '.join('?' * len(batch))})"
            rows = {row[1]: row for row in self._ask(question, (cell, *batch), place_of(cell, batch[0]))}
            for run in batch:
                if run not in rows:
                    raise InputError(f"{self._path}: {place_of(cell, run)}expected a finished run; it is not there yet")
                entry = verified(rows[run])
                if entry is None:
                    raise InputError(f"{self._path}: {place_of(cell, run)}{ALTERED}")
                yield entry

    def _ask(self, question: str, values: Sequence[Any] = (), where: str = "") -> list[Any]:
        with translated_errors(self._path, where):
            try:
                return _answer(self._path, question, values)
            except sqlite3.OperationalError as error:
                if _code(error) != sqlite3.SQLITE_READONLY_ROLLBACK:
                    raise
            # A writer was killed while writing: opening for writing rolls its transaction back.
            _answer(self._path, question, values, mode="rw")
            return _answer(self._path, question, values)


def _answer(path: Path, question: str, values: Sequence[Any], mode: str = "ro") -> list[Any]:
    with closing(_opened(path, mode)) as database:
        check_tables(path, database)
        return database.execute(question, values).fetchall()


def _opened(path: Path, mode: str = "ro") -> sqlite3.Connection:
    database = sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", timeout=WAIT, uri=True)
    database.text_factory = _text  # so that one damaged row does not fail a query of many
    return database


def _text(content: bytes) -> str | bytes:
    try:
        return content.decode()
    except UnicodeDecodeError:  # callers that expect text refuse it
        return content


def check_tables(path: Path, database: sqlite3.Connection) -> None:
    """Raise `InputError` unless the file has exactly the tables of a campaign, without triggers or views."""
    rows = database.execute("SELECT sql FROM sqlite_master WHERE name NOT LIKE 'sqlite~_%' ESCAPE '~'")
    if sorted(str(sql) for (sql,) in rows) != sorted(TABLES):
        raise InputError(f"{path}: expected the tables of a campaign; the file is cut short or altered")


def checked_keys(path: Path, rows: Sequence[tuple[Any, Any]]) -> list[tuple[str, int]]:
    """Return the cells and numbers of runs. Raises `InputError` for values of other types."""
    for cell, run in rows:
        if not isinstance(cell, str) or not isinstance(run, int):
            raise InputError(f"{path}: expected the name and number of a run; got {shown(cell)} and {shown(run)}")
    return list(rows)


def lock_of(folder: Path) -> sqlite3.Connection:
    """Return the lock of a folder, see `vedette.internal.files.locked`."""
    busy = f"{folder}: expected to write alone; another process is writing this campaign"
    return locked(folder / LOCK, busy, f"{folder}: expected a folder that can be written; {LOCK}:")


def check_contents(path: Path, rows: Sequence[tuple[str]], contents: str) -> None:
    """Raise `InputError` unless the file contains only the checksum `contents` of the manifest."""
    if list(rows) != [(contents,)]:
        raise InputError(
            f"{path}: expected the runs of the manifest beside it; they are another campaign's, or the manifest was "
            "altered"
        )


def place_of(cell: str, run: int | str) -> str:
    """Return the beginning of messages about a run."""
    return f"cell {cell}, run {run}: "


@contextmanager
def translated_errors(path: Path, where: str = "") -> Iterator[None]:
    """Context manager that turns SQLite errors into errors of this library that name the file."""
    try:
        yield
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # the latter if a message quotes the file
        raise InputError(f"{path}: {where}{_advice(path, error)} ({printable(error_summary(error))})") from error


def _advice(path: Path, error: Exception) -> str:
    primary = _code(error) & 0xFF
    if primary in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
        return "expected room on the disk and a disk that works; no finished run is lost: make room, go on"
    if primary in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM):
        return "expected a file that can be opened" if path.exists() else "expected the runs of a campaign; got no file"
    if primary == sqlite3.SQLITE_BUSY:
        return f"expected a file that is free within {WAIT:g} s; it stayed in use"
    return "expected the runs of a campaign as they were written; the file is cut short or altered"


def _code(error: Exception) -> int:
    """Return SQLite's extended error code, or -1 for errors of Python's own layer."""
    return int(getattr(error, "sqlite_errorcode", -1))
