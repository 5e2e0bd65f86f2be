"""Figure of the reward of each action at one decision (paper Fig. 4)."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from vedette.control.plan import Plan, RewardTable
from vedette.errors import InputError
from vedette.evaluation.actions import ActionAxis, action_axis
from vedette.evaluation.figures.scene import Scene
from vedette.evaluation.figures.style import (
    COLOURS,
    COLUMN_WIDTH,
    HEAT_MAP,
    degrees_label,
    legend_columns,
    new_figure,
    sensor_styles,
    styled,
)
from vedette.internal.text import with_minus
from vedette.kernels.base.types import Floats
from vedette.platforms import Actions

_PANEL_WIDTH = 2.4  # inches, within the labels of a column


@styled
def reward_figure(plan: Plan, *, pair: tuple[int, int] | None = None, scene: Scene | None = None) -> Figure:
    """Return a figure of reward against action, one curve for each sensor, with the choice marked.

    Bands are one standard error over the samples. Actions of one column lie at its number, and others side by side.
    Sensors with other columns have separate panels. An independent plan shows its curves unchanged. A joint plan has
    above them a heat map of the joint table with the chosen actions framed. Its curves are the largest reward of each
    of a sensor's actions over the others' actions. With more than two sensors, the heat map is the maximum over the
    sensors outside `pair`. Entries that a search did not evaluate are blank. A sensor with only one action has no
    curve. Of more than six sensors, those whose choice makes the most difference have one.

    Args:
        plan: with reward tables.
        pair: the sensors on the axes of the heat map. None: the first two that have a choice.
        scene: names of sensors and rewards.

    Raises `InputError` for a plan without tables (random or fixed control) or without a choice, or a pair that is not
    two of its sensors.
    """
    scene = scene or Scene()
    plan.validate()
    if not plan.tables:
        raise InputError(f"plan: expected reward tables; got none, as planner {plan.planner!r} weighs no actions")
    sensors_shown = sensors_with_choice([(plan.tables, plan.actions)])
    if not sensors_shown:
        raise InputError("plan: expected a sensor with a choice; got one action each")
    joint = [table for table in plan.tables if len(table.sensors) > 1]
    pair = pair or first_pair(plan.tables, plan.actions)
    sensors_with_axis = {*sensors_shown, *(pair or ())} & {*range(len(plan.actions))}
    action_axes = {sensor: action_axis(plan.actions[sensor]) for sensor in sensors_with_axis}
    groups = group_by_axis(action_axes, sensors_shown)
    if pair is None:
        joint = []
    heights = [1.55] * len(joint[:1]) + [1.0] * len(groups)
    figure = new_figure((COLUMN_WIDTH + 1.4 if joint else 2.3) + 1.9 * (len(groups) - 1))
    panels = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    if joint and pair is not None:
        _draw_heat_map(figure, panels[0], plan, joint[0], pair, action_axes, scene)
    for axes, sensors in zip(panels[-len(groups) :], groups, strict=True):
        _draw_curves(
            axes, plan, {sensor: action_axes[sensor] for sensor in sensors}, scene, sensor_styles(sensors_shown)
        )
    return figure


def sensors_with_choice(decisions: Sequence[tuple[Sequence[RewardTable], Sequence[Actions]]]) -> tuple[int, ...]:
    """Return the sensors with more than one action in any of the decisions, given by their tables and actions.

    Of more than six, the six whose choice makes the most difference to the reward.
    """
    spans: dict[int, float] = {}
    for tables, actions in decisions:
        for table in tables:
            for axis, sensor in enumerate(table.sensors):
                if len(actions[sensor]) > 1:
                    curve = best_over_others(table, axis)[0]
                    finite = curve[np.isfinite(curve)]
                    spans[sensor] = spans.get(sensor, 0.0) + float(np.ptp(finite) if len(finite) else 0.0)
    return tuple(sorted(sorted(spans, key=lambda sensor: -spans[sensor])[: len(COLOURS)]))


def first_pair(tables: Sequence[RewardTable], actions: Sequence[Actions]) -> tuple[int, int] | None:
    """Return the first two sensors with a choice in a joint table, or None if there are none."""
    joint = [table.sensors for table in tables if len(table.sensors) > 1]
    with_choice = [sensor for sensors in joint[:1] for sensor in sensors if len(actions[sensor]) > 1]
    return (with_choice[0], with_choice[1]) if len(with_choice) > 1 else None


def group_by_axis(action_axes: Mapping[int, ActionAxis], sensors: Sequence[int]) -> list[list[int]]:
    """Return groups of sensors whose actions can be drawn along one axis.

    action_axes: the axis of each sensor's actions.
    """
    groups: dict[Any, list[int]] = {}
    for sensor in sensors:
        axis = action_axes[sensor]
        groups.setdefault(axis.title() if axis.is_numeric else axis.labels, []).append(sensor)
    return list(groups.values())


def _draw_curves(
    axes: Axes, plan: Plan, action_axes: Mapping[int, ActionAxis], scene: Scene, styles: Mapping[int, Any]
) -> None:
    for table in plan.tables:
        for axis, sensor in enumerate(table.sensors):
            if sensor in action_axes:
                curve, chosen = best_over_others(table, axis), plan.chosen[sensor]
                _draw_curve(axes, action_axes[sensor], *curve, chosen, scene.name(sensor), styles[sensor])
    joint = any(len(table.sensors) > 1 for table in plan.tables)
    mark_actions(axes, next(iter(action_axes.values())))
    axes.set_ylabel(scene.reward_title("Largest joint reward" if joint else "Reward").replace(" (", "\n("))
    # Above the panel: inside it, a legend would cover a curve.
    columns = legend_columns([str(each) for each in axes.get_legend_handles_labels()[1]], width=_PANEL_WIDTH)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, frameon=False, handlelength=1.8)


def _draw_curve(axes: Axes, axis: ActionAxis, mean: Floats, error: Floats, choice: int, name: str, style: Any) -> None:
    # Changes of heading have another order than the resulting headings.
    order = np.argsort(axis.places, kind="stable")
    places, mean, error = axis.places[order], mean[order], error[order]
    chosen = int(np.flatnonzero(order == choice)[0])
    shade, marker, dashes = style
    if axis.is_numeric:
        axes.fill_between(places, mean - error, mean + error, color=shade, alpha=0.2, linewidth=0)
    else:
        axes.errorbar(places, mean, error, color=shade, linestyle="", linewidth=0.8)
    axes.plot(
        places,
        mean,
        color=shade,
        linestyle=dashes if axis.is_numeric else "",
        marker=marker,
        markersize=6,
        markeredgecolor="black",
        markevery=[chosen],
        label=f"{name}: {with_minus(axis.labels[order[chosen]])}",
    )
    axes.plot(places, mean, color=shade, linestyle="", marker=".", markersize=3)


def mark_actions(axes: Axes, along: ActionAxis, every: int = 60) -> None:
    """Set title and ticks of an axis of actions: one tick every `every` degrees, or each action in words."""
    axes.set_xlabel(along.title())
    low, high = axes.get_xlim()
    if not along.is_numeric:
        axes.set_xticks(along.places, along.ticks, rotation=90, fontsize=5)
    elif along.unit == "deg" and 180.0 < high - low < 420.0 and low > -220.0 and high < 220.0:
        axes.set_xticks(np.arange(-180, 181, every), [degrees_label(value) for value in range(-180, 181, every)])


def map_ticks(axis: Any, along: ActionAxis, max_ticks: int) -> None:
    """Set at most `max_ticks` ticks on one side of a map of joint actions."""
    step = max(1, -(-len(along.places) // max_ticks))
    style = {} if along.is_numeric or axis.axis_name == "y" else {"rotation": 90}
    axis.set_ticks(range(0, len(along.ticks), step), along.ticks[::step], **style)


def best_over_others(table: RewardTable, axis: int) -> tuple[Floats, Floats]:
    """Return, for each action on `axis`, the largest mean over all other axes, and the standard error of that entry."""
    mean = np.moveaxis(table.mean, axis, 0).reshape(table.mean.shape[axis], -1)
    error = np.moveaxis(table.standard_error, axis, 0).reshape(mean.shape)
    best = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=1)
    rows = np.arange(len(mean))
    return mean[rows, best], error[rows, best]


def best_over_pair(table: RewardTable, pair: tuple[int, int]) -> Floats:
    """Return the largest mean over the actions of all other sensors.

    Shape (num_actions of pair[0], num_actions of pair[1]). Raises `InputError` if `pair` is not two sensors of the
    table.
    """
    if pair[0] == pair[1] or not set(pair) <= set(table.sensors):
        raise InputError(f"pair: expected two of the sensors {table.sensors}; got {pair}")
    positions = [table.sensors.index(sensor) for sensor in pair]
    others = tuple(axis for axis in range(table.mean.ndim) if axis not in positions)
    reward = np.fmax.reduce(table.mean, axis=others) if others else table.mean
    return reward.T if positions[0] > positions[1] else reward


def _draw_heat_map(
    figure: Figure,
    axes: Axes,
    plan: Plan,
    table: RewardTable,
    pair: tuple[int, int],
    along: Mapping[int, ActionAxis],
    scene: Scene,
) -> None:
    reward = best_over_pair(table, pair)
    image = axes.imshow(reward.T, origin="lower", cmap=HEAT_MAP, aspect="auto", interpolation="nearest")
    axes.grid(False)
    for axis, sensor in zip((axes.xaxis, axes.yaxis), pair, strict=True):
        map_ticks(axis, along[sensor], 7)
        axis.set_label_text(along[sensor].title(scene.name(sensor)))
    column, row = plan.chosen[pair[0]], plan.chosen[pair[1]]
    for shade, width in (("black", 2.6), ("white", 1.2)):  # legible on the dark and on the light end of the scale
        axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, edgecolor=shade, linewidth=width))
    figure.colorbar(image, ax=axes, label=scene.reward_title("Joint reward").replace(" (", "\n("))
