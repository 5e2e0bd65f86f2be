"""Figures of the error of the strategies over time (paper Fig. 5)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vedette.errors import InputError
from vedette.evaluation.comparison import Comparison
from vedette.evaluation.ensembles import PARTS
from vedette.evaluation.figures.labels import short_labels
from vedette.evaluation.figures.style import (
    GREY,
    colour,
    legend_columns,
    line_style,
    new_figure,
    span_times,
    styled,
)
from vedette.evaluation.statistics import Summary, summarise
from vedette.internal.text import named_in
from vedette.kernels.base.types import Bools, Floats


@dataclass(frozen=True, slots=True)
class SharedInterval:
    """An interval over which several curves are equal."""

    members: tuple[int, ...]  # indices of the curves, increasing
    shown: Bools  # (num_points,) True for the points of the interval. It may have gaps


def shared_intervals(curves: Floats) -> tuple[SharedInterval, ...]:
    """Return every set of curves that are equal over one or more steps, with the points of those steps.

    Args:
        curves: (num_curves, num_points).
    """
    same_point = curves[:, None, :] == curves[None, :, :]
    same_step = same_point[:, :, :-1] & same_point[:, :, 1:]
    points_by_members: dict[tuple[int, ...], Bools] = {}
    for step in range(curves.shape[1] - 1):
        for curve in range(len(curves)):
            members = tuple(np.flatnonzero(same_step[curve, :, step]).tolist())
            if len(members) > 1 and members[0] == curve:
                points_by_members.setdefault(members, np.zeros(curves.shape[1], bool))[step : step + 2] = True
    return tuple(SharedInterval(members, shown) for members, shown in points_by_members.items())


def distinct_points(curves: Floats) -> Bools:
    """Return True at ends of steps over which a curve equals no other, (num_curves, num_points), or all for one."""
    num_curves, num_points = curves.shape
    if num_curves == 1:
        return np.ones((1, num_points), bool)
    same_point = curves[:, None, :] == curves[None, :, :]
    is_distinct = (same_point[:, :, :-1] & same_point[:, :, 1:]).sum(axis=1) == 1
    distinct = np.zeros(curves.shape, bool)
    distinct[:, :-1] |= is_distinct
    distinct[:, 1:] |= is_distinct
    return distinct


_LABELS = {"total": "OSPA", "localisation": "Localisation", "cardinality": "Cardinality"}
_OUTLIER_FACTOR = 2.0  # times the second largest difference; a larger one leaves the axis
_DASH = 4.5  # line widths, dashes of curves that coincide


@styled
def ospa_figure(comparison: Comparison, *, parts: Sequence[str] = ("total",)) -> Figure:
    """Return a figure of the mean OSPA of each strategy against time, with bands of one standard error over the runs.

    Decisions are marked.

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
    return _with_legend(figure, panels[0])


def _with_legend(figure: Figure, axes: Axes) -> Figure:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=legend_columns(labels), columnspacing=1.2, handlelength=1.8
    )
    return figure


@styled
def differences_figure(comparison: Comparison) -> Figure:
    """Return a figure of the decisions' effect over time: mean OSPA and paired differences from the first one on.

    Upper panel: bands of one standard error. Lower panel: each strategy minus the first, run by run: the mean with its
    pointwise 95 % confidence interval at each scan, above 0 if the first strategy is better.

    Raises `InputError` for one strategy, or one run.
    """
    if len(comparison.strategies) < 2 or comparison.num_runs < 2:
        raise InputError(
            f"comparison: expected two strategies and runs or more; got {len(comparison.strategies)} and "
            f"{comparison.num_runs}"
        )
    figure = new_figure(4.05)
    above, below = figure.subplots(2, 1, sharex=True)
    draw_ospa(above, comparison, "total")
    _limit_height(above, comparison, since_first_decision(comparison))
    draw_differences(below, comparison)
    return _with_legend(figure, above)


def since_first_decision(comparison: Comparison) -> Bools:
    """Return True for each scan at or after the first decision, (num_scans,), or all if fewer than two are."""
    shown = comparison.times >= (comparison.decision_times[:1].min(initial=np.inf))
    return shown if shown.sum() >= 2 else np.ones(len(shown), bool)


