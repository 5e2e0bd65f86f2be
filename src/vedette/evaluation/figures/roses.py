"""Figure of the chosen headings or actions and their frequencies: one rose for each strategy and decision."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vedette.errors import InputError
from vedette.evaluation.actions import Row, describe_action
from vedette.evaluation.comparison import Comparison
from vedette.evaluation.ensembles import Choice
from vedette.evaluation.figures.labels import short_labels
from vedette.evaluation.figures.scene import Scene
from vedette.evaluation.figures.style import (
    COLOURS,
    GREY,
    TEXT_WIDTH,
    legend_columns,
    new_figure,
    sensor_styles,
    shown_decisions,
    styled,
)
from vedette.internal.text import with_minus
from vedette.kernels.base.types import Floats, Ints

_SIZE = 1.5  # inches of a rose
_MAX_BARS = 4  # for each sensor
_SECTORS = 24  # in which headings without a fixed grid are counted


@styled
def roses_figure(comparison: Comparison, scene: Scene | None = None) -> Figure:
    """Return a figure of the shares of the runs in which each action was chosen, by strategy and decision.

    Each row is a strategy that decides, each column a decision. A panel is a rose if every action has a heading or a
    course. Otherwise it has bars of the actions in words. Headings are counter-clockwise from east (0), courses
    clockwise from north (0, upwards). Sensors are side by side within the sector of a heading. The area of a bar of a
    rose is proportional to the share: the radius is proportional to its square root. Sensors that always stand still
    are left out, and more than six are combined. Of many decisions at most six are shown, evenly spread, with the first
    and the last.

    Raises `InputError` if no strategy made a decision, or no sensor had a choice.
    """
    rows = [index for index, each in enumerate(comparison.ensembles) if any(each.choices)]
    if not rows:
        raise InputError("comparison: expected decisions; got none")
    columns = shown_decisions(len(comparison.decision_times))
    deciding, names = _deciding_sensors(comparison), short_labels(comparison.strategies, 20)
    sensors = {sensor: (scene or Scene()).name(sensor) for sensor in deciding}
    if is_combined := len(deciding) > len(COLOURS):
        sensors = {0: f"{len(deciding)} sensors, taken together"}
    shades = [shade for shade, _, _ in sensor_styles(list(sensors)).values()]
    size = min(TEXT_WIDTH / (len(columns) + 0.35), _SIZE)
    figure = new_figure(size * len(rows) + 0.5, width=size * (len(columns) + 0.35))
    chosen_actions = [dict(choice[sensor]) for choice in _all_choices(comparison) for sensor in deciding]
    angle = next((name for name in ("heading_deg", "course_deg") if all(name in row for row in chosen_actions)), None)
    polar: dict[str, Any] = {"projection": "polar"} if angle else {}
    if angle == "course_deg":
        polar |= {"theta_offset": np.pi / 2.0, "theta_direction": -1}
    panels = figure.subplots(len(rows), len(columns), subplot_kw=polar, squeeze=False)
    for row, index in enumerate(rows):
        for column, decision in enumerate(columns):
            panel = panels[row, column]
            runs = [run[decision] for run in comparison.ensembles[index].choices if decision < len(run)]
            chosen = [tuple(choice[sensor] for sensor in deciding) for choice in runs]
            if is_combined:
                chosen = [(each,) for choice in chosen for each in choice]
            if angle and chosen:
                _draw_rose(panel, _headings(chosen, angle), shades)
            else:
                _draw_bars(panel, chosen, shades)
            if row == 0:
                panel.set_title(f"{comparison.decision_times[decision]:g} s", pad=9)
        panels[row, 0].set_ylabel(names[index], labelpad=22, fontsize=8)
    handles = [Patch(color=shade, label=name) for shade, name in zip(shades, sensors.values(), strict=True)]
    num_columns = legend_columns(list(sensors.values()), width=figure.get_figwidth())
    figure.legend(handles=handles, loc="outside lower center", ncols=num_columns)
    return figure


def _deciding_sensors(comparison: Comparison) -> list[int]:
    """Return the sensors that can do more than stand still."""
    choices_by_sensor: list[tuple[Row, ...]] = list(zip(*_all_choices(comparison), strict=True))
    sensors = [sensor for sensor, chosen in enumerate(choices_by_sensor) if any(chosen)]
    if not sensors:
        raise InputError("comparison: expected a sensor with a choice; got none")
    return sensors


def _all_choices(comparison: Comparison) -> list[Choice]:
    return [choice for each in comparison.ensembles for run in each.choices for choice in run]


def _headings(chosen: list[Choice], angle: str) -> Ints:
    """Headings or courses in whole degrees, (num_runs, num_sensors)."""
    degrees = [[dict(row)[angle] for row in choice] for choice in chosen]
    return np.array(degrees, np.int64).reshape(len(chosen), -1) % 360


def _draw_bars(axes: Any, chosen: list[Choice], shades: Sequence[str]) -> None:
    """Draw one bar for each sensor and chosen action, the most frequent of each sensor on top."""
    bar, ticks = 0, []
    for shade, actions in zip(shades, zip(*chosen, strict=True), strict=False):
        for action, count in Counter(actions).most_common(_MAX_BARS):
            axes.barh(bar, count / len(chosen), color=shade, height=0.8)
            ticks.append(with_minus(describe_action(action)))
            bar += 1
    axes.set_yticks(range(bar), ticks, fontsize=5)
    axes.set_axisbelow(True)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.0)
    axes.set_xticks([0.0, 0.5, 1.0], ["0", "", "100 %"], fontsize=6)


def _draw_rose(axes: Any, chosen: Ints, shades: Sequence[str]) -> None:
    centres, width = _sectors(chosen)
    share = width / len(shades) * 0.9
    for index, shade in enumerate(shades):
        counts = _shares(chosen[:, index], centres, width)
        # Bars of the sensors are side by side, counter-clockwise, so that equal choices of all stay visible.
        angles = centres + (index - (len(shades) - 1) / 2.0) * share
        shown = counts > 0.0
        axes.bar(angles[shown], np.sqrt(counts[shown]), width=share, color=shade)
    axes.set_thetagrids(range(0, 360, 90), ["0°", "90°", "180°", "270°"])
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks(np.sqrt([0.1, 0.5]), ["10 %", "50 %"])
    axes.set_rlabel_position(112.0)
    axes.tick_params(axis="x", labelsize=6, pad=-2)
    axes.tick_params(axis="y", labelsize=5, labelcolor=GREY)
    axes.spines["polar"].set_visible(True)
    axes.spines["polar"].set_linewidth(0.5)


def _sectors(chosen: Ints) -> tuple[Floats, float]:
    """Return centres (rad) and width of the sectors: from the grid of the headings, or else of equal width."""
    step = int(np.gcd.reduce(np.append(chosen.ravel(), 360)))
    if 360 // step > 2 * _SECTORS:
        step = 360 // _SECTORS
    step = min(step, 30)
    degrees = np.arange(0, 360, step)
    return np.deg2rad(degrees.astype(np.float64)), float(np.deg2rad(step))


def _shares(headings: Ints, centres: Floats, width: float) -> Floats:
    if len(headings) == 0:
        return np.zeros(len(centres))
    sector = np.floor(np.deg2rad(headings) / width + 0.5).astype(np.int64) % len(centres)
    return np.bincount(sector, minlength=len(centres)) / len(headings)
