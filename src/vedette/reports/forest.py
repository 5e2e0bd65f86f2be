"""Forest plot of strategies: the error of each, and its paired difference to the first on a shared axis."""

import math
from dataclasses import dataclass

from matplotlib.ticker import MaxNLocator

from vedette.evaluation.tables import heading, significance
from vedette.internal.text import named_in, with_error, with_minus
from vedette.reports.groups import Group
from vedette.reports.pairwise import PairwiseComparison, compare_with_first

_ROOM = 0.06  # share of the axis that is left free at each side


@dataclass(frozen=True, slots=True)
class ForestRow:
    """One strategy of a forest plot."""

    name: str  # name and description of the strategy
    words: str
    error: str  # mean OSPA with its standard error
    pair: PairwiseComparison | None  # comparison of the first strategy with this one, None for the first itself
    # positions of the difference and of the ends of its interval on the axis, in percent of the width, or None for the
    # first strategy, and for the interval of one run
    mean: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Forest:
    """Rows of a forest plot with their axis."""

    title: str  # scenario, runs and time window
    error: str  # column headings, with units
    difference: str
    rows: tuple[ForestRow, ...]  # one per strategy, the reference first
    ticks: tuple[tuple[float, str], ...]  # position on the axis in percent of the width, and text
    note: str  # statement of the significant differences


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
    first, *others = group.strategies
    rows = [ForestRow(first.name, first.words, texts[0], None)]
    for strategy, text, pair in zip(others, texts[1:], comparisons, strict=True):
        places = map(place, (pair.mean, pair.low, pair.high))
        rows.append(ForestRow(strategy.name, strategy.words, text, pair, *places))
    return Forest(
        heading(comparison),
        named_in("OSPA", comparison.unit),
        named_in(f"Difference to {first.name}", comparison.unit) + ", 95 % interval",
        tuple(rows),
        tuple((place(tick) or 0.0, with_minus(f"{tick:g}")) for tick in ticks),
        significance(comparison),
    )
