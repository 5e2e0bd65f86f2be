"""The runs of a campaign in one SQLite file: a row a run, each landing whole or not at all.

A rollback journal, not a write-ahead log: see docs/decisions/0004-results-store.md.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vedette.campaigns.rows import Entry, Row, pack, verified
from vedette.errors import InputError
from vedette.reading import inflate, said
from vedette.text import printable, shown

DATABASE, LOCK = "campaign.sqlite", "campaign.lock"

_WAIT = 60.0  # s, for a reader or writer of the same file; each holds it for milliseconds
_AT_ONCE = 256  # rows that are asked for together
_TABLES = (
    "CREATE TABLE campaign (contents TEXT NOT NULL)",
    "CREATE TABLE runs (cell TEXT NOT NULL, run INTEGER NOT NULL, session INTEGER NOT NULL, "
    "payload BLOB NOT NULL, payload_sha256 TEXT NOT NULL, metrics BLOB NOT NULL, metrics_sha256 TEXT NOT NULL, "
    "timings BLOB NOT NULL, timings_sha256 TEXT NOT NULL, PRIMARY KEY (cell, run))",
    "CREATE TABLE failures (cell TEXT NOT NULL, run INTEGER NOT NULL, session INTEGER NOT NULL, "
    "message TEXT NOT NULL, PRIMARY KEY (cell, run))",
)
_ALTERED = "expected the run as it was written; it is cut short or altered"
_COLUMNS = "cell, run, session, payload, payload_sha256, metrics, metrics_sha256, timings, timings_sha256"
_INSERT = f"INSERT INTO runs ({_COLUMNS}) VALUES ({', '.join('?' * (_COLUMNS.count(',') + 1))})"


@dataclass(frozen=True, slots=True)
class Failure:
    """A run that could not be finished, in which session (counted from 1), and why: where it stopped."""

    cell: str
    run: int
    session: int
    message: str


class Writer:
    """Adds runs to the file of one folder, alone: `InputError` if another writer has it open."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / DATABASE
        self._lock = _lock(folder)
        self._opened: sqlite3.Connection | None = None

    @property
    def _database(self) -> sqlite3.Connection:
        assert self._opened is not None  # by `open_runs`
        return self._opened

    def open_runs(self, contents: str) -> None:
        """Make the file, or check that it is of the campaign whose manifest has the checksum `contents`."""
        with _explained(self._path):
            database = sqlite3.connect(self._path, timeout=_WAIT, isolation_level=None, check_same_thread=False)
            self._opened = database
            database.execute("PRAGMA journal_mode = PERSIST")
            database.execute("PRAGMA synchronous = FULL")
            database.execute("BEGIN IMMEDIATE")
            if self._path.stat().st_size == 0:  # what an interrupted start left is taken back by now
                for statement in _TABLES:
                    database.execute(statement)
                database.execute("INSERT INTO campaign VALUES (?)", (contents,))
            _check_tables(self._path, database)
            found = database.execute("SELECT contents FROM campaign").fetchall()
            database.execute("COMMIT")
        _check_contents(self._path, found, contents)

    def put(self, rows: Sequence[Row], session: int) -> None:
        """Put runs on the disk, all or none; when this returns they stay, whatever happens to this process or machine.

        Args:
            rows: of the runs.
            session: that they are handed in by, counted from 1.

        Raises `InputError`, and keeps none, where a run is there already, and where the disk is full or fails.
        """
        places = [_place(row.cell, row.run) for row in rows]
        with _explained(self._path, places[0] if len(places) == 1 else ""):
            self._database.execute("BEGIN IMMEDIATE")
            with self._database:
                for row, place in zip(rows, places, strict=True):
                    try:
                        self._database.execute(_INSERT, row.values(session))
                    except sqlite3.IntegrityError:
                        raise InputError(f"{self._path}: {place}expected another run; it is there") from None
                    self._database.execute("DELETE FROM failures WHERE cell = ? AND run = ?", (row.cell, row.run))

    def put_failure(self, failure: Failure) -> None:
        """Keep why a run could not be finished, in place of an earlier reason, until it is."""
        self._change(
            failure.cell,
            failure.run,
            "INSERT OR REPLACE INTO failures (session, message, cell, run) VALUES (?, ?, ?, ?)",
            failure.session,
            failure.message,
        )

    def finished(self) -> set[tuple[str, int]]:
        """Cell and number of every run in the file."""
        return set(self._keys())

    def damaged(self) -> tuple[tuple[str, int], ...]:
        """Cell and number of every run whose row is not as it was written."""
        with _explained(self._path):
            rows = self._database.execute(f"SELECT {_COLUMNS} FROM runs ORDER BY cell, run")
            return tuple((row[0], row[1]) for row in rows if verified(row) is None)

    def metrics(self) -> Iterator[tuple[str, int, bytes]]:
        """Cell and number of every run, with its measures."""
        with _explained(self._path):
            rows = self._database.execute("SELECT cell, run, metrics FROM runs ORDER BY cell, run").fetchall()
        return ((cell, run, inflate(packed)) for cell, run, packed in rows)

    def put_metrics(self, cell: str, run: int, metrics: bytes) -> None:
        """Keep other measures of a run that is there."""
        where = "UPDATE runs SET metrics = ?, metrics_sha256 = ? WHERE cell = ? AND run = ?"
        self._change(cell, run, where, *pack(cell, run, metrics))

    def take_in(self, others: Iterable[tuple[Reader, Callable[[int], int]]]) -> int:
        """Copy the runs of other folders that are not here yet, all in one transaction; returns their number.

        Args:
            others: each with the session that stands here for one of its own.

        Raises `InputError`, and changes nothing, for a run that is not as it was written, or has other bytes here.
        """
        with _explained(self._path):
            self._database.execute("BEGIN IMMEDIATE")
            with self._database:
                num_taken = 0
                for reader, session in others:
                    for row in reader.rows():
                        num_taken += self._take_in(reader, (*row[:2], session(row[2]), *row[3:]))
                    for each in reader.failures():
                        failure = (each.cell, each.run, session(each.session), each.message)
                        self._database.execute("INSERT OR REPLACE INTO failures VALUES (?, ?, ?, ?)", failure)
                self._database.execute("DELETE FROM failures WHERE (cell, run) IN (SELECT cell, run FROM runs)")
            return num_taken

    def _take_in(self, reader: Reader, row: tuple[Any, ...]) -> bool:
        """Whether a run was new."""
        if self._database.execute(_INSERT.replace("INSERT", "INSERT OR IGNORE", 1), row).rowcount:
            return True
        kept = "SELECT payload_sha256 FROM runs WHERE cell = ? AND run = ?"
        if self._database.execute(kept, row[:2]).fetchone() != (row[4],):
            place = _place(*row[:2])
            raise InputError(f"{reader}: {place}expected the bytes that another folder has of it; got others")
        return False

    def rewrite(self, payload: Callable[[Entry], bytes]) -> None:
        """Give every run another payload, all in one transaction.

        Raises `InputError`, and changes nothing, for a run that is not as it was written, and as `payload` does.
        """
        with _explained(self._path):
            keys = self._keys()
            self._database.execute("BEGIN IMMEDIATE")
            with self._database:
                for key in keys:
                    self._rewrite(*key, payload)

    def _rewrite(self, cell: str, run: int, payload: Callable[[Entry], bytes]) -> None:
        where = f"{self._path}: {_place(cell, run)}"
        rows = self._database.execute(f"SELECT {_COLUMNS} FROM runs WHERE cell = ? AND run = ?", (cell, run))
        entry = verified(rows.fetchone())
        if entry is None:
            raise InputError(f"{where}{_ALTERED}")
        try:
            packed = pack(cell, run, payload(entry))
        except InputError as error:
            raise InputError(f"{where}{error}") from error
        change = "UPDATE runs SET payload = ?, payload_sha256 = ? WHERE cell = ? AND run = ?"
        self._database.execute(change, (*packed, cell, run))

    def discard(self, cell: str, run: int) -> None:
        """Take a run out of the file."""
        self._change(cell, run, "DELETE FROM runs WHERE cell = ? AND run = ?")

    def _keys(self) -> list[tuple[str, int]]:
        with _explained(self._path):
            rows = self._database.execute("SELECT cell, run FROM runs ORDER BY cell, run").fetchall()
        return _checked_keys(self._path, rows)

    def _change(self, cell: str, run: int, statement: str, *values: Any) -> None:
        """A statement about one run, which stands behind its values."""
        with _explained(self._path, _place(cell, run)):
            self._database.execute(statement, (*values, cell, run))

    def close(self) -> None:
        """Let other writers in."""
        if self._opened is not None:
            # A reader at this very moment: the emptied journal does no harm.
            with suppress(sqlite3.Error, UnicodeDecodeError):
                self._opened.execute("PRAGMA busy_timeout = 0")
                self._opened.execute("PRAGMA journal_mode = DELETE")
            self._opened.close()
        self._lock.close()


