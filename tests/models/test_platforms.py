"""Platforms at constant speed along their heading."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.models.platforms import advance


def test_one_platform():
    moved = advance([100.0, -50.0, 1.0], math.radians(30.0), 50.0, 2.0)
    np.testing.assert_allclose(moved, [100.0 + 100.0 * math.sqrt(3) / 2, 0.0, math.radians(30.0)], atol=1e-12)


def test_a_row_of_platforms_is_each_alone():
    poses = np.random.default_rng(0).normal(0, 500, (6, 3))
    headings, speeds = np.linspace(-3.0, 3.0, 6), np.arange(6.0)
    together = advance(poses, headings, speeds, 1.5)
    for i in range(6):
        np.testing.assert_array_equal(together[i], advance(poses[i], headings[i], speeds[i], 1.5))


def test_steps_add_up():
    pose = np.array([0.0, 0.0, 0.0])
    for _ in range(10):
        pose = advance(pose, -1.0, 40.0, 1.0)
    np.testing.assert_allclose(pose, advance([0.0, 0.0, 0.0], -1.0, 40.0, 10.0), rtol=1e-13)


def test_half_turns_either_way_are_one_heading():
    left, right = (advance([1.0, 2.0, 0.0], heading, 50.0, 10.0) for heading in (math.pi, -math.pi))
    np.testing.assert_array_equal(left, right)
    assert left[2] == math.pi


def test_standing_still_keeps_the_place_and_the_argument():
    pose = np.array([3.0, 4.0, 0.5])
    np.testing.assert_array_equal(advance(pose, 0.5, 0.0, 1.0), pose)
    np.testing.assert_array_equal(pose, [3.0, 4.0, 0.5])


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        (([0.0, 0.0], 0.0, 1.0, 1.0), "pose"),
        (([0.0, 0.0, np.nan], 0.0, 1.0, 1.0), "pose"),
        (([0.0, 0.0, 0.0], np.inf, 1.0, 1.0), "heading_rad"),
        (([0.0, 0.0, 0.0], [0.0, 1.0], 1.0, 1.0), "heading_rad"),
        (([0.0, 0.0, 0.0], 0.0, -1.0, 1.0), "speed"),
        (([0.0, 0.0, 0.0], 0.0, 1.0, -1.0), "dt"),
    ],
)
def test_bad_input(arguments, field):
    with pytest.raises(InputError, match=field):
        advance(*arguments)
