"""The rewards that a strategy decided on, averaged over its runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.evaluation.actions import ActionAxis, action_axis
from vedette.evaluation.figures.rewards import best_over_others, best_over_pair, map_ticks, mark_actions
from vedette.evaluation.figures.style import (
    HEAT_MAP,
    INK,
    MARKERS,
    TEXT_WIDTH,
    colour,
    line_style,
    new_figure,
    shown_decisions,
    styled,
)
from vedette.evaluation.rewards import MeanRewards, mean_rewards
from vedette.kernels.base.types import Floats
from vedette.simulation.records import RunRecord

_COLUMNS = 3
_LARGEST_MARK = 60.0  # points squared, of a choice made in every run
_PAIR = (0, 1)
_LEVELS = 48  # of colour, which a vector file holds one by one


@styled
def mean_rewards_figure(records: Sequence[RunRecord]) -> Figure:
    """Mean reward over the runs of one strategy against action, a panel a decision, with how often each was chosen.

    Independent decisions: one curve a sensor with a band of one standard error over the runs. Joint decisions: a heat
    map over the first two sensors, the largest over the others where there are more; where the joint table was too
    large to keep, curves with the other sensors at their choice. The area of a mark is the share of the runs that chose
    the action. Of many decisions at most six are shown.

    Raises `InputError` for runs without rewards, or without a common set of actions.
    """
    number = max((len(record.decisions) for record in records), default=0)
    decisions = [mean_rewards(records, decision) for decision in shown_decisions(number)]
    if not decisions:
        raise InputError("records: expected runs with decisions; got none")
    joint = any(len(table.sensors) > 1 for table in decisions[0].tables)
    columns = min(len(decisions), _COLUMNS)
    rows = -(-len(decisions) // columns)
    width = TEXT_WIDTH * (columns / _COLUMNS if columns < _COLUMNS else 1.0)
    figure = new_figure((2.35 if joint else 1.9) * rows + (0.0 if joint else 0.2), width=width)
    panels = figure.subplots(rows, columns, sharey=not joint, squeeze=False)
    for panel, rewards in zip(panels.ravel(), decisions, strict=False):
        if joint:
            _draw_joint(figure, panel, rewards)
        else:
            _draw_curves(panel, rewards)
        panel.set_title(f"{rewards.time:g} s")
    for panel in panels.ravel()[len(decisions) :]:
        panel.set_visible(False)
    _label(figure, panels, decisions[0], joint)
    return figure


def _label(figure: Figure, panels: Any, rewards: MeanRewards, joint: bool) -> None:
    for panel in panels[-1]:
        if joint:
            panel.set_xlabel(action_axis(rewards.actions[_PAIR[0]]).title(_PAIR[0]))
    for row in panels[:, 0]:
        row.set_ylabel(action_axis(rewards.actions[_PAIR[1]]).title(_PAIR[1]) if joint else "Mean reward")
    if not joint:
        handles, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 6))


def _draw_curves(axes: Axes, rewards: MeanRewards) -> None:
    along = {sensor: action_axis(rewards.actions[sensor]) for table in rewards.tables for sensor in table.sensors}
    alike = len({each.title() if each.is_numeric else each.labels for each in along.values()}) == 1
    for table, share in zip(rewards.tables, rewards.shares, strict=True):
        for axis, sensor in enumerate(table.sensors):
            others = tuple(other for other in range(share.ndim) if other != axis)
            _draw_curve(
                axes,
                along[sensor] if alike else along[sensor].counted(),
                sensor,
                best_over_others(table, axis),
                share.sum(axis=others),
            )
    if alike:
        mark_actions(axes, next(iter(along.values())), 90)
    else:
        axes.set_xlabel("Number of the action")


def _draw_curve(axes: Axes, along: ActionAxis, sensor: int, curve: tuple[Floats, Floats], share: Floats) -> None:
    order = np.argsort(along.places, kind="stable")
    places = along.places[order]
    mean, error, share = curve[0][order], curve[1][order], share[order]
    shade = colour(sensor)
    if along.is_numeric:
        axes.fill_between(places, mean - error, mean + error, color=shade, alpha=0.2, linewidth=0)
    else:
        axes.errorbar(places, mean, error, color=shade, linestyle="", linewidth=0.8)
    axes.plot(
        places,
        mean,
        color=shade,
        linestyle=line_style(sensor) if along.is_numeric else ":",
        label=f"sensor {sensor + 1}",
    )
    axes.scatter(
        places, mean, s=_LARGEST_MARK * share, color=shade, marker=MARKERS[sensor % len(MARKERS)],
        edgecolors=INK, linewidths=np.where(share > 0.0, 0.5, 0.0).tolist(), zorder=3,
    )  # fmt: skip


def _draw_joint(figure: Figure, axes: Axes, rewards: MeanRewards) -> None:
    place, table = next((i, table) for i, table in enumerate(rewards.tables) if len(table.sensors) > 1)
    reward, share = best_over_pair(table, _PAIR), _pair_share(table, rewards.shares[place])
    edges = [np.arange(length + 1) - 0.5 for length in reward.shape]
    image = axes.pcolormesh(
        *edges, reward.T, cmap=matplotlib.colormaps[HEAT_MAP].resampled(_LEVELS), edgecolors="face", linewidth=0.1
    )
    first, second = np.nonzero(share)
    axes.scatter(
        first, second, s=_LARGEST_MARK * share[first, second], color="white", edgecolors="black", linewidths=0.5
    )
    axes.grid(False)
    axes.set_aspect("equal" if reward.shape[0] == reward.shape[1] else "auto")
    for axis, sensor in zip((axes.xaxis, axes.yaxis), _PAIR, strict=True):
        map_ticks(axis, action_axis(rewards.actions[sensor]), 5)
    bar = figure.colorbar(image, ax=axes, shrink=0.9)
    bar.ax.tick_params(labelsize=6)
    bar.ax.set_title("reward", fontsize=6, pad=4)
    assert bar.solids is not None
    bar.solids.set(edgecolor="face", rasterized=False)  # a page would have to load the picture


def _pair_share(table: RewardTable, share: Floats) -> Floats:
    """Share of the runs that chose each pair of actions, whatever the other sensors did."""
    positions = [table.sensors.index(sensor) for sensor in _PAIR]
    summed = share.sum(axis=tuple(axis for axis in range(share.ndim) if axis not in positions))
    return np.asarray(summed if positions[0] < positions[1] else summed.T)
