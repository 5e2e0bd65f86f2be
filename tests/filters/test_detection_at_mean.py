"""Filters that take detection as its mean over each Gaussian, against a Bernoulli filter in plain NumPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from reference.gaussian import gaussian_pdf
from vedette import models
from vedette.densities import existence_probabilities
from vedette.filters import DeltaGlmbFilter, Limits, LmbFilter, PhdFilter

pytestmark = pytest.mark.lanes

POSE = np.zeros(3)
CLUTTER, VOLUME, NOISE, SURVIVAL, BIRTH = 3.0, 4.0e6, 10.0, 0.98, 0.3
MEAN, COV = np.array([480.0, 60.0, 5.0, 0.0]), np.diag([900.0, 400.0, 25.0, 25.0])
SCANS = [[[490.0, 50.0]], [], [[505.0, 70.0]]]
DETECTIONS = {
    "closed form": models.gaussian_detection(400.0),
    "rays": models.limited_range(0.9, 500.0),
    "nodes": models.soft_sector(0.9, 500.0, range_slope=0.1),
}


def sensor(detection, detection_at):
    clutter = models.region_clutter(CLUTTER, models.Region(-1000.0, 1000.0, -1000.0, 1000.0), "position")
    noise = models.constant_noise([NOISE, NOISE])
    return models.SensorModel(models.position(), noise, detection, clutter, detection_at=detection_at)


def plain_bernoulli(prob_detection):
    """Existence after each scan: one target, born at step 1, as a growing mixture of (weight, mean, cov)."""
    eye, zero = np.eye(2), np.zeros((2, 2))
    f = np.block([[eye, eye], [zero, eye]])
    q = 4.0 * np.block([[eye / 4, eye / 2], [eye / 2, eye]])
    h = np.hstack([eye, zero])
    found: list[Any] = []
    for scan in SCANS:
        if not found:
            existence, mixture = BIRTH, [(1.0, MEAN, COV)]
        else:
            existence *= SURVIVAL
            mixture = [(w, f @ m, f @ p @ f.T + q) for w, m, p in mixture]
        updated = [(w * (1.0 - prob_detection(m, p)), m, p) for w, m, p in mixture]
        for z in scan:
            for w, m, p in mixture:
                s = h @ p @ h.T + NOISE**2 * np.eye(2)
                gain = p @ h.T @ np.linalg.inv(s)
                likelihood = prob_detection(m, p) * gaussian_pdf(np.array(z), h @ m, s) * VOLUME / CLUTTER
                updated.append((w * likelihood, m + gain @ (z - h @ m), p - gain @ s @ gain.T))
        total = sum(w for w, _, _ in updated)
        existence = existence * total / (1.0 - existence + existence * total)
        mixture = [(w / total, m, p) for w, m, p in updated]
        found.append(existence)
    return found


def existences(kind, model):
    birth = models.BirthModel(np.array([BIRTH]), np.array([MEAN]), np.array([COV]), frozenset([1]))
    targets = models.TargetModel(models.constant_velocity(2.0), models.constant_survival(SURVIVAL), birth)
    local = kind(targets, model, Limits.none())
    belief, found = local.initial(), []
    for step, scan in enumerate(SCANS, start=1):
        measurements = np.array(scan).reshape(-1, 2)
        belief, _ = local.step(belief, measurements, POSE, 1.0, step, rng=np.random.default_rng(0))
        found.append(float(existence_probabilities(belief)[1][0]))
    return found


@pytest.mark.parametrize("kind", [LmbFilter, DeltaGlmbFilter])
@pytest.mark.parametrize("name", DETECTIONS)
def test_a_filter_takes_the_mean(kind, name):
    model = sensor(DETECTIONS[name], "mean")
    expected = plain_bernoulli(lambda mean, cov: model.mean_detection([mean], [cov], POSE)[0])
    np.testing.assert_allclose(existences(kind, model), expected, rtol=1e-9)


@pytest.mark.parametrize("name", DETECTIONS)
def test_at_the_centre_only_the_mean_counts(name):
    model = sensor(DETECTIONS[name], "centre")
    expected = plain_bernoulli(lambda mean, cov: DETECTIONS[name].prob([mean], POSE)[0])
    np.testing.assert_allclose(existences(LmbFilter, model), expected, rtol=1e-9)
    missed = 1  # the scan without a measurement
    over_mean = existences(LmbFilter, sensor(DETECTIONS[name], "mean"))
    assert not math.isclose(expected[missed], over_mean[missed], rel_tol=1e-6)


def test_a_phd_filter_takes_it_too():
    model, birth = (
        sensor(DETECTIONS["rays"], "mean"),
        models.BirthModel(np.array([BIRTH]), np.array([MEAN]), np.array([COV])),
    )
    targets = models.TargetModel(models.constant_velocity(2.0), models.constant_survival(SURVIVAL), birth)
    local = PhdFilter(targets, model, Limits.none())
    belief, _ = local.step(local.initial(), np.empty((0, 2)), POSE, 1.0, 1, rng=np.random.default_rng(0))
    missed = 1.0 - model.mean_detection([MEAN], [COV], POSE)[0]
    assert np.exp(belief.log_weights).sum() == pytest.approx(BIRTH * missed, rel=1e-12)
