"""Means of the probability of detection over a Gaussian: closed forms, rays and nodes against plain quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.special import ndtr

from vedette import models
from vedette.errors import InputError, ModelError
from vedette.kernels.gaussian.position_integrals import spread_nodes

pytestmark = pytest.mark.lanes

POSE = np.array([40.0, -30.0, 0.7])
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
ELONGATED = np.array([[900.0, -350.0], [-350.0, 250.0]])
EDGE = POSE[:2] + 500.0 * np.array([math.cos(0.7), math.sin(0.7)])


def sensor(detection, **options):
    clutter = models.region_clutter(2.0, REGION, "position")
    return models.SensorModel(models.position(), models.constant_noise([5.0, 5.0]), detection, clutter, **options)


def state_cov(position_cov):
    """Covariance of [px, py, vx, vy] with correlations between position and velocity."""
    cov = np.zeros((4, 4))
    cov[:2, :2] = position_cov
    cov[2:, 2:] = 9.0 * np.eye(2)
    cov[0, 2] = cov[2, 0] = 0.3 * math.sqrt(9.0 * position_cov[0, 0])
    return cov


def mean_detection(detection, centre, position_cov, pose=POSE):
    mean = np.array([*centre, 3.0, -1.0])
    return sensor(detection).mean_detection([mean], [state_cov(position_cov)], pose)[0]


def by_gauss_hermite(detection, centre, position_cov, pose=POSE, order=48):
    """Dense product rule: exact to the last digits where detection is smooth over the Gaussian."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(order)
    x, y = np.meshgrid(nodes, nodes)
    points = np.column_stack([x.ravel(), y.ravel()]) @ np.linalg.cholesky(position_cov).T + centre
    states = np.hstack([points, np.zeros((len(points), 2))])
    return float(np.outer(weights, weights).ravel() @ detection.prob(states, pose) / weights.sum() ** 2)


def by_polar_quadrature(centre, position_cov, max_range, middle, half_width, pose=POSE):
    """Share of the Gaussian in a sector, by adaptive quadrature of its density in polar coordinates."""
    offset, precision = centre - pose[:2], np.linalg.inv(position_cov)
    norm = 1.0 / (2.0 * math.pi * math.sqrt(np.linalg.det(position_cov)))

    def density(rho, angle):
        x = rho * math.cos(angle) - offset[0], rho * math.sin(angle) - offset[1]
        square = x[0] * x[0] * precision[0, 0] + 2 * x[0] * x[1] * precision[0, 1] + x[1] * x[1] * precision[1, 1]
        return norm * rho * math.exp(-0.5 * square)

    reach, distance = 8.0 * math.sqrt(np.linalg.eigvalsh(position_cov)[-1]), math.hypot(*offset)
    near, far = max(distance - reach, 0.0), min(distance + reach, max_range)
    spread = math.asin(reach / distance) if distance > reach else math.pi
    total = 0.0
    for turn in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
        toward = math.atan2(offset[1], offset[0]) + turn
        low, high = max(middle - half_width, toward - spread), min(middle + half_width, toward + spread)
        if low < high and near < far:
            total += dblquad(density, low, high, near, far, epsabs=1e-9, epsrel=1e-9)[0]
    return total


@pytest.mark.parametrize("sigma", [40.0, 300.0, 10000.0])
@pytest.mark.parametrize("centre", [EDGE, POSE[:2] + 3.0, POSE[:2]])
def test_the_mean_of_gaussian_detection_is_exact(sigma, centre):
    detection = models.gaussian_detection(sigma)
    expected = by_gauss_hermite(detection, centre, 0.25 * ELONGATED)
    assert mean_detection(detection, centre, 0.25 * ELONGATED) == pytest.approx(expected, abs=1e-9, rel=1e-10)


def test_the_mean_of_constant_detection_is_it():
    assert mean_detection(models.constant_detection(0.7), EDGE, ELONGATED) == 0.7


@pytest.mark.parametrize("spread", [0.01, 1.0, 60.0])
@pytest.mark.parametrize("further", [-30.0, 0.0, 8.0, 500.0])
def test_the_share_within_a_range(spread, further):
    centre = EDGE + further * np.array([math.cos(0.7), math.sin(0.7)])
    share = by_polar_quadrature(centre, spread * ELONGATED, 500.0, 0.0, math.pi)
    detection = models.limited_range(0.9, 500.0, outside=0.1)
    assert mean_detection(detection, centre, spread * ELONGATED) == pytest.approx(0.1 + 0.8 * share, abs=2e-6)


