"""Sequences of another platform's actions, followed one after the other by plain formulas."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.platforms import GridPlatform, HeadingPlatform, Pointing, Sequences, Stationary, Waypoints

POSE = np.array([10.0, -5.0, 0.3])


def test_columns_are_those_of_every_stage():
    assert Sequences(HeadingPlatform(5.0), 2.0, 3).columns == ("heading_deg_1", "heading_deg_2", "heading_deg_3")
    assert Sequences(GridPlatform(3.0, 1.0), 2.0, 2).columns == ("dx_1", "dy_1", "dx_2", "dy_2")
    assert Sequences(Stationary(), 2.0, 2).columns == ()


def test_every_action_follows_every_other_the_last_fastest():
    headings = (-90.0, 0.0, 45.0)
    actions = Sequences(HeadingPlatform(5.0, headings), 2.0, 2).actions(POSE)
    assert actions.tolist() == [list(pair) for pair in itertools.product(headings, headings)]


def test_later_actions_are_those_at_the_pose_where_it_then_is():
    actions = Sequences(HeadingPlatform(5.0, (-30.0, 40.0), relative=True), 2.0, 3).actions(POSE)
    now = math.degrees(0.3)
    expected = [
        [now + first, now + first + second, now + first + second + third]
        for first, second, third in itertools.product((-30.0, 40.0), repeat=3)
    ]
    np.testing.assert_allclose(actions, expected, atol=1e-9)


class Corridor:
    """Ahead, or where x is below 20 also back: its actions differ from place to place."""

    columns = ("dx",)

    def actions(self, pose):
        return np.array([[10.0], [-10.0]] if pose[0] < 20.0 else [[10.0]])

    def course(self, pose, action, times):
        poses = np.tile(pose, (len(times), 1))
        poses[:, 0] += action[0] * np.minimum(times, 1.0)
        return poses


def test_sequences_are_the_ways_through_a_tree():
    actions = Sequences(Corridor(), 1.0, 3).actions(POSE)
    assert actions.tolist() == [[10, 10, 10], [-10, 10, 10], [-10, 10, -10], [-10, -10, 10], [-10, -10, -10]]


def test_a_course_follows_the_actions_each_from_where_the_last_one_ended():
    platform = Sequences(HeadingPlatform(5.0, (0.0, 90.0)), 2.0, 2)
    times = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 6.0])
    course = platform.course(POSE, np.array([90.0, 0.0]), times)
    north = math.pi / 2
    expected = [
        [10.0, -5.0, north],
        [10.0, 0.0, north],
        [10.0, 5.0, north],
        [15.0, 5.0, 0.0],
        [20.0, 5.0, 0.0],
        [30.0, 5.0, 0.0],
    ]
    np.testing.assert_allclose(course, expected, atol=1e-12)


def test_a_step_ends_before_the_next_one_begins():
    platform = Sequences(GridPlatform(10.0, 10.0, (0.0, 90.0)), 3.0, 2)
    course = platform.course(POSE, np.array([10.0, 0.0, 0.0, 10.0]), np.array([0.5, 1.0, 2.9, 3.5, 9.0]))
    expected = [[15.0, -5.0], [20.0, -5.0], [20.0, -5.0], [20.0, 0.0], [20.0, 5.0]]
    np.testing.assert_allclose(course[:, :2], expected, atol=1e-12)


@pytest.mark.parametrize(
    "platform", [HeadingPlatform(7.0), GridPlatform(3.0, 1.0), Pointing([0.0, 90.0], turn_rate_deg=10.0)]
)
def test_one_action_is_the_platform_itself(platform):
    pose = np.array([10.0, -5.0, 0.3, 0.1, 0.5])
    once, times = Sequences(platform, 2.0, 1), np.linspace(0.0, 5.0, 11)
    np.testing.assert_array_equal(once.actions(pose), platform.actions(pose))
    for action in platform.actions(pose):
        np.testing.assert_array_equal(once.course(pose, action, times), platform.course(pose, action, times))


def test_rounded_sums_of_periods_are_the_time_of_the_decision():
    platform, period = Sequences(HeadingPlatform(1.0, (0.0, 180.0)), 0.1, 4), 0.1
    times = period * np.arange(1.0, 5.0)  # 0.3 among them is 0.30000000000000004
    course = platform.course(POSE, np.array([0.0, 0.0, 0.0, 180.0]), times)
    assert np.abs(course[:, 2]).tolist() == [0.0, 0.0, 0.0, math.pi]


def test_more_sequences_than_can_be_listed_are_refused():
    with pytest.raises(InputError, match="at most 1000000 sequences of actions; got 4826809 after 6 of 8 decisions"):
        Sequences(HeadingPlatform(5.0), 2.0, 8).actions(POSE)


def test_waypoints_are_chosen_anew():
    platform = Sequences(Waypoints([[0.0, 0.0], [100.0, 0.0]], 5.0), 1.0, 2)
    course = platform.course(np.array([50.0, 0.0, 0.0]), np.array([1.0, 2.0]), np.array([1.0, 2.0]))
    np.testing.assert_allclose(course[:, 0], [45.0, 50.0])
