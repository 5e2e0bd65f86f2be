"""Velocities of births from measurements with range rates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tracking.scenes import lmb
from vedette import models
from vedette.models import BirthModel, MeasurementBirth
from vedette.tracking.births import births_from_scans

STD = np.array([30.0, 30.0, 12.0, 8.0])
BIRTH = replace(BirthModel.none(4), from_measurements=MeasurementBirth(0.4, 0.3, STD))
NOBODY = lmb(np.empty((0, 2), np.int64), [], np.empty((0, 4)), np.empty((0, 4, 4)))
REGION = models.Region(-5000.0, 5000.0, -5000.0, 5000.0)
SENSOR = models.SensorModel(
    models.bearing_range_rate(),
    models.constant_noise([0.01, 10.0, 0.5]),
    models.constant_detection(0.9),
    models.region_clutter(1.0, REGION, "bearing_range_rate"),
)
POSES = np.array([[-900.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 1.0], [0.0, -700.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
STATES = np.array([[300.0, 400.0, 6.0, -3.0], [-500.0, -100.0, -8.0, 2.0]])


def posterior(place, looks):
    """Mean and covariance of the velocity: Bayes' rule in information form."""
    info, total = np.diag(STD[2:] ** -2.0), np.zeros(2)
    for pose, rate in looks:
        sight = (place - pose[:2]) / np.hypot(*(place - pose[:2]))
        info = info + np.outer(sight, sight) / 0.25
        total = total + sight * (rate + sight @ pose[6:8]) / 0.25
    return np.linalg.solve(info, total), np.linalg.inv(info)


@pytest.mark.parametrize("seeing", [(0,), (0, 1)])
def test_a_birth_has_the_velocity_of_its_range_rates(seeing):
    scans = [SENSOR.measurement.measure(STATES, pose) if s in seeing else None for s, pose in enumerate(POSES)]
    born = births_from_scans(BIRTH, NOBODY, (SENSOR,) * 2, scans, POSES, 7)
    assert born is not None
    assert born.tracks.num_tracks == 2
    for mean, cov in zip(born.tracks.means, born.tracks.covs, strict=True):
        i = int(np.hypot(*(STATES[:, :2] - mean[:2]).T).argmin())
        np.testing.assert_allclose(mean[:2], STATES[i, :2], atol=1e-9)
        velocity, spread = posterior(STATES[i, :2], [(POSES[s], scans[s][i, 2]) for s in seeing])
        np.testing.assert_allclose(mean[2:], velocity, rtol=1e-6)
        np.testing.assert_allclose(cov[2:, 2:], spread, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(cov[:2], np.diag(STD**2)[:2])


def test_a_birth_without_range_rates_stays_at_rest():
    plain = models.SensorModel(
        models.bearing_range(),
        models.constant_noise([0.01, 10.0]),
        models.constant_detection(0.9),
        models.region_clutter(1.0, REGION, "bearing_range"),
    )
    scan = plain.measurement.measure(STATES, POSES[0])
    born = births_from_scans(BIRTH, NOBODY, (plain,), [scan], POSES[:1], 7)
    assert born is not None
    np.testing.assert_array_equal(born.tracks.means[:, 2:], 0.0)
    np.testing.assert_array_equal(born.tracks.covs, np.tile(np.diag(STD**2), (2, 1, 1)))
