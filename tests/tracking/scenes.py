"""Small worlds for trackers: targets at constant velocity, and sensors of their positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette import models
from vedette.densities import LMB
from vedette.filters import Limits, LmbFilter
from vedette.kernels.base.types import Floats

SURVIVAL = 0.97


def targets(existence: Sequence[float] = (0.5, 0.3), measured: models.MeasurementBirth | None = None) -> Any:
    """Births at step 1, at (0, 0), (100, 0), ... m."""
    num = len(existence)
    means = np.zeros((num, 4))
    means[:, 0] = 100.0 * np.arange(num)
    birth = models.BirthModel(
        np.array(existence), means, np.tile(np.diag([400.0, 400.0, 25.0, 25.0]), (num, 1, 1)), frozenset({1}), measured
    )
    return models.TargetModel(models.constant_velocity(1.0), models.constant_survival(SURVIVAL), birth)


def sensor(std: float = 5.0, prob: float = 0.8, rate: float = 0.0, max_range: float | None = None) -> Any:
    """Of positions anywhere, or up to a range."""
    bound = np.full(2, 1000.0)
    seen = models.constant_detection(prob) if max_range is None else models.limited_range(prob, max_range)
    return models.SensorModel(
        models.position(),
        models.constant_noise([std, std]),
        seen,
        models.measurement_space_clutter(rate, -bound, bound),
    )


def scans_of(truth: Floats, sensors: Sequence[Any], poses: Floats, rng: np.random.Generator) -> list[Any]:
    """One scan a sensor of (n, 4) targets."""
    from vedette.simulation import simulate_scan

    return [simulate_scan(truth, pose, one, rng=rng).measurements for one, pose in zip(sensors, poses, strict=True)]


def filters(world: Any, sensors: Sequence[Any], **limits: Any) -> tuple[LmbFilter, ...]:
    own = {"max_components": 1, **limits}
    return tuple(LmbFilter(world, one, Limits(**own)) for one in sensors)


def rngs(num: int, seed: int = 0) -> list[np.random.Generator]:
    return [np.random.default_rng((seed, s)) for s in range(num)]


def assert_same_lmb(one: LMB, other: LMB, tolerance: float) -> None:
    np.testing.assert_array_equal(one.tracks.labels, other.tracks.labels)
    np.testing.assert_allclose(one.existence_logit, other.existence_logit, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(one.tracks.means, other.tracks.means, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(one.tracks.covs, other.tracks.covs, rtol=tolerance, atol=tolerance)


def lmb(labels: Any, existence: Any, means: Any, covs: Any) -> LMB:
    return LMB.from_bernoullis(labels, existence, means, covs)


__all__ = ["assert_same_lmb", "filters", "lmb", "rngs", "scans_of", "sensor", "targets"]
