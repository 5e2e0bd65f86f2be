"""Clutter intensities integrate to their rate and agree with what the samplers draw."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from vedette import models

pytestmark = pytest.mark.lanes

REGION = models.Region(-1000.0, 600.0, -300.0, 900.0)
POSES = {
    "inside": np.array([-200.0, 100.0, 0.0]),
    "on a corner": np.array([-1000.0, -300.0, 0.0]),
    "beside": np.array([900.0, 200.0, 0.0]),
    "diagonal": np.array([-1500.0, 1400.0, 0.0]),
}
MEASUREMENTS = {"bearing_only": models.bearing_only(), "range_only": models.range_only()}
CORNERS = np.array([[x, y] for x in (-1000.0, 600.0) for y in (-300.0, 900.0)])


def intensity(clutter, pose):
    return lambda value: math.exp(clutter.log_intensity_at([[value]], pose)[0])


def breaks(kind, pose):
    """Where the intensity has kinks: towards the corners, and at the distances of corners and sides."""
    offsets = CORNERS - pose[:2]
    if kind == "bearing_only":
        return sorted({-math.pi, math.pi, *np.arctan2(offsets[:, 1], offsets[:, 0])})
    sides = np.abs([REGION.x_min - pose[0], REGION.x_max - pose[0], REGION.y_min - pose[1], REGION.y_max - pose[1]])
    return sorted({0.0, *np.linalg.norm(offsets, axis=1), *sides})


@pytest.mark.parametrize("where", POSES)
@pytest.mark.parametrize("kind", MEASUREMENTS)
def test_one_dimensional_intensity_integrates_to_the_rate(kind, where):
    clutter, pose = models.region_clutter(25.0, REGION, kind), POSES[where]
    edges = breaks(kind, pose)
    function = intensity(clutter, pose)
    total = sum(quad(function, low, high, epsabs=1e-9)[0] for low, high in itertools.pairwise(edges))
    assert total == pytest.approx(25.0, rel=1e-6)


@pytest.mark.parametrize("where", POSES)
@pytest.mark.parametrize("kind", MEASUREMENTS)
def test_one_dimensional_intensity_is_a_marginal_of_bearing_range(kind, where):
    """Along a ray, or round an arc, the bearing-range intensity integrates to the other kind's (midpoint rule)."""
    pose, num = POSES[where], 4000
    both = models.region_clutter(25.0, REGION, "bearing_range")
    clutter = models.region_clutter(25.0, REGION, kind)
    if kind == "bearing_only":
        value, width = math.atan2(220.0 - pose[1], 130.0 - pose[0]), 3000.0
        grid = np.stack([np.full(num, value), (np.arange(num) + 0.5) * width / num], axis=1)
    else:
        value, width = math.hypot(220.0 - pose[1], 130.0 - pose[0]), 2 * math.pi
        grid = np.stack([-math.pi + (np.arange(num) + 0.5) * width / num, np.full(num, value)], axis=1)
    total = np.exp(both.log_intensity_at(grid, pose)).sum() * width / num
    assert math.exp(clutter.log_intensity_at([[value]], pose)[0]) == pytest.approx(total, rel=4e-3)


def test_bearing_range_intensity_is_rate_times_range_over_area():
    clutter, pose = models.region_clutter(25.0, REGION, "bearing_range"), POSES["inside"]
    inside = clutter.log_intensity_at([[0.3, 200.0]], pose)[0]
    assert math.exp(inside) == pytest.approx(25.0 * 200.0 / (1600.0 * 1200.0), rel=1e-12)
    outside = clutter.log_intensity_at([[0.3, 2000.0], [0.3, 0.0], [0.3, -10.0]], pose)
    np.testing.assert_array_equal(outside, [-np.inf] * 3)


def test_position_intensity():
    clutter = models.region_clutter(25.0, REGION, "position")
    values = clutter.log_intensity_at([[0.0, 0.0], [601.0, 0.0]], POSES["inside"])
    np.testing.assert_allclose(values, [math.log(25.0 / 1.92e6), -math.inf])


@pytest.mark.parametrize(("kind", "bearing"), [("bearing_only", 0.0), ("bearing_only", math.pi / 2)])
def test_rays_along_the_axes(kind, bearing):
    clutter = models.region_clutter(25.0, REGION, kind)
    inside, beside = clutter.log_intensity_at([[bearing]], POSES["inside"]), np.array([-5000.0, -5000.0, 0.0])
    assert np.isfinite(inside).all()
    assert clutter.log_intensity_at([[bearing]], beside)[0] == -math.inf


def test_ranges_out_of_reach():
    clutter = models.region_clutter(25.0, REGION, "range_only")
    values = clutter.log_intensity_at([[0.0], [-5.0], [1e5], [100.0]], POSES["beside"])
    np.testing.assert_array_equal(values, [-np.inf] * 4)


SENSORS = {
    "bearing_range": models.bearing_range(),
    "bearing_only": models.bearing_only(),
    "range_only": models.range_only(),
    "position": models.position(),
}


