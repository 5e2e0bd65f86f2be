"""Numbers at the edge of what a double holds: a valid density, or an error that says what could not be done."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.densities import GLMB, LMB, IidCluster, MultiBernoulli, Poisson, as_lmb, marginalise
from vedette.errors import NumericalError
from vedette.filters import CbMemberFilter, CphdFilter, DeltaGlmbFilter, Limits, LmbFilter, PhdFilter
from vedette.fusion import CmDeltaGlmb

KINDS: dict[Any, Any] = {
    DeltaGlmbFilter: GLMB,
    LmbFilter: LMB,
    PhdFilter: Poisson,
    CphdFilter: IidCluster,
    CbMemberFilter: MultiBernoulli,
}
ORIGIN = np.zeros(3)
RNG = np.random.default_rng(0)  # no filter here draws from it


def make(
    kind: Any,
    stds: Any = (10.0, 10.0),
    method: str = "ekf",
    limits: Limits | None = None,
    sigma_v: float = 1.0,
    **parts: Any,
) -> Any:
    standard: dict[str, Any] = {
        "measurement": models.position(),
        "noise": models.constant_noise(stds),
        "detection": models.constant_detection(0.95),
        "clutter": models.region_clutter(1.0, models.Region(-1e4, 1e4, -1e4, 1e4), "position"),
    }
    sensor = models.SensorModel(**(standard | parts), method=method)
    motion, birth = models.constant_velocity(sigma_v, method=method), models.BirthModel.none(4)
    targets = models.TargetModel(motion, models.constant_survival(0.99), birth)
    return kind(targets, sensor, limits or Limits())


def target(kind: Any, means: Any, cov: Any) -> Any:
    """Targets there with probability 0.9."""
    means = np.asarray(means, np.float64)
    num = len(means)
    covs, labels = np.tile(cov, (num, 1, 1)), [(0, i) for i in range(num)]
    if kind is CphdFilter:
        return IidCluster.from_gaussians([0.1, 0.9], np.full(num, 1.0 / num), means, covs)
    if kind is PhdFilter:
        return Poisson.from_gaussians(np.full(num, 0.9), means, covs)
    if kind is CbMemberFilter:
        return MultiBernoulli.from_gaussians(np.full(num, 0.9), means, covs)
    lmb = LMB.from_bernoullis(labels, np.full(num, 0.9), means, covs)
    return lmb if kind is LmbFilter else GLMB.from_hypotheses(lmb.tracks, [range(num), []], [0.9, 0.1])


def components(belief: Any) -> tuple[Any, Any, Any]:
    table = belief.tracks if isinstance(belief, GLMB | LMB) else belief
    return table.log_weights, table.means, table.covs


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["ekf", "ukf", "ckf"])
@pytest.mark.parametrize("std", [1e-12, 1e-6, 1e-3])
def test_noise_far_below_what_was_expected(kind: Any, method: str, std: float) -> None:
    """The variance of a measured position is then that of the noise, which P - K S K' rounds away."""
    tracker, cov = make(kind, (std, 2.0 * std), method), np.diag([1e4, 1e4, 100.0, 100.0])
    cov[0, 2] = cov[2, 0] = 300.0
    belief, _ = tracker.step(target(kind, [[0.0, 0.0, 1.0, 0.0]], cov), [[3.0, 4.0]], ORIGIN, 1.0, 1, rng=RNG)
    belief.validate()
    _, means, covs = components(belief)
    seen = int(np.argmin(covs[:, 0, 0]))
    np.testing.assert_allclose(means[seen, :2], [3.0, 4.0], atol=1e-6)
    np.testing.assert_allclose(np.diagonal(covs[seen])[:2], [std**2, 4.0 * std**2], rtol=1e-2)


def test_a_bearing_of_next_to_no_noise() -> None:
    """It fixes a direction that is no axis, to more digits than the entries of a covariance have."""
    parts: dict[str, Any] = {
        "measurement": models.bearing_only(),
        "clutter": models.measurement_space_clutter(1.0, [-np.pi], [np.pi]),
    }
    prior = target(LmbFilter, [[1e3, 1e3, 0.0, 0.0]], np.diag([1e4, 1e4, 100.0, 100.0]))
    belief, _ = make(LmbFilter, (1e-8,), **parts).step(prior, [[0.786]], ORIGIN, 1.0, 1, rng=RNG)
    belief.validate()
    with pytest.raises(NumericalError, match="positive definite within the precision"):
        make(LmbFilter, (1e-11,), **parts).step(prior, [[0.786]], ORIGIN, 1.0, 1, rng=RNG)


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_double_cannot_hold_is_refused_by_name(kind: Any) -> None:
    """No process noise and a huge step: position and velocity are one number to sixteen digits."""
    tracker = make(kind, sigma_v=0.0)
    with pytest.raises(NumericalError, match="covariance of a track is not positive definite within the precision"):
        tracker.step(target(kind, [[0.0] * 4], np.diag([1e-8, 1e-8, 1e8, 1e8])), [], ORIGIN, 1e4, 1, rng=RNG)


@pytest.mark.parametrize("kind", KINDS)
def test_scans_far_from_everything_without_a_gate(kind: Any) -> None:
    """Log weights of -1e14, whose sum must still be one."""
    tracker = make(kind, (1e-3, 1e-3), limits=Limits(gate_probability=1.0, merge_distance=0.0, max_components=5))
    prior = target(kind, [[0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]], 1e-6 * np.eye(4))
    scan = [[9e3, 9e3], [-9e3, 9e3], [9e3, -9e3]]
    belief, _ = tracker.step(prior, scan, ORIGIN, 1e-3, 1, rng=RNG)
    belief.validate()


def test_sensors_that_contradict_each_other_beyond_all_measure() -> None:
    def belief(at: float, weights: Any) -> GLMB:
        lmb = target(LmbFilter, [[at, 0.0, 0.0, 0.0], [at, 5.0, 0.0, 0.0]], 1e-6 * np.eye(4))
        return GLMB.from_hypotheses(lmb.tracks, [[0], [1], [0, 1]], weights)

    fused, _ = CmDeltaGlmb((0.5, 0.5)).fuse([belief(0.0, [0.2, 0.3, 0.5]), belief(1e6, [0.4, 0.5, 0.1])])
    fused.validate()


def test_targets_too_far_apart_for_one_gaussian() -> None:
    tracks = target(LmbFilter, [[0.0, 0.0, 0.0, 0.0], [1e9, 1e9, 0.0, 0.0]], 1e-4 * np.eye(4)).tracks
    one_label = type(tracks)(np.zeros((2, 2), np.int64), *[getattr(tracks, name) for name in tracks.__slots__[1:]])
    glmb = GLMB.from_hypotheses(one_label, [[0], [1]], [0.5, 0.5])
    for convert in (marginalise, as_lmb):
        with pytest.raises(NumericalError, match="positive definite within the precision"):
            convert(glmb)
        convert(glmb, max_components=2).validate()
