"""What commands print, wherever it goes: a terminal, a file, a pipe that closes, a disk that is full."""

from __future__ import annotations

import errno
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

_FULL = (errno.ENOSPC, errno.EIO, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)


def console(*, stderr: bool = False) -> Console:
    """A console that takes every text for text: names may hold brackets and colons."""
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, markup=False, emoji=False)


def accept_any_letter() -> None:
    """Letters that the encoding of the output does not have are printed as question marks."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def trouble_of_system(error: OSError) -> str:
    """What to say of an error of the system that no command has explained; empty for a reader that went away.

    Raises the error where it is neither about the output nor about a limit of the system.
    """
    if error.errno == errno.EPIPE:
        return ""
    if error.errno in _FULL and error.filename is None:
        return f"the output cannot be written: {error.strerror}"
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{error.strerror}: this process may have too few files open at once (ulimit -n)"
    raise error


def drop_output() -> None:
    """Let what is still buffered go nowhere, so that nothing more is said of it when the program ends."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
    except (OSError, ValueError):  # no file behind it
        pass