def share_of_disc(centre, long_std, short_std, direction, radius):
    """Of a Gaussian with its long axis along `direction`: sums across it of the closed form along it."""
    along = np.array([math.cos(direction), math.sin(direction)])
    across = np.array([-along[1], along[0]])
    z = np.linspace(-8.0, 8.0, 200_001)
    off = (centre - POSE[:2]) @ across + short_std * z
    half = np.sqrt(np.maximum(radius**2 - off**2, 0.0))
    at = (centre - POSE[:2]) @ along
    inner = np.where(abs(off) <= radius, ndtr((half - at) / long_std) - ndtr((-half - at) / long_std), 0.0)
    return float((inner * np.exp(-0.5 * z**2)).sum() * (z[1] - z[0]) / math.sqrt(2.0 * math.pi))


@pytest.mark.parametrize("ratio", [3.0, 10.0, 40.0, 400.0])
@pytest.mark.parametrize("direction", [0.0, 0.7, 1.6, 2.5])
@pytest.mark.parametrize("further", [-40.0, 0.0, 30.0])
def test_the_share_of_a_long_and_thin_gaussian(ratio, direction, further):
    """As of a target far off whose bearing is far less certain than its range."""
    centre, std = EDGE + further * np.array([math.cos(0.7), math.sin(0.7)]), 80.0
    axes = np.array([[math.cos(direction), -math.sin(direction)], [math.sin(direction), math.cos(direction)]])
    cov = axes @ np.diag([std**2, (std / ratio) ** 2]) @ axes.T
    share = share_of_disc(centre, std, std / ratio, direction, 500.0)
    assert mean_detection(models.limited_range(0.9, 500.0), centre, cov) == pytest.approx(0.9 * share, abs=5e-6)


@pytest.mark.parametrize("half_width", [0.2, 1.2, 2.5, math.pi])
@pytest.mark.parametrize(
    "offset", [(300.0, 100.0), (-400.0, 20.0), (10.0, 5.0), (-30.0, -490.0), (383.0, 322.0), (0.0, 0.0)]
)
def test_the_share_within_a_sector(offset, half_width):
    centre = POSE[:2] + offset
    share = by_polar_quadrature(centre, ELONGATED, 500.0, 0.7, half_width)
    detection = models.limited_sector(0.9, 500.0, half_width, outside=0.05)
    assert mean_detection(detection, centre, ELONGATED) == pytest.approx(0.05 + 0.85 * share, abs=2e-6)
    camera, pose = models.camera(0.9, 500.0), np.array([*POSE[:2], 0.0, 0.7, half_width])
    assert mean_detection(camera, centre, ELONGATED, pose) == pytest.approx(0.9 * share, abs=2e-6)


def test_a_camera_that_zooms_sees_farther():
    zoomed = np.array([*POSE[:2], 0.0, 0.7, 0.1])
    camera = models.camera(0.9, 300.0, reference_half_width_rad=0.2)
    expected = mean_detection(models.limited_sector(0.9, 600.0, 0.1), EDGE, ELONGATED, np.array([*POSE[:2], 0.7]))
    assert mean_detection(camera, EDGE, ELONGATED, zoomed) == pytest.approx(expected, abs=1e-12)
    assert mean_detection(camera, EDGE, ELONGATED, np.array([*POSE[:2], 0.0, 0.7, 0.0])) == 0.0


def test_a_target_that_is_known_exactly_is_seen_as_at_its_place():
    detection = models.limited_sector(0.9, 500.0, 1.0)
    for angle, expected in ((0.7, 0.9), (2.0, 0.0)):
        centre = POSE[:2] + 200.0 * np.array([math.cos(angle), math.sin(angle)])
        assert mean_detection(detection, centre, 1e-6 * np.eye(2)) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("half_width", [0.5, math.pi])
def test_far_from_the_edge_there_is_nothing_below_0_or_above_1(half_width):
    detection = models.limited_sector(0.9, 500.0, half_width)
    for distance in np.linspace(1.0, 900.0, 300):
        centre = POSE[:2] + distance * np.array([math.cos(0.71), math.sin(0.71)])
        assert 0.0 <= mean_detection(detection, centre, 25.0 * np.eye(2)) <= 0.9


def test_a_gaussian_that_is_as_good_as_a_line():
    direction = np.array([math.cos(0.7), math.sin(0.7)])
    flat = 900.0 * np.outer(direction, direction)
    detection = models.limited_range(0.9, 500.0)
    assert mean_detection(detection, EDGE, flat) == pytest.approx(0.45, abs=1e-3)


