"""Filters that take detection as its mean over each Gaussian, against a Bernoulli filter in plain NumPy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from reference.gaussian import gaussian_pdf
from vedette import models
from vedette.densities import existence_probabilities
from vedette.filters import DeltaGlmbFilter, FactoredGlmbFilter, Limits, LmbFilter, PhdFilter
from vedette.kernels.gaussian.position_integrals import spread_nodes

pytestmark = pytest.mark.lanes

POSE = np.zeros(3)
CLUTTER, VOLUME, NOISE, SURVIVAL, BIRTH = 3.0, 4.0e6, 10.0, 0.98, 0.3
MEAN, COV = np.array([480.0, 60.0, 5.0, 0.0]), np.diag([900.0, 400.0, 25.0, 25.0])
SCANS = [[[490.0, 50.0]], [], [[505.0, 70.0]]]
DETECTIONS = {
    "smooth": models.gaussian_detection(400.0),
    "an edge": models.limited_range(0.9, 500.0),
    "a soft edge": models.soft_sector(0.9, 500.0, range_slope=0.1),
}


def sensor(detection, detection_at):
    clutter = models.region_clutter(CLUTTER, models.Region(-1000.0, 1000.0, -1000.0, 1000.0), "position")
    noise = models.constant_noise([NOISE, NOISE])
    return models.SensorModel(models.position(), noise, detection, clutter, detection_at=detection_at)


def detections(model, mean, cov, deviates):
    """P_D at the states whose position is so many standard deviates from the mean."""
    states = np.tile(mean, (len(deviates), 1))
    states[:, :2] += deviates @ np.linalg.cholesky(cov[:2, :2]).T
    return model.detection.prob(states, POSE)


def at_nodes(model, mean, cov):
    """Weights and deviates of the nodes, P_D there, and whether it differs, at every other one."""
    weights, deviates = np.split(spread_nodes(), [1], axis=1)
    found = detections(model, mean, cov, deviates)
    return weights[:, 0], deviates, found, np.ptp(found[::2]) > 0.01


def if_missed(model, mean, cov):
    """Mean and covariance of what a miss leaves of a Gaussian, by the nodes of the library."""
    weights, deviates, found, differs = at_nodes(model, mean, cov)
    if not differs:
        return mean, cov
    weights = weights * (1.0 - found)
    centre, spread = np.average(deviates, axis=0, weights=weights), np.cov(deviates.T, aweights=weights, ddof=0)
    spread += max(0.0, 0.02 - np.linalg.eigvalsh(spread)[0]) * np.eye(2)
    slope = cov[:, :2] @ np.linalg.inv(np.linalg.cholesky(cov[:2, :2]).T)
    return mean + slope @ centre, cov + slope @ (spread - np.eye(2)) @ slope.T


def at_centre(model):
    """What a scan makes of a Gaussian: P_D, mean and covariance if missed, P_D there of a detection."""

    def prob(mean, cov):
        return model.detection.prob([mean], POSE)[0]

    return prob, lambda mean, cov: (mean, cov), lambda mean, cov, *after: prob(mean, cov)


def over_gaussians(model):
    """As `at_centre`, with means over Gaussians."""

    def prob(mean, cov):
        weights, _, found, differs = at_nodes(model, mean, cov)
        return weights @ found if differs else model.detection.prob([mean], POSE)[0]

    def of_detected(mean, cov, mean_after, cov_after):
        return prob(mean_after, cov_after) if at_nodes(model, mean, cov)[3] else prob(mean, cov)

    return prob, lambda mean, cov: if_missed(model, mean, cov), of_detected


def plain_bernoulli(prob, missed, prob_of_detected):
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
        updated = [(w * (1.0 - prob(m, p)), *missed(m, p)) for w, m, p in mixture]
        for z in scan:
            for w, m, p in mixture:
                s = h @ p @ h.T + NOISE**2 * np.eye(2)
                gain = p @ h.T @ np.linalg.inv(s)
                after = m + gain @ (z - h @ m), p - gain @ s @ gain.T
                detected = prob_of_detected(m, p, *after)
                updated.append((w * detected * gaussian_pdf(np.array(z), h @ m, s) * VOLUME / CLUTTER, *after))
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
    expected = plain_bernoulli(*over_gaussians(model))
    np.testing.assert_allclose(existences(kind, model), expected, rtol=1e-9)


@pytest.mark.parametrize("name", DETECTIONS)
def test_at_the_centre_only_the_mean_counts(name):
    model = sensor(DETECTIONS[name], "centre")
    expected = plain_bernoulli(*at_centre(model))
    np.testing.assert_allclose(existences(LmbFilter, model), expected, rtol=1e-9)
    missed = 1  # the scan without a measurement
    over_mean = existences(LmbFilter, sensor(DETECTIONS[name], "mean"))
    assert not math.isclose(expected[missed], over_mean[missed], rel_tol=1e-6)


def test_a_phd_filter_takes_it_too():
    model, birth = (
        sensor(DETECTIONS["an edge"], "mean"),
        models.BirthModel(np.array([BIRTH]), np.array([MEAN]), np.array([COV])),
    )
    targets = models.TargetModel(models.constant_velocity(2.0), models.constant_survival(SURVIVAL), birth)
    local = PhdFilter(targets, model, Limits.none())
    belief, _ = local.step(local.initial(), np.empty((0, 2)), POSE, 1.0, 1, rng=np.random.default_rng(0))
    missed = 1.0 - over_gaussians(model)[0](MEAN, COV)
    assert missed == pytest.approx(1.0 - model.mean_detection([MEAN], [COV], POSE)[0], abs=0.05)
    assert np.exp(belief.log_weights).sum() == pytest.approx(BIRTH * missed, rel=1e-12)


@pytest.mark.parametrize("distance", [470.0, 500.0, 530.0])
def test_a_miss_pushes_a_target_out_of_view(distance):
    """Mean, covariance and existence after one miss against a grid over the position, 0.05 standard deviations fine."""
    model, cov = sensor(DETECTIONS["an edge"], "mean"), COV.copy()
    cov[0, 1] = cov[1, 0] = 200.0
    cov[0, 2] = cov[2, 0] = 100.0
    mean = np.array([distance, 20.0, 5.0, 0.0])
    birth = models.BirthModel(np.array([BIRTH]), np.array([mean]), np.array([cov]), frozenset([1]))
    targets = models.TargetModel(models.constant_velocity(2.0), models.constant_survival(SURVIVAL), birth)
    local = LmbFilter(targets, model, Limits.none())
    belief, _ = local.step(local.initial(), np.empty((0, 2)), POSE, 1.0, 1, rng=np.random.default_rng(0))
    axis = np.arange(-6.0, 6.0, 0.05)
    deviates = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    density = np.exp(-0.5 * (deviates**2).sum(axis=1)) * 0.05**2 / (2.0 * math.pi)
    weights = density * (1.0 - detections(model, mean, cov, deviates))
    states = deviates @ np.linalg.cholesky(cov[:2, :2]).T
    states = np.column_stack([states, states @ np.linalg.solve(cov[:2, :2], cov[:2, 2:])]) + mean
    left = cov[2:, 2:] - cov[2:, :2] @ np.linalg.solve(cov[:2, :2], cov[:2, 2:])
    exact_cov = np.cov(states.T, aweights=weights, ddof=0)
    exact_cov[2:, 2:] += left
    std = np.sqrt(np.diag(exact_cov))
    exact_mean, total = np.average(states, axis=0, weights=weights), weights.sum()
    tracks = belief.tracks
    np.testing.assert_array_less(np.abs(tracks.means[0] - exact_mean), 0.05 * std)
    np.testing.assert_array_less(np.abs(tracks.covs[0] - exact_cov), 0.15 * np.outer(std, std))
    assert np.abs(mean - exact_mean)[0] > 0.15 * std[0]
    existence = float(existence_probabilities(belief)[1][0])
    assert existence == pytest.approx(BIRTH * total / (1.0 - BIRTH + BIRTH * total), rel=0.05)


@pytest.mark.parametrize(("detection_at", "least", "most"), [("centre", -1.0, 0.001), ("mean", 0.09, 0.17)])
def test_undetected_targets_beyond_the_edge_stay(detection_at, least, most):
    """Ten misses of a target on the edge leave half of it: .15 of .3; at the centre it is all in view, and gone."""
    birth = models.BirthModel(np.array([0.1]), np.array([[500.0, 0.0, 0.0, 0.0]]), COV[None], frozenset([1]))
    targets = models.TargetModel(models.constant_velocity(0.01), models.constant_survival(1.0), birth)
    local = FactoredGlmbFilter(targets, sensor(models.limited_range(0.9, 500.0), detection_at))
    belief = local.initial()
    for step in range(1, 11):
        dt = 1.0 if step == 1 else 0.01
        belief, _ = local.step(belief, np.empty((0, 2)), POSE, dt, step, rng=np.random.default_rng(0))
    assert belief.undetected is not None
    assert least < 3.0 * np.exp(belief.undetected.intensity.log_weights).sum() < most
