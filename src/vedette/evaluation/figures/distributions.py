"""Figure of the error of each run by strategy, and of its paired difference from the first strategy."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.cells import cell_len

from vedette.evaluation.comparison import Comparison
from vedette.evaluation.figures.labels import short_labels
from vedette.evaluation.figures.style import GREY, INK, colour, new_figure, styled
from vedette.evaluation.statistics import Summary, paired_difference
from vedette.internal.text import named_in
from vedette.kernels.base.types import Floats

MAX_DOTS = 2000  # in a row: more would merge into one blot
_ROW = 0.36  # inches
_SHORT, _ONE_LINE = 8, 20  # letters
_GOLDEN = 0.6180339887498949


@styled
def distributions_figure(comparison: Comparison) -> Figure:
    """Return a figure of the mean OSPA of every run, and below it of every paired difference from the first strategy.

    Each dot is a run. Of more than `MAX_DOTS` runs, the first are drawn. The box contains the middle half of the runs
    and its line is their median. The diamond is the mean, in the lower panel with its 95 % confidence interval. If the
    interval contains 0, the difference is not significant.
    """
    strategies = comparison.strategies
    others = strategies[1:]
    rows = (len(strategies), len(others)) if others else (len(strategies),)
    figure = new_figure(_ROW * sum(rows) + 0.62 * len(rows))
    panels = figure.subplots(len(rows), 1, height_ratios=rows, squeeze=False)[:, 0]
    for index, strategy in enumerate(strategies):
        means = comparison.run_means(strategy)
        _draw_runs(panels[0], means, len(strategies) - 1 - index, colour(index))
        _draw_box(panels[0], means, len(strategies) - 1 - index)
    _name_rows(panels[0], list(short_labels(strategies)))
    panels[0].set_xlabel(named_in("Mean OSPA of a run", comparison.unit))
    if others:
        _draw_differences(panels[1], comparison)
    return figure


def _draw_differences(axes: Axes, comparison: Comparison) -> None:
    others = comparison.strategies[1:]
    first = comparison.run_means(comparison.strategies[0])
    axes.axvline(0.0, color=INK, linewidth=0.8)
    for index, strategy in enumerate(others):
        row, means = len(others) - 1 - index, comparison.run_means(strategy)
        _draw_runs(axes, means - first, row, colour(index + 1))
        _draw_mean(axes, paired_difference(means, first).summary, row)
    name, *names = short_labels(comparison.strategies)
    _name_rows(axes, [_minus(other, name) for other in names])
    # The whole sentence if it fits; the names of the rows have the same meaning.
    are_short = cell_len(name) <= _SHORT and max(map(cell_len, names)) <= _ONE_LINE - _SHORT
    better = f", right of 0: {name} better" if are_short else ""
    axes.set_xlabel(f"{named_in('Paired difference', comparison.unit)}{better}")


def _minus(name: str, reference: str) -> str:
    """Return the name of a difference, on two lines if one would leave little room to draw."""
    separator = "\n" if cell_len(name + reference) > _ONE_LINE else " "
    return f"{name}{separator}\N{MINUS SIGN} {reference}"


def _draw_runs(axes: Axes, values: Floats, row: int, shade: str) -> None:
    """Draw dots of the first runs, spread over half the height of the row, so that equal values are distinguishable."""
    shown = values[:MAX_DOTS]
    spread = (np.arange(1, len(shown) + 1) * _GOLDEN) % 1.0 - 0.5
    axes.plot(
        shown, row + 0.55 * spread, linestyle="", marker="o", markersize=2.4, markeredgewidth=0, color=shade, alpha=0.6
    )


def _draw_box(axes: Axes, values: Floats, row: int) -> None:
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    corners_x, corners_y = [low, high, high, low, low], [row - 0.36, row - 0.36, row + 0.36, row + 0.36, row - 0.36]
    axes.plot(corners_x, corners_y, color=INK, linewidth=0.8)
    axes.plot([middle, middle], [row - 0.36, row + 0.36], color=INK, linewidth=1.6)
    axes.plot(values.mean(), row, marker="D", markersize=4, color=INK, markerfacecolor="white", markeredgewidth=0.8)


def _draw_mean(axes: Axes, summary: Summary, row: int) -> None:
    if summary.num_runs > 1:
        axes.plot([summary.low, summary.high], [row, row], color=INK, linewidth=1.6)
        for end in (summary.low, summary.high):
            axes.plot([end, end], [row - 0.14, row + 0.14], color=INK, linewidth=1.0)
    axes.plot(summary.mean, row, marker="D", markersize=4, color=INK, markerfacecolor="white", markeredgewidth=0.8)


def _name_rows(axes: Axes, names: list[str]) -> None:
    axes.set_yticks(range(len(names)), names[::-1])
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(-0.6, len(names) - 0.4)
    axes.grid(False, axis="y")
    axes.spines["left"].set_visible(False)
    axes.axhline(-0.6, color=GREY, linewidth=0.6)
