"""Figure of a strategy's rewards at its decisions, averaged over its runs."""

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vedette.control.plan import RewardTable
from vedette.errors import InputError
from vedette.evaluation.actions import ActionAxis, action_axis
from vedette.evaluation.figures.rewards import (
    best_over_others,
    best_over_pair,
    first_pair,
    map_ticks,
    mark_actions,
    sensors_with_choice,
)
from vedette.evaluation.figures.scene import Scene
from vedette.evaluation.figures.style import (
    HEAT_MAP,
    INK,
    TEXT_WIDTH,
    legend_columns,
    new_figure,
    sensor_styles,
    styled,
)
from vedette.evaluation.rewards import MeanRewards
from vedette.kernels.base.types import Floats

_COLUMNS = 3
_LARGEST_MARK = 60.0  # points squared, area of the mark of a choice made in every run
_LEVELS = 48  # colour levels, which a vector file stores separately


@styled
def mean_rewards_figure(decisions: Sequence[MeanRewards], scene: Scene | None = None) -> Figure:
    """Return a figure of the mean reward over the runs of a strategy against action, and how often each was chosen.

    One panel for each decision. Independent decisions: one curve for each sensor with a band of one standard error over
    the runs. Joint decisions: a heat map over the first two sensors with a choice, the maximum over any others. If the
    joint table was too large to store, curves with the other sensors at their choice. The area of a mark is the share
    of the runs that chose the action. A sensor with only one action has no curve. Of more than six sensors, those whose
    choice makes the most difference have one.

    Args:
        decisions: to be shown, in order. `vedette.evaluation.mean_rewards` computes those of runs.
        scene: names of sensors and reward. None: numbers.

    Raises `InputError` for no decision, or none with a choice.
    """
    scene = scene or Scene()
    if not decisions:
        raise InputError("decisions: expected the rewards of one or more; got none")
    pair = first_pair(decisions[0].tables, decisions[0].actions)
    sensors = sensors_with_choice([(each.tables, each.actions) for each in decisions])
    if not sensors:
        raise InputError("decisions: expected a sensor with a choice; got one action each")
    columns = min(len(decisions), _COLUMNS)
    rows = -(-len(decisions) // columns)
    width = TEXT_WIDTH * (columns / _COLUMNS if columns < _COLUMNS else 1.0)
    label_height = 0.0 if all(action_axis(decisions[0].actions[sensor]).is_numeric for sensor in sensors) else 0.4
    height = (1.9 + label_height) * rows + 0.4 if pair is None else 2.35 * rows
    figure = new_figure(height, width=width)
    panels = figure.subplots(rows, columns, sharey=pair is None, squeeze=False)
    for panel, rewards in zip(panels.ravel(), decisions, strict=False):
        if pair is None:
            _draw_curves(panel, rewards, sensors, scene)
        else:
            _draw_joint(figure, panel, rewards, pair)
        panel.set_title(f"{rewards.time:g} s")
    for panel in panels.ravel()[len(decisions) :]:
        panel.set_visible(False)
    if pair is None:
        for row in panels[:, 0]:
            row.set_ylabel("Mean reward")
        _name_curves(figure, panels, scene)
    else:
        _name_maps(figure, panels, pair, decisions[0], scene)
    return figure


def _name_curves(figure: Figure, panels: Any, scene: Scene) -> None:
    handles, labels = panels[0, 0].get_legend_handles_labels()
    columns = legend_columns(labels, width=figure.get_figwidth())
    title = scene.reward_title() if scene.reward else None
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, title=title, title_fontsize=7)


def _name_maps(figure: Figure, panels: Any, pair: tuple[int, int], rewards: MeanRewards, scene: Scene) -> None:
    x_title, y_title = (action_axis(rewards.actions[sensor]).title(scene.name(sensor)) for sensor in pair)
    for panel in panels[-1]:
        panel.set_xlabel(x_title)
    for panel in panels[:, 0]:
        panel.set_ylabel(y_title)
    if scene.reward:
        figure.suptitle(scene.reward_title("Colour: mean reward"), fontsize=7)


def _draw_curves(axes: Axes, rewards: MeanRewards, sensors: Sequence[int], scene: Scene) -> None:
    axes_of_sensors = {sensor: action_axis(rewards.actions[sensor]) for sensor in sensors}
    styles = sensor_styles(sensors)
    one_axis = (
        len({own_axis.title() if own_axis.is_numeric else own_axis.labels for own_axis in axes_of_sensors.values()})
        == 1
    )
    for table, share in zip(rewards.tables, rewards.shares, strict=True):
        for axis, sensor in enumerate(table.sensors):
            if sensor not in axes_of_sensors:
                continue
            others = tuple(other for other in range(share.ndim) if other != axis)
            _draw_curve(
                axes,
                axes_of_sensors[sensor] if one_axis else axes_of_sensors[sensor].counted(),
                best_over_others(table, axis),
                share.sum(axis=others),
                scene.name(sensor),
                styles[sensor],
            )
    if one_axis:
        mark_actions(axes, next(iter(axes_of_sensors.values())), 90)
    else:
        axes.set_xlabel("Number of the action")


def _draw_curve(
    axes: Axes, along: ActionAxis, curve: tuple[Floats, Floats], share: Floats, name: str, style: Any
) -> None:
    order = np.argsort(along.places, kind="stable")
    places = along.places[order]
    mean, error, share = curve[0][order], curve[1][order], share[order]
    shade, marker, dashes = style
    if along.is_numeric:
        axes.fill_between(places, mean - error, mean + error, color=shade, alpha=0.2, linewidth=0)
    else:
        axes.errorbar(places, mean, error, color=shade, linestyle="", linewidth=0.8)
    axes.plot(
        places,
        mean,
        color=shade,
        linestyle=dashes if along.is_numeric else ":",
        label=name,
    )
    chosen = share > 0.0
    axes.scatter(
        places[chosen], mean[chosen], s=_LARGEST_MARK * share[chosen], color=shade,
        marker=marker, edgecolors=INK, linewidths=0.5, zorder=3,
    )  # fmt: skip


def _draw_joint(figure: Figure, axes: Axes, rewards: MeanRewards, pair: tuple[int, int]) -> None:
    index, table = next((i, table) for i, table in enumerate(rewards.tables) if len(table.sensors) > 1)
    reward, share = best_over_pair(table, pair), _pair_share(table, rewards.shares[index], pair)
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
    for axis, sensor in zip((axes.xaxis, axes.yaxis), pair, strict=True):
        map_ticks(axis, action_axis(rewards.actions[sensor]), 5)
    bar = figure.colorbar(image, ax=axes, shrink=0.9)
    bar.ax.tick_params(labelsize=6)
    bar.ax.set_title("reward", fontsize=6, pad=4)
    assert bar.solids is not None
    bar.solids.set(edgecolor="face", rasterized=False)  # otherwise a page would have to load a separate image


def _pair_share(table: RewardTable, share: Floats, pair: tuple[int, int]) -> Floats:
    """Return the share of the runs that chose each pair of actions, summed over the other sensors' actions."""
    positions = [table.sensors.index(sensor) for sensor in pair]
    summed = share.sum(axis=tuple(axis for axis in range(share.ndim) if axis not in positions))
    return np.asarray(summed if positions[0] < positions[1] else summed.T)
