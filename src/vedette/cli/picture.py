"""Picture of a scenario: region, true tracks, sensors and birth sites (paper Fig. 2)."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch
from matplotlib.ticker import MaxNLocator

from vedette.evaluation.figures.labels import drawn_text
from vedette.evaluation.figures.scene import (
    bounded_field,
    draw_field,
    draw_zones,
    field_handles,
    label_axes,
    place_names,
    zone_handles,
)
from vedette.evaluation.figures.style import (
    COLUMN_WIDTH,
    INK,
    colour,
    legend_columns,
    line_style,
    new_figure,
    styled,
)
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario
from vedette.scenarios.zones import zones
from vedette.simulation import Truth

_MARGIN = 0.04  # share of the drawn extent
_KILOMETRES_FROM = 4000.0  # m of extent


@styled
def scenario_figure(scenario: Scenario, truth: Truth) -> Figure:
    """Draw region, tracks (circle: start, triangle: end), sensors (square, with initial heading) and birth sites."""
    low, high = _extent(scenario, truth)
    scale = 1e-3 if float((high - low).max()) > _KILOMETRES_FROM else 1.0
    aspect = float((high[1] - low[1]) / (high[0] - low[0]))
    figure = new_figure(float(np.clip(COLUMN_WIDTH * 0.85 * aspect, 1.5, 2.5 * COLUMN_WIDTH)) + 0.7)
    axes = figure.subplots()
    axes.set_aspect("equal")
    draw_zones(axes, zones(scenario), scale)
    _draw_births(axes, scenario, scale)
    _draw_tracks(axes, truth, scale)
    _draw_sensors(axes, scenario, truth, np.array([low, high]), scale)
    axes.set_xlim(low[0] * scale, high[0] * scale)
    axes.set_ylim(low[1] * scale, high[1] * scale)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    label_axes(axes, scale, None if scenario.model.origin is None else scenario.model.origin.build())
    axes.set_title(drawn_text(scenario.name), pad=14)  # above the names of sensors at the upper edge
    handles = [*_legend(scenario), *zone_handles(zones(scenario))]
    columns = legend_columns([str(handle.get_label()) for handle in handles])
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)
    return figure


def _extent(scenario: Scenario, truth: Truth) -> tuple[Floats, Floats]:
    """Return the corners of a box around region, sensors and tracks, with a margin."""
    region = scenario.model.region
    corners = [[region.x_min, region.y_min], [region.x_max, region.y_max]]
    points = np.vstack([corners, [sensor.position for sensor in scenario.model.sensors], truth.states[:, :2]])
    low, high = points.min(axis=0), points.max(axis=0)
    margin = _MARGIN * float((high - low).max())
    return low - margin, high + margin


def _draw_births(axes: Axes, scenario: Scenario, scale: float) -> None:
    """Draw a cross at each site and the ellipse of two standard deviations."""
    birth = scenario.model.birth.build(scenario.model.motion, scenario.model.region)
    for mean, cov in zip(birth.means[:, :2], birth.covs[:, :2, :2], strict=True):
        variances, principal_axes = np.linalg.eigh(cov)
        width, height = 4.0 * np.sqrt(variances) * scale
        angle = float(np.degrees(np.arctan2(principal_axes[1, 0], principal_axes[0, 0])))
        centre = (float(mean[0] * scale), float(mean[1] * scale))
        axes.add_patch(Ellipse(centre, width, height, angle=angle, facecolor=INK, alpha=0.15, linewidth=0, zorder=1))
        axes.plot(*centre, marker="+", color=INK, markersize=9, markeredgewidth=0.8, zorder=2)


def _draw_tracks(axes: Axes, truth: Truth, scale: float) -> None:
    for index, target in enumerate(np.unique(truth.ids)):
        path = truth.states[truth.ids == target, :2] * scale
        style: dict[str, Any] = {"color": colour(index), "zorder": 3}
        axes.plot(path[:, 0], path[:, 1], linestyle=line_style(index // 6), **style)
        axes.plot(*path[0], marker="o", markersize=4.5, markerfacecolor="white", **style)
        axes.plot(*path[-1], marker="^", markersize=5, **style)


def _draw_sensors(axes: Axes, scenario: Scenario, truth: Truth, bounds: Floats, scale: float) -> None:
    model = scenario.model
    places = np.array([sensor.position for sensor in model.sensors])
    name_places = place_names(model.sensor_names, places, bounds, truth.states[:, :2])
    for name, sensor, name_place in zip(model.sensor_names, model.sensors, name_places, strict=True):
        place = (sensor.position[0] * scale, sensor.position[1] * scale)
        if sensor.platform.top_speed > 0.0:
            heading = np.radians(sensor.heading_deg)
            arrow = {"arrowstyle": "<|-", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
            start = (14.0 * float(np.cos(heading)), 14.0 * float(np.sin(heading)))
            axes.annotate("", place, xytext=start, textcoords="offset points", arrowprops=arrow, zorder=4)
        field = bounded_field(sensor)
        if field is not None:
            draw_field(axes, place, field, scale)
        axes.plot(*place, marker="s", markersize=6, color=INK, zorder=5)
        background = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
        style: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "zorder": 4.5, "bbox": background}
        axes.annotate(drawn_text(name), place, **name_place.arguments, **style)


def _legend(scenario: Scenario) -> list[Line2D | Patch]:
    target: dict[str, Any] = {"color": INK, "linewidth": 1.0}
    ends = [
        Line2D([], [], marker="o", markerfacecolor="white", markersize=4.5, label="target start", **target),
        Line2D([], [], marker="^", markersize=5, label="target end", **target),
    ]
    return [
        *(ends if scenario.model.targets.kind != "unknown" else []),
        Line2D([], [], linestyle="", marker="s", markersize=6, color=INK, label="sensor"),
        *(
            [Line2D([], [], linestyle="", marker="+", color=INK, label="birth site, 2 std")]
            if scenario.model.birth.sites
            else []
        ),
        *field_handles(scenario.model.sensors),
    ]
