"""The folder in which the workers of this machine keep what they need; what a killed campaign left is taken away."""

from __future__ import annotations

import os
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

_PREFIX = "vedette-workers-"
_LOCK = "in-use.lock"


@contextmanager
def scratch_folder() -> Iterator[str]:
    """A new folder in the temporary directory, gone at the end; those of this user whose process is gone go first."""
    for left in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with suppress(OSError):
            _remove_abandoned(left)
    new = tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
    with new as scratch, closing(_locked(Path(scratch) / _LOCK)):
        yield scratch


def _remove_abandoned(folder: Path) -> None:
    """Remove a folder that is this user's own and that no living process has locked."""
    found = folder.lstat()  # never what a link of that name leads to
    own = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    if not own or not folder.is_dir() or folder.is_symlink() or not (folder / _LOCK).is_file():
        return
    try:
        lock = _locked(folder / _LOCK)
    except sqlite3.Error:  # it is in use
        return
    with closing(lock):
        shutil.rmtree(folder, ignore_errors=True)


def _locked(path: Path) -> sqlite3.Connection:
    """A lock of SQLite's, which the system ends with the process, however that ends; `sqlite3.Error` if it is held."""
    lock = sqlite3.connect(path, timeout=0.0, isolation_level=None, check_same_thread=False)
    try:
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.Error:
        lock.close()
        raise
    return lock
