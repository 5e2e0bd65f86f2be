"""Figure of the consistency of estimates with their covariances, over time."""

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from vedette.errors import InputError
from vedette.evaluation.figures.labels import short_labels
from vedette.evaluation.figures.style import (
    GREY,
    INK,
    colour,
    legend_columns,
    line_style,
    new_figure,
    span_times,
    styled,
)
from vedette.evaluation.metrics.consistency import AverageNees
from vedette.kernels.base.types import Floats


@styled
def consistency_figure(times: Floats, position: Mapping[str, AverageNees]) -> Figure:
    """Return a figure of the average NEES over the runs, divided by its dimension, against time.

    A consistent filter is at 1. 95 % of its scans then lie in the interval, drawn as a band (that of the first
    strategy: its width follows from the number of pairs). Above the band, estimates are worse than their covariances.

    Args:
        times: (num_scans,) s.
        position: for each strategy, the average at each scan.

    Raises `InputError` for no strategy.
    """
    if not position:
        raise InputError("position: expected the NEES of at least one strategy; got none")
    figure = new_figure(2.2)
    axes = figure.subplots()
    for index, (label, average) in enumerate(zip(short_labels(list(position)), position.values(), strict=True)):
        axes.plot(
            times,
            average.mean / average.dim,
            color=colour(index),
            linestyle=line_style(index),
            label=label,
        )
    _draw_interval(axes, times, next(iter(position.values())))
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    span_times(axes, times)
    axes.set_xlabel("Time (s)")
    axes.set_ylabel("Position NEES / 2")
    _, labels = axes.get_legend_handles_labels()
    figure.legend(loc="outside upper center", ncols=legend_columns(labels))
    return figure


def _draw_interval(axes: Axes, times: Floats, average: AverageNees) -> None:
    low, high = average.lower / average.dim, average.upper / average.dim
    axes.fill_between(times, low, high, color=GREY, alpha=0.3, linewidth=0, label="95 % if consistent")
    axes.axhline(1.0, color=INK, linewidth=0.6)
