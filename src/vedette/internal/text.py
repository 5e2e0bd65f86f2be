"""Numbers of things in words, and names of any length where there is little room."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Iterable, Sequence
from datetime import date, timedelta
from typing import Any

from rich.cells import cell_len, chop_cells

ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


def printable(text: str) -> str:
    """The text with letters that no screen shows (control characters, lone surrogates) written as escapes."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def pluralise(number: int, thing: str) -> str:
    """`1 sensor`, `2 sensors`."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def join_alternatives(names: Sequence[str]) -> str:
    """Alternatives in words: "a", "a or b", "a, b or c"."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def named_in(name: str, unit: str) -> str:
    """`OSPA (m)`; of a quantity without a unit its name alone."""
    return f"{name} ({unit})" if unit else name


def with_unit(number: str, unit: str) -> str:
    """`1.25 m`; of a quantity without a unit the number alone."""
    return f"{number} {unit}" if unit else number


def unique_name(name: str, taken: Collection[str]) -> str:
    """The name, or where that is taken the first of `name-2`, `name-3` and so on that is not."""
    candidates = itertools.chain([name], (f"{name}-{number}" for number in itertools.count(2)))
    return next(candidate for candidate in candidates if candidate not in taken)


def with_error(mean: float, error: float | None, sign: str = "") -> str:
    """`12.30 ± 0.45`; without its standard error where that is not known, None or NaN. sign: "+" for always one."""
    text = f"{mean:{sign}.2f}"
    return text if error is None or error != error else f"{text} ± {error:.2f}"


def with_minus(text: str) -> str:
    """The text with minus signs in place of hyphens."""
    return text.replace("-", "\N{MINUS SIGN}")


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: bool = True) -> str:
    """A table in Markdown, its first column words; with `numbers` the others end at the right."""
    lines = ["| " + " | ".join(header) + " |", "| --- |" + (" ---: |" if numbers else " --- |") * (len(header) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def plain(value: Any) -> str:
    """A value as a person would write it: numbers of NumPy as numbers, also inside lists."""
    import numpy as np  # here, as the command line starts without it

    with np.printoptions(legacy="1.25"):  # from 2.0 on the repr of a number names its type
        try:
            return repr(value.tolist() if isinstance(value, np.ndarray) else value)
        except ValueError:  # a whole number of more digits than Python writes
            return "a number of thousands of digits"


def shown(value: Any) -> str:
    """A value in a message: in quotes where it is text, in printable letters, and not long."""
    return elided(printable(f"the time {value}" if isinstance(value, date | timedelta) else plain(value)), 80)


_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


def spreadsheet_text(text: str) -> str:
    """A text for a cell of a CSV file; one that a spreadsheet would run as a formula has an apostrophe before it."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) and not _NUMBER.fullmatch(text) else text


def elided(text: str, most: int = 24) -> str:
    """The text on one line; what is wider than `most` columns keeps its beginning and its end."""
    text = " ".join(text.split())
    if cell_len(text) <= most:
        return text
    tail = (most - 1) // 2
    return _fitting(text, most - 1 - tail) + ELLIPSIS + _fitting(text[::-1], tail)[::-1]


def _fitting(text: str, most: int) -> str:
    """As much of the beginning as fits into so many columns, where wide letters (Chinese, emoji) take two."""
    first = chop_cells(text, max(most, 1))[0]
    return first if cell_len(first) <= most else ""


def elided_apart(names: Sequence[str], most: int = 24) -> tuple[str, ...]:
    """Each name elided; those that would then look alike have their place in the list, from 1, put behind."""
    short = [elided(name, most) for name in names]
    return tuple(
        text if short.count(text) == 1 else f"{elided(name, most - 5)} ({place})"
        for place, (name, text) in enumerate(zip(names, short, strict=True), start=1)
    )
