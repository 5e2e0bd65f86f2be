"""Platforms on their ways, what they may do, and which actions lead the same way."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.platforms import Actions, Fleet, HeadingPlatform, options_at

POSES = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 1.0]])
PLATFORMS = (HeadingPlatform(10.0), HeadingPlatform(20.0))


def test_a_fleet_lies_still_until_it_is_told_to_go():
    fleet = Fleet(PLATFORMS, POSES, (np.zeros(1), None), 3.0)
    np.testing.assert_array_equal(fleet.poses(5.0), [[20.0, 0.0, 0.0], [100.0, 0.0, 1.0]])
    later = fleet.follow((np.array([90.0]), np.array([180.0])), 5.0)
    expected = [[20.0, 30.0, np.pi / 2], [40.0, 0.0, np.pi]]
    np.testing.assert_allclose(later.poses(8.0), expected, atol=1e-12)
    np.testing.assert_array_equal(fleet.poses(3.0), POSES)


def test_a_fleet_wants_a_pose_and_an_action_of_each():
    with pytest.raises(InputError, match="fleet: expected 2 poses and actions; got 1, 2"):
        Fleet(PLATFORMS, POSES[:1], (None, None), 0.0)
    with pytest.raises(InputError, match=r"sensors\[1\] action: expected an array of shape \(1,\)"):
        Fleet(PLATFORMS, POSES, (None, np.zeros(2)), 0.0)


def test_equal_courses_are_found_by_their_poses():
    options = options_at("platform", HeadingPlatform(10.0, (-180, 0, 180, 360, 0.001)), POSES[0], np.array([1.0, 2.0]))
    assert options.which.tolist() == [0, 1, 0, 1, 2]
    assert [options.first_action(course) for course in range(3)] == [0, 1, 4]
    np.testing.assert_allclose(options.courses[0, :, 0], [-10.0, -20.0])


def test_equal_places_under_other_headings_are_two_courses():
    options = options_at("platform", HeadingPlatform(0.0, (0, 90)), POSES[0], np.array([1.0]))
    assert len(options.courses) == 2


def test_actions_in_words():
    actions = Actions(("heading_deg", "speed"), np.array([[-30.0, 5.0], [0.1 + 0.2, 0.0]]))
    assert [actions.text(index) for index in range(len(actions))] == [
        "heading_deg -30, speed 5",
        "heading_deg 0.3, speed 0",
    ]
    assert Actions.of(dx=1.0, dy=2.0).values.tolist() == [[1.0, 2.0]]
    with pytest.raises(InputError, match="at least one action"):
        Actions(("heading_deg",), np.empty((0, 1)))
    with pytest.raises(InputError, match=r"actions.values: expected an array of shape \(any, 1\)"):
        Actions(("heading_deg",), np.zeros((1, 2)))
