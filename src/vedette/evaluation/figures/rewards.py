"""The reward of each action at one decision (paper Fig. 4)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from vedette.control.plan import Plan, RewardTable
from vedette.errors import InputError
from vedette.evaluation.figures.style import (
    COLUMN_WIDTH,
    HEAT_MAP,
    MARKERS,
    colour,
    degrees_label,
    line_style,
    new_figure,
    styled,
)
from vedette.kernels.base.types import Floats


@styled
def reward_figure(plan: Plan, *, pair: tuple[int, int] = (0, 1)) -> Figure:
    """Reward against heading, one curve a sensor, the choice marked, with bands of one standard error over the samples.

    A plan made independently has its curves as they are. A joint plan has above them a heat map of the joint table with
    the chosen actions framed; its curves are the most that a sensor's action can bring with the best actions of the
    others. With more than two sensors the heat map is likewise the maximum over the sensors outside `pair`. What a
    search did not evaluate is left blank.

    Args:
        plan: with reward tables.
        pair: the sensors on the axes of the heat map.

    Raises `InputError` for a plan without tables (random or fixed control), or a pair that is not two of its sensors.
    """
    plan.validate()
    if not plan.tables:
        raise InputError(f"plan: expected reward tables; got none, as planner {plan.planner!r} weighs no actions")
    joint = [table for table in plan.tables if len(table.sensors) > 1]
    if not joint:
        figure = new_figure(2.3)
        _draw_curves(figure.subplots(), plan)
        return figure
    figure = new_figure(COLUMN_WIDTH + 1.4)
    upper, lower = figure.subplots(2, 1, height_ratios=(1.55, 1.0))
    _draw_heat_map(figure, upper, plan, joint[0], pair)
    _draw_curves(lower, plan)
    return figure


def _draw_curves(axes: Axes, plan: Plan) -> None:
    for table in plan.tables:
        for axis, sensor in enumerate(table.sensors):
            mean, error = best_over_others(table, axis)
            _draw_curve(axes, plan, sensor, mean, error)
    joint = any(len(table.sensors) > 1 for table in plan.tables)
    axes.set_xlabel("Heading (deg)")
    axes.set_ylabel("Largest joint reward" if joint else "Reward (CS divergence)")
    # Above the panel: wherever a legend would lie inside, some curve passes.
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False, handlelength=1.8)


def _draw_curve(axes: Axes, plan: Plan, sensor: int, mean: Floats, error: Floats) -> None:
    # Changes of heading come in another order than the headings that they lead to.
    order = np.argsort(plan.action_values[sensor], kind="stable")
    headings, mean, error = np.rad2deg(plan.action_values[sensor])[order], mean[order], error[order]
    chosen = int(np.flatnonzero(order == plan.chosen[sensor])[0])
    shade = colour(sensor)
    axes.fill_between(headings, mean - error, mean + error, color=shade, alpha=0.2, linewidth=0)
    axes.plot(
        headings,
        mean,
        color=shade,
        linestyle=line_style(sensor),
        marker=MARKERS[sensor % len(MARKERS)],
        markersize=6,
        markeredgecolor="black",
        markevery=[chosen],
        label=f"sensor {sensor + 1}: {degrees_label(headings[chosen])}°",
    )
    axes.plot(headings, mean, color=shade, linestyle="", marker=".", markersize=3)
    if headings.min() >= -180.5 and headings.max() <= 180.5 and np.ptp(headings) > 180:
        axes.set_xticks(np.arange(-180, 181, 60))


def best_over_others(table: RewardTable, axis: int) -> tuple[Floats, Floats]:
    """For each action on `axis`, the largest mean over all other axes, and the standard error of that entry."""
    mean = np.moveaxis(table.mean, axis, 0).reshape(table.mean.shape[axis], -1)
    error = np.moveaxis(table.standard_error, axis, 0).reshape(mean.shape)
    best = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=1)
    rows = np.arange(len(mean))
    return mean[rows, best], error[rows, best]


def best_over_pair(table: RewardTable, pair: tuple[int, int]) -> Floats:
    """(num_actions of pair[0], num_actions of pair[1]) largest mean over the actions of all other sensors.

    Raises `InputError` for what is not two sensors of the table.
    """
    if pair[0] == pair[1] or not set(pair) <= set(table.sensors):
        raise InputError(f"pair: expected two of the sensors {table.sensors}; got {pair}")
    positions = [table.sensors.index(sensor) for sensor in pair]
    others = tuple(axis for axis in range(table.mean.ndim) if axis not in positions)
    reward = np.fmax.reduce(table.mean, axis=others) if others else table.mean
    return reward.T if positions[0] > positions[1] else reward


def _draw_heat_map(figure: Figure, axes: Axes, plan: Plan, table: RewardTable, pair: tuple[int, int]) -> None:
    reward = best_over_pair(table, pair)
    image = axes.imshow(reward.T, origin="lower", cmap=HEAT_MAP, aspect="auto", interpolation="nearest")
    axes.grid(False)
    for axis, sensor in zip((axes.xaxis, axes.yaxis), pair, strict=True):
        headings = np.rad2deg(plan.action_values[sensor])
        every = max(1, -(-len(headings) // 7))
        axis.set_ticks(range(0, len(headings), every), [degrees_label(value) for value in headings[::every]])
    axes.set_xlabel(f"Heading of sensor {pair[0] + 1} (deg)")
    axes.set_ylabel(f"Heading of sensor {pair[1] + 1} (deg)")
    column, row = plan.chosen[pair[0]], plan.chosen[pair[1]]
    for shade, width in (("black", 2.6), ("white", 1.2)):  # legible on the dark and on the light end of the scale
        axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, edgecolor=shade, linewidth=width))
    figure.colorbar(image, ax=axes, label="Joint reward (CS divergence)")
