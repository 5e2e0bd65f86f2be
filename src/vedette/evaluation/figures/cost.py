"""What the strategies cost in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from vedette.errors import InputError
from vedette.evaluation.figures.style import MARKERS, colour, legend_columns, new_figure, strategy_label, styled
from vedette.kernels.types import Floats


@styled
def cost_figure(seconds: Mapping[str, Mapping[str, Floats]]) -> Figure:
    """Time of each stage: the median, with a line from the 5th to the 95th percentile, in milliseconds.

    Args:
        seconds: for each strategy, for each stage (such as "filter, a scan"), one number a scan or a decision, s.

    Raises `InputError` where nothing was timed.
    """
    stages = list(dict.fromkeys(stage for spent in seconds.values() for stage in spent))
    if not stages:
        raise InputError("seconds: expected the time of at least one stage; got none")
    figure = new_figure(0.75 + (0.11 * len(seconds) + 0.08) * len(stages))
    axes = figure.subplots()
    for index, (strategy, spent) in enumerate(seconds.items()):
        shade, marker = colour(index), MARKERS[index % len(MARKERS)]
        offset = (index - (len(seconds) - 1) / 2.0) * 0.7 / max(len(seconds), 1)
        rows = [row for row, stage in enumerate(stages) if len(spent.get(stage, ()))]
        low, middle, high = np.array([np.quantile(spent[stages[row]], (0.05, 0.5, 0.95)) for row in rows]).T * 1e3
        places = np.array(rows) + offset
        axes.hlines(places, low, high, color=shade, linewidth=1.2)
        axes.plot(
            middle, places, linestyle="", marker=marker, markersize=4, color=shade, label=strategy_label(strategy)
        )
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_yticks(range(len(stages)), stages)
    axes.set_ylim(len(stages) - 0.5, -0.5)
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("Time (ms): median, 5 % to 95 %")
    _, labels = axes.get_legend_handles_labels()
    figure.legend(loc="outside upper center", ncols=legend_columns(labels), handlelength=1.2)
    return figure
