"""Output of commands to a terminal, file or pipe. It handles closed pipes and full disks.

Every command takes `--json`, `--quiet` and `--verbose` (`with_output_options`). All output goes through here: results
by `echo` and `console`, remarks by `note`, the document of `--json` by `emit_json`. Errors are always printed.
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
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TextIO, get_type_hints

import typer

if TYPE_CHECKING:
    from rich.console import Console

FORMAT_VERSION = 2  # of the documents of `--json`; incremented when a key is renamed or removed
_DISK_FULL = (errno.ENOSPC, errno.EIO, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EFBIG)


class OutputMode(NamedTuple):
    """Output mode of a command: one JSON document, errors only, or with details."""

    as_json: bool = False
    quiet: bool = False
    verbose: bool = False


_DEFAULT_MODE = OutputMode()
_output_mode: ContextVar[OutputMode] = ContextVar("_output_mode", default=_DEFAULT_MODE)
_OPTIONS = {
    "as_json": Annotated[bool, typer.Option("--json", help="Print the result as one JSON document.")],
    "quiet": Annotated[bool, typer.Option("--quiet", "-q", help="Print errors only.")],
    "verbose": Annotated[bool, typer.Option("--verbose", "-v", help="Print details as well.")],
}


def with_output_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with the options `--json`, `--quiet` and `--verbose`."""

    @functools.wraps(command)
    def wrapped(*, as_json: bool, quiet: bool, verbose: bool, **options: Any) -> None:
        previous = _output_mode.set(OutputMode(as_json, quiet, verbose))
        try:
            with warnings.catch_warnings():
                if quiet:
                    warnings.simplefilter("ignore")
                command(**options)
        finally:
            _output_mode.reset(previous)

    signature = inspect.signature(command)
    hints = get_type_hints(command, include_extras=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    parameters = [each.replace(kind=keyword, annotation=hints[name]) for name, each in signature.parameters.items()]
    added = [inspect.Parameter(name, keyword, default=False, annotation=kind) for name, kind in _OPTIONS.items()]
    wrapped.__signature__ = signature.replace(parameters=[*parameters, *added])  # type: ignore[attr-defined]
    wrapped.__annotations__ = {**hints, **_OPTIONS}
    return wrapped


def echo(text: str = "", *, nl: bool = True, even_if_quiet: bool = False) -> None:
    """Print a line of the result."""
    mode = _output_mode.get()
    if not mode.as_json and (even_if_quiet or not mode.quiet):
        typer.echo(_for_terminal(text, sys.stdout), nl=nl)


def is_verbose() -> bool:
    """Return True if details are printed (`--verbose`)."""
    return _output_mode.get().verbose


def note(text: str) -> None:
    """Print a remark on standard error: progress, omissions or a possible mistake in the input."""
    if not _output_mode.get().quiet:
        echo_error(text)


def echo_error(text: str) -> None:
    """Print an error message on standard error."""
    typer.echo(_for_terminal(text, sys.stderr), err=True)


def _for_terminal(text: str, stream: TextIO) -> str:
    return wrap_line(text, shutil.get_terminal_size().columns) if stream.isatty() else text


def wrap_line(text: str, width: int) -> str:
    """Return a line, wrapped between words if it is longer than `width`.

    Several lines, and indented text such as a command to copy, are returned unchanged.
    """
    line = text.strip("\n")
    if "\n" in line or line.startswith(" ") or len(line) <= width:
        return text
    return text.replace(line, textwrap.fill(line, width, break_long_words=False, break_on_hyphens=False))


def emit_json(document: Mapping[str, Any] | list[dict[str, Any]]) -> None:
    """Print the result of a command as data, if `--json` is given. Called once. A mapping gets the format's version."""
    print_json({"version": FORMAT_VERSION, **document} if isinstance(document, Mapping) else document)


def print_json(document: Any) -> None:
    """Print a document as it is, if `--json` is given. Numbers that are not finite become null."""
    if _output_mode.get().as_json:
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

    mode = _output_mode.get()
    silent = mode.quiet or (mode.as_json and not stderr)
    return Console(stderr=stderr, quiet=silent, highlight=False, markup=False, emoji=False)


@contextmanager
def bar(what: str, total: int | None = None) -> Iterator[Callable[..., None]]:
    """Show a progress bar on a terminal. Yields a function that receives the amount done, and the total if unknown."""
    from rich.progress import Progress

    screen = console(stderr=True)
    with Progress(console=screen, disable=not screen.is_terminal, transient=True) as progress:
        task = progress.add_task(what, total=total)
        yield lambda done, new_total=total: progress.update(task, completed=done, total=new_total)


def print_names(rows: Mapping[str, str]) -> None:
    """Print names with their descriptions. On a narrow terminal, each name has its own line."""
    from rich.cells import cell_len
    from rich.padding import Padding
    from rich.table import Table

    terminal = console()
    name_width = max(map(cell_len, rows), default=0)
    if terminal.width - name_width < _MIN_DESCRIPTION_WIDTH:
        for name, text in rows.items():
            terminal.print(name, soft_wrap=True)
            terminal.print(Padding(text, (0, 0, 0, 2)))
        return
    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True, min_width=name_width)
    table.add_column(overflow="fold")
    for name, text in rows.items():
        table.add_row(name, text)
    terminal.print(table)


_MIN_DESCRIPTION_WIDTH = 30  # columns for descriptions next to the names


def replace_unencodable() -> None:
    """Print characters that the encoding of the output lacks as question marks."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def system_error_message(error: OSError) -> str:
    """Return the message for a system error that no command has explained, empty if the reader of a pipe has gone.

    Raises the error again if it does not concern the output, a limit of the system or a file.
    """
    if error.errno == errno.EPIPE:
        return ""
    if error.errno in _DISK_FULL and error.filename is None:
        return f"the output cannot be written: {error.strerror}"
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{error.strerror}: this process may have too few files open at once (ulimit -n)"
    if error.filename is not None:
        return f"{error.filename}: expected a file or folder that can be used; {error.strerror}"
    raise error


def discard_output() -> None:
    """Discard buffered output, so that it causes no error when the program ends."""
    try:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
    except (OSError, ValueError):  # the output is not a file
        pass
