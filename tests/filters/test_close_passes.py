"""Updates by measurements that bend over a prior, against the posterior on a fine grid; and by those that do not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reference.polar import posterior
from vedette import models
from vedette.filters import DeltaGlmbFilter, LmbFilter
from vedette.kernels.base.types import RowNoise
from vedette.kernels.gaussian.innovation import expect, update_mean, whiten
from vedette.kernels.gaussian.relinearisation import Pair, make_pair_work, relinearise

STD, NOISE = 10.0, np.array([np.deg2rad(1.0), 10.0])  # m of the prior, along each axis; rad and m
COURSE = [(x, 8.0) for x in (-120.0, -70.0, -20.0, 30.0, 80.0)]  # m, past a target near the origin
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
AXIS = np.linspace(-6.0 * STD, 6.0 * STD, 201)
X, Y = np.meshgrid(AXIS, AXIS)


def sensor(
    method: str = "auto", measurement: models.MeasurementModel | None = None, noise: Any = NOISE
) -> models.SensorModel:
    detection, clutter = models.constant_detection(0.9), models.region_clutter(1.0, REGION, "bearing_range")
    own = measurement or models.bearing_range()
    return models.SensorModel(own, models.constant_noise(noise), detection, clutter, method)


def scans(rng: Any, course: Any) -> tuple[Any, list[tuple[Any, Any]]]:
    """A target at rest, drawn from the prior, and what is measured of it from each place."""
    target, seen = np.array([*rng.normal(0.0, STD, 2), 0.0, 0.0]), []
    for x, y in course:
        pose = np.array([x, y, 0.0])
        seen.append((pose, models.bearing_range().measure(target, pose)[0] + rng.normal(size=2) * NOISE))
    return target, seen


NO_NOISE = RowNoise(np.empty((0, 2, 2)), np.empty((0, 2, 2)))


def update(own: models.SensorModel, pose: Any, mean: Any, cov: Any, measured: Any) -> tuple[Any, Any, float]:
    """Mean, covariance and log likelihood of a measurement, as filters take them."""
    kernel, work, after = own.to_kernel(), make_pair_work(len(mean), own.meas_dim), np.empty(len(mean))
    innovation, residual = work.innovation, work.scratch.residual
    expect(kernel, pose, mean, cov, 0, innovation, work.scratch)
    if innovation.bends[0]:
        distance = relinearise(kernel, Pair(pose, mean, cov, measured, NO_NOISE), work)
    else:
        distance = whiten(innovation, 0, measured, own.measurement.periods, np.inf, residual)
    update_mean(innovation, 0, residual, mean, after)
    return after, innovation.covs[0].copy(), innovation.log_norm[0] - 0.5 * distance


def updated(own: models.SensorModel, seen: Any) -> tuple[Any, Any]:
    """Mean and covariance after all scans."""
    mean, cov = np.zeros(4), np.diag([STD**2, STD**2, 1.0, 1.0])
    for pose, measured in seen:
        mean, cov, _ = update(own, pose, mean, cov, measured)
    return mean, cov


def nees(mean: Any, cov: Any, target: Any) -> float:
    """Normalised error squared of the position."""
    off = (mean - target)[:2]
    return float(off @ np.linalg.solve(cov[:2, :2], off))


def exact_mean(seen: Any) -> Any:
    """Of the position, by quadrature."""
    log_density = -(X**2 + Y**2) / (2.0 * STD**2)
    for pose, measured in seen:
        off = measured[0] - np.arctan2(Y - pose[1], X - pose[0])
        far = measured[1] - np.hypot(X - pose[0], Y - pose[1])
        log_density -= 0.5 * ((np.remainder(off + np.pi, 2.0 * np.pi) - np.pi) / NOISE[0]) ** 2
        log_density -= 0.5 * (far / NOISE[1]) ** 2
    density = np.exp(log_density - log_density.max())
    return np.array([(density * X).sum(), (density * Y).sum()]) / density.sum()


def test_a_close_pass_leaves_an_error_that_the_covariance_knows() -> None:
    rng, errors, error, least = np.random.default_rng(0), {"auto": [], "ekf": []}, [], []  # type: ignore[var-annotated]
    for _ in range(150):
        target, seen = scans(rng, COURSE)
        for method, found in errors.items():
            mean, cov = updated(sensor(method), seen)
            found.append(nees(mean, cov, target))
            if method == "auto":
                error.append(np.hypot(*(mean - target)[:2]))
        least.append(np.hypot(*(exact_mean(seen) - target[:2])))
    # 2 of a Gaussian that is what it says; the extended filter has some that are ten standard deviations off.
    assert np.mean(errors["auto"]) < 4.0
    assert np.mean(errors["ekf"]) > 12.0
    assert np.mean(error) < 1.6 * np.mean(least)


@pytest.mark.parametrize("distance", [200.0, 2000.0])
def test_far_for_its_spread_a_target_is_updated_as_by_the_extended_filter(distance: float) -> None:
    _, seen = scans(np.random.default_rng(1), [(distance, 0.0), (0.0, -distance)])
    for mine, other in zip(updated(sensor(), seen), updated(sensor("ekf"), seen), strict=True):
        assert mine.tobytes() == other.tobytes()


def prior(std: float, distance: float) -> tuple[Any, Any]:
    """A position at a distance from the origin, twice as certain along one slanted axis, and its velocity."""
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    cov = np.diag([0.0, 0.0, 4.0, 4.0])
    cov[:2, :2] = turn @ np.diag([std**2, 0.25 * std**2]) @ turn.T
    return np.array([0.8 * distance, -0.6 * distance, 1.0, 2.0]), cov


# Distance in m, noise of the bearing in degrees and of the range in m, standard deviation of the prior in m.
BENT = [
    (365.0, 0.17, 10.0, 50.0),
    (1500.0, 0.1, 10.0, 150.0),
    (1500.0, 0.05, 1.0, 500.0),
    (5000.0, 1.0, 50.0, 500.0),
    (20000.0, 0.05, 1.0, 500.0),
    (20000.0, 3.0, 1.0, 500.0),
    (100.0, 0.5, 1.0, 20.0),
    (100.0, 3.0, 10.0, 50.0),
    (200.0, 0.2, 5.0, 150.0),
]


@pytest.mark.parametrize("case", BENT)
def test_a_measurement_that_bends_gives_the_moments_and_likelihood_of_the_posterior(case: Any) -> None:
    distance, bearing, reach, std = case
    noise, rng = np.array([np.deg2rad(bearing), reach]), np.random.default_rng(2)
    own, pose, (mean, cov) = sensor(noise=noise), np.zeros(3), prior(std, distance)
    shifts, off_likelihoods, errors = [], [], []
    for _ in range(60):
        target = rng.multivariate_normal(mean, cov)
        measured = models.bearing_range().measure(target, pose)[0] + rng.normal(size=2) * noise
        found, spread, log_likelihood = update(own, pose, mean, cov, measured)
        exact, exact_spread, exact_likelihood = posterior(mean[:2], cov[:2, :2], pose[:2], measured, noise)
        shifts.append(nees(found, np.pad(exact_spread, (0, 2)), np.pad(exact, (0, 2))))
        off_likelihoods.append(abs(log_likelihood - exact_likelihood))
        errors.append(nees(found, spread, target))
    assert np.median(shifts) < 0.05
    assert np.median(off_likelihoods) < 0.05
    assert np.mean(errors) < 4.0


@pytest.mark.parametrize("kind", [DeltaGlmbFilter, LmbFilter])
def test_a_filter_takes_the_update_of_the_pair(kind: Any) -> None:
    noise, pose, (mean, cov) = np.array([np.deg2rad(0.1), 10.0]), np.zeros(3), prior(150.0, 1500.0)
    own, birth = sensor(noise=noise), models.BirthModel(np.array([0.9]), mean[np.newaxis], cov[np.newaxis])
    targets = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.99), birth)
    measured = models.bearing_range().measure(mean + np.array([60.0, 90.0, 0.0, 0.0]), pose)
    local = kind(targets, own)
    belief, _ = local.step(local.initial(), measured, pose, 1.0, 1, rng=np.random.default_rng(0))
    found, spread, _ = update(own, pose, mean, cov, measured[0])
    # One Gaussian of an LMB is of the update and, with little weight, of a miss.
    slack = 1e-12 if kind is DeltaGlmbFilter else 0.2
    nearest = np.argmin(np.hypot(*(belief.tracks.means - found)[:, :2].T))
    np.testing.assert_allclose(belief.tracks.means[nearest], found, rtol=slack)
    np.testing.assert_allclose(np.diag(belief.tracks.covs[nearest]), np.diag(spread), rtol=slack)


def test_named_methods_never_linearise_again() -> None:
    mean, cov = prior(150.0, 1500.0)
    for method in ("ekf", "ukf", "ckf"):
        own, work = sensor(method, noise=NOISE / 10.0), make_pair_work(4, 2)
        expect(own.to_kernel(), np.zeros(3), mean, cov, 0, work.innovation, work.scratch)
        assert not work.innovation.bends[0]


def test_linear_measurements_are_linear_at_any_distance() -> None:
    noise, clutter = models.constant_noise([10.0, 10.0]), models.region_clutter(1.0, REGION, "position")
    places = [
        models.SensorModel(models.position(), noise, models.constant_detection(0.9), clutter, method)
        for method in ("auto", "ekf")
    ]
    seen = [(np.array([1.0, 2.0, 0.0]), np.array([3.0, -4.0]))]
    for mine, other in zip(*(updated(own, seen) for own in places), strict=True):
        assert mine.tobytes() == other.tobytes()
