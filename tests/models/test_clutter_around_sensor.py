"""Clutter around the sensor: it integrates to its rate, is uniform in the figure, and moves with the sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from vedette import models

pytestmark = pytest.mark.lanes

POSE = np.array([300.0, -200.0, 0.6])
FIGURES = {
    "disc": {"radius": 40.0},
    "sector": {"radius": 40.0, "half_width_rad": 0.8},
    "wide sector": {"radius": 40.0, "half_width_rad": 2.6},
    "square": {"half_side": 40.0},
    "part of a square": {"half_side": 40.0, "half_width_rad": math.pi / 4},
    "wide part of a square": {"half_side": 40.0, "half_width_rad": 2.0},
}
MEASUREMENTS = {"position": models.position(), "bearing_range": models.bearing_range()}


def inside(offsets, figure):
    """Whether offsets from the sensor lie in the figure, by its definition."""
    half_width = figure.get("half_width_rad", math.pi)
    off = np.abs(np.angle(np.exp(1j * (np.arctan2(offsets[:, 1], offsets[:, 0]) - POSE[2]))))
    if "radius" in figure:
        return (np.hypot(*offsets.T) <= figure["radius"]) & (off <= half_width)
    return (np.abs(offsets).max(axis=1) <= figure["half_side"]) & (off <= half_width)


def grid(num=801, half=42.0):
    """Midpoints of a fine grid of offsets, and the area of a cell."""
    axis = (np.arange(num) + 0.5) * 2.0 * half / num - half
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2), (2.0 * half / num) ** 2


@pytest.mark.parametrize("name", FIGURES)
def test_the_intensity_is_uniform_in_the_figure_and_integrates_to_the_rate(name):
    clutter = models.around_sensor(5.0, "position", **FIGURES[name])
    offsets, _ = grid(num=201)
    intensity = np.exp(clutter.log_intensity_at(offsets + POSE[:2], POSE))
    expected_inside = inside(offsets, FIGURES[name])
    np.testing.assert_array_equal(intensity > 0.0, expected_inside)
    assert np.ptp(intensity[expected_inside]) == pytest.approx(0.0, abs=1e-15)
    fine, fine_cell = grid()
    area = inside(fine, FIGURES[name]).sum() * fine_cell
    assert intensity.max() == pytest.approx(5.0 / area, rel=2e-3)
    assert clutter.rate == 5.0


@pytest.mark.parametrize("name", FIGURES)
def test_bearing_and_range_have_their_jacobian(name):
    by_position = models.around_sensor(5.0, "position", **FIGURES[name])
    polar = models.around_sensor(5.0, "bearing_range", **FIGURES[name])
    offsets = np.random.default_rng(0).uniform(-50.0, 50.0, (50, 2))
    ranges, bearings = np.hypot(*offsets.T), np.arctan2(offsets[:, 1], offsets[:, 0])
    expected = by_position.log_intensity_at(offsets + POSE[:2], POSE) + np.log(ranges)
    found = polar.log_intensity_at(np.column_stack([bearings, ranges]), POSE)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_array_equal(polar.log_intensity_at([[0.6, 0.0], [0.6, -3.0]], POSE), [-np.inf] * 2)


@pytest.mark.parametrize("kind", MEASUREMENTS)
@pytest.mark.parametrize("name", FIGURES)
def test_what_is_drawn_is_uniform_in_the_figure(name, kind):
    clutter, rng = models.around_sensor(2000.0, kind, **FIGURES[name]), np.random.default_rng(4)
    drawn = clutter.sample(POSE, MEASUREMENTS[kind], state_dim=5, rng=rng)
    assert abs(len(drawn) - 2000) < 5.0 * math.sqrt(2000.0)
    assert np.isfinite(clutter.log_intensity_at(drawn, POSE)).all()
    offsets = drawn - POSE[:2] if kind == "position" else drawn[:, 1:] * _direction(drawn[:, 0])
    plain = np.random.default_rng(5).uniform(-40.0, 40.0, (40_000, 2))
    expected = plain[inside(plain, FIGURES[name])]
    for along in (_direction(np.array([POSE[2]]))[0], np.array([0.8, 0.6]), np.array([0.0, 1.0])):
        assert stats.ks_2samp(offsets @ along, expected @ along).pvalue > 1e-3


def _direction(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_quarter_of_a_square_has_a_quarter_of_its_clutter_at_every_heading():
    """Points over a square of which those within 45 degrees of the heading are kept."""
    whole = models.around_sensor(5.0, "position", half_side=2000.0)
    quarter = models.around_sensor(1.25, "position", half_side=2000.0, half_width_rad=math.pi / 4)
    for heading in np.linspace(-4.0, 4.0, 9):
        pose = np.array([10.0, 20.0, heading])
        ahead = pose[:2] + 100.0 * np.array([math.cos(heading), math.sin(heading)])
        density = quarter.log_intensity_at([ahead], pose)[0]
        assert density == pytest.approx(whole.log_intensity_at([ahead], pose)[0], rel=1e-12)
        assert density == pytest.approx(math.log(5.0 / 1.6e7), rel=1e-12)


def test_it_checks_with_its_sensor():
    clutter = models.around_sensor(10.0, "bearing_range", radius=800.0, half_width_rad=1.0)
    noise, detection = models.constant_noise([0.01, 1.0]), models.constant_detection(0.9)
    models.SensorModel(models.bearing_range(), noise, detection, clutter).check([[320.0, -200.0, 0.0, 0.0]], POSE)
