"""Strategies side by side, in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.cells import cell_len

from vedette.cli.output import console as new_console
from vedette.text import elided_apart, named_in

if TYPE_CHECKING:
    from rich.console import Console

    from vedette.evaluation import Comparison

# Of `vedette.evaluation.tables.header`, for a terminal of 80 columns; the caption under the table says the rest.
_SHORT_HEADER = ("loc.", "card.", "difference", "95 %", "won")
_LONGEST_LABEL, _SHORTEST_LABEL = 24, 8


def print_comparison(comparison: Comparison) -> None:
    """The table of the strategies, what its numbers are, and what each strategy decided.

    Labels that are too long are elided, numbers never: where they do not fit side by side they stand in lines.
    """
    from vedette.evaluation import decision_rows, strategy_rows
    from vedette.evaluation.tables import caption

    console = new_console()
    names = (named_in("OSPA", comparison.unit), *_SHORT_HEADER)
    numbers = [row[1:] for row in strategy_rows(comparison)]
    labels = elided_apart(comparison.strategies, _LONGEST_LABEL)
    longest = max(map(cell_len, labels))
    gap = 2 if _width(names, numbers, 2) + longest <= console.width else 1
    room = console.width - _width(names, numbers, gap)
    if room < min(_SHORTEST_LABEL, longest):
        _print_lines(console, labels, names, numbers)
    else:
        shown = elided_apart(comparison.strategies, min(room, _LONGEST_LABEL))
        _print_table(console, shown, names, numbers, gap)
    console.print(caption(comparison), style="dim")
    for label, strategy in zip(labels, comparison.strategies, strict=True):
        for when, shares in decision_rows(comparison, strategy):
            console.print(f"{label} at {when}: {shares}")


def _width(names: tuple[str, ...], numbers: list[tuple[str, ...]], gap: int) -> int:
    """Columns of the terminal that the numbers take, each with the gap before it."""
    columns = zip(names, *numbers, strict=True)
    return sum(gap + max(map(len, column)) for column in columns)


def _print_table(
    console: Console, labels: tuple[str, ...], names: tuple[str, ...], numbers: list[tuple[str, ...]], gap: int
) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0))
    for i, heading in enumerate(("", *names)):
        table.add_column(heading, justify="right" if i else "left", no_wrap=True)
    for label, row in zip(labels, numbers, strict=True):
        table.add_row(label, *row)
    console.print(table)


def _print_lines(
    console: Console, labels: tuple[str, ...], names: tuple[str, ...], numbers: list[tuple[str, ...]]
) -> None:
    """One strategy after the other, with a line for each number that it has."""
    widest = max(map(len, names))
    for label, row in zip(labels, numbers, strict=True):
        console.print(label)
        for heading, number in zip(names, row, strict=True):
            if number:
                console.print(f"  {heading:<{widest}}  {number}")
