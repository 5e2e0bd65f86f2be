"""Files of a live loop: a record of its lines and snapshots of its state, to resume after any interruption."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any, BinaryIO

from vedette.errors import InputError
from vedette.internal.files import lock_beside
from vedette.live.answers import Answer
from vedette.live.lines import CHUNK, LineSplitter
from vedette.live.loop import LiveLoop, LiveState
from vedette.live.messages import MAX_LINE_BYTES, is_message
from vedette.tracking import load_snapshot, save_snapshot


class PersistentLoop:
    """A live loop with its files.

    A line is written to the record before it is processed. After any interruption, the next loop starts from the
    snapshot, processes the lines of the record after it, and continues. The result is the same as without the
    interruption, except that these lines are answered a second time.

    Args:
        live: the loop.
        identity: identifier of the loop in its snapshots, such as a digest of its files.
        snapshot: file of the state. None: no snapshots.
        snapshot_interval: time between snapshots in s.
        record: file of the lines. None: no record.
        clock: function that returns a time in s, for the times of snapshots.
        report: receives the message if a snapshot cannot be written. The loop continues.

    Raises:
        InputError: a file that cannot be read or written, belongs to another loop, or is in use by another process.
    """

    def __init__(
        self,
        live: LiveLoop,
        *,
        identity: str = "",
        snapshot: Path | None = None,
        snapshot_interval: float = 10.0,
        record: Path | None = None,
        clock: Callable[[], float] = time.monotonic,
        report: Callable[[str], object] = print,
    ) -> None:
        self.live, self.state = live, live.initial()
        self._identity = identity
        self._snapshot = snapshot
        self._snapshot_interval = snapshot_interval
        self._clock = clock
        self._report = report
        self._saved_at, self._saved_lines = clock(), 0
        self._path = record
        with contextlib.ExitStack() as locks:
            for file in (snapshot, record):
                if file is not None and file.parent.is_dir():
                    locks.callback(lock_beside(file).close)
            if snapshot is not None and os.path.lexists(snapshot):
                self.state = _restored_state(load_snapshot(snapshot), snapshot, identity)
                self._saved_lines = self.state.num_lines
            self._record = None if record is None else _open_record(record)
            self._locks = locks.pop_all()

    def resume(self) -> Iterator[tuple[Answer, ...]]:
        """Process the lines of the record after the snapshot, and yield the answers to each."""
        if self._record is None:
            return
        num_in_snapshot, num = self.state.num_lines, 0
        self._record.seek(0)
        for num, line in enumerate(_lines(self._record), start=1):
            if num > num_in_snapshot:
                self.state, answers = self.live.process(self.state, line)
                yield answers
        if num < num_in_snapshot:
            wanted = f"at least the {num_in_snapshot} lines that the snapshot has taken"
            raise InputError(f"{self._path}: expected {wanted}; got {num}")
        _truncate_incomplete_line(self._record)

    def process(self, line: bytes) -> tuple[Answer, ...]:
        """Record a line, process it, save the state if a snapshot is due, and return the answers."""
        if self._record is not None:
            try:
                self._record.write(line + b"\n")
                self._record.flush()
            except OSError as error:
                raise InputError(f"{self._path}: expected room for the record; {error.strerror}") from error
        self.state, answers = self.live.process(self.state, line)
        if self._snapshot is not None and self._clock() - self._saved_at >= self._snapshot_interval:
            self.save()
        return answers

    def save(self) -> None:
        """Save the state if there is a file for it and lines arrived since the last snapshot."""
        if self._snapshot is None or self.state.num_lines == self._saved_lines:
            return
        try:
            parts = {field.name: getattr(self.state, field.name) for field in fields(self.state)}
            save_snapshot(self._snapshot, {"of": self._identity, **parts})
            self._saved_lines = self.state.num_lines
        except InputError as error:
            self._report(f"no snapshot: {error}")
        self._saved_at = self._clock()

    def close(self) -> None:
        """Save the state if it changed, and close the record."""
        self.save()
        if self._record is not None:
            with contextlib.suppress(OSError):  # of a full disk, which `process` has reported
                self._record.close()
        self._locks.close()


def _restored_state(parts: dict[str, Any], path: Path, identity: str) -> LiveState:
    if set(parts) != {"of", *(field.name for field in fields(LiveState))}:
        raise InputError(f"{path}: expected a snapshot of a live loop; got one of {', '.join(map(str, parts))}")
    if parts.pop("of") != identity:
        raise InputError(f"{path}: expected a snapshot of the same sensors and options; got one of others")
    return LiveState(**parts)


def _open_record(path: Path) -> BinaryIO:
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: expected a file for the record; got something else")
    try:
        file = path.open("r+b" if path.exists() else "w+b")
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be written; {error.strerror}") from error
    if not _may_be_record(file):
        file.close()
        raise InputError(f"{path}: expected a new file, or a record of live scans; got a file without any scan")
    return file


def _may_be_record(file: BinaryIO) -> bool:
    """Return True if a line of a file is a message, or the file is empty or an incomplete first message."""
    is_whole = False
    for line in _lines(file):
        if is_message(line):
            return True
        is_whole = True
    file.seek(0)
    return not is_whole and file.read(1) in (b"", b"{")


def _lines(file: BinaryIO) -> Iterator[bytes]:
    """Yield the complete lines of a record."""
    splitter = LineSplitter(MAX_LINE_BYTES)
    while chunk := file.read(CHUNK):
        yield from splitter.feed(chunk)


def _truncate_incomplete_line(file: BinaryIO) -> None:
    """Remove an incomplete last line, and move to the end of the file."""
    size = end = file.seek(0, os.SEEK_END)
    while end > 0:
        start = max(end - CHUNK, 0)
        file.seek(start)
        place = file.read(end - start).rfind(b"\n")
        if place >= 0:
            end = start + place + 1
            break
        end = start
    if end < size:
        file.truncate(end)
    file.seek(end)
