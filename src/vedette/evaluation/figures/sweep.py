"""Figure of the error against a number that a campaign varies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from vedette.errors import InputError
from vedette.evaluation.figures.labels import drawn_text, short_labels
from vedette.evaluation.figures.style import (
    MARKERS,
    colour,
    legend_columns,
    line_style,
    new_figure,
    styled,
)
from vedette.evaluation.statistics import Summary
from vedette.internal.text import named_in
from vedette.kernels.base.types import Floats


@dataclass(frozen=True, slots=True)
class SweepCurve:
    """One line of a sweep.

    Attributes:
        name: of the strategy.
        values: (num_values,) of the varied number.
        errors: for each value, the mean over runs of their mean OSPA.
    """

    name: str
    values: Floats
    errors: tuple[Summary, ...]


@styled
def sweep_figure(curves: Sequence[SweepCurve], label: str, unit: str = "m") -> Figure:
    """Return a figure of the mean OSPA over the runs against a varied number, with its 95 % confidence interval.

    Args:
        curves: one for each strategy.
        label: of the varied number, for the axis.
        unit: of OSPA, none ("") if it compares whole states.

    Raises `InputError` for no curve.
    """
    if not curves:
        raise InputError("curves: expected at least one; got none")
    figure = new_figure(2.4)
    axes = figure.subplots()
    values = np.unique(np.concatenate([curve.values for curve in curves]))
    logarithmic = bool(len(values) > 2 and values[0] > 0.0 and values[-1] / values[0] >= 20.0)
    names = short_labels([curve.name for curve in curves])
    for index, (name, curve) in enumerate(zip(names, curves, strict=True)):
        order = np.argsort(curve.values)
        mean = np.array([float(curve.errors[i].mean) for i in order])
        low, high = (np.array([float(getattr(curve.errors[i], end)) for i in order]) for end in ("low", "high"))
        positions = _shift_sideways(curve.values[order], index - (len(curves) - 1) / 2.0, values, logarithmic)
        style = {"color": colour(index), "linestyle": line_style(index), "marker": MARKERS[index % len(MARKERS)]}
        error_bars = np.nan_to_num(np.array([mean - low, high - mean]))
        axes.errorbar(positions, mean, yerr=error_bars, markersize=4, capsize=2, elinewidth=0.9, label=name, **style)
    if logarithmic:
        axes.set_xscale("log")
    axes.set_xticks(values, [f"{value:g}" for value in values])
    axes.minorticks_off()
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(drawn_text(label))
    axes.set_ylabel(named_in("Mean OSPA", unit))
    _, labels = axes.get_legend_handles_labels()
    figure.legend(loc="outside upper center", ncols=legend_columns(labels))
    return figure


def _shift_sideways(positions: Floats, offset: float, values: Floats, logarithmic: bool) -> Floats:
    """Return values shifted a little sideways, so that the intervals of several curves at one value do not overlap."""
    if len(values) < 2:
        return positions
    if logarithmic:
        return np.asarray(positions * np.exp(0.04 * offset * float(np.diff(np.log(values)).min())))
    return positions + 0.04 * offset * float(np.diff(values).min())
