"""Forest plot of strategies: the error of each, and its paired difference to the first on a shared axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

from matplotlib.ticker import MaxNLocator

from vedette.evaluation.tables import heading, significance
from vedette.internal.text import named_in, with_error, with_minus
from vedette.reports.groups import Group
from vedette.reports.pairwise import compare_with_first

_ROOM = 0.06  # share of the axis that is left free at each side
# Verdicts state the first strategy against another; the page shows that of the other.
_WORDS = {"better": "larger error", "worse": "smaller error", "unclear": "not significant", "unknown": "one run"}


@dataclass(frozen=True, slots=True)
class ForestRow:
    """One strategy of a forest plot.

    Attributes:
        name, words: name and description of the strategy.
        colour: index of the strategy, which determines its colour.
        error: mean OSPA with its standard error.
        mean, low, high: positions of the difference and of the ends of its interval on the axis, in percent of the
            width, or None for the first strategy, and for the interval of one run.
        difference: the same as text.
        verdict: class of the verdict on the difference, `reference` for the first strategy.
        verdict_words: the verdict in words.
        sentence: the finding.
    """

    name: str
    words: str
    colour: int
    error: str
    mean: float | None = None
    low: float | None = None
    high: float | None = None
    difference: str = ""
    verdict: str = "reference"
    verdict_words: str = "reference"
    sentence: str = ""


@dataclass(frozen=True, slots=True)
class Forest:
    """Rows of a forest plot with their axis.

    Attributes:
        title: scenario, runs and time window.
        error, difference: column headings, with units.
        rows: one per strategy, the reference first.
        ticks: position on the axis in percent of the width, and text.
        note: statement of the significant differences.
    """

    title: str
    error: str
    difference: str
    rows: tuple[ForestRow, ...]
    ticks: tuple[tuple[float, str], ...]
    note: str


def forest_of(group: Group) -> Forest | None:
    """Return the forest plot of a group, or None without runs in common or with a single strategy."""
    comparison = group.comparison
    if comparison is None or len(comparison.strategies) < 2:
        return None
    comparisons = compare_with_first(comparison)
    shown = [value for each in comparisons for value in (each.mean, each.low, each.high) if math.isfinite(value)]
    ticks = [
        float(tick) for tick in MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(min(0.0, *shown), max(0.0, *shown))
    ]
    start, width = ticks[0], ticks[-1] - ticks[0]

    def place(value: float) -> float | None:
        share = _ROOM + (1.0 - 2.0 * _ROOM) * (value - start) / width
        return round(100.0 * share, 2) if math.isfinite(value) else None

    errors = [comparison.summary(name) for name in comparison.strategies]
    texts = [with_error(float(each.mean), float(each.standard_error)) for each in errors]
    strategies = group.strategies
    rows = [ForestRow(strategies[0].name, strategies[0].words, 0, texts[0])]
    for index, each in enumerate(comparisons, start=1):
        rows.append(
            ForestRow(
                each.second,
                strategies[index].words,
                index,
                texts[index],
                place(each.mean),
                place(each.low),
                place(each.high),
                each.difference,
                each.verdict,
                _WORDS[each.verdict],
                each.sentence,
            )
        )
    return Forest(
        heading(comparison),
        named_in("OSPA", comparison.unit),
        named_in(f"Difference to {strategies[0].name}", comparison.unit) + ", 95 % interval",
        tuple(rows),
        tuple((place(tick) or 0.0, with_minus(f"{tick:g}")) for tick in ticks),
        significance(comparison),
    )