class Reader:
    """Reads the file of one folder, also while a writer adds to it; opened anew for every question."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / DATABASE

    def __str__(self) -> str:
        return str(self._path)

    def check(self, contents: str) -> None:
        """`InputError` unless the file is whole so far and of the campaign whose manifest has that checksum."""
        _check_contents(self._path, self._ask("SELECT contents FROM campaign"), contents)

    def finished(self) -> list[tuple[str, int]]:
        """Cell and number of every run in the file, sorted."""
        return _checked_keys(self._path, self._ask("SELECT cell, run FROM runs ORDER BY cell, run"))

    def failures(self) -> list[Failure]:
        """The runs that were tried and could not be finished, sorted."""
        rows = self._ask("SELECT cell, run, session, message FROM failures ORDER BY cell, run")
        _checked_keys(self._path, [row[:2] for row in rows])
        for _, _, session, message in rows:
            if not isinstance(session, int) or not isinstance(message, str):
                raise InputError(f"{self._path}: expected why a run failed; got {shown(message)}")
        return [Failure(*row) for row in rows]

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Every run as it is kept, by cell and number. `InputError` at the first one that is damaged."""
        with _explained(self._path), closing(_opened(self._path)) as database:
            for row in database.execute(f"SELECT {_COLUMNS} FROM runs ORDER BY cell, run"):
                if verified(row) is None:
                    raise InputError(f"{self._path}: {_place(*map(printable, map(str, row[:2])))}{_ALTERED}")
                yield row

    def entry(self, cell: str, run: int) -> Entry:
        """A finished run, its checksums verified. `InputError` where there is none, or its row is damaged."""
        (entry,) = self.entries(cell, [run])
        return entry

    def entries(self, cell: str, runs: Sequence[int]) -> Iterator[Entry]:
        """Finished runs of a cell, a few hundred read at a time; raises as `entry`."""
        for start in range(0, len(runs), _AT_ONCE):
            few = runs[start : start + _AT_ONCE]
            question = f"SELECT {_COLUMNS} FROM runs WHERE cell = ? AND run IN ({', '.join('?' * len(few))})"
            found = {row[1]: row for row in self._ask(question, (cell, *few), _place(cell, few[0]))}
            for run in few:
                if run not in found:
                    raise InputError(f"{self._path}: {_place(cell, run)}expected a finished run; it is not there yet")
                entry = verified(found[run])
                if entry is None:
                    raise InputError(f"{self._path}: {_place(cell, run)}{_ALTERED}")
                yield entry

    def _ask(self, question: str, values: Sequence[Any] = (), where: str = "") -> list[Any]:
        with _explained(self._path, where):
            try:
                return _answer(self._path, question, values)
            except sqlite3.OperationalError as error:
                if _code(error) != sqlite3.SQLITE_READONLY_ROLLBACK:
                    raise
            # A writer was killed in the middle of a run: what it left half done is first taken back.
            _answer(self._path, question, values, mode="rw")
            return _answer(self._path, question, values)