def draw_differences(axes: Axes, comparison: Comparison) -> None:
    """Draw the paired difference of each strategy to the first against time, with 95 % confidence bands.

    A strategy that is much worse than all others leaves the axis at the top, so that the others are distinguishable.
    """
    shown = since_first_decision(comparison)
    largest: dict[str, float] = {}
    times = comparison.times[shown]
    axes.axhline(0.0, color=colour(0), linewidth=1.4, label=short_labels(comparison.strategies)[0])
    first = comparison.values(comparison.strategies[0])
    for index, (strategy, label) in enumerate(
        zip(comparison.strategies[1:], short_labels(comparison.strategies)[1:], strict=True), start=1
    ):
        curve = summarise(comparison.values(strategy)[:, shown] - first[:, shown])
        axes.plot(times, curve.mean, color=colour(index), linestyle=line_style(index), label=label)
        _fill(axes, times, curve.low, curve.high, np.ones(len(times), bool), colour(index))
        largest[label] = float(np.abs([curve.low, curve.high]).max())
    _cut_off_outlier(axes, largest)
    _mark_decisions(axes, comparison)
    span_times(axes, times)
    axes.set_xlabel("Time (s)")
    axes.set_ylabel(named_in(f"minus {short_labels(comparison.strategies)[0]}", comparison.unit))


def _cut_off_outlier(axes: Axes, largest: dict[str, float]) -> None:
    """End the axis above the second largest difference if the largest is far beyond it, with a note in the figure."""
    *_, second, worst = [("", 0.0), *sorted(largest.items(), key=lambda each: each[1])]
    if worst[1] > _OUTLIER_FACTOR * second[1] > 0.0:
        axes.set_ylim(axes.get_ylim()[0], 1.15 * second[1])
        axes.text(
            0.98, 0.02, f"{worst[0]} leaves the axis", transform=axes.transAxes, ha="right", color=GREY, fontsize=6
        )


def _limit_height(axes: Axes, comparison: Comparison, shown: Bools) -> None:
    """Limit the height of the axes to the curves with their bands at these scans."""
    curves = [comparison.curve(strategy) for strategy in comparison.strategies]
    low = min(float((curve.mean - curve.standard_error)[shown].min()) for curve in curves)
    high = max(float((curve.mean + curve.standard_error)[shown].max()) for curve in curves)
    margin = 0.06 * (high - low) or 1.0
    axes.set_ylim(max(0.0, low - margin), high + margin)


def draw_ospa(axes: Axes, comparison: Comparison, part: str) -> None:
    """Draw one part of the OSPA of every strategy into axes. Curves that coincide have dashes of all their colours."""
    times = comparison.times
    curves = [comparison.curve(strategy, part) for strategy in comparison.strategies]
    means = np.array([curve.mean for curve in curves])
    distinct = distinct_points(means)
    for index, (label, curve) in enumerate(zip(short_labels(comparison.strategies), curves, strict=True)):
        shade = colour(index)
        mean = np.where(distinct[index], curve.mean, np.nan)
        axes.plot(times, mean, color=shade, linestyle=line_style(index), label=label)
        if comparison.num_runs > 1:
            _draw_band(axes, times, curve, distinct[index], shade)
    for interval in shared_intervals(means):
        mean = np.where(interval.shown, means[interval.members[0]], np.nan)
        for position, index in enumerate(interval.members):
            dashes = (-_DASH * position, (_DASH, _DASH * (len(interval.members) - 1)))
            axes.plot(times, mean, color=colour(index), linestyle=dashes, dash_capstyle="butt", label="_")
        if comparison.num_runs > 1:
            _draw_band(axes, times, curves[interval.members[0]], interval.shown, GREY)
    _mark_decisions(axes, comparison)
    axes.set_ylim(bottom=0.0)
    span_times(axes, comparison.times)
    axes.set_ylabel(named_in(_LABELS[part], comparison.unit))


def _mark_decisions(axes: Axes, comparison: Comparison) -> None:
    for number, time in enumerate(comparison.decision_times):
        label = "_" if number else "decision"  # named once in the legend
        axes.axvline(time, color=GREY, linestyle=(0, (2, 2)), linewidth=0.9, zorder=1, label=label)


def _draw_band(axes: Axes, times: Floats, curve: Summary, shown: Bools, shade: str) -> None:
    """Draw a band of one standard error to either side."""
    _fill(axes, times, curve.mean - curve.standard_error, curve.mean + curve.standard_error, shown, shade)


def _fill(axes: Axes, times: Floats, low: Floats, high: Floats, shown: Bools, shade: str) -> None:
    """Fill a band faintly, with a thin outline that separates it from others."""
    axes.fill_between(
        times, low, high, where=shown.tolist(), facecolor=(shade, 0.12), edgecolor=(shade, 0.45), linewidth=0.35
    )
