"""Shortest paths around forbidden zones, by a visibility graph over the corners of the zones.

A shortest path among polygons is straight except for bends at their convex corners (T. Lozano-Perez and M. A. Wesley,
An algorithm for planning collision-free paths among polyhedral obstacles, Communications of the ACM 22 (1979) 560-570).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vedette.control.constraints.protocol import Constraint, ZoneConstraint
from vedette.control.constraints.regions import edges_of, inside_edges
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.planning.lines import Edges, clear_lengths, first_touches
from vedette.models.arguments import provides

# m; paths keep this distance from corners, as edges are forbidden. Gaps narrower than twice this are closed.
MARGIN = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class VisibilityGraph:
    """Shortest paths in the plane outside forbidden zones."""

    edges: Edges  # edges of all zones
    nodes: Floats  # (num_nodes, 2) m, the corners at which paths may bend, `MARGIN` outside the zones
    # (num_points, 2) m, points where free space extends farthest into the zones: at their other corners, and where
    # edges of two zones cross
    coast: Floats
    lengths: Floats  # (num_nodes, num_nodes) m, lengths of the shortest paths between nodes, or inf if there is none
    before: Ints  # (num_nodes, num_nodes) the node before the second one on the path from the first. Below 0: none

    @classmethod
    def of(cls, zones: Sequence[Sequence[Floats]]) -> "VisibilityGraph":
        """Return the graph of zones, each the interior of polygons (num_corners, 2), m, by the even-odd rule."""
        from scipy.sparse.csgraph import shortest_path

        none = np.empty((0, 2))
        if not zones:
            edges, nothing = Edges(none, none, np.empty(0, np.int64)), np.empty((0, 0))
            return cls(edges, none, none, nothing, nothing.astype(np.int64))
        zones = [[ring[np.any(ring != np.roll(ring, 1, axis=0), axis=1)] for ring in rings] for rings in zones]
        pairs = [edges_of(rings) for rings in zones]
        starts, ends = (np.concatenate(each) for each in zip(*pairs, strict=True))
        edges = Edges(starts, ends, np.repeat(np.arange(len(pairs)), [len(own) for own, _ in pairs]))
        sides = [_near_corners(ring) for rings in zones for ring in rings]
        outer, inner = (np.concatenate(each) for each in zip(*sides, strict=True))
        nodes, coast = (own[_is_free(edges, own)] for own in (outer, np.concatenate([inner, _crossings(edges)])))
        straight = clear_lengths(nodes, nodes, edges)
        if len(nodes) == 0:
            return cls(edges, nodes, coast, straight, np.empty((0, 0), np.int64))
        links = np.where(np.isinf(straight), 0.0, straight)
        lengths, before = shortest_path(links, method="D", return_predecessors=True)
        return cls(edges, nodes, coast, lengths, np.asarray(before, np.int64))

    def to(self, goals: Floats, start: Floats) -> "Paths":
        """Return the paths from near a start (2,) to goals (num_goals, 2), m.

        A goal inside a zone, or one that no path reaches, is approached as closely as paths from the start allow.
        """
        points, none = np.array(goals, np.float64, order="C"), np.empty((0, len(goals)))
        if len(self.edges.zones) == 0:
            return Paths(self, points, np.zeros(len(points)), none, none.astype(np.int64))
        origin = self.outside(start[np.newaxis])
        from_origin = _added(clear_lengths(origin, self.nodes, self.edges), self.lengths)[0]
        for goal in np.flatnonzero(~self._are_linked(points, origin, from_origin)).tolist():
            near = (own for own in self._nearest(points[goal]) if self._are_linked(own, origin, from_origin)[0])
            points[goal] = next(near, origin)[0]
        last = clear_lengths(points, self.nodes, self.edges)
        through = self.lengths[:, np.newaxis] + last
        distances = np.hypot(*(goals - points).T)
        if len(self.nodes) == 0:
            return Paths(self, points, distances, none, none.astype(np.int64))
        return Paths(self, points, distances, through.min(axis=2), through.argmin(axis=2))

    def is_blocked(self, start: Floats, courses: Floats) -> Bools:
        """Return (num_courses,) whether courses (num_courses, num_times, 2) from `start` (2,) touch a zone.

        Zones that contain the start do not count: a sensor may leave them.
        """
        points = np.concatenate([np.broadcast_to(start, (len(courses), 1, 2)), courses], axis=1)
        ignored = np.repeat(_inside(self.edges, points[:, 0]), courses.shape[1], axis=0)
        starts, ends = (np.ascontiguousarray(own.reshape(-1, 2)) for own in (points[:, :-1], points[:, 1:]))
        touched = np.isfinite(first_touches(starts, ends, self.edges, ignored))
        return np.asarray(touched.reshape(courses.shape[:2]).any(axis=1))

    def free_fraction(self, starts: Floats, ends: Floats) -> Floats:
        """Return the fraction (num,) of each line from start to end (num, 2) before it touches a zone. 1: all."""
        shares = first_touches(starts, ends, self.edges, _inside(self.edges, starts))
        length = np.maximum(np.hypot(*(ends - starts).T), MARGIN)
        return np.where(np.isinf(shares), 1.0, np.maximum(shares - MARGIN / length, 0.0))

    def outside(self, points: Floats) -> Floats:
        """Return the points (num, 2), with those inside a zone replaced by the nearest points outside all zones."""
        moved = np.array(points, np.float64, order="C")
        for i in np.flatnonzero(~_is_free(self.edges, moved)).tolist():
            moved[i] = next(self._nearest(moved[i]), moved[i : i + 1])[0]
        return moved

    def _nearest(self, point: Floats) -> Iterator[Floats]:
        """Yield points (1, 2) outside all zones near a point (2,), the nearest first."""
        along = self.edges.ends - self.edges.starts
        length = np.hypot(*along.T)[:, np.newaxis]
        share = ((point - self.edges.starts) * along).sum(axis=1, keepdims=True) / length**2
        foot = self.edges.starts + np.clip(share, 0.0, 1.0) * along
        normal = MARGIN * np.column_stack([-along[:, 1], along[:, 0]]) / length
        near = np.concatenate([self.nodes, self.coast, foot + normal, foot - normal])
        near = near[np.argsort(np.hypot(*(near - point).T), kind="stable")]
        return (own[np.newaxis] for own in near if _is_free(self.edges, own[np.newaxis])[0])

    def _are_linked(self, points: Floats, origin: Floats, from_origin: Floats) -> Bools:
        """Return (num,) whether paths lead from the origin (1, 2) to points (num, 2) outside all zones.

        from_origin: (num_nodes,) m, path lengths from the origin to the nodes.
        """
        straight = np.isfinite(clear_lengths(origin, points, self.edges)[0])
        by_corners = np.isfinite(clear_lengths(points, self.nodes, self.edges) + from_origin).any(axis=1)
        return np.asarray((straight | by_corners) & _is_free(self.edges, points))


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Shortest paths to a set of goals."""

    graph: VisibilityGraph  # visibility graph of the zones that the paths avoid
    points: Floats  # (num_goals, 2) m, end points of the paths: the goals, or the nearest points that paths reach
    left: Floats  # (num_goals,) m, distance from these points to the goals
    lengths: Floats  # (num_nodes, num_goals) m, path length from each node to each point, or inf if there is no path
    last: Ints  # (num_nodes, num_goals) the last node on that path

    def are_straight(self, starts: Floats) -> Bools:
        """Return (num_starts, num_goals) whether the line from each start (num_starts, 2) to each point is free."""
        return np.isfinite(clear_lengths(starts, self.points, self.graph.edges))

    def distances(self, starts: Floats) -> Floats:
        """Return the lengths (num_starts, num_goals) m of shortest paths from starts (num_starts, 2) to the goals.

        The last part, from the points to the goals, is straight. So is the first part out of a zone that contains a
        start. inf: no path.
        """
        graph, origins = self.graph, self.graph.outside(starts)
        lengths = clear_lengths(origins, self.points, graph.edges)
        if not np.isfinite(lengths).all():
            around = _added(clear_lengths(origins, graph.nodes, graph.edges), self.lengths)
            lengths = np.minimum(lengths, around)
        return np.asarray(np.hypot(*(origins - starts).T)[:, np.newaxis] + lengths + self.left)

    def paths(self, starts: Floats, goals: Ints) -> Floats:
        """Return the shortest paths (num, num_corners, 2) m from starts (num, 2) to goals (num,), which must exist.

        Paths with fewer corners stay at the last one.
        """
        if len(self.graph.edges.zones) == 0:
            return np.stack([starts, self.points[goals]], axis=1)
        found = [self._path(start, goal) for start, goal in zip(starts, goals.tolist(), strict=True)]
        most = max(map(len, found))
        return np.stack([np.concatenate([each, each[-1:].repeat(most - len(each), axis=0)]) for each in found])

    def _path(self, start: Floats, goal: int) -> Floats:
        """Return the shortest path (num_corners, 2) m from a start (2,) to the point of a goal."""
        graph, origin = self.graph, self.graph.outside(start[np.newaxis])
        begin = start[np.newaxis] if np.array_equal(origin[0], start) else np.stack([start, origin[0]])
        if self.are_straight(origin)[0, goal]:
            return np.concatenate([begin, self.points[goal][np.newaxis]])
        first = int((clear_lengths(origin, graph.nodes, graph.edges)[0] + self.lengths[:, goal]).argmin())
        chain = [int(self.last[first, goal])]
        while chain[-1] != first:
            chain.append(int(graph.before[first, chain[-1]]))
        return np.concatenate([begin, graph.nodes[chain[::-1]], self.points[goal][np.newaxis]])