def _answer(path: Path, question: str, values: Sequence[Any], mode: str = "ro") -> list[Any]:
    with closing(_opened(path, mode)) as database:
        _check_tables(path, database)
        return database.execute(question, values).fetchall()


def _opened(path: Path, mode: str = "ro") -> sqlite3.Connection:
    database = sqlite3.connect(f"{path.resolve().as_uri()}?mode={mode}", timeout=_WAIT, uri=True)
    database.text_factory = _text  # so that one damaged row does not hide behind all that are asked for with it
    return database


def _text(content: bytes) -> str:
    return content.decode(errors="replace")


def _check_tables(path: Path, database: sqlite3.Connection) -> None:
    """`InputError` unless the tables are those of a campaign, with nothing that acts or answers in their place."""
    rows = database.execute("SELECT sql FROM sqlite_master WHERE name NOT LIKE 'sqlite~_%' ESCAPE '~'")
    if sorted(str(sql) for (sql,) in rows) != sorted(_TABLES):
        raise InputError(f"{path}: expected the tables of a campaign; the file is cut short or altered")


def _checked_keys(path: Path, rows: Sequence[tuple[Any, Any]]) -> list[tuple[str, int]]:
    """Cells and numbers of runs, if that is what they are."""
    for cell, run in rows:
        if not isinstance(cell, str) or not isinstance(run, int):
            raise InputError(f"{path}: expected the name and number of a run; got {shown(cell)} and {shown(run)}")
    return list(rows)


