"""One fault of a scenario file, and how values are named in messages."""

import json
from datetime import date, time
from typing import Any, NamedTuple

from vedette.internal.text import elided, plain, printable

Path = tuple[str | int, ...]
Place = tuple[int, int]  # line and column, from 1
Finding = tuple[Path, str, str]  # path, expected, got

MISSING = "no such key"  # `got` of a fault if a required key is missing
_MAX_LENGTH = 60


class Diagnostic(NamedTuple):
    """A fault of the data: its path, the expected and the given value in words, and a hint on the correction or ""."""

    path: Path
    expected: str
    got: str
    hint: str = ""

    @property
    def message(self) -> str:
        """`field: expected ..., got ... (hint)`, or `field: required key is missing`."""
        field = f"{format_path(self.path)}: " if self.path else ""
        what = "required key is missing" if self.got == MISSING else f"expected {self.expected}, got {self.got}"
        return printable(f"{field}{what}" + (f" ({self.hint})" if self.hint else ""))


class Fault(NamedTuple):
    """A fault of a file, and its place: line and column, from 1."""

    place: Place
    diagnostic: Diagnostic

    def message(self, file: str) -> str:
        """`file:line:column: field: expected ..., got ...`."""
        return f"{printable(file)}:{self.place[0]}:{self.place[1]}: {self.diagnostic.message}"


def format_path(path: Path) -> str:
    """Return `("sensors", 0, "noise")` as `sensors[0].noise`; long or unprintable keys as by `shown_key`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{shown_key(part)}" if text else shown_key(part)
    return text


def shown_key(word: str) -> str:
    """Return a word of the file for a message: in printable letters, and shortened."""
    return elided(printable(word), _MAX_LENGTH)


def describe(value: Any) -> str:
    """Return a value of the file in a few words."""
    if value is None:
        return "nothing"
    if isinstance(value, date | time):
        return f"the date or time {value}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, dict):
        return "a mapping"
    text = printable(json.dumps(value, ensure_ascii=False) if isinstance(value, str) else plain(value))
    return text if len(text) <= _MAX_LENGTH else text[: _MAX_LENGTH - 3] + "..."
