"""Shortest paths around zones, against samples along every line between corners and closed forms around rectangles."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from reference.shortest_paths import forbidden, nearest_free, path_length
from vedette.control import KeepOut, StayInside
from vedette.control.constraints.paths import Paths, VisibilityGraph, visibility_graph
from vedette.models import Region

CLOSE = 0.02  # m; paths keep 1 mm from corners

pytestmark = pytest.mark.lanes


def to(constraints: Any, goals: Any, start: Any) -> Paths:
    graph = visibility_graph(tuple(constraints))
    assert graph is not None
    return graph.to(np.array(goals, np.float64), np.array(start, np.float64))


def distance(constraints: Any, start: Any, goal: Any) -> float:
    return float(to(constraints, [goal], start).distances(np.array([start], np.float64))[0, 0])


def square(half: float, centre: Any = (0.0, 0.0)) -> Any:
    return np.array(centre) + half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def legs(*corners: Any) -> float:
    """m, of the line through corners."""
    return float(np.hypot(*np.diff(np.array(corners, np.float64), axis=0).T).sum())


WALL = KeepOut(Region(0.0, 20.0, -80.0, 80.0))


@pytest.mark.parametrize(("y", "corner"), [(10.0, 80.0), (-10.0, -80.0)])
def test_around_a_rectangle_by_its_nearer_end(y: float, corner: float) -> None:
    start, goal = (-4.0, y), (100.0, y)
    assert distance((WALL,), start, goal) == pytest.approx(legs(start, (0, corner), (20, corner), goal), abs=CLOSE)
    path = to((WALL,), [goal], start).paths(np.array([start]), np.array([0]))[0]
    np.testing.assert_allclose(path, [start, (0, corner), (20, corner), goal], atol=0.002)


def test_nothing_is_longer_where_the_straight_line_is_free() -> None:
    assert distance((WALL,), (-4.0, 90.0), (100.0, 90.0)) == 104.0
    assert len(visibility_graph(()).edges.zones) == 0


def test_zones_that_overlap_are_gone_around_as_one() -> None:
    second, goal = KeepOut(Region(-60.0, 10.0, 60.0, 100.0)), (60.0, 50.0)
    for start in ((-20.0, 0.0), (-20.0, 50.0)):
        south = legs(start, (0, -80), (20, -80), goal)
        north = legs(start, (-60, 60), (-60, 100), (10, 100), goal)
        assert distance((WALL, second), start, goal) == pytest.approx(min(south, north), abs=CLOSE)


def test_a_fence_closes_the_path_at_one_end() -> None:
    fence = StayInside(Region(-200.0, 200.0, -300.0, 80.0))  # up to the wall's northern end
    start, goal = (-4.0, 70.0), (60.0, 70.0)
    assert distance((WALL, fence), start, goal) == pytest.approx(legs(start, (0, -80), (20, -80), goal), abs=CLOSE)
    # Its own edge is allowed.
    assert distance((fence,), (-200.0, 80.0), (200.0, 80.0)) == 400.0


def test_a_ring_with_one_gap_is_entered_through_it() -> None:
    half = 30.0
    outside = [[-half, 110], [-110, 110], [-110, -110], [110, -110], [110, 110], [half, 110]]
    inside = [[half, 90], [90, 90], [90, -90], [-90, -90], [-90, 90], [-half, 90]]
    start, goal = (-20.0, -180.0), (10.0, 0.0)
    wanted = legs(start, (-110, -110), (-110, 110), (-30, 110), goal)
    assert distance((KeepOut(np.array(outside + inside)),), start, goal) == pytest.approx(wanted, abs=CLOSE)


def test_a_concave_bay_is_left_by_its_mouth() -> None:
    """The bay opens to the west; the target is east of its end."""
    bay = KeepOut(np.array([[0.0, 0], [100, 0], [100, 100], [0, 100], [0, 80], [80, 80], [80, 20], [0, 20]]))
    start, goal = (70.0, 50.0), (150.0, 50.0)
    wanted = legs(start, (0, 20), (0, 0), (100, 0), goal)
    assert distance((bay,), start, goal) == pytest.approx(wanted, abs=CLOSE)


@pytest.mark.parametrize(("width", "is_open"), [(1.0, True), (0.1, True), (0.0, False)])
def test_narrow_straits_are_open_and_touching_zones_are_not(width: float, is_open: bool) -> None:
    north, south = KeepOut(Region(0.0, 20.0, width, 500.0)), KeepOut(Region(0.0, 20.0, -500.0, 0.0))
    start, goal = (-100.0, width / 2.0), (100.0, width / 2.0)
    around = legs(start, (0, 500), (20, 500), goal)
    assert distance((north, south), start, goal) == pytest.approx(200.0 if is_open else around, abs=CLOSE)


def test_holes_are_free_but_closed() -> None:
    """A lake on an island: a boat there reaches its shore nearest to a target at sea, and the other way round."""
    island = KeepOut(square(100.0), holes=(square(50.0),))
    for start, goal, point, left in (
        ((0.0, 0.0), (300.0, 10.0), (50.0, 10.0), 250.0),
        ((300.0, 10.0), (30.0, 0.0), (100.0, 0.0), 70.0),
    ):
        paths = to((island,), [goal], start)
        np.testing.assert_allclose(paths.points, [point], atol=0.002)
        assert paths.left[0] == pytest.approx(left, abs=CLOSE)
        assert distance((island,), start, goal) == pytest.approx(legs(start, point, goal), abs=CLOSE)
    assert distance((island,), (-40.0, -40.0), (40.0, 40.0)) == pytest.approx(80.0 * math.sqrt(2.0))
    assert to((island,), [(40.0, 40.0)], (0.0, 0.0)).left.tolist() == [0.0]


def test_a_start_in_a_zone_leaves_it_by_the_nearest_edge() -> None:
    assert distance((WALL,), (15.0, 0.0), (100.0, 30.0)) == pytest.approx(legs((15, 0), (20, 0), (100, 30)), abs=CLOSE)
    wanted = legs((5, 0), (0, 0), (0, 80), (20, 80), (100, 30))
    assert distance((WALL,), (5.0, 0.0), (100.0, 30.0)) == pytest.approx(wanted, abs=CLOSE)
    # On the edge, which is forbidden.
    assert distance((WALL,), (0.0, 0.0), (-50.0, 0.0)) == pytest.approx(50.0, abs=CLOSE)


def test_a_goal_in_a_zone_is_approached_as_near_as_it_can_be() -> None:
    paths = to((WALL,), [(15.0, 10.0), (5.0, 10.0)], (-50.0, 0.0))
    np.testing.assert_allclose(paths.points, [(20.0, 10.0), (0.0, 10.0)], atol=0.002)
    np.testing.assert_allclose(paths.left, [5.0, 5.0], atol=0.002)
    # In the corner that two zones make, neither of which has one there.
    corner = (KeepOut(Region(0.0, 100.0, -10.0, 40.0)), KeepOut(Region(-10.0, 40.0, 0.0, 100.0)))
    np.testing.assert_allclose(to(corner, [(35.0, 35.0)], (90.0, 90.0)).points, [(40.0, 40.0)], atol=0.002)


def test_corners_that_repeat_and_walls_without_width_are_no_trouble() -> None:
    repeated = KeepOut(np.array([[0.0, -80], [20, -80], [20, -80], [20, 80], [0, 80], [0, -80]]))
    assert distance((repeated,), (-4.0, 10.0), (100.0, 10.0)) == distance((WALL,), (-4.0, 10.0), (100.0, 10.0))
    line = KeepOut(np.array([[0.0, -80.0], [0.0, 80.0], [0.0, 0.0]]))
    wanted = legs((-60, 10), (0, 80), (60, 10))
    assert distance((line,), (-60.0, 10.0), (60.0, 10.0)) == pytest.approx(wanted, abs=CLOSE)


def test_the_graph_of_the_same_zones_is_built_once() -> None:
    again = KeepOut(Region(0.0, 20.0, -80.0, 80.0))
    assert visibility_graph((WALL,)) is visibility_graph((again,))


def star(rng: Any, centre: Any, size: float, num: int) -> Any:
    """A polygon of 4 corners or more, in most cases not convex, around its centre."""
    angles = 2.0 * math.pi * (np.arange(num) + rng.uniform(0.0, 0.8, num)) / num
    radii = size * rng.uniform(0.3, 1.0, num)
    return centre + np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def random_zones(rng: Any) -> list[Any]:
    """One to four islands that may overlap, some with a lake, some within a fence."""
    zones: list[Any] = []
    for _ in range(rng.integers(1, 5)):
        centre, size = rng.uniform(-60.0, 60.0, 2), rng.uniform(25.0, 60.0)
        outer = star(rng, centre, size, int(rng.integers(4, 9)))
        lake = centre + 0.6 * (outer - centre)
        zones.append([outer, lake] if rng.random() < 0.3 else [outer])
    if rng.random() < 0.3:
        zones.append(list(StayInside(Region(-90.0, 90.0, -90.0, 90.0)).zone))
    return zones


@pytest.mark.parametrize("seed", range(6))
def test_random_zones(seed: int) -> None:
    """Lengths between random places, also in zones and lakes, are those of the reference."""
    rng = np.random.default_rng(seed)
    zones = random_zones(rng)
    graph = VisibilityGraph.of(zones)
    places = rng.uniform(-85.0, 85.0, (6, 2))
    origins = graph.outside(places)
    for place, origin in zip(places, origins, strict=True):
        out = np.hypot(*(origin - place))
        assert out == pytest.approx(nearest_free(place, zones, 0.1), abs=0.25)
    for start, origin in zip(places[:2], origins, strict=False):
        paths = graph.to(places, start)
        found = paths.distances(start[np.newaxis])[0]
        assert np.isfinite(found).all()
        for goal, point in enumerate(origins):
            wanted = path_length(origin, point, zones)
            if math.isinf(wanted):
                assert paths.left[goal] > 0.0
                continue
            length = found[goal] - np.hypot(*(origin - start)) - paths.left[goal]
            assert length == pytest.approx(wanted, rel=1e-3, abs=0.05)
            path = paths.paths(start[np.newaxis], np.array([goal]))[0]
            assert legs(*path) == pytest.approx(found[goal] - paths.left[goal], abs=1e-9)
            shares = np.linspace(0.0, 1.0, 100)[:, np.newaxis]
            for a, b in pairwise(path):
                if not np.array_equal(a, start) or np.array_equal(start, origin):
                    assert not forbidden(a + shares * (b - a), zones).any()