def visibility_graph(constraints: Sequence[Constraint] = ()) -> VisibilityGraph:
    """Return the visibility graph of the zones of constraints. Without zones all paths are straight.

    The graph of the same zones is built once and shared by all decisions, planners and runs.
    """
    zones = [constraint.zone for constraint in constraints if provides(constraint, ZoneConstraint)]
    return _built(tuple(tuple(ring.tobytes() for ring in rings) for rings in zones))


@lru_cache(maxsize=32)
def _built(zones: tuple[tuple[bytes, ...], ...]) -> VisibilityGraph:
    return VisibilityGraph.of([[np.frombuffer(ring).reshape(-1, 2) for ring in rings] for rings in zones])


def _added(first: Floats, then: Floats) -> Floats:
    """Return the least sum (num_starts, num_goals) m over nodes of `first` (num_starts, num_nodes) and `then`."""
    columns = [(first + own).min(axis=1, initial=np.inf) for own in then.T]
    return np.stack(columns, axis=1) if columns else np.empty((len(first), 0))


def _inside(edges: Edges, points: Floats) -> Bools:
    """Return (num_points, num_zones) whether each point is inside each zone."""
    inside = np.empty((len(points), int(edges.zones.max(initial=-1)) + 1), np.bool_)
    for zone in range(inside.shape[1]):
        own = edges.zones == zone
        inside[:, zone] = inside_edges(points, (edges.starts[own], edges.ends[own]))
    return inside


