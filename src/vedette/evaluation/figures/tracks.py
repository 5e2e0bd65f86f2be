"""Figures of the paths of targets and sensors, and of the estimates (paper Fig. 3)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Wedge
from matplotlib.ticker import MaxNLocator

from vedette.errors import InputError
from vedette.evaluation.actions import drawn_angle
from vedette.evaluation.comparison import Comparison
from vedette.evaluation.figures.labels import drawn_text, short_label
from vedette.evaluation.figures.ospa import draw_differences, draw_ospa
from vedette.evaluation.figures.scene import (
    Scene,
    draw_field,
    draw_zones,
    field_handles,
    label_axes,
    place_names,
    zone_handles,
)
from vedette.evaluation.figures.style import (
    COLUMN_WIDTH,
    GREY,
    INK,
    TEXT_WIDTH,
    colour,
    legend_columns,
    new_figure,
    styled,
)
from vedette.internal.text import named_in
from vedette.kernels.base.types import HALF_WIDTH, Floats, Ints
from vedette.simulation.records import RunRecord

LARGE = 5000.0  # m; axes of a larger extent are in kilometres
_MANY_SCANS = 200  # with more scans, estimates are drawn smaller
_TITLE_PAD = 14  # points, above the names of sensors at the upper edge
SENSOR_MARKERS = "sDpP*X"
_MAX_NAMED, _MAX_DECISIONS = 8, 12  # largest numbers of sensor names and of decisions that fit


@styled
def tracks_figure(*records: RunRecord, titles: Sequence[str] | None = None, scene: Scene | None = None) -> Figure:
    """Return a figure of truth, estimates, sensor paths, decisions and zones in the plane, one panel for each run.

    The axes are equal. With more than eight sensors, names and decisions are left out, and so are more than twelve
    decisions.

    Args:
        records: one run fills a column, two fill the width of the page.
        titles: one for each run, by default the strategies.
        scene: the sensors' names, and the zones.

    Raises `InputError` for no record, or another number of titles.
    """
    if not records:
        raise InputError("records: expected at least one run; got none")
    scene = scene or Scene()
    names = tuple(titles) if titles is not None else tuple(short_label(record.planner) for record in records)
    if len(names) != len(records):
        raise InputError(f"titles: expected {len(records)}; got {len(names)}")
    width = COLUMN_WIDTH if len(records) == 1 else TEXT_WIDTH * max(1.0, len(records) / 2)
    figure = new_figure(width / len(records) + 0.4, width=width)
    figure.set_layout_engine("constrained", h_pad=0.08)  # equal axes are fitted last and would push titles off the top
    panels = figure.subplots(1, len(records), sharex=True, sharey=True, squeeze=False)[0]
    scale = 1e-3 if plot_extent(records) > LARGE else 1.0
    for panel, record, name in zip(panels, records, names, strict=True):
        draw_tracks(panel, record, scale, scene)
        panel.set_title(drawn_text(name), pad=_TITLE_PAD)
    frame_tracks(panels[0], records, scale, scene)
    add_legend(figure, records[0], scene)
    return figure


@styled
def overview_figure(
    record: RunRecord, comparison: Comparison, *, strategy: str = "", scene: Scene | None = None
) -> Figure:
    """Return an overview of an experiment, as wide as a page: the tracks of one run, and the effect of the decisions.

    Right: the paired difference of each strategy to the first, from the first decision on, with 95 % confidence bands,
    and a small chart of the whole run above it. With one run or one strategy, the error itself.

    Args:
        record: the run.
        comparison: of all strategies.
        strategy: of the run. Default: the one named as its planner.
        scene: the sensors' names, and the zones.

    Raises `InputError` for a strategy that is not compared.
    """
    scene, strategy = scene or Scene(), strategy or record.planner
    if strategy not in comparison.strategies:
        raise InputError(f"strategy: expected one of {', '.join(comparison.strategies)}; got {strategy!r}")
    figure = new_figure(TEXT_WIDTH / 2 + 0.1, width=TEXT_WIDTH)
    is_comparison = comparison.num_runs > 1 and len(comparison.strategies) > 1
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 3.0))
    left, right = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[1 if is_comparison else slice(None), 1])
    scale = 1e-3 if plot_extent([record]) > LARGE else 1.0
    shade = colour(comparison.strategies.index(strategy))
    draw_tracks(left, record, scale, scene, shade)
    frame_tracks(left, [record], scale, scene)
    left.set_title(f"{short_label(strategy)}, {record.source}", pad=_TITLE_PAD)
    above = right
    if is_comparison:
        draw_differences(right, comparison)
        minus = f"minus {short_label(comparison.strategies[0])}"
        right.set_ylabel(f"{named_in('OSPA', comparison.unit)} {minus}")
        above = figure.add_subplot(grid[0, 1])
        _draw_error(above, comparison)
    else:
        draw_ospa(right, comparison, "total")
        right.set_xlabel("Time (s)")
    handles, labels = right.get_legend_handles_labels()
    columns = legend_columns(labels)
    above.legend(handles, labels, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns, frameon=False)
    add_legend(figure, record, scene, shade)
    return figure


def _draw_error(axes: Axes, comparison: Comparison) -> None:
    """Draw the error over the whole run, small."""
    draw_ospa(axes, comparison, "total")
    axes.set_ylabel(named_in("OSPA", comparison.unit), fontsize=6)
    axes.tick_params(labelsize=6)
    axes.yaxis.set_major_locator(MaxNLocator(3))


def draw_tracks(axes: Axes, record: RunRecord, scale: float, scene: Scene, shade: str = "") -> None:
    """Draw one run into axes, in metres times `scale`, the estimates in a shade, or coloured by label."""
    draw_zones(axes, scene.zones, scale)
    _draw_truth(axes, record, scale)
    _draw_estimates(axes, record, scale, shade)
    marks = np.concatenate([_positions(record), *(decision.poses[:, :2] for decision in record.decisions)])
    names = [scene.name(sensor) for sensor in range(record.num_sensors)]
    name_places = place_names(names, record.poses[0, :, :2], plot_bounds([record], scene), marks)
    for sensor in range(record.num_sensors):
        _draw_sensor(axes, record, sensor, scale, scene, name_places[sensor].arguments)
    axes.set_aspect("equal")


def frame_tracks(axes: Axes, records: Sequence[RunRecord], scale: float, scene: Scene) -> None:
    """Set the limits from `plot_bounds`, shared by all panels, and the labels of the axes."""
    low, high = plot_bounds(records, scene) * scale
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    label_axes(axes, scale, scene.origin if len(records) == 1 else None)


def plot_bounds(records: Sequence[RunRecord], scene: Scene) -> Floats:
    """Return the corners of a square around everything except stray estimates, (2, 2), m."""
    points = np.concatenate([scene.corners, *(_positions(record) for record in records)])
    low, high = points.min(axis=0), points.max(axis=0)
    half_width = 0.55 * max(float((high - low).max()), np.finfo(float).eps)
    middle = (low + high) / 2.0
    return np.array([middle - half_width, middle + half_width])


def plot_extent(records: Sequence[RunRecord]) -> float:
    """Return the extent of the targets and sensors of runs, m."""
    return float(max(np.ptp(_positions(record), axis=0).max() for record in records))


def _positions(record: RunRecord) -> Floats:
    """Return the positions, (n, 2) m, of targets (if unknown, of estimates) and sensors."""
    true_positions = record.truth.states[:, :2]
    targets = [true_positions] if len(true_positions) else [estimate.means[:, :2] for estimate in record.estimates]
    return np.concatenate([*targets, record.poses[:, :, :2].reshape(-1, 2)])


def _draw_truth(axes: Axes, record: RunRecord, scale: float) -> None:
    for target in np.unique(record.truth.ids):
        path = record.truth.states[record.truth.ids == target, :2] * scale
        axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=0.9, zorder=2)
        axes.plot(*path[0], marker="o", color=INK, markerfacecolor="white", markersize=5, zorder=4)
        axes.plot(*path[-1], marker="^", color=INK, markerfacecolor="white", markersize=5, zorder=4)


def _draw_estimates(axes: Axes, record: RunRecord, scale: float, shade: str) -> None:
    labels = np.concatenate([estimate.labels for estimate in record.estimates])
    points = np.concatenate([estimate.means[:, :2] for estimate in record.estimates]) * scale
    if not shade and labels_recur(labels):
        distinct, group_of_estimate = np.unique(labels, axis=0, return_inverse=True)
        groups = [points[group_of_estimate.ravel() == index] for index in range(len(distinct))]
    else:
        groups = [points]
    size = 3.2 * min(1.0, (_MANY_SCANS / record.num_scans) ** 0.5)
    for index, group in enumerate(groups):
        axes.plot(
            group[:, 0], group[:, 1], linestyle="", marker=".", markersize=size, color=shade or colour(index),
            alpha=0.8, zorder=3,
        )  # fmt: skip


def labels_recur(labels: Ints) -> bool:
    """Return True if a label occurs more than once. Filters without labels give each estimate another one."""
    return len(np.unique(labels, axis=0)) < len(labels)


def _draw_sensor(
    axes: Axes, record: RunRecord, sensor: int, scale: float, scene: Scene, name_place: dict[str, Any]
) -> None:
    path = record.poses[:, sensor, :2] * scale
    field = scene.field(sensor, record.poses[0, sensor])
    if field is not None:
        draw_field(axes, _point(path[0]), field, scale)
    axes.plot(path[:, 0], path[:, 1], color=GREY, linewidth=1.6, linestyle=(0, (2.5, 1)), zorder=5)
    if record.num_sensors > _MAX_NAMED:
        axes.plot(*path[0], marker="s", color=INK, markerfacecolor=GREY, markersize=4, markeredgewidth=0.5, zorder=6)
        return
    marker = SENSOR_MARKERS[sensor % len(SENSOR_MARKERS)]
    axes.plot(*path[0], marker=marker, color=INK, markerfacecolor=GREY, markersize=9, zorder=6)
    background = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": 7, "zorder": 9, "bbox": background}
    axes.annotate(scene.name(sensor), _point(path[0]), **name_place, **style)
    if len(record.decisions) > _MAX_DECISIONS:
        return
    for number, decision in enumerate(record.decisions, start=1):
        if len(decision.plan.actions[sensor]) == 1:
            continue
        place = _point(decision.poses[sensor, :2] * scale)
        arrow = {"arrowstyle": "<|-", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
        plan = decision.plan
        row = dict(zip(plan.actions[sensor].columns, plan.chosen_actions[sensor].tolist(), strict=True))
        direction = 13.0 * _direction(row)
        if direction.any():
            axes.annotate("", place, xytext=_point(direction), textcoords="offset points", arrowprops=arrow, zorder=7)
        _draw_field(axes, row, decision.poses[sensor], 0.12 * plot_extent([record]), scale)
        axes.plot(*place, marker="o", markersize=6.0, color=INK, markerfacecolor="white", markeredgewidth=0.7, zorder=8)
        axes.annotate(str(number), place, ha="center", va="center_baseline", fontsize=5, zorder=9)


def _draw_field(axes: Axes, row: dict[str, float], pose: Floats, size: float, scale: float) -> None:
    """Draw a sector of a given size in the chosen pointing direction of the sensor."""
    middle = drawn_angle(row, "pointing_deg", "azimuth_deg")
    if middle is not None:
        half = row.get("half_width_deg", float(np.rad2deg(pose[HALF_WIDTH])) if len(pose) > HALF_WIDTH else 0.0)
        sides = middle - half, middle + half
        axes.add_patch(Wedge(_point(pose[:2] * scale), size * scale, *sides, color=INK, alpha=0.2, lw=0, zorder=5))


def _direction(row: dict[str, float]) -> Floats:
    """Return the unit vector of the sensor's chosen direction, or 0 if its action is neither a heading nor a step."""
    heading = drawn_angle(row)
    if heading is not None and row.get("distance_m") != 0.0:
        return np.array([np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading))])
    step = np.array([row.get("dx", 0.0), row.get("dy", 0.0)])
    return np.asarray(step / max(float(np.hypot(*step)), np.finfo(float).tiny))