@pytest.mark.parametrize("where", ["inside", "diagonal"])
@pytest.mark.parametrize("kind", SENSORS)
def test_sampler_agrees_with_the_intensity(kind, where):
    """Counts are Poisson; all points lie where the intensity is positive; bins hold what it integrates to there."""
    pose, num_scans = POSES[where], 40
    clutter, rng = models.region_clutter(50.0, REGION, kind), np.random.default_rng(3)
    scans = [clutter.sample(pose, SENSORS[kind], state_dim=4, rng=rng) for _ in range(num_scans)]
    drawn = np.concatenate(scans)
    assert abs(len(drawn) - 50.0 * num_scans) < 4.0 * math.sqrt(50.0 * num_scans)
    assert np.isfinite(clutter.log_intensity_at(drawn, pose)).all()
    if kind in ("bearing_range", "position"):
        return
    edges = np.quantile(drawn[:, 0], np.linspace(0.0, 1.0, 9))
    edges[[0, -1]] = [breaks(kind, pose)[0], breaks(kind, pose)[-1]]
    function = intensity(clutter, pose)
    shares = [quad(function, low, high, limit=200)[0] / 50.0 for low, high in itertools.pairwise(edges)]
    counts = np.histogram(drawn[:, 0], edges)[0]
    assert stats.chisquare(counts, np.array(shares) / sum(shares) * counts.sum()).pvalue > 1e-3


def test_sampler_draws_uniform_positions():
    pose, rng = POSES["inside"], np.random.default_rng(4)
    clutter = models.region_clutter(4000.0, REGION, "bearing_range")
    drawn = clutter.sample(pose, models.bearing_range(), state_dim=4, rng=rng)
    x = pose[0] + drawn[:, 1] * np.cos(drawn[:, 0])
    y = pose[1] + drawn[:, 1] * np.sin(drawn[:, 0])
    assert stats.kstest((x - REGION.x_min) / 1600.0, "uniform").pvalue > 1e-3
    assert stats.kstest((y - REGION.y_min) / 1200.0, "uniform").pvalue > 1e-3


def test_box_clutter():
    clutter = models.measurement_space_clutter(15.0, [-math.pi / 2, 0.0], [math.pi / 2, 2000.0])
    values = clutter.log_intensity_at([[0.0, 1000.0], [2.0, 1000.0], [0.0, 2001.0], [0.0, -1.0]], np.zeros(3))
    np.testing.assert_allclose(values, [math.log(15.0 / (2000.0 * math.pi)), -math.inf, -math.inf, -math.inf])
    drawn = clutter.sample(np.zeros(3), models.bearing_range(), state_dim=5, rng=np.random.default_rng(0))
    assert drawn.shape[1] == 2
    assert np.isfinite(clutter.log_intensity_at(drawn, np.zeros(3))).all()


def test_box_clutter_across_the_cut_of_the_circle():
    clutter = models.measurement_space_clutter(500.0, [math.radians(170)], [math.radians(200)], angular=[True])
    values = clutter.log_intensity_at(np.radians([[175.0], [-165.0], [-155.0], [0.0]]), np.zeros(3))
    np.testing.assert_array_equal(np.isfinite(values), [True, True, False, False])
    drawn = clutter.sample(np.zeros(3), models.bearing_only(), state_dim=4, rng=np.random.default_rng(0))
    assert (np.abs(drawn) <= math.pi).all()
    assert (drawn < 0).any()
    assert np.isfinite(clutter.log_intensity_at(drawn, np.zeros(3))).all()


@pytest.mark.parametrize("clutter", [models.region_clutter(0.0, REGION, "position")])
def test_no_clutter(clutter):
    assert clutter.log_intensity_at([[0.0, 0.0]], np.zeros(3))[0] == -math.inf
    assert clutter.sample(np.zeros(3), models.position(), state_dim=4, rng=np.random.default_rng(0)).shape == (0, 2)


def test_same_seed_same_clutter():
    clutter = models.region_clutter(25.0, REGION, "bearing_range")
    first, second = (
        clutter.sample(POSES["inside"], models.bearing_range(), state_dim=4, rng=np.random.default_rng(9))
        for _ in range(2)
    )
    np.testing.assert_array_equal(first, second)


def test_region():
    assert REGION.area == 1600.0 * 1200.0
    np.testing.assert_array_equal(REGION.contains([[0.0, 0.0], [600.0, 900.0], [601.0, 0.0]]), [True, True, False])
    assert REGION.contains(REGION.sample(100, rng=np.random.default_rng(0))).all()


BUILT_IN = {
    "region, bearing_range": models.region_clutter(25.0, REGION, "bearing_range"),
    "region, bearing_only": models.region_clutter(25.0, REGION, "bearing_only"),
    "region, range_only": models.region_clutter(25.0, REGION, "range_only"),
    "region, position": models.region_clutter(25.0, REGION, "position"),
    "disc, bearing_range": models.around_sensor(25.0, "bearing_range", radius=500.0),
    "square, position": models.around_sensor(25.0, "position", half_side=500.0, half_width_rad=0.7),
    "box, bearing_range": models.measurement_space_clutter(25.0, [-3.0, 100.0], [3.0, 900.0], angular=[True, False]),
}


@pytest.mark.parametrize("name", BUILT_IN)
def test_at_a_corrected_measurement_the_density_is_that_at_the_raw_one(name):
    clutter, pose, moved, kind = BUILT_IN[name], POSES["inside"], np.array([40.0, -70.0]), name.split(", ")[1]
    bias = {"bearing_range": [0.2, -60.0], "bearing_only": [0.2], "range_only": [-60.0], "position": [30.0, -20.0]}
    taken, measurement = np.array(bias[kind]), getattr(models, kind)()
    raw = clutter.sample(pose, measurement, state_dim=4, rng=np.random.default_rng(0))
    corrected = models.clutter.at_raw_measurements(clutter, taken, moved)
    found = corrected.log_intensity_at(raw - taken, pose - [*moved, 0.0])
    np.testing.assert_allclose(found, clutter.log_intensity_at(raw, pose), rtol=1e-9)
    assert np.isfinite(found).all()
    assert found.size > 5
