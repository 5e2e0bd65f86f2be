"""Comparison tables of strategies for a terminal.

Labels that are too long are shortened. Numbers are never shortened: if they do not fit in a row, each has its own line.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.cells import cell_len

from vedette.cli.output import console as new_console
from vedette.cli.output import is_verbose, print_names
from vedette.internal.text import elided_apart, named_in, pluralise

if TYPE_CHECKING:
    from rich.console import Console

    from vedette.campaigns.leaderboard import SceneTable
    from vedette.campaigns.scores import StrategyScore
    from vedette.evaluation import Comparison

# Short form of `vedette.evaluation.tables.header` for a terminal of 80 columns; the caption of the table explains it.
_SHORT_HEADER = ("loc.", "card.", "difference", "95 %", "won")
_SHORT_SCORES = ("worst", "difference", "N error", "tracked", "s", "runs")  # of `vedette.campaigns.scores.score_header`
_OMITTED = ("NEES, 95 %", "Filter steps", "Fusions", "Rewards")  # columns of `vedette.campaigns.leaderboard.header`
_SHORT_STANDINGS = ("more", "95 %", "N error", "NEES", "ms", "lost", "runs")  # short form of the other columns
_LONGEST_LABEL, _SHORTEST_LABEL = 24, 8
_MAX_DECISIONS = 6  # number of decision times printed; the tables and the report have all of them


def print_comparison(comparison: Comparison, words: Sequence[str] = ()) -> None:
    """Print the table of the strategies and its legend, and with `--verbose` also its tails and the decisions.

    Args:
        comparison: comparison of the strategies.
        words: description of each strategy, empty if the strategies are not planners.
    """
    from vedette.evaluation import strategy_rows
    from vedette.evaluation.tables import heading, legend, significance
    from vedette.evaluation.tail_summary import tail_sentence

    console = new_console()
    console.print(heading(comparison), style="bold")
    names = (named_in("OSPA", comparison.unit), *_SHORT_HEADER)
    numbers = [row[1:] for row in strategy_rows(comparison)]
    _print_rows(console, comparison.strategies, names, numbers)
    sentences = " ".join(filter(None, (legend(comparison), significance(comparison))))
    console.print(sentences, style="dim")
    if words:
        print_names(dict(zip(comparison.strategies, words, strict=True)))
    if is_verbose():
        console.print(tail_sentence(comparison), style="dim")
        _print_decisions(console, comparison)


def _print_decisions(console: Console, comparison: Comparison) -> None:
    from vedette.evaluation import decision_rows

    labels = elided_apart(comparison.strategies, _LONGEST_LABEL)
    for label, strategy in zip(labels, comparison.strategies, strict=True):
        decisions = decision_rows(comparison, strategy)
        for when, shares in decisions[:_MAX_DECISIONS]:
            console.print(f"{label} at {when}: {shares}")
        if len(decisions) > _MAX_DECISIONS:
            console.print(f"{label}: and at {pluralise(len(decisions) - _MAX_DECISIONS, 'other time')}")


def print_scores(scores: Sequence[StrategyScore], comparison: Comparison) -> None:
    """Print the errors and costs of strategies next to the published ones."""
    from vedette.campaigns.scores import score_row
    from vedette.evaluation.tail_summary import tail_sentence

    rows = [score_row(score)[1:] for score in scores]
    names = (named_in("OSPA", comparison.unit), *_SHORT_SCORES)
    _print_rows(new_console(), [score.label for score in scores], names, rows)
    if tails := tail_sentence(comparison):
        new_console().print(tails, style="dim")


def print_standings(table: SceneTable) -> None:
    """Print the ranking of entrants on a scene with the columns that fit a terminal. The page has all of them."""
    from vedette.campaigns.leaderboard import header, row
    from vedette.evaluation.tail_summary import tail_header, tail_text

    names, rows = header(table), [row(table, standing) for standing in table.standings]
    left_out = (*_OMITTED, *tail_header(table.unit))
    columns = [column for column, name in enumerate(names) if column and name not in left_out]
    new_console().print(f"{table.scene.name}: {table.scene.about}")
    numbers = [tuple(each[column] for column in columns) for each in rows]
    _print_rows(new_console(), [each[0] for each in rows], (names[1], *_SHORT_STANDINGS), numbers)
    tails = tail_text({standing.label: standing.tail for standing in table.standings}, table.unit)
    new_console().print(tails, style="dim")
    for standing in table.standings:
        if standing.reason:
            new_console().print(f"lost, {standing.label}: {standing.reason}", soft_wrap=True)


def _print_rows(
    console: Console, strategies: Sequence[str], names: tuple[str, ...], numbers: list[tuple[str, ...]]
) -> None:
    labels = elided_apart(strategies, _LONGEST_LABEL)
    longest = max(map(cell_len, labels))
    gap = 2 if _width(names, numbers, 2) + longest <= console.width else 1
    label_width = console.width - _width(names, numbers, gap)
    if label_width < min(_SHORTEST_LABEL, longest):
        widest = max(map(len, names))
        for label, row in zip(labels, numbers, strict=True):
            console.print(label)
            for heading, number in zip(names, row, strict=True):
                if number:
                    console.print(f"  {heading:<{widest}}  {number}")
    else:
        _print_table(console, elided_apart(strategies, min(label_width, _LONGEST_LABEL)), names, numbers, gap)


def _width(names: tuple[str, ...], numbers: list[tuple[str, ...]], gap: int) -> int:
    """Return the width of the numbers in columns of the terminal, each with the gap before it."""
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