def _lock(folder: Path) -> sqlite3.Connection:
    """An open transaction on a file beside: SQLite's own locks, which the system ends with the process."""
    path = folder / LOCK
    lock = sqlite3.connect(path, timeout=0.0, isolation_level=None, check_same_thread=False)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except (sqlite3.Error, UnicodeDecodeError) as error:
        lock.close()
        if _code(error) == sqlite3.SQLITE_BUSY:
            raise InputError(f"{folder}: expected to write alone; another process is writing this campaign") from None
        why = f"{path.name}: {printable(said(error))}"
        raise InputError(f"{folder}: expected a folder that can be written; {why}") from error
    return lock


def _check_contents(path: Path, found: Sequence[tuple[str]], contents: str) -> None:
    if list(found) != [(contents,)]:
        raise InputError(
            f"{path}: expected the runs of the manifest beside it; they are another campaign's, or the manifest was "
            "altered"
        )


def _place(cell: str, run: int | str) -> str:
    return f"cell {cell}, run {run}: "


@contextmanager
def _explained(path: Path, where: str = "") -> Iterator[None]:
    """What SQLite raises, as errors of this library that name the file."""
    try:
        yield
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # the latter of words of the file in a message
        raise InputError(f"{path}: {where}{_advice(path, error)} ({printable(said(error))})") from error


def _advice(path: Path, error: Exception) -> str:
    primary = _code(error) & 0xFF
    if primary in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
        return "expected room on the disk and a disk that works; what was finished before is kept: make room, go on"
    if primary in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM):
        return "expected a file that can be opened" if path.exists() else "expected the runs of a campaign; got no file"
    if primary == sqlite3.SQLITE_BUSY:
        return f"expected a file that is free within {_WAIT:g} s; it stayed in use"
    return "expected the runs of a campaign as they were written; the file is cut short or altered"


def _code(error: Exception) -> int:
    """SQLite's extended code of an error; -1 for what Python's own layer raised."""
    return int(getattr(error, "sqlite_errorcode", -1))
