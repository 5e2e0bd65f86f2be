"""Updates of a sensor that passes close by a target, against the posterior on a fine grid; and far away."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.kernels.gaussian.innovation import expect, make_innovation, update_mean, whiten
from vedette.kernels.gaussian.scratch import make_scratch

STD, NOISE = 10.0, np.array([np.deg2rad(1.0), 10.0])  # m of the prior, along each axis; rad and m
COURSE = [(x, 8.0) for x in (-120.0, -70.0, -20.0, 30.0, 80.0)]  # m, past a target near the origin
REGION = models.Region(-1000.0, 1000.0, -1000.0, 1000.0)
AXIS = np.linspace(-6.0 * STD, 6.0 * STD, 201)
X, Y = np.meshgrid(AXIS, AXIS)


def sensor(method: str = "auto", measurement: models.MeasurementModel | None = None) -> models.SensorModel:
    noise, detection = models.constant_noise(NOISE), models.constant_detection(0.9)
    clutter = models.region_clutter(1.0, REGION, "bearing_range")
    return models.SensorModel(measurement or models.bearing_range(), noise, detection, clutter, method)


def scans(rng: Any, course: Any) -> tuple[Any, list[tuple[Any, Any]]]:
    """A target at rest, drawn from the prior, and what is measured of it from each place."""
    target, seen = np.array([*rng.normal(0.0, STD, 2), 0.0, 0.0]), []
    for x, y in course:
        pose = np.array([x, y, 0.0])
        seen.append((pose, models.bearing_range().measure(target, pose)[0] + rng.normal(size=2) * NOISE))
    return target, seen


def updated(own: models.SensorModel, seen: Any) -> tuple[Any, Any]:
    """Mean and covariance after all scans."""
    kernel, innovation, scratch = own.to_kernel(), make_innovation(1, 4, 2), make_scratch(4, 2)
    mean, cov, residual = np.zeros(4), np.diag([STD**2, STD**2, 1.0, 1.0]), np.empty(2)
    for pose, measured in seen:
        expect(kernel, pose, mean, cov, 0, innovation, scratch)
        whiten(innovation, 0, measured, own.measurement.angular, np.inf, residual)
        after = np.empty(4)
        update_mean(innovation, 0, residual, mean, after)
        mean, cov = after, innovation.covs[0].copy()
    return mean, cov


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
    rng, nees, error, least = np.random.default_rng(0), {"auto": [], "ekf": []}, [], []  # type: ignore[var-annotated]
    for _ in range(150):
        target, seen = scans(rng, COURSE)
        for method, found in nees.items():
            mean, cov = updated(sensor(method), seen)
            off = (mean - target)[:2]
            found.append(off @ np.linalg.solve(cov[:2, :2], off))
            if method == "auto":
                error.append(np.hypot(*off))
        least.append(np.hypot(*(exact_mean(seen) - target[:2])))
    # 2 of a Gaussian that is what it says; the extended filter has some that are ten standard deviations off.
    assert np.mean(nees["auto"]) < 4.0
    assert np.mean(nees["ekf"]) > 12.0
    assert np.mean(error) < 1.6 * np.mean(least)


@pytest.mark.parametrize("distance", [100.0, 2000.0])
def test_far_for_its_spread_a_target_is_updated_as_by_the_extended_filter(distance: float) -> None:
    _, seen = scans(np.random.default_rng(1), [(distance, 0.0), (0.0, -distance)])
    for mine, other in zip(updated(sensor(), seen), updated(sensor("ekf"), seen), strict=True):
        assert mine.tobytes() == other.tobytes()


def test_close_for_its_spread_it_is_updated_as_by_the_unscented_filter() -> None:
    _, seen = scans(np.random.default_rng(1), [(40.0, 0.0)])
    for mine, other in zip(updated(sensor(), seen), updated(sensor("ukf"), seen), strict=True):
        assert mine.tobytes() == other.tobytes()


def test_linear_measurements_are_linear_at_any_distance() -> None:
    noise, clutter = models.constant_noise([10.0, 10.0]), models.region_clutter(1.0, REGION, "position")
    places = [
        models.SensorModel(models.position(), noise, models.constant_detection(0.9), clutter, method)
        for method in ("auto", "ekf")
    ]
    seen = [(np.array([1.0, 2.0, 0.0]), np.array([3.0, -4.0]))]
    for mine, other in zip(*(updated(own, seen) for own in places), strict=True):
        assert mine.tobytes() == other.tobytes()
