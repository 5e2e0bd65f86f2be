"""Output of commands to a terminal, file or pipe; it handles closed pipes and full disks.

Every command takes `--json`, `--quiet` and `--verbose` (`speaking`). All output goes through here: results by `say` and
`console`, remarks by `note`, the document of `--json` by `publish`. Errors are always printed.
"""

from __future__ import annotations

import errno
import functools
import inspect
import json
import math
import os
import shutil
import sys
import textwrap
import warnings
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TextIO, get_type_hints

import typer

if TYPE_CHECKING:
    from rich.console import Console

FORMAT_VERSION = 1  # of the documents of `--json`; incremented when a key is renamed or removed
_FULL = (errno.ENOSPC, errno.EIO, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)


class Manner(NamedTuple):
    """Output mode of a command: one JSON document, errors only, or with details."""

    as_json: bool = False
    quiet: bool = False
    verbose: bool = False


_PLAINLY = Manner()
_manner: ContextVar[Manner] = ContextVar("_manner", default=_PLAINLY)
_OPTIONS = {
    "as_json": Annotated[bool, typer.Option("--json", help="Print the result as one JSON document.")],
    "quiet": Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")],
    "verbose": Annotated[bool, typer.Option("--verbose", "-v", help="Print details as well.")],
}


def speaking(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with the options `--json`, `--quiet` and `--verbose`."""

    @functools.wraps(command)
    def spoken(*, as_json: bool, quiet: bool, verbose: bool, **options: Any) -> None:
        before = _manner.set(Manner(as_json, quiet, verbose))
        try:
            with warnings.catch_warnings():
                if quiet:
                    warnings.simplefilter("ignore")
                command(**options)
        finally:
            _manner.reset(before)

    signature = inspect.signature(command)
    hints = get_type_hints(command, include_extras=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    taken = [each.replace(kind=keyword, annotation=hints[name]) for name, each in signature.parameters.items()]
    more = [inspect.Parameter(name, keyword, default=False, annotation=kind) for name, kind in _OPTIONS.items()]
    spoken.__signature__ = signature.replace(parameters=[*taken, *more])  # type: ignore[attr-defined]
    spoken.__annotations__ = {**hints, **_OPTIONS}
    return spoken


def say(text: str = "", *, nl: bool = True, even_if_quiet: bool = False) -> None:
    """Print a line of the result."""
    manner = _manner.get()
    if not manner.as_json and (even_if_quiet or not manner.quiet):
        typer.echo(_for_terminal(text, sys.stdout), nl=nl)


def is_verbose() -> bool:
    """Return True if details are printed (`--verbose`)."""
    return _manner.get().verbose


def note(text: str) -> None:
    """Print a remark on standard error: progress, omissions or a possible mistake in the input."""
    if not _manner.get().quiet:
        complain(text)


def complain(text: str) -> None:
    """Print an error message on standard error."""
    typer.echo(_for_terminal(text, sys.stderr), err=True)


def _for_terminal(text: str, stream: TextIO) -> str:
    return folded(text, shutil.get_terminal_size().columns) if stream.isatty() else text


def folded(text: str, width: int) -> str:
    """Return a line, wrapped between words if it is longer than `width`.

    Several lines, and indented text such as a command to copy, are returned unchanged.
    """
    line = text.strip("\n")
    if "\n" in line or line.startswith(" ") or len(line) <= width:
        return text
    return text.replace(line, textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False))


def publish(document: Mapping[str, Any] | list[dict[str, Any]]) -> None:
    """Print the result of a command as data, if `--json` is given; called once. A mapping gets the format's version."""
    print_json({"version": FORMAT_VERSION, **document} if isinstance(document, Mapping) else document)


def print_json(document: Any) -> None:
    """Print a document as it is, if `--json` is given. Numbers that are not finite become null."""
    if _manner.get().as_json:
        typer.echo(json.dumps(_plain(document), indent=2, ensure_ascii=False, allow_nan=False))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if hasattr(value, "tolist"):  # a NumPy value
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def console(*, stderr: bool = False) -> Console:
    """Return a console without markup, since names may contain brackets and colons."""
    from rich.console import Console

    manner = _manner.get()
    silent = manner.quiet or (manner.as_json and not stderr)
    return Console(stderr=stderr, quiet=silent, highlight=False, markup=False, emoji=False)


def print_names(rows: Mapping[str, str]) -> None:
    """Print names with their descriptions; on a narrow terminal, each name has its own line."""
    from rich.cells import cell_len
    from rich.padding import Padding
    from rich.table import Table

    shown = console()
    longest = max(map(cell_len, rows), default=0)
    if shown.width - longest < _LEAST_ROOM:
        for name, text in rows.items():
            shown.print(name, soft_wrap=True)
            shown.print(Padding(text, (0, 0, 0, 2)))
        return
    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True, min_width=longest)
    table.add_column(overflow="fold")
    for name, text in rows.items():
        table.add_row(name, text)
    shown.print(table)


_LEAST_ROOM = 30  # columns for descriptions next to the names


def accept_any_letter() -> None:
    """Print characters that the encoding of the output lacks as question marks."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def trouble_of_system(error: OSError) -> str:
    """Return the message for a system error that no command has explained; empty if the reader of a pipe has gone.

    Raises the error again if it does not concern the output, a limit of the system or a file.
    """
    if error.errno == errno.EPIPE:
        return ""
    if error.errno in _FULL and error.filename is None:
        return f"the output cannot be written: {error.strerror}"
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{error.strerror}: this process may have too few files open at once (ulimit -n)"
    if error.filename is not None:
        return f"{error.filename}: expected a file or folder that can be used; {error.strerror}"
    raise error


def drop_output() -> None:
    """Discard buffered output, so that it causes no error when the program ends."""
    try:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
    except (OSError, ValueError):  # the output is not a file
        pass
