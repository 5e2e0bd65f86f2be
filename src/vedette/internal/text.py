"""Text helpers: counts and units in words, elided names, tables in Markdown."""

import itertools
import re
from collections.abc import Collection, Iterable, Sequence
from datetime import date, timedelta
from typing import Any

from rich.cells import cell_len, chop_cells

ELLIPSIS = "\N{HORIZONTAL ELLIPSIS}"


def printable(text: str) -> str:
    """Return the text with unprintable characters (control characters, lone surrogates) as escapes."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


def pluralise(number: int, thing: str) -> str:
    """Return a count with its noun: `1 sensor`, `2 sensors`."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def join_alternatives(names: Sequence[str]) -> str:
    """Return alternatives in words: "a", "a or b", "a, b or c"."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def named_in(name: str, unit: str) -> str:
    """Return a name with its unit: `OSPA (m)`, or without a unit only the name."""
    return f"{name} ({unit})" if unit else name


def with_unit(number: str, unit: str) -> str:
    """Return a number with its unit: `1.25 m`, or without a unit only the number."""
    return f"{number} {unit}" if unit else number


def unique_name(name: str, taken: Collection[str]) -> str:
    """Return the name, or the first of `name-2`, `name-3` and so on that is not taken."""
    candidates = itertools.chain([name], (f"{name}-{number}" for number in itertools.count(2)))
    return next(candidate for candidate in candidates if candidate not in taken)


def with_error(mean: float, error: float | None, sign: str = "") -> str:
    """Return `12.30 ± 0.45`, or without the standard error if it is None or NaN. sign: "+" to always show a sign."""
    text = f"{mean:{sign}.2f}"
    return text if error is None or error != error else f"{text} ± {error:.2f}"


def with_minus(text: str) -> str:
    """Return the text with hyphens replaced by minus signs."""
    return text.replace("-", "\N{MINUS SIGN}")


def markdown_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: bool = True) -> str:
    """Return a table in Markdown. The first column is left-aligned, the others are right-aligned if `numbers`."""
    lines = ["| " + " | ".join(header) + " |", "| --- |" + (" ---: |" if numbers else " --- |") * (len(header) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def plain(value: Any) -> str:
    """Return the repr of a value with NumPy numbers as plain numbers, also inside lists."""
    import numpy as np  # imported here, as the command line starts without NumPy

    with np.printoptions(legacy="1.25"):  # since NumPy 2.0 the repr of a number includes its type
        try:
            return repr(value.tolist() if isinstance(value, np.ndarray) else value)
        except ValueError:  # an integer with more digits than Python converts
            return "a number of thousands of digits"


def shown(value: Any) -> str:
    """Return a value for a message: quoted if it is text, printable, and at most 80 columns wide."""
    return elided(printable(f"the time {value}" if isinstance(value, date | timedelta) else plain(value)), 80)


_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")


def spreadsheet_text(text: str) -> str:
    """Return a text for a cell of a CSV file, with an apostrophe first if a spreadsheet would run it as a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) and not _NUMBER.fullmatch(text) else text


def elided(text: str, most: int = 24) -> str:
    """Return the text on one line, or if it is wider than `most` columns, only its beginning and its end."""
    text = " ".join(text.split())
    if cell_len(text) <= most:
        return text
    tail = (most - 1) // 2
    return _fitting(text, most - 1 - tail) + ELLIPSIS + _fitting(text[::-1], tail)[::-1]


def _fitting(text: str, most: int) -> str:
    """Return the longest beginning that fits into `most` columns. Wide characters (Chinese, emoji) take two."""
    first = chop_cells(text, max(most, 1))[0]
    return first if cell_len(first) <= most else ""


def elided_apart(names: Sequence[str], most: int = 24) -> tuple[str, ...]:
    """Return each name elided. Names that would then be equal get their position, from 1, appended."""
    short = [elided(name, most) for name in names]
    return tuple(
        text if short.count(text) == 1 else f"{elided(name, most - 5)} ({place})"
        for place, (name, text) in enumerate(zip(names, short, strict=True), start=1)
    )
