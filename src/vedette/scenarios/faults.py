"""One fault of a scenario file, and how values are named in messages."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

from vedette.text import elided, plain, printable

Path = tuple[str | int, ...]
Place = tuple[int, int]  # line and column, from 1
Finding = tuple[Path, str, str]  # path, expected, got

_LONGEST = 60


@dataclass(frozen=True, slots=True)
class Fault:
    """What is wrong, where.

    Attributes:
        place: line and column, from 1.
        path: keys and indices that lead to the field; empty for the file as a whole.
        expected, got: what should stand there, and what does.
        hint: how to mend it, or empty.
    """

    place: Place
    path: Path
    expected: str
    got: str
    hint: str = ""

    def message(self, file: str) -> str:
        """`file:line:column: field: expected ..., got ...`."""
        field = f" {format_path(self.path)}:" if self.path else ""
        hint = f" ({self.hint})" if self.hint else ""
        text = f"{file}:{self.place[0]}:{self.place[1]}:{field} expected {self.expected}, got {self.got}{hint}"
        return printable(text)


def format_path(path: Path) -> str:
    """`("sensors", 0, "noise")` as `sensors[0].noise`; keys that no screen shows or that are long, as `named`."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{named(part)}" if text else named(part)
    return text


def named(word: str) -> str:
    """A word of the file in a message: in printable letters, and not long."""
    return elided(printable(word), _LONGEST)


def describe(value: Any) -> str:
    """A value of the file in a few words."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, dict):
        return "a mapping"
    text = printable(json.dumps(value, ensure_ascii=False) if isinstance(value, str) else plain(value))
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
