"""Atomic file writes and lock files: a file appears complete or not at all."""

import contextlib
import errno
import os
import re
import sqlite3
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from vedette.errors import InputError
from vedette.internal.text import printable

_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{32}")  # next to a file until it is whole


def write_whole(target: Path, write: Callable[[BinaryIO], object]) -> None:
    """Let `write` fill a new file next to `target`, sync it to disk, and move it to `target`.

    Raises `OSError` if this fails, or if `target` is a device or a pipe. `target` is then unchanged.
    """
    if target.exists() and not target.is_file() and not target.is_dir():
        raise OSError(errno.EINVAL, "it is no regular file", str(target))
    temporary = target.with_name(f".{target.name}.{uuid.uuid4().hex}")
    try:
        with temporary.open("xb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
        sync_folder(target.parent)
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def write_file(target: Path, write: Callable[[BinaryIO], object], *, make_folder: bool = False) -> None:
    """Do the same as `write_whole`, making the folder if `make_folder`. Raises `InputError` if this fails."""
    try:
        if make_folder:
            target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, write)
    except OSError as error:
        raise InputError(f"{target}: expected a file that can be written; {error.strerror or error}") from error


def sweep(folder: Path, name: str = "") -> None:
    """Delete what killed processes have left of `write_whole`, for files of this name or all, only under a lock."""
    if folder.is_dir():
        for path in folder.iterdir():
            if (found := _TEMPORARY.fullmatch(path.name)) and name in ("", found[1]):
                path.unlink(missing_ok=True)


def unwritable(target: Path) -> str:
    """Return the reason why no file can be written at `target`, empty if its nearest existing folder is writable."""
    around = next(folder for folder in target.absolute().parents if folder.exists())
    if not around.is_dir():
        return f"{around} is no folder"
    return "" if os.access(around, os.W_OK | os.X_OK) else f"{around} may not be written to"


def sync_folder(folder: Path) -> None:
    """Sync the names in a folder to disk, if the operating system supports it."""
    with contextlib.suppress(OSError):  # Windows cannot open folders
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def lock_beside(path: Path) -> sqlite3.Connection:
    """Return a lock that lets a single process write a file: an open transaction on `PATH.lock`.

    What a killed process has left of the file is deleted. The lock ends with the process. Raises `InputError`
    if another process holds it, or the folder cannot be written.
    """
    busy = f"{path}: expected to write alone; another process is writing it"
    failed = f"{path}: expected a file in a folder that can be written;"
    lock = locked(path.with_name(f"{path.name}.lock"), busy, failed)
    sweep(path.parent, path.name)
    return lock


def locked(path: Path, busy: str, failed: str) -> sqlite3.Connection:
    """Return an open transaction on a lock file, which the operating system ends with the process.

    Raises `InputError` with the text `busy` if another process holds it, else with `failed` and the reason.
    """
    lock = None
    try:
        lock = sqlite3.connect(path, timeout=0.0, isolation_level=None, check_same_thread=False)
        lock.execute("BEGIN EXCLUSIVE")
    except (sqlite3.Error, UnicodeDecodeError) as error:
        if lock is not None:
            lock.close()
        if getattr(error, "sqlite_errorcode", 0) & 0xFF == sqlite3.SQLITE_BUSY:
            raise InputError(busy) from None
        raise InputError(f"{failed} {printable(str(error))}") from error
    return lock
