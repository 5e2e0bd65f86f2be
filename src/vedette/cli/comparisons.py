"""Strategies side by side, in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vedette.evaluation import Comparison

# Of `vedette.evaluation.tables.HEADER`, for a terminal of 80 columns; the caption under the table says the rest.
_SHORT_HEADER = ("", "OSPA (m)", "loc.", "card.", "difference", "95 %", "won")


def print_comparison(comparison: Comparison) -> None:
    """The table of the strategies, what its numbers are, and what each strategy decided."""
    from rich.console import Console
    from rich.table import Table

    from vedette.evaluation import decision_rows, strategy_rows
    from vedette.evaluation.tables import caption

    console = Console(highlight=False)
    table = Table(box=None, pad_edge=False)
    for i, heading in enumerate(_SHORT_HEADER):
        table.add_column(heading, justify="right" if i else "left", no_wrap=True)
    for row in strategy_rows(comparison):
        table.add_row(*row)
    console.print(table)
    console.print(caption(comparison), style="dim")
    for strategy in comparison.strategies:
        for when, shares in decision_rows(comparison, strategy):
            console.print(f"{strategy} at {when}: {shares}")