def _point(values: Floats) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def add_legend(figure: Figure, record: RunRecord, scene: Scene, shade: str = "", *, is_video: bool = False) -> None:
    """Add the legend below the axes. Estimates coloured by label have a mark of several colours.

    In a video a target has one mark, at its position. Measurements have one, and there are no decisions.
    """
    open_marker: dict[str, Any] = {"color": INK, "markerfacecolor": "white", "markersize": 4.5, "linewidth": 0.9}
    labels = np.concatenate([estimate.labels for estimate in record.estimates])
    by_label = not shade and labels_recur(labels)
    shades = [colour(index) for index in range(3)] if by_label else [shade or colour(0)]
    has_moved = bool((record.poses[:, :, :2] != record.poses[0, :, :2]).any())
    path: Any = {"linestyle": (0, (2.5, 1)), "linewidth": 1.6} if has_moved else {"linestyle": ""}
    entries: dict[str, Any] = {}
    if len(record.truth.ids) and is_video:
        entries["target"] = Line2D([], [], marker="o", **open_marker)
    elif len(record.truth.ids):
        entries["target start"] = Line2D([], [], marker="o", **open_marker)
        entries["target end"] = Line2D([], [], marker="^", **open_marker)
    entries |= {
        "estimates, by label" if by_label else "estimates": tuple(
            Line2D([], [], linestyle="", marker=".", color=each) for each in shades
        ),
        "sensor, path" if has_moved else "sensor": Line2D([], [], marker="s", color=GREY, markersize=4.5, **path),
    }
    if is_video:
        entries["measurement"] = Line2D([], [], linestyle="", marker="x", color=INK, markersize=4)
    elif 0 < len(record.decisions) <= _MAX_DECISIONS and record.num_sensors <= _MAX_NAMED:
        entries["decision"] = Line2D([], [], linestyle="", marker="$\\rightarrow$", color=INK, markersize=8)
    entries |= {
        str(patch.get_label()): patch for patch in field_handles(scene.sensors, "" if is_video else ", first scan")
    }
    entries |= {str(patch.get_label()): patch for patch in zone_handles(scene.zones)}
    columns = legend_columns(list(entries), width=figure.get_figwidth())
    by_parts = {tuple: HandlerTuple(ndivide=None, pad=0.0)}
    figure.legend(
        list(entries.values()), list(entries), loc="outside lower center", ncols=columns, handler_map=by_parts
    )
