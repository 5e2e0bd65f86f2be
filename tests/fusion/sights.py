"""Sensors that see part of a plane, and beliefs about targets in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vedette.densities import LMB
from vedette.fusion import FieldsOfView
from vedette.models import (
    SensorModel,
    constant_detection,
    constant_noise,
    limited_range,
    measurement_space_clutter,
    position,
)

LABELS: tuple[tuple[int, int], ...] = ((1, 0), (1, 1), (3, 0))
PLACES = np.array([[0.0, 0.0], [400.0, 0.0], [800.0, 0.0]])
BLIND = constant_detection(0.0)


def sensor(detection: Any) -> SensorModel:
    clutter = measurement_space_clutter(1.0, [-2000.0, -2000.0], [2000.0, 2000.0])
    return SensorModel(position(), constant_noise([1.0, 1.0]), detection, clutter)


def informed(*chances: float) -> NDArray[np.float64]:
    """Weights by views of sensors that detect so much: of the information about an existence of .999."""
    informations = np.array([chance / (1.0 - 0.999 * chance) for chance in chances])
    return np.asarray(informations / informations.sum())


def views(
    detections: Sequence[Any],
    at: Sequence[float] | None = None,
    scanned: Sequence[bool] | None = None,
    prediction: Any = None,
) -> FieldsOfView:
    """Sensors on the x axis; a number is a detection probability within 150 m."""
    models = tuple(sensor(limited_range(d, 150.0) if isinstance(d, float) else d) for d in detections)
    poses = np.array([[x, 0.0, 0.0] for x in (at or [0.0] * len(models))])
    return FieldsOfView(models, poses, tuple(scanned or [True] * len(models)), prediction)


def belief(existence: Sequence[float], rng: np.random.Generator, labels: Sequence[int] = (0, 1, 2)) -> LMB:
    """Some of the three labels, each within a few metres of its place."""
    means = PLACES[list(labels)] + rng.normal(size=(len(labels), 2))
    covs = np.array([np.diag(rng.uniform(0.2, 1.0, 2)) for _ in labels])
    return LMB.from_bernoullis([LABELS[i] for i in labels], existence, means, covs)


def moments(density: LMB) -> dict[tuple[int, int], tuple[float, NDArray[np.float64], NDArray[np.float64]]]:
    """Logit, mean and covariance of each label, of single Gaussians."""
    tracks = density.tracks
    assert len(tracks.log_weights) == tracks.num_tracks
    labels = [(int(a), int(b)) for a, b in tracks.labels]
    return dict(zip(labels, zip(density.existence_logit, tracks.means, tracks.covs, strict=True), strict=True))


def assert_same_bits(one: LMB, other: LMB) -> None:
    assert one.existence_logit.tobytes() == other.existence_logit.tobytes()
    for name in ("labels", "offsets", "log_weights", "means", "covs"):
        assert getattr(one.tracks, name).tobytes() == getattr(other.tracks, name).tobytes(), name
