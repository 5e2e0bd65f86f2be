"""Regions that platforms must stay inside, and regions that they must not enter."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from vedette.control.constraints.protocol import ConstraintContext, PerSensorConstraint
from vedette.kernels.base.types import Bools, Floats
from vedette.models import Region
from vedette.models.arguments import float_array, reject
from vedette.models.fields import Checked
from vedette.models.region import warn_if_corners_in_degrees

# m; distance from a fence to its zone, and width of the zone.
_EDGE, _BEYOND = 1e-6, 1e7


@dataclass(frozen=True, slots=True)
class StayInside(PerSensorConstraint, Checked):
    """Every moving platform stays inside a rectangle, its edge included, at all times of the horizon.

    Attributes:
        region: the rectangle.
    """

    region: Region
    name: ClassVar[str] = "stay_inside"
    needs_beliefs: ClassVar[bool] = False
    time_invariant = True

    @property
    def zone(self) -> tuple[Floats, ...]:
        """The exterior of the rectangle, whose edge is allowed: a frame around it, wider than any course."""
        (x_min, y_min), (x_max, y_max) = self.region.corners[0] - _EDGE, self.region.corners[2] + _EDGE
        inner = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])
        return inner + _BEYOND * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]), inner

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return the distance, m, from the rectangle, averaged over the times.

        The straight way between two points inside is inside, too.
        """
        places = np.concatenate([own[:, :, :2] for own in situation.courses])
        low, high = self.region.corners.min(axis=0), self.region.corners.max(axis=0)
        beyond = np.maximum(np.maximum(low - places, places - high), 0.0)
        return situation.of_movable(np.asarray(np.hypot(beyond[..., 0], beyond[..., 1]).mean(axis=1)))


@dataclass(frozen=True, slots=True, eq=False)
class KeepOut(PerSensorConstraint):
    """No platform enters a region: neither at the times of the horizon nor on the straight way between two of them.

    The way from the present position counts unless that position is already inside. A platform that cannot move at all
    may be inside.

    Attributes:
        area: a `Region`, or the corners (num_corners, 2) of a polygon in order, m, 3 or more. The interior of a polygon
            that crosses itself is determined by the even-odd rule. Its edge is forbidden, too.
        holes: polygons inside the area that are allowed, except for their edges: a lake on an island.

    Raises:
        InputError: an area or a hole that is neither a region nor a polygon.
    """

    area: Region | Floats
    holes: tuple[Floats, ...] = ()
    time_invariant = True
    _edges: tuple[Floats, Floats] = field(init=False, repr=False)  # (num_edges, 2) start and end of each edge
    name: ClassVar[str] = "keep_out"
    needs_beliefs: ClassVar[bool] = False

    def __post_init__(self) -> None:
        corners = _polygon("area", self.area.corners if isinstance(self.area, Region) else self.area)
        if not isinstance(self.area, Region):
            warn_if_corners_in_degrees("area", corners)
            object.__setattr__(self, "area", corners)
        holes = tuple(_polygon(f"holes[{i}]", hole) for i, hole in enumerate(self.holes))
        object.__setattr__(self, "holes", holes)
        object.__setattr__(self, "_edges", edges_of((corners, *holes)))

    @property
    def zone(self) -> tuple[Floats, ...]:
        """The polygon and its holes."""
        return (self.area.corners if isinstance(self.area, Region) else self.area, *self.holes)

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return the depth in m inside the area, averaged over the way's corners, nearly 0 if only a leg crosses it."""
        edges = self._edges
        ways = np.concatenate([situation.ways(s) for s in range(len(situation.courses))])
        inside, crosses = inside_edges(ways, edges), _cross(ways, edges)
        if situation.poses is not None:
            crosses[:, 0] &= ~inside[:, 0]
            inside[:, 0] = False
        depths = np.where(inside, _distances(ways, edges), 0.0).mean(axis=1)
        touched = inside.any(axis=1) | crosses.any(axis=1)
        return situation.of_movable(np.where(touched, np.maximum(depths, np.finfo(float).tiny), 0.0))


def edges_of(rings: Sequence[Floats]) -> tuple[Floats, Floats]:
    """Return the start and end points (num_edges, 2) of the edges of polygons."""
    return np.concatenate(rings), np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])


def _polygon(name: str, given: Any) -> Floats:
    corners = float_array(name, given, (None, 2))
    if len(corners) < 3:
        raise reject(name, "a Region, or a polygon of at least 3 corners", f"{len(corners)} corners")
    return corners


def inside_edges(points: Floats, edges: tuple[Floats, Floats]) -> Bools:
    """Return (...) whether points (..., 2) are inside: a ray to the east crosses the edges an odd number of times."""
    x, y = points[..., 0, np.newaxis], points[..., 1, np.newaxis]
    (x1, y1), (x2, y2) = edges[0].T, edges[1].T
    spans = (y1 > y) != (y2 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x1 + (y - y1) / (y2 - y1) * (x2 - x1)
    return np.asarray((spans & (x < crossing)).sum(axis=-1) % 2 == 1)


def _distances(points: Floats, edges: tuple[Floats, Floats]) -> Floats:
    """Return the distance (...) m from points (..., 2) to the nearest edge."""
    along, off = edges[1] - edges[0], points[..., np.newaxis, :] - edges[0]
    length = np.maximum((along**2).sum(axis=-1), np.finfo(float).tiny)
    share = np.clip((off * along).sum(axis=-1) / length, 0.0, 1.0)
    return np.asarray(np.sqrt(((off - share[..., np.newaxis] * along) ** 2).sum(axis=-1)).min(axis=-1))


def _cross(ways: Floats, edges: tuple[Floats, Floats]) -> Bools:
    """Return (num_courses, num_legs) whether straight legs of ways (num_courses, num_points, 2) touch an edge.

    A way of a single point has one leg, without length.
    """
    starts = ways[:, :-1] if ways.shape[1] > 1 else ways
    ends = ways[:, 1:] if ways.shape[1] > 1 else ways
    a, b = starts[:, :, np.newaxis], ends[:, :, np.newaxis]
    c, d = edges
    # Two segments touch if neither lies wholly on one side of the other, or beyond its end.
    apart = (_side(a, b, c) * _side(a, b, d) > 0.0) | (_side(c, d, a) * _side(c, d, b) > 0.0)
    beside = (np.maximum(a, b) < np.minimum(c, d)) | (np.maximum(c, d) < np.minimum(a, b))
    return np.asarray((~(apart | beside.any(axis=-1))).any(axis=-1))


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    """Return the sign of the side of a line that a point is on."""
    along, to = end - start, point - start
    return np.asarray(np.sign(along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]))
