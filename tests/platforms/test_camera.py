"""Cameras that turn and zoom, on the spot or carried, and what they see."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.errors import InputError, ModelError
from vedette.models import camera
from vedette.platforms import GridPlatform, HeadingPlatform, MountedPlatform, Pointing, Stationary, options_at

POSE = np.array([100.0, 50.0, 0.3, math.radians(170.0), math.radians(20.0)])
TIMES = np.array([0.0, 1.0, 3.0, 20.0])


def test_it_turns_at_once_and_stays_in_its_place():
    course = Pointing([-90.0, 0.0]).course(POSE, np.array([-90.0]), TIMES)
    np.testing.assert_allclose(course, np.tile([100.0, 50.0, 0.3, -math.pi / 2, POSE[4]], (4, 1)))


def test_pointings_may_be_changes_of_the_present_one():
    actions = Pointing([-30.0, 0.0, 30.0], relative=True).actions(POSE)
    np.testing.assert_allclose(actions, [[140.0], [170.0], [-160.0]])


@pytest.mark.parametrize(("to", "way"), [(-160.0, 30.0), (80.0, -90.0), (-11.0, 179.0), (-10.0, 180.0), (-9.0, -179.0)])
def test_it_turns_the_shorter_way_at_its_rate(to, way):
    course = Pointing([to], turn_rate_deg=20.0).course(POSE, np.array([to]), TIMES)
    for pose, time in zip(course, TIMES, strict=True):
        expected = math.radians(170.0 + math.copysign(min(20.0 * time, abs(way)), way))
        assert abs(math.remainder(pose[3] - expected, math.tau)) < 1e-12
        assert -math.pi < pose[3] <= math.pi


def test_it_may_be_blind_while_it_turns():
    """The turn of 90 degrees takes 4.5 s, none 0 s; a camera that turns at once is never blind."""
    times, actions = np.array([0.0, 1.0, 4.5, 20.0]), np.array([[80.0], [170.0]])
    slow = Pointing([80.0, 170.0], turn_rate_deg=20.0, blind_while_turning=True)
    turning = slow.scans(POSE, actions, times)
    np.testing.assert_array_equal(turning, [[False, False, True, True], [True] * 4])
    assert Pointing([80.0, 170.0], blind_while_turning=True).scans(POSE, actions, times).all()
    assert Pointing([80.0], turn_rate_deg=20.0).scans(POSE, actions, times).all()
    carried = options_at("platform", MountedPlatform(Stationary(), slow), POSE, times[1:])
    np.testing.assert_array_equal(carried.scans[:, 0], [False, True])


def test_it_zooms_in_every_direction():
    platform = Pointing([0.0, 90.0], half_widths_deg=[5.0, 30.0])
    assert platform.columns == ("pointing_deg", "half_width_deg")
    assert platform.actions(POSE).tolist() == [[0.0, 5.0], [0.0, 30.0], [90.0, 5.0], [90.0, 30.0]]
    np.testing.assert_allclose(platform.course(POSE, np.array([90.0, 5.0]), TIMES)[:, 4], math.radians(5.0))


def test_a_carried_camera_has_every_action_of_both():
    carrier, pointing = HeadingPlatform((10.0, 20.0), (0.0, 90.0)), Pointing([0.0, 180.0, -180.0])
    platform = MountedPlatform(carrier, pointing)
    assert platform.columns == ("heading_deg", "speed", "pointing_deg")
    options = options_at("platform", platform, POSE, TIMES)
    assert options.actions.values.shape == (12, 3)
    assert options.actions.text(1) == "heading_deg 0, speed 10, pointing_deg 180"
    assert len(options.courses) == 8  # -180 and 180 are one pointing
    for row, which in zip(options.actions.values, options.which, strict=True):
        course = options.courses[which]
        np.testing.assert_allclose(course[:, :3], carrier.course(POSE[:3], row[:2], TIMES), atol=1e-12)
        np.testing.assert_allclose(course[:, 3:], pointing.course(POSE, row[2:], TIMES)[:, 3:], atol=1e-12)


def test_a_sensor_of_a_longer_pose_beside_one_of_a_shorter():
    longer = np.array([0.0, 0.0, 0.0, 0.0, 0.0])
    for platform in (HeadingPlatform(10.0), GridPlatform(10.0, 1.0), Stationary()):
        options = options_at("platform", platform, longer, TIMES)
        assert options.courses.shape[2] == 5
        assert (options.courses[..., 3:] == 0.0).all()


@pytest.mark.lanes
def test_it_sees_within_its_range_and_width():
    angles, distances = np.meshgrid(np.radians(np.arange(-180.0, 180.0, 7.0)), [1.0, 80.0, 120.0, 399.0, 401.0])
    angles, distances = angles.ravel(), distances.ravel()
    states = np.column_stack([100.0 + distances * np.cos(angles), 50.0 + distances * np.sin(angles), angles, angles])
    off = np.abs(np.remainder(angles - POSE[3] + math.pi, math.tau) - math.pi)
    for model, reach in ((camera(0.8, 100.0), 100.0), (camera(0.8, 100.0, math.radians(80.0)), 400.0)):
        expected = np.where((off <= POSE[4]) & (distances <= reach), 0.8, 0.0)
        np.testing.assert_array_equal(model.prob(states, POSE), expected)
    assert camera(0.8, 100.0).prob(np.array([[100.0, 50.0, 0.0, 0.0]]), POSE)[0] == 0.8


@pytest.mark.lanes
def test_it_needs_a_pose_with_a_pointing():
    with pytest.raises(ModelError, match="expected a pose with pointing_rad and half_width_rad"):
        camera(0.8, 100.0).prob(np.zeros((1, 4)), POSE[:3])
    with pytest.raises(InputError, match=r"pose: expected 5 components.*; got 3"):
        Pointing([0.0]).actions(POSE[:3])
