"""What is drawn around a run: the sensors' names, the region and the zones, and what its rewards are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Polygon, Wedge

from vedette.evaluation.figures.labels import drawn_text
from vedette.evaluation.figures.style import GREY, INK
from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario
from vedette.scenarios.sections.planners import STRATEGIES, NamedIndependent, NamedJoint, NamedLookahead
from vedette.scenarios.views import HOLE, INSIDE, NO_GO, REGION, FieldOfView, Zone, zones
from vedette.text import elided

_NEAR = 0.1  # of the extent of a figure
_ZONES: dict[str, dict[str, Any]] = {
    REGION: {"edgecolor": GREY, "linewidth": 0.8, "linestyle": "--"},
    INSIDE: {"edgecolor": INK, "linewidth": 0.8, "linestyle": "-."},
    NO_GO: {"edgecolor": GREY, "linewidth": 0.8, "hatch": "////"},
    HOLE: {"edgecolor": GREY, "linewidth": 0.8, "fill": True, "facecolor": "white"},
}


@dataclass(frozen=True, slots=True)
class Scene:
    """What figures say of a scenario; without any, sensors are numbered and rewards are rewards.

    Attributes:
        names: of the sensors.
        reward: what the rewards are, with their unit, such as "CS divergence"; nothing where it is not known.
        zones: of the plane.
    """

    names: tuple[str, ...] = ()
    reward: str = ""
    zones: tuple[Zone, ...] = ()

    def name(self, sensor: int) -> str:
        """What a sensor is called in a figure."""
        return drawn_text(elided(self.names[sensor], 20)) if self.names else f"sensor {sensor + 1}"

    def reward_title(self, of: str = "Reward") -> str:
        """`Reward (CS divergence)`."""
        return f"{of} ({self.reward})" if self.reward else of

    @property
    def corners(self) -> Floats:
        """(num, 2) corners of the no-go zones, those beyond the region moved to its edge, m."""
        of_region = [zone.corners for zone in self.zones if zone.kind == REGION]
        found = [np.array(zone.corners) for zone in self.zones if zone.kind == NO_GO]
        if not found or not of_region:
            return np.empty((0, 2))
        low, high = np.min(of_region[0], axis=0), np.max(of_region[0], axis=0)
        return np.asarray(np.clip(np.concatenate(found), low, high))


def scene_of(scenario: Scenario, planner: str) -> Scene:
    """What figures of runs of a scenario under a strategy say."""
    model = scenario.model
    own, words = model.planners.get(planner), ""  # a planner of the user's own may weigh anything
    if isinstance(own, NamedJoint | NamedIndependent | NamedLookahead):
        words = (own.reward or model.control.reward).words
    elif planner in STRATEGIES:
        words = model.control.reward.words
    return Scene(model.sensor_names, words, zones(model))


def name_offsets(places: Floats, extent: float) -> list[dict[str, Any]]:
    """Where the names of sensors stand, given (num, 2) places: above, or below where one near by is above."""
    above: list[Floats] = []
    offsets: list[dict[str, Any]] = []
    for place in places:
        if any(np.hypot(*(place - other)) < _NEAR * extent for other in above):
            offsets.append({"xytext": (0, -7), "va": "top", "ha": "center"})
        else:
            above.append(place)
            offsets.append({"xytext": (0, 7), "ha": "center"})
    return offsets


def draw_zones(axes: Axes, drawn: Sequence[Zone], scale: float) -> None:
    """Draw zones into axes, in metres times `scale`."""
    for zone in drawn:
        axes.add_patch(Polygon(scale * np.array(zone.corners), zorder=1.5, **{"fill": False, **_ZONES[zone.kind]}))


def draw_field(axes: Axes, place: tuple[float, float], field: FieldOfView, scale: float) -> Patch:
    """Shade what a sensor sees, at a place that is in metres times `scale` already."""
    sides = np.degrees([field.middle - field.half_width, field.middle + field.half_width])
    wedge = Wedge(place, field.reach * scale, *sides, facecolor=GREY, alpha=0.15, linewidth=0, zorder=1)
    return axes.add_patch(wedge)


def zone_handles(drawn: Sequence[Zone]) -> Iterator[Patch]:
    """What the zones mean, for a legend."""
    for kind in dict.fromkeys(zone.kind for zone in drawn if zone.kind != HOLE):
        yield Patch(fill=False, label=kind, **_ZONES[kind])
