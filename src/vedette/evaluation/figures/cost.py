"""Figure of the computing time of the strategies."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from vedette.errors import InputError
from vedette.evaluation.figures.labels import short_labels
from vedette.evaluation.figures.style import MARKERS, colour, legend_columns, new_figure, styled

MIN_FOR_TAILS = 20  # number of values below which their 5th and 95th percentiles are only the extremes


@styled
def cost_figure(seconds: Mapping[str, Mapping[str, NDArray[np.floating]]]) -> Figure:
    """Return a figure of the time of each stage: the median, and a line from the 5th to the 95th percentile, in ms.

    The line needs 20 values or more. The number of values stands next to each stage (of several strategies, the
    largest).

    Args:
        seconds: for each strategy and stage (such as "filter, a scan"), one number for each scan or decision, s.

    Raises `InputError` if nothing was timed.
    """
    stages = list(dict.fromkeys(stage for stage_seconds in seconds.values() for stage in stage_seconds))
    if not stages:
        raise InputError("seconds: expected the time of at least one stage; got none")
    labels = short_labels(list(seconds))
    columns = legend_columns(labels)
    lines = -(-len(labels) // columns)
    figure = new_figure(0.6 + 0.15 * lines + (0.11 * len(seconds) + 0.08) * len(stages))
    axes = figure.subplots()
    for index, (label, stage_seconds) in enumerate(zip(labels, seconds.values(), strict=True)):
        shade, marker = colour(index), MARKERS[index % len(MARKERS)]
        offset = (index - (len(seconds) - 1) / 2.0) * 0.7 / max(len(seconds), 1)
        rows = [row for row, stage in enumerate(stages) if len(stage_seconds.get(stage, ()))]
        low, middle, high = np.array([_quantiles(stage_seconds[stages[row]]) for row in rows]).T * 1e3
        heights = np.array(rows) + offset
        axes.hlines(heights, low, high, color=shade, linewidth=1.2)
        axes.plot(middle, heights, linestyle="", marker=marker, markersize=4, color=shade, label=label)
    axes.set_xscale("log")
    _label_times(axes)
    counts = [max(len(stage_seconds.get(stage, ())) for stage_seconds in seconds.values()) for stage in stages]
    axes.set_yticks(range(len(stages)), [f"{stage}\nn = {count}" for stage, count in zip(stages, counts, strict=True)])
    axes.set_ylim(len(stages) - 0.5, -0.5)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("Time (ms): median, 5 % to 95 %")
    figure.legend(loc="outside upper center", ncols=columns, handlelength=1.2)
    return figure


def _label_times(axes: Axes) -> None:
    """Set labels that do not overlap: decades, or within two decades 1, 2 and 5. The axis spans at least a decade."""
    low, high = axes.get_xlim()
    if high < 10.0 * low:
        middle = float(np.sqrt(low * high))
        low, high = middle / np.sqrt(10.0), middle * np.sqrt(10.0)
        axes.set_xlim(low, high)
    if high < 100.0 * low:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _quantiles(values: NDArray[np.floating]) -> tuple[float, float, float]:
    """Return 5 %, median and 95 %, or three times the median if there are too few values for the others."""
    low, middle, high = np.quantile(values, (0.05, 0.5, 0.95)).tolist()
    return (low, middle, high) if len(values) >= MIN_FOR_TAILS else (middle, middle, middle)
