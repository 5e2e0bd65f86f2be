"""How the error of the strategies goes over time (paper Fig. 5)."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vedette.errors import InputError
from vedette.evaluation.comparison import PARTS, Comparison
from vedette.evaluation.figures.style import (
    GREY,
    colour,
    legend_columns,
    line_style,
    new_figure,
    strategy_label,
    styled,
)

_LABELS = {"total": "OSPA (m)", "localisation": "Localisation (m)", "cardinality": "Cardinality (m)"}


@styled
def ospa_figure(comparison: Comparison, *, parts: Sequence[str] = ("total",)) -> Figure:
    """Mean OSPA of each strategy against time, with bands of one standard error over the runs; decisions are marked.

    Args:
        comparison: from `vedette.evaluation.comparison.compare`.
        parts: one panel for each of "total", "localisation", "cardinality".

    Raises `InputError` for no part, or another name.
    """
    if not parts or not set(parts) <= set(PARTS):
        raise InputError(f"parts: expected some of {', '.join(PARTS)}; got {', '.join(parts) or 'none'}")
    figure = new_figure(0.55 + 1.75 * len(parts))
    panels = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    for panel, part in zip(panels, parts, strict=True):
        draw_ospa(panel, comparison, part)
    panels[-1].set_xlabel("Time (s)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=legend_columns(labels), columnspacing=1.2, handlelength=1.8
    )
    return figure


def draw_ospa(axes: Axes, comparison: Comparison, part: str) -> None:
    """Draw one part of the OSPA of every strategy into axes."""
    for index, strategy in enumerate(comparison.strategies):
        curve = comparison.curve(strategy, part)
        shade = colour(index)
        axes.plot(
            comparison.times, curve.mean, color=shade, linestyle=line_style(index), label=strategy_label(strategy)
        )
        if comparison.num_runs > 1:
            low, high = curve.mean - curve.standard_error, curve.mean + curve.standard_error
            axes.fill_between(comparison.times, low, high, color=shade, alpha=0.2, linewidth=0)
    for number, time in enumerate(comparison.decision_times):
        label = "_" if number else "decision"  # named once in the legend
        axes.axvline(time, color=GREY, linestyle=(0, (2, 2)), linewidth=0.9, zorder=1, label=label)
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(comparison.times[0], comparison.times[-1])
    axes.set_ylabel(_LABELS[part])
