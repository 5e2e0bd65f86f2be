"""Reporting of errors in commands: the message without a traceback, and an exit status.

0: done. 1: faulty content (a scenario, a file, a computation). 2: wrong use of the command line. 130: interrupted.
"""

import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from vedette.cli.output import discard_output, echo_error, replace_unencodable, system_error_message
from vedette.errors import InputError, VedetteError
from vedette.internal.text import shown

INTERRUPTED = 130


class CommandGroup(TyperGroup):
    """Group of all commands. It prints the library's own errors instead of raising them."""

    def main(self, *args: Any, **options: Any) -> Any:
        """Run the program, with an output that can print every character."""
        replace_unencodable()
        return super().main(*args, **options)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the summaries of the commands, group by group."""
        groups: dict[str | None, list[tuple[str, str]]] = {}
        width = max(map(len, self.commands))
        for name, command in self.commands.items():
            row = name.ljust(width), command.get_short_help_str(limit=formatter.width)
            groups.setdefault(getattr(command, "rich_help_panel", None), []).append(row)
        for title, rows in groups.items():
            with formatter.section(title):
                formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        """Run a command. Print an exception as a line and convert it into an exit status."""
        try:
            result = super().invoke(ctx)
            sys.stdout.flush()  # here, where a fault can still be reported as a message
            return result
        except typer.BadParameter as error:
            error.message = _message_with_value(error)
            raise
        except VedetteError as error:
            echo_error(str(error))
            raise typer.Exit(1) from None
        except OSError as error:
            text = system_error_message(error)
            discard_output()
            if text:
                echo_error(text)
            raise typer.Exit(1) from None
        except KeyboardInterrupt:  # in a command that reports nothing about its partial results
            typer.echo("\ninterrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None


def _message_with_value(error: typer.BadParameter) -> str:
    """Return the message of an error. The given value is added to a message of pydantic, which lacks it."""
    pydantic_errors = getattr(error.__cause__, "errors", None)
    if pydantic_errors is None:
        return error.message
    first = pydantic_errors()[0]
    expected = re.sub("^(Input should be|Value error, .* is not)(?= )", "expected", first["msg"]).rstrip(".")
    return f"{expected}; got {shown(first['input'])}"


def usage_error(message: str, option: str) -> typer.BadParameter:
    """Return the error for wrong use of an option, which has exit status 2."""
    return typer.BadParameter(message, param_hint=option)


def check_ending(path: Path | None, option: str, *endings: str) -> None:
    """Raise a usage error unless the output file, if any, has one of the endings. This protects other files."""
    if path is not None and path.suffix[1:].lower() not in endings:
        raise usage_error(f"expected a file ending in {', '.join(endings)}; got {path}", option)


@contextmanager
def option_errors(options: Mapping[str, str]) -> Iterator[None]:
    """Replace the names of the library's arguments in errors by the options that set them."""
    try:
        yield
    except InputError as error:
        field, _, rest = str(error).partition(": ")
        if field not in options:
            raise
        raise InputError(f"{options[field]}: {rest}") from error
