"""Platforms that move by the step, along a path, or not at all, by plain formulas."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from vedette.platforms import GridPlatform, Options, Stationary, Waypoints, options_at

POSE = np.array([10.0, -5.0, 0.3, 0.7])
TIMES = np.array([0.0, 1.0, 2.5, 4.0, 100.0])


def test_what_is_still_has_one_action_without_numbers():
    options: Options = options_at("platform", Stationary(), POSE, TIMES)
    assert options.actions.columns == ()
    assert options.actions.values.shape == (1, 0)
    np.testing.assert_array_equal(options.courses, np.tile(POSE, (1, 5, 1)))


def test_a_step_is_made_at_the_speed_and_ends():
    platform = GridPlatform(100.0, 40.0, (0.0, 90.0, -150.0))
    actions = platform.actions(POSE)
    expected = [[100.0, 0.0], [0.0, 100.0], [-50.0 * math.sqrt(3), -50.0], [0.0, 0.0]]
    np.testing.assert_allclose(actions, expected, atol=1e-12)
    for action, angle in zip(actions, (0.0, math.pi / 2, -5 * math.pi / 6), strict=False):
        for pose, time in zip(platform.course(POSE, action, TIMES), TIMES, strict=True):
            gone = min(40.0 * time, 100.0)
            away = [10.0 + gone * math.cos(angle), -5.0 + gone * math.sin(angle), angle, 0.7]
            np.testing.assert_allclose(pose, away, atol=1e-12)


def test_to_stay_is_an_action_that_keeps_the_heading():
    platform = GridPlatform(100.0, 40.0)
    assert platform.actions(POSE).shape == (9, 2)
    np.testing.assert_array_equal(platform.course(POSE, platform.actions(POSE)[-1], TIMES), np.tile(POSE, (5, 1)))
    assert GridPlatform(100.0, 40.0, (0.0,), allow_staying=False).actions(POSE).tolist() == [[100.0, 0.0]]


POINTS = [[10.0, 15.0], [40.0, 15.0], [40.0, 15.0], [40.0, -25.0]]


def along(corners, distance):
    """Place and heading after a distance along the corners, leg by leg; at the end it waits."""
    heading = 0.3
    for (x, y), (u, v) in pairwise(corners):
        leg = math.hypot(u - x, v - y)
        if leg == 0.0:
            continue
        heading = math.atan2(v - y, u - x)
        if distance < leg:
            return x + distance / leg * (u - x), y + distance / leg * (v - y), heading
        distance -= leg
    return *corners[-1], heading


@pytest.mark.parametrize("waypoint", [1, 2, 3, 4])
def test_a_path_is_followed_from_the_chosen_waypoint_to_its_end(waypoint):
    platform = Waypoints(POINTS, 7.0)
    assert platform.actions(POSE).tolist() == [[1.0], [2.0], [3.0], [4.0]]
    times = np.linspace(0.0, 30.0, 61)
    course = platform.course(POSE, np.array([float(waypoint)]), times)
    for pose, time in zip(course, times, strict=True):
        np.testing.assert_allclose(pose[:3], along([POSE[:2], *POINTS[waypoint - 1 :]], 7.0 * time), atol=1e-9)
        assert pose[3] == 0.7


def test_a_closed_path_goes_round_and_round():
    platform = Waypoints(POINTS, 7.0, closed=True)
    times = np.linspace(0.0, 60.0, 121)
    corners = [POSE[:2], *POINTS[1:], *POINTS, *POINTS, *POINTS]
    for pose, time in zip(platform.course(POSE, np.array([2.0]), times), times, strict=True):
        np.testing.assert_allclose(pose[:3], along(corners, 7.0 * time), atol=1e-9)


@pytest.mark.parametrize("closed", [False, True])
def test_a_path_of_one_point_where_it_is_leads_nowhere(closed):
    course = Waypoints([[10.0, -5.0]], 7.0, closed).course(POSE, np.array([1.0]), TIMES)
    np.testing.assert_array_equal(course, np.tile(POSE, (5, 1)))