def _is_free(edges: Edges, points: Floats) -> Bools:
    """Return (num_points,) whether each point is in no zone and on no edge."""
    if len(edges.zones) == 0:
        return np.ones(len(points), np.bool_)
    inside = _inside(edges, points)
    return ~inside.any(axis=1) & np.isinf(first_touches(points, points, edges, np.zeros_like(inside)))


def _near_corners(corners: Floats) -> tuple[Floats, Floats]:
    """Return points (num, 2) at `MARGIN` from the corners of a polygon: outside convex corners, and in reflex ones."""
    to, on = np.roll(corners, 1, axis=0) - corners, np.roll(corners, -1, axis=0) - corners
    middle = to / np.hypot(*to.T)[:, np.newaxis] + on / np.hypot(*on.T)[:, np.newaxis]
    size = np.hypot(*middle.T)
    turning = size > 1e-9
    step = MARGIN * middle[turning] / size[turning][:, np.newaxis]
    return corners[turning] - step, corners[turning] + step


def _crossings(edges: Edges) -> Floats:
    """Return points (num, 2) at `MARGIN` from the crossings of edges of two zones, one on each of the four sides."""
    crossings = [np.empty((0, 2))]
    for start, end, zone in zip(*edges, strict=True):
        others = edges.zones > zone
        along, across = end - start, edges.ends[others] - edges.starts[others]
        turn, gap = along[0] * across[:, 1] - along[1] * across[:, 0], edges.starts[others] - start
        with np.errstate(divide="ignore", invalid="ignore"):
            here = (gap[:, 0] * across[:, 1] - gap[:, 1] * across[:, 0]) / turn
            there = (gap[:, 0] * along[1] - gap[:, 1] * along[0]) / turn
        at = (turn != 0.0) & (here >= 0.0) & (here <= 1.0) & (there >= 0.0) & (there <= 1.0)
        unit, units = along / np.hypot(*along), across[at] / np.hypot(*across[at].T)[:, np.newaxis]
        for side in (unit + units, unit - units):
            step = MARGIN * side / np.hypot(*side.T)[:, np.newaxis]
            crossings += [start + here[at, np.newaxis] * along + step, start + here[at, np.newaxis] * along - step]
    return np.concatenate(crossings)
