"""Textbook Kalman filters: linear, extended, unscented (2n+1 points) and cubature (2n points), in plain NumPy."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from reference import Floats

Function = Callable[[Floats], Floats]


def gaussian_pdf(point: Floats, mean: Floats, cov: Floats) -> float:
    """N(point; mean, cov)."""
    deviation = point - mean
    exponent = -0.5 * deviation @ np.linalg.inv(cov) @ deviation
    return float(np.exp(exponent) / np.sqrt(np.linalg.det(2.0 * np.pi * cov)))


def wrap(residual: Floats, angular: Sequence[bool]) -> Floats:
    """The residual with its angular components brought to (-pi, pi]."""
    wrapped = np.array(residual, dtype=float)
    for i, is_angle in enumerate(angular):
        if is_angle:
            wrapped[i] = np.pi - (np.pi - wrapped[i]) % (2.0 * np.pi)
    return wrapped


def sigma_points(mean: Floats, cov: Floats, kappa: float) -> tuple[list[Floats], list[float]]:
    """The mean and 2n points at +- sqrt(n + kappa) times the columns of the Cholesky factor, and their weights."""
    n = len(mean)
    columns = np.linalg.cholesky(cov).T * np.sqrt(n + kappa)
    points = [mean] + [mean + column for column in columns] + [mean - column for column in columns]
    return points, [kappa / (n + kappa)] + [0.5 / (n + kappa)] * (2 * n)


def _unscented_moments(
    mean: Floats, cov: Floats, function: Function, kappa: float, angular: Sequence[bool]
) -> tuple[Floats, Floats, Floats]:
    """Mean and covariance of the image, and the covariance of state and image. Angles are averaged near the mean's."""
    points, weights = sigma_points(mean, cov, kappa)
    centre = function(mean)
    images = [centre + wrap(function(point) - centre, angular) for point in points]
    image_mean = sum(w * image for w, image in zip(weights, images, strict=True))
    image_cov = sum(w * np.outer(y - image_mean, y - image_mean) for w, y in zip(weights, images, strict=True))
    cross = sum(w * np.outer(x - mean, y - image_mean) for w, x, y in zip(weights, points, images, strict=True))
    return np.asarray(image_mean), np.asarray(image_cov), np.asarray(cross)


def ekf_predict(
    mean: Floats, cov: Floats, transition: Function, jacobian: Function, noise_cov: Floats
) -> tuple[Floats, Floats]:
    """Linearised prediction; exact for a linear transition."""
    f = jacobian(mean)
    return transition(mean), f @ cov @ f.T + noise_cov


def sigma_predict(
    mean: Floats, cov: Floats, transition: Function, noise_cov: Floats, *, kappa: float
) -> tuple[Floats, Floats]:
    """Unscented prediction; cubature with `kappa` 0."""
    predicted, spread, _ = _unscented_moments(mean, cov, transition, kappa, [False] * len(mean))
    return predicted, spread + noise_cov


Update = tuple[Floats, Floats, float]


def _kalman_update(mean: Floats, cov: Floats, residual: Floats, cross: Floats, innovation_cov: Floats) -> Update:
    gain = cross @ np.linalg.inv(innovation_cov)
    likelihood = gaussian_pdf(residual, np.zeros(len(residual)), innovation_cov)
    return mean + gain @ residual, cov - gain @ innovation_cov @ gain.T, likelihood


def ekf_update(
    mean: Floats,
    cov: Floats,
    measurement: Floats,
    function: Function,
    jacobian: Function,
    noise_cov: Floats,
    angular: Sequence[bool],
) -> Update:
    """Linearised update: mean, covariance and the likelihood of the measurement; exact for a linear measurement."""
    h = jacobian(mean)
    residual = wrap(measurement - function(mean), angular)
    return _kalman_update(mean, cov, residual, cov @ h.T, h @ cov @ h.T + noise_cov)


def sigma_update(
    mean: Floats,
    cov: Floats,
    measurement: Floats,
    function: Function,
    noise_cov: Floats,
    angular: Sequence[bool],
    *,
    kappa: float,
) -> Update:
    """Unscented update: mean, covariance and the likelihood of the measurement; cubature with `kappa` 0."""
    predicted, spread, cross = _unscented_moments(mean, cov, function, kappa, angular)
    residual = wrap(measurement - predicted, angular)
    return _kalman_update(mean, cov, residual, cross, spread + noise_cov)
