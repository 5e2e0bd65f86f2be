"""Recordings as they come damaged: bytes flipped, files cut, columns exchanged, cells empty, rows twice, times back."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from typing import Any

import numpy as np

from fuzz.mutations import pick, spoil_bytes

Generator = np.random.Generator
Rows = list[list[str]]

CELLS = [
    *("", " ", "nan", "NaN", "inf", "-inf", "1e400", "-", "n/a", "1,5", "0x10", "\u0663", "1_0", "x" * 3000, "-1"),
    *("1e9", "1e308", "5e-324", "91", "200", "361", "1970-01-01", "2016-01-12T13:02", "99:99", "2016-13-45T00:00:00Z"),
    *("2016-01-12T13:02:24+25:00", "9999-12-31T23:59:59Z", "\x00", "\x1b[31m", '"', "a\nb", "=1+cmd", "\u202e", "None"),
]
FACTORS = [1852.0, 1.0 / 1852.0, 1000.0, 1e-3, 57.29577951308232, 0.017453292519943295, -1.0, 0.0, 1e6]


def damaged_rows(rng: Generator, rows: Rows) -> Rows:
    """A table, header first, with one or two of the mistakes that people and programs make."""
    rows = [list(row) for row in rows]
    for _ in range(int(rng.integers(1, 3))):
        pick(rng, _OF_ROWS)(rng, rows)
    return rows


def damaged_lines(rng: Generator, lines: list[bytes]) -> bytes:
    """Lines of a log, likewise."""
    lines = list(lines)
    for _ in range(int(rng.integers(1, 4))):
        how = int(rng.integers(6))
        place = int(rng.integers(len(lines)))
        if how == 0:
            lines[place] = spoil_bytes(rng, lines[place])
        elif how == 1:
            lines[place] = lines[place][: int(rng.integers(len(lines[place]) + 1))]
        elif how == 2:
            lines.insert(place, pick(rng, lines))
        elif how == 3:
            lines.reverse()
        elif how == 4:
            lines[place] = bytes(rng.integers(0, 256, 30, np.uint8)) + lines[place]
        else:
            lines[place : place + 2] = [b"".join(lines[place : place + 2])]
    return b"\n".join(lines) + b"\n"


def damaged_blocks(rng: Generator, blocks: list[bytes]) -> bytes:
    """Blocks of a binary file, likewise."""
    blocks = list(blocks)
    how = int(rng.integers(5))
    if how == 0:
        rng.shuffle(blocks)
    elif how == 1:
        blocks += blocks
    elif how == 2:
        blocks.pop(int(rng.integers(len(blocks))))
    else:
        return spoil_bytes(rng, b"".join(blocks))
    return b"".join(blocks)


def csv_of(rng: Generator, rows: Rows) -> bytes:
    """The table as a file, now and then of another encoding or separator, or with bytes flipped."""
    out = io.StringIO()
    csv.writer(out, delimiter=pick(rng, [";", "\t"]) if rng.random() < 0.02 else ",").writerows(rows)
    text, how = out.getvalue(), rng.random()
    if how < 0.03:
        return text.encode("utf-16", "surrogatepass")
    if how < 0.06:
        return b"\xef\xbb\xbf" + text.encode()
    if how < 0.1:
        return text.encode("latin-1", "replace").replace(b"\r\n", pick(rng, [b"\n", b"\r", b"\n\n"]))
    return spoil_bytes(rng, text.encode()) if how < 0.25 else text.encode()


def _cell(rng: Generator, rows: Rows) -> None:
    for _ in range(int(rng.integers(1, 4))):
        row = pick(rng, rows)
        if row:
            row[int(rng.integers(len(row)))] = pick(rng, CELLS)


def _column(rng: Generator, rows: Rows, change: Callable[[list[str]], list[str]]) -> None:
    place = int(rng.integers(len(rows[0]) or 1))
    have = [row for row in rows[1:] if place < len(row)]
    for row, cell in zip(have, change([row[place] for row in have]), strict=True):
        row[place] = cell


def _blank(rng: Generator, rows: Rows) -> None:
    _column(rng, rows, lambda cells: [pick(rng, [cell, ""]) for cell in cells])


def _scaled(rng: Generator, rows: Rows) -> None:
    factor = pick(rng, FACTORS)

    def scaled(cell: str) -> str:
        try:
            return repr(factor * float(cell))
        except ValueError:
            return cell

    _column(rng, rows, lambda cells: [scaled(cell) for cell in cells])


def _backwards(rng: Generator, rows: Rows) -> None:
    _column(rng, rows, lambda cells: cells[::-1])


def _exchanged(rng: Generator, rows: Rows) -> None:
    first, second = (int(place) for place in rng.integers(0, max(len(rows[0]), 1), 2))
    for row in rows[int(rng.integers(2)) :]:
        if max(first, second) < len(row):
            row[first], row[second] = row[second], row[first]


def _without_column(rng: Generator, rows: Rows) -> None:
    place = int(rng.integers(len(rows[0]) or 1))
    for row in rows:
        del row[place : place + 1]


def _renamed(rng: Generator, rows: Rows) -> None:
    if rows[0]:
        rows[0][int(rng.integers(len(rows[0])))] = pick(rng, ["", "range", "bearing", "time", "own_x", "x", "lat", "?"])


def _again(rng: Generator, rows: Rows) -> None:
    rows.extend(list(row) for row in (rows[1:] if rng.random() < 0.3 else [pick(rng, rows)]))


def _order(rng: Generator, rows: Rows) -> None:
    body: list[Any] = rows[1:]
    if rng.random() < 0.5:
        body.reverse()
    else:
        rng.shuffle(body)
    rows[1:] = body


def _cut(rng: Generator, rows: Rows) -> None:
    del rows[int(rng.integers(len(rows))) + 1 :]
    if rng.random() < 0.5 and rows[-1]:
        del rows[-1][int(rng.integers(len(rows[-1]))) :]


_OF_ROWS = (
    _cell, _cell, _cell, _blank, _scaled, _scaled, _backwards, _exchanged, _without_column, _renamed, _again, _order,
    _cut,
)  # fmt: skip
