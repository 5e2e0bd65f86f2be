"""Courses at a speed, by their plain formula."""

from __future__ import annotations

import math

import numpy as np

from vedette.platforms import PAPER_HEADINGS_DEG, HeadingPlatform

POSE = np.array([100.0, -50.0, 1.0, 0.7, 0.2])


def test_straight_on_at_the_speed():
    times = np.array([0.0, 2.0, 5.0])
    course = HeadingPlatform(50.0).course(POSE, np.array([30.0]), times)
    for pose, time in zip(course, times, strict=True):
        expected = [100.0 + 50.0 * time * math.sqrt(3) / 2, -50.0 + 25.0 * time, math.radians(30.0), 0.7, 0.2]
        np.testing.assert_allclose(pose, expected, atol=1e-12)
    np.testing.assert_array_equal(POSE, [100.0, -50.0, 1.0, 0.7, 0.2])


def test_the_papers_headings_are_absolute():
    platform = HeadingPlatform(50.0)
    assert platform.columns == ("heading_deg",)
    np.testing.assert_array_equal(platform.actions(POSE)[:, 0], PAPER_HEADINGS_DEG)


def test_changes_of_heading_are_added_to_the_present_one():
    actions = HeadingPlatform(5.0, [-30, 0, 30], relative=True).actions(np.array([0.0, 0.0, math.radians(170.0)]))
    np.testing.assert_allclose(actions[:, 0], [140.0, 170.0, -160.0])


def test_each_heading_at_each_of_several_speeds():
    platform = HeadingPlatform((0.0, 20.0), [0, 90])
    assert platform.columns == ("heading_deg", "speed")
    assert platform.actions(POSE).tolist() == [[0.0, 0.0], [0.0, 20.0], [90.0, 0.0], [90.0, 20.0]]
    moved = platform.course(POSE, np.array([90.0, 20.0]), np.array([3.0]))
    np.testing.assert_allclose(moved[0, :3], [100.0, 10.0, math.pi / 2], atol=1e-12)


def test_half_turns_either_way_are_one_course():
    left, right = (HeadingPlatform(50.0).course(POSE, np.array([angle]), np.array([10.0])) for angle in (180.0, -180.0))
    np.testing.assert_array_equal(left, right)
    assert left[0, 2] == math.pi
