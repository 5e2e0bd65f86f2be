"""Scene of a figure: names of the sensors, region and zones, meaning of the rewards."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch, Wedge
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from vedette.evaluation.figures.labels import drawn_text
from vedette.evaluation.figures.style import GREY, INK
from vedette.internal.text import elided
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario
from vedette.scenarios.sections.field_of_view import FieldOfView, field_of_view
from vedette.scenarios.sections.planners import STRATEGIES, NamedIndependent, NamedJoint, NamedLookahead
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.zones import COAST, HOLE, INSIDE, NO_GO, REGION, Zone, zones

if TYPE_CHECKING:
    from vedette.recorded import Origin

_POINTS_ACROSS, _LETTER = 200.0, 4.2  # points: width of a column's axes, and of a letter of a name
# Possible places of a name, the preferred side first: offset in points, and alignment.
_SIDES: tuple[tuple[tuple[float, float], dict[str, str]], ...] = (
    ((0.0, 7.0), {"ha": "center", "va": "bottom"}),
    ((0.0, -7.0), {"ha": "center", "va": "top"}),
    ((8.0, 0.0), {"ha": "left", "va": "center"}),
    ((-8.0, 0.0), {"ha": "right", "va": "center"}),
    ((7.0, 5.0), {"ha": "left", "va": "bottom"}),
    ((-7.0, 5.0), {"ha": "right", "va": "bottom"}),
    ((7.0, -5.0), {"ha": "left", "va": "top"}),
    ((-7.0, -5.0), {"ha": "right", "va": "top"}),
)
_ZONES: dict[str, dict[str, Any]] = {
    REGION: {"edgecolor": GREY, "linewidth": 0.8, "linestyle": "--"},
    INSIDE: {"edgecolor": INK, "linewidth": 0.8, "linestyle": "-."},
    NO_GO: {"edgecolor": GREY, "linewidth": 0.8, "hatch": "////"},
    COAST: {"edgecolor": GREY, "linewidth": 0.6},
}


@dataclass(frozen=True, slots=True)
class Scene:
    """Parts of a scenario that figures show. By default, sensors are numbered and rewards have no name.

    Attributes:
        names: of the sensors.
        reward: name of the rewards, with their unit, such as "CS divergence", empty if unknown.
        zones: of the plane.
        sensors: for their fields of view.
        origin: of the plane on the Earth, or None if unknown.
    """

    names: tuple[str, ...] = ()
    reward: str = ""
    zones: tuple[Zone, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    origin: Origin | None = None

    def name(self, sensor: int) -> str:
        """Return the name of a sensor in a figure."""
        return drawn_text(elided(self.names[sensor], 20)) if self.names else f"sensor {sensor + 1}"

    def field(self, sensor: int, pose: Floats) -> FieldOfView | None:
        """Return the field of view of a sensor at a pose, or None if it has no edge or is unknown."""
        return bounded_field(self.sensors[sensor], pose) if sensor < len(self.sensors) else None

    def reward_title(self, title: str = "Reward") -> str:
        """Return the title `Reward (CS divergence)`."""
        return f"{title} ({self.reward})" if self.reward else title

    @property
    def corners(self) -> Floats:
        """Corners of the no-go zones, (num, 2) m. Corners beyond the region are moved to its edge."""
        region_corners = [zone.corners for zone in self.zones if zone.kind == REGION]
        zone_corners = [np.array(zone.corners) for zone in self.zones if zone.kind == NO_GO]
        if not zone_corners or not region_corners:
            return np.empty((0, 2))
        low, high = np.min(region_corners[0], axis=0), np.max(region_corners[0], axis=0)
        return np.asarray(np.clip(np.concatenate(zone_corners), low, high))


def build_scene(scenario: Scenario, planner: str) -> Scene:
    """Return the scene for figures of runs of a scenario under a strategy."""
    model = scenario.model
    custom, reward = model.planners.get(planner), ""  # a custom planner may use any reward
    if isinstance(custom, NamedJoint | NamedIndependent | NamedLookahead):
        reward = (custom.reward or model.control.reward).words
    elif planner in STRATEGIES:
        reward = model.control.reward.words
    origin = None if model.origin is None else model.origin.build()
    return Scene(model.sensor_names, reward, zones(scenario), model.sensors, origin)


class NamePlace(NamedTuple):
    """Place of a name: arguments of `Axes.annotate`, and True if it covers another name there."""

    arguments: dict[str, Any]
    covers_name: bool


def place_names(names: Sequence[str], places: Floats, bounds: Floats, marks: Floats) -> list[NamePlace]:
    """Return the places of names: at the side that is within the axes and covers no name and the fewest marks.

    Args:
        names: the more important ones first.
        places: (num, 2) of the named things, m.
        bounds: (2, 2) lower left and upper right corner of the axes, m.
        marks: (n, 2) points that names should not cover, such as targets and paths, m.
    """
    point = float((bounds[1] - bounds[0]).max()) / _POINTS_ACROSS
    corners = np.array([[x, y] for x in np.linspace(-1.0, 1.0, 9) for y in (-1.0, 0.0, 1.0)])
    obstacles, covered_points = np.concatenate([marks, places]), np.empty((0, 2))
    chosen = []
    for name, place in zip(names, places, strict=True):
        half = np.array([0.5 * _LETTER * len(name) + 2.0, 5.0]) * point
        centres = [place + point * np.array(offset) + half * np.sign(offset) for offset, _ in _SIDES]
        covered = [
            (
                _count_inside(covered_points, centre, half),
                bool((centre - half < bounds[0]).any() or (centre + half > bounds[1]).any()),
                _count_inside(obstacles, centre, half),
            )
            for centre in centres
        ]
        side = min(range(len(_SIDES)), key=lambda each: covered[each])
        offset, alignment = _SIDES[side]
        chosen.append(NamePlace({"xytext": offset, **alignment}, covered[side][0] > 0))
        covered_points = np.concatenate([covered_points, centres[side] + half * corners])
    return chosen


def _count_inside(points: Floats, centre: Floats, half: Floats) -> int:
    """Return the number of points in a box."""
    return int((np.abs(points - centre) < half).all(axis=1).sum())


def draw_zones(axes: Axes, drawn: Sequence[Zone], scale: float) -> None:
    """Draw zones into axes, in metres times `scale`. Holes are cut out of the zones that precede them."""
    shown: list[tuple[str, list[Path]]] = []
    coast = [scale * np.array(zone.corners) for zone in drawn if zone.kind == COAST]
    style = {"colors": _ZONES[COAST]["edgecolor"], "linewidths": _ZONES[COAST]["linewidth"], "zorder": 1.2}
    axes.add_collection(LineCollection(coast, **style), autolim=False)
    for zone in drawn:
        if zone.kind == COAST:
            continue
        ring = Path(scale * _oriented_ring(zone.corners, left=zone.kind != HOLE), closed=True)
        if zone.kind == HOLE:
            shown[-1][1].append(ring)
        else:
            shown.append((zone.kind, [ring]))
    for kind, rings in shown:
        axes.add_patch(PathPatch(Path.make_compound_path(*rings), zorder=1.5, fill=False, **_ZONES[kind]))


def _oriented_ring(corners: Sequence[tuple[float, float]], *, left: bool) -> Floats:
    """Return a closed ring of corners, counter-clockwise (`left`) or clockwise: a hole turns against its zone."""
    ring = np.array([*corners, corners[0]])
    area = float((ring[:-1, 0] * ring[1:, 1] - ring[1:, 0] * ring[:-1, 1]).sum())
    return np.asarray(ring if (area > 0.0) == left else ring[::-1])


def bounded_field(sensor: Sensor, pose: Floats | None = None) -> FieldOfView | None:
    """Return the field of view of a sensor at a pose, or at its start, or None if it has no edge."""
    field = field_of_view(sensor, None if pose is None else pose.tolist())
    return field if field is not None and np.isfinite(field.reach) else None


def draw_field(axes: Axes, place: tuple[float, float], field: FieldOfView, scale: float) -> Patch:
    """Shade the field of view of a sensor, at a place that is already in metres times `scale`."""
    sides = np.degrees([field.middle - field.half_width, field.middle + field.half_width])
    wedge = Wedge(place, field.reach * scale, *sides, facecolor=GREY, alpha=0.15, linewidth=0, zorder=1)
    return axes.add_patch(wedge)


def label_axes(axes: Axes, scale: float, origin: Origin | None) -> None:
    """Label the axes. With an origin, longitude and latitude are at the other sides.

    These are exact along lines through the middle of the axes, whose limits must be set before.
    """
    unit = "m" if scale == 1.0 else "km"
    axes.set_xlabel(f"x ({unit})")
    axes.set_ylabel(f"y ({unit})")
    if origin is None:
        return
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    middle = limits.mean(axis=1)
    for k, (side, name) in enumerate((("top", "longitude"), ("right", "latitude"))):
        ends = np.array([middle, middle])
        ends[:, k] = limits[k]
        degrees = origin.to_degrees(ends / scale)[:, k]
        if not degrees[0] < degrees[1]:  # over a pole, or where longitudes wrap around
            continue
        to_degrees, to_metres = _line(limits[k], degrees), _line(degrees, limits[k])
        functions = (to_degrees, to_metres)
        second = axes.secondary_yaxis("right", functions) if k else axes.secondary_xaxis("top", functions)
        axis = second.xaxis if k == 0 else second.yaxis
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
        axis.set_label_text(f"{name} (\N{DEGREE SIGN})")
        second.tick_params(labelsize=6, colors=GREY, width=0.4)
        axis.label.set(color=GREY, fontsize=7)
        second.spines[side].set(visible=True, color=GREY, linewidth=0.4)


def _line(start: Floats, end: Floats) -> Callable[[Any], Any]:
    slope = float((end[1] - end[0]) / (start[1] - start[0]))
    return lambda value: end[0] + slope * (np.asarray(value) - start[0])


def field_handles(sensors: Sequence[Sensor], when: str = "") -> Iterator[Patch]:
    """Yield the legend entry of the shade of `draw_field`, if a sensor's view has an edge."""
    if any(bounded_field(sensor) is not None for sensor in sensors):
        yield Patch(color=GREY, alpha=0.15, linewidth=0, label=f"field of view{when}")


def zone_handles(drawn: Sequence[Zone]) -> Iterator[Patch | Line2D]:
    """Yield the legend entries of the zones and the coastline."""
    for kind in dict.fromkeys(zone.kind for zone in drawn if zone.kind != HOLE):
        if kind == COAST:
            yield Line2D([], [], color=_ZONES[kind]["edgecolor"], linewidth=1.0, label=kind)
        else:
            yield Patch(fill=False, label=kind, **_ZONES[kind])