def test_nodes_have_the_moments_of_the_gaussian():
    nodes = spread_nodes()
    weights, points = nodes[:, 0], nodes[:, 1:]
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(weights @ points, 0.0, atol=1e-14)
    np.testing.assert_allclose(points.T @ (points * weights[:, None]), np.eye(2), atol=1e-13)


@models.model_function("prob_detection")
def beyond_the_edge(state, pose, params):
    return params[0] if math.hypot(state[0] - pose[0], state[1] - pose[1]) <= params[1] else 0.0


@pytest.mark.parametrize("further", [-40.0, -10.0, 0.0, 10.0, 40.0])
def test_nodes_at_a_range_edge(further):
    """A user's own function has no closed form; its nodes part the Gaussian as many drawn points do."""
    centre = EDGE + further * np.array([math.cos(0.7), math.sin(0.7)])
    drawn = np.random.default_rng(3).multivariate_normal(centre, ELONGATED, 40_000)
    expected = 0.9 * (np.linalg.norm(drawn - POSE[:2], axis=1) <= 500.0).mean()
    detection = models.DetectionModel(beyond_the_edge, np.array([0.9, 500.0]))
    assert mean_detection(detection, centre, ELONGATED) == pytest.approx(expected, abs=0.05)
    assert mean_detection(models.limited_range(0.9, 500.0), centre, ELONGATED) == pytest.approx(expected, abs=0.01)


def test_nodes_where_detection_falls_off_slowly():
    detection = models.soft_sector(0.95, 500.0, 1.0, range_slope=0.02, angle_slope=4.0)
    expected = by_gauss_hermite(detection, EDGE, ELONGATED)
    assert mean_detection(detection, EDGE, ELONGATED) == pytest.approx(expected, abs=3e-3)


def test_nodes_count_where_detection_hardly_differs():
    """The mean of planners is over all nodes, also where P_D differs by less than the .01 that filters pass over."""
    detection, centre = (
        models.soft_sector(0.95, 500.0, 1.0, range_slope=0.02, angle_slope=4.0),
        np.array([270.0, 30.0]),
    )
    nodes = spread_nodes()
    states = np.zeros((len(nodes), 4))
    states[:, :2] = nodes[:, 1:] @ np.linalg.cholesky(0.002 * ELONGATED).T + centre
    at_nodes = detection.prob(states, POSE)
    assert 0.0 < np.ptp(at_nodes) < 0.01
    assert mean_detection(detection, centre, 0.002 * ELONGATED) == pytest.approx(nodes[:, 0] @ at_nodes, rel=1e-12)


def test_several_gaussians_at_once_and_none():
    detection, covs = models.limited_range(0.9, 500.0), np.stack([state_cov(ELONGATED), state_cov(4.0 * ELONGATED)])
    means = np.array([[*EDGE, 0.0, 0.0], [*POSE[:2], 1.0, 1.0]])
    both = sensor(detection).mean_detection(means, covs, POSE)
    one_by_one = [sensor(detection).mean_detection([m], [c], POSE)[0] for m, c in zip(means, covs, strict=True)]
    np.testing.assert_array_equal(both, one_by_one)
    assert sensor(detection).mean_detection(np.empty((0, 4)), np.empty((0, 4, 4)), POSE).shape == (0,)


@models.model_function("mean_prob_detection")
def twice(mean, cov, pose, params):
    return 2.0


@models.model_function("prob_detection")
def two_beyond(state, pose, params):
    return 2.0 if state[0] > params[0] else 0.0


def test_what_is_no_probability_is_refused():
    with pytest.raises(ModelError, match="mean_prob_detection function 'twice'"):
        models.DetectionModel(beyond_the_edge, np.array([0.9, 500.0]), twice).check(np.zeros(4), POSE)
    for detection in (
        models.DetectionModel(beyond_the_edge, np.array([0.9, 1.0]), twice),
        models.DetectionModel(two_beyond, np.array([45.0])),
    ):
        with pytest.raises(ModelError, match="not in"):
            mean_detection(detection, POSE[:2], ELONGATED)


def test_other_arguments_are_named():
    with pytest.raises(InputError, match="mean_function: expected a function decorated"):
        models.DetectionModel(beyond_the_edge, np.array([0.9, 1.0]), beyond_the_edge)
    with pytest.raises(InputError, match="detection_at: expected one of centre, mean; got middle"):
        sensor(models.constant_detection(0.9), detection_at="middle")
    with pytest.raises(InputError, match="covs"):
        sensor(models.constant_detection(0.9)).mean_detection(np.zeros((2, 4)), np.zeros((1, 4, 4)), POSE)
