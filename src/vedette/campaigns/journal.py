"""Writer of the runs of a campaign: one row per run in the SQLite file, each written atomically."""

import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from vedette.campaigns import database
from vedette.campaigns.rows import Row, pack, unpack, verified
from vedette.errors import InputError
from vedette.internal.files import sweep

_INSERT = f"INSERT INTO runs ({database.COLUMNS}) VALUES ({', '.join('?' * (database.COLUMNS.count(',') + 1))})"


class Writer:
    """The only writer of the SQLite file of a folder: `InputError` if another writer has it open."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / database.DATABASE
        self._lock = database.lock_of(folder)
        sweep(folder)
        self._opened: sqlite3.Connection | None = None

    @property
    def _database(self) -> sqlite3.Connection:
        assert self._opened is not None  # set by `open_runs`
        return self._opened

    def open_runs(self, contents: str) -> None:
        """Create the file, or check that it belongs to the campaign whose manifest has the checksum `contents`."""
        with database.translated_errors(self._path):
            opened = sqlite3.connect(self._path, timeout=database.WAIT, isolation_level=None, check_same_thread=False)
            self._opened = opened
            opened.execute("PRAGMA journal_mode = PERSIST")
            opened.execute("PRAGMA synchronous = FULL")
            opened.execute("BEGIN IMMEDIATE")
            if self._path.stat().st_size == 0:  # SQLite has rolled back an interrupted start by now
                for statement in database.TABLES:
                    opened.execute(statement)
                opened.execute("INSERT INTO campaign VALUES (?)", (contents,))
            database.check_tables(self._path, opened)
            rows = opened.execute("SELECT contents FROM campaign").fetchall()
            opened.execute("COMMIT")
        database.check_contents(self._path, rows, contents)

    def put(self, rows: Sequence[Row], session: int) -> None:
        """Store runs, all or none. When this returns they survive any failure of this process or machine.

        Args:
            rows: the runs.
            session: number, from 1, of the session that stores them.

        Raises `InputError`, and stores none, if a run is stored already, or the disk is full or fails.
        """
        places = [database.place_of(row.cell, row.run) for row in rows]
        with database.translated_errors(self._path, places[0] if len(places) == 1 else ""):
            self._database.execute("BEGIN IMMEDIATE")
            with self._database:
                for row, place in zip(rows, places, strict=True):
                    try:
                        self._database.execute(_INSERT, row.values(session))
                    except sqlite3.IntegrityError:
                        raise InputError(f"{self._path}: {place}expected another run; it is there") from None
                    self._database.execute("DELETE FROM failures WHERE cell = ? AND run = ?", (row.cell, row.run))

    def finished(self) -> set[tuple[str, int]]:
        """Return cell and number of every run in the file."""
        with database.translated_errors(self._path):
            rows = self._database.execute("SELECT cell, run FROM runs ORDER BY cell, run").fetchall()
        return set(database.checked_keys(self._path, rows))

    def damaged(self) -> tuple[tuple[str, int], ...]:
        """Return cell and number of every run whose row has changed since it was written."""
        with database.translated_errors(self._path):
            rows = self._database.execute(f"SELECT {database.COLUMNS} FROM runs ORDER BY cell, run")
            return tuple((row[0], row[1]) for row in rows if verified(row) is None)

    def metrics(self) -> Iterator[tuple[str, int, bytes]]:
        """Return cell and number of every run, with its metrics."""
        with database.translated_errors(self._path):
            rows = self._database.execute("SELECT cell, run, metrics FROM runs ORDER BY cell, run").fetchall()
        return ((cell, run, unpack(packed)) for cell, run, packed in rows)

    def put_metrics(self, cell: str, run: int, metrics: bytes) -> None:
        """Replace the metrics of a stored run."""
        where = "UPDATE runs SET metrics = ?, metrics_sha256 = ? WHERE cell = ? AND run = ?"
        self._change(cell, run, where, *pack(cell, run, metrics))

    def copy_missing(self, others: Iterable[tuple[database.Reader, Callable[[int], int]]]) -> int:
        """Copy the runs of other folders that are missing here, in one transaction, and return their number.

        Args:
            others: readers, each with a function from its session numbers to those of this folder.

        Raises `InputError`, and changes nothing, for a damaged run, or one that is stored here with other bytes.
        """
        with database.translated_errors(self._path):
            self._database.execute("BEGIN IMMEDIATE")
            with self._database:
                num_taken = 0
                for reader, session in others:
                    for row in reader.rows():
                        num_taken += self._copy_missing(reader, (*row[:2], session(row[2]), *row[3:]))
                    for each in reader.failures():
                        failure = (each.cell, each.run, session(each.session), each.message)
                        self._database.execute("INSERT OR REPLACE INTO failures VALUES (?, ?, ?, ?)", failure)
                self._database.execute("DELETE FROM failures WHERE (cell, run) IN (SELECT cell, run FROM runs)")
            return num_taken

    def _copy_missing(self, reader: database.Reader, row: tuple[Any, ...]) -> bool:
        """Copy a run, and return True if it was new."""
        if self._database.execute(_INSERT.replace("INSERT", "INSERT OR IGNORE", 1), row).rowcount:
            return True
        stored_checksum = "SELECT payload_sha256 FROM runs WHERE cell = ? AND run = ?"
        if self._database.execute(stored_checksum, row[:2]).fetchone() != (row[4],):
            place = database.place_of(*row[:2])
            raise InputError(f"{reader}: {place}expected the bytes that another folder has of it; got others")
        return False

    def discard(self, cell: str, run: int) -> None:
        """Delete a run from the file."""
        self._change(cell, run, "DELETE FROM runs WHERE cell = ? AND run = ?")

    def _change(self, cell: str, run: int, statement: str, *values: Any) -> None:
        """Execute a statement about one run, whose key follows the values."""
        with database.translated_errors(self._path, database.place_of(cell, run)):
            self._database.execute(statement, (*values, cell, run))

    def close(self) -> None:
        """Release the file for other writers."""
        if self._opened is not None:
            # Fails if a reader is active; the empty journal is harmless.
            with suppress(sqlite3.Error, UnicodeDecodeError):
                self._opened.execute("PRAGMA busy_timeout = 0")
                self._opened.execute("PRAGMA journal_mode = DELETE")
            self._opened.close()
        self._lock.close()
