"""The filters against full enumeration: every death, birth and association, no cap anywhere."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import reference
from densities.examples import plain_glmb, plain_lmb, plain_moments
from reference import glmb as oracle
from vedette import models
from vedette.densities import GLMB, LMB, cardinality_distribution
from vedette.filters import DeltaGlmbFilter, FilterInfo, Gibbs, Limits, LmbFilter

DT = 1.5
SURVIVAL = 0.9
SIGMA_V = 1.0
POSE = np.array([40.0, -25.0, 0.3])
# Far enough round the sensor that bearings of the second site lie across +-pi.
BIRTHS = models.BirthModel(
    np.array([0.3, 0.2]),
    np.array([[60.0, 20.0, 2.0, 1.0], [-110.0, -26.0, 0.0, 1.0]]),
    np.array([np.diag([80.0, 60.0, 9.0, 9.0]), np.diag([90.0, 50.0, 4.0, 9.0])]),
    frozenset({1, 3}),
)
REGION = models.Region(-400.0, 400.0, -400.0, 400.0)
RATE = 3.0


def _transition_matrix() -> Any:
    matrix = np.eye(4)
    matrix[0, 2] = matrix[1, 3] = DT
    return matrix


def _process_noise() -> Any:
    gain = np.array([[DT**2 / 2, 0.0], [0.0, DT**2 / 2], [DT, 0.0], [0.0, DT]])
    return SIGMA_V**2 * gain @ gain.T


def _polar(state: Any) -> Any:
    dx, dy = state[:2] - POSE[:2]
    return np.array([np.arctan2(dy, dx), np.hypot(dx, dy)])


def _polar_jacobian(state: Any) -> Any:
    (dx, dy), distance = state[:2] - POSE[:2], _polar(state)[1]
    jacobian = np.zeros((2, 4))
    jacobian[:, :2] = [[-dy / distance**2, dx / distance**2], [dx / distance, dy / distance]]
    return jacobian


def _polar_noise(state: Any) -> Any:
    distance = _polar(state)[1]
    return np.diag([(0.03 + 2e-4 * distance) ** 2, (3.0 + 1e-4 * distance**2) ** 2])


@dataclass(frozen=True)
class Example:
    """The same models twice, three scans, and how the detection is evaluated by the oracle."""

    sensor: models.SensorModel
    motion: models.MotionModel
    model: oracle.Model
    scans: tuple[Any, ...]

    @property
    def targets(self) -> models.TargetModel:
        return models.TargetModel(self.motion, models.constant_survival(SURVIVAL), BIRTHS)

    def filter(self, limits: Limits, **options: Any) -> DeltaGlmbFilter:
        return DeltaGlmbFilter(self.targets, self.sensor, limits, **options)

    def lmb_filter(self, limits: Limits) -> LmbFilter:
        return LmbFilter(self.targets, self.sensor, limits)


def _oracle_model(method: str, **parts: Any) -> oracle.Model:
    matrix, noise = _transition_matrix(), _process_noise()
    return oracle.Model(
        transition=lambda x: matrix @ x,
        transition_jacobian=lambda x: matrix,
        process_noise_cov=lambda x: noise,
        prob_survival=lambda x: SURVIVAL,
        method=method,
        **parts,
    )


def _positions(method: str) -> Example:
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([6.0, 8.0]),
        models.constant_detection(0.8),
        models.region_clutter(RATE, REGION, "position"),
        method=method,
    )
    model = _oracle_model(
        method,
        measurement=lambda x: x[:2],
        measurement_jacobian=lambda x: np.eye(2, 4),
        measurement_noise_cov=lambda x: np.diag([36.0, 64.0]),
        prob_detection=lambda x: 0.8,
        clutter_intensity=lambda z: RATE / 800.0**2,
        angular=(False, False),
    )
    # Two that both targets of the first site may have caused, one of the second site, clutter; then a missed one.
    scans = ([[62.0, 22.0], [68.0, 15.0]], [[64.0, 23.0], [-108.0, -20.0]], [[66.0, 25.0]])
    return Example(sensor, models.constant_velocity(SIGMA_V, method=method), model, tuple(map(np.array, scans)))


def _bearings_and_ranges(method: str) -> Example:
    sensor = models.SensorModel(
        models.bearing_range(),
        models.range_dependent_noise(3.0, 1e-4, 0.03, 2e-4),
        models.gaussian_detection(200.0),
        models.region_clutter(RATE, REGION, "bearing_range"),
        method=method,
    )
    model = _oracle_model(
        method,
        measurement=_polar,
        measurement_jacobian=_polar_jacobian,
        measurement_noise_cov=_polar_noise,
        prob_detection=lambda x: float(np.exp(-0.5 * (_polar(x)[1] / 200.0) ** 2)),
        clutter_intensity=lambda z: RATE / 800.0**2 * z[1],
        angular=(True, False),
    )
    at_site = _polar(np.array([61.0, 22.0]))
    scans = ([at_site, [-3.12, 148.0]], [[3.13, 151.0], at_site + np.array([0.05, 2.0])], [[3.11, 152.0]])
    return Example(sensor, models.constant_velocity(SIGMA_V, method=method), model, tuple(map(np.array, scans)))


EXAMPLES: dict[str, Callable[[], Example]] = {
    "linear": lambda: _positions("ekf"),
    "position ukf": lambda: _positions("ukf"),
    "ekf": lambda: _bearings_and_ranges("ekf"),
    "ukf": lambda: _bearings_and_ranges("ukf"),
    "ckf": lambda: _bearings_and_ranges("ckf"),
}
each_example = pytest.mark.parametrize("name", EXAMPLES)


def plain_births(step: int) -> reference.Lmb:
    if not BIRTHS.is_active(step):
        return {}
    return {
        (step, site): (float(BIRTHS.existence[site]), [(1.0, BIRTHS.means[site], BIRTHS.covs[site])])
        for site in range(BIRTHS.num_sites)
    }


@functools.cache
def enumerated(name: str) -> tuple[list[oracle.Hypotheses], list[float]]:
    """Posteriors after each scan, and the log-likelihoods of the scans."""
    example = EXAMPLES[name]()
    hypotheses, posteriors, log_likelihoods = oracle.no_target(), [], []
    for step, scan in enumerate(example.scans, 1):
        hypotheses, total = oracle.step(hypotheses, plain_births(step), list(scan), example.model)
        clutter = sum(math.log(example.model.clutter_intensity(z)) for z in scan)
        posteriors.append(hypotheses)
        log_likelihoods.append(math.log(total) + clutter - RATE)
    return posteriors, log_likelihoods


def run(tracker: Any, example: Example, seed: int = 0) -> tuple[list[Any], list[FilterInfo]]:
    rng, belief, beliefs, infos = np.random.default_rng(seed), tracker.initial(), [], []
    for step, scan in enumerate(example.scans, 1):
        belief, info = tracker.step(belief, scan, POSE, DT, step, rng=rng)
        belief.validate()
        beliefs.append(belief)
        infos.append(info)
    return beliefs, infos


def pooled_moments(plain: reference.Glmb) -> dict[reference.Label, tuple[float, Any, Any]]:
    return {label: (existence, *plain_moments(mixture)) for label, (existence, mixture) in oracle.to_lmb(plain).items()}


def assert_same_weights(found: reference.Glmb, wanted: reference.Glmb, tolerance: float = 1e-10) -> None:
    """Weights of label sets."""
    weights, wanted_weights = oracle.label_set_weights(found), oracle.label_set_weights(wanted)
    for labels in weights.keys() | wanted_weights.keys():
        assert weights.get(labels, 0.0) == pytest.approx(wanted_weights.get(labels, 0.0), abs=tolerance)


def assert_same_density(found: reference.Glmb, wanted: reference.Glmb, tolerance: float = 1e-10) -> None:
    """Weights of label sets, existences and the moments of every label's density."""
    assert_same_weights(found, wanted, tolerance)
    moments, wanted_moments = pooled_moments(found), pooled_moments(wanted)
    assert moments.keys() == wanted_moments.keys()
    for label, (existence, mean, cov) in wanted_moments.items():
        assert moments[label][0] == pytest.approx(existence, abs=tolerance)
        np.testing.assert_allclose(moments[label][1], mean, rtol=tolerance, atol=1e-8)
        np.testing.assert_allclose(moments[label][2], cov, rtol=tolerance, atol=1e-7)


def fingerprints(plain: reference.Glmb) -> list[tuple[float, ...]]:
    """Weight and means of each hypothesis, ordered by the means; the oracle loses weights that underflow."""
    rows = []
    for weight, tracks in plain:
        means = [mean for label in sorted(tracks) for _, mean, _ in tracks[label]]
        if weight > 1e-200:
            rows.append((float(weight), *(float(x) for mean in means for x in mean)))
    return sorted(rows, key=lambda row: (len(row), *(round(x, 5) for x in row[1:])))


@each_example
def test_ranked_without_limits_is_the_enumeration(name: str) -> None:
    example = EXAMPLES[name]()
    posteriors, log_likelihoods = enumerated(name)
    beliefs, infos = run(example.filter(Limits.none()), example)
    for belief, info, hypotheses, log_likelihood in zip(beliefs, infos, posteriors, log_likelihoods, strict=True):
        wanted = oracle.as_glmb(hypotheses)
        assert_same_density(plain_glmb(belief), wanted)
        sizes = np.zeros(1 + max(len(tracks) for _, tracks in wanted))
        for weight, tracks in wanted:
            sizes[len(tracks)] += weight
        np.testing.assert_allclose(cardinality_distribution(belief)[: len(sizes)], sizes, rtol=0, atol=1e-10)
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-10)
        assert not info.search_cut
        assert (np.diff(belief.hyp_log_weights) <= 0.0).all()


@each_example
def test_each_hypothesis_is_the_enumerated_one(name: str) -> None:
    """The number too: the same tracks are one hypothesis, whoever else died."""
    example = EXAMPLES[name]()
    posteriors, _ = enumerated(name)
    beliefs, _ = run(example.filter(Limits.none()), example)
    for belief, hypotheses in zip(beliefs, posteriors, strict=True):
        found, wanted = fingerprints(plain_glmb(belief)), fingerprints(oracle.as_glmb(hypotheses))
        assert len(found) == len(wanted)
        for one, other in zip(found, wanted, strict=True):
            np.testing.assert_allclose(one[0], other[0], rtol=1e-8)
            np.testing.assert_allclose(one[1:], other[1:], rtol=1e-9, atol=1e-9)


@each_example
def test_plenty_of_gibbs_samples_are_the_enumeration(name: str) -> None:
    example = EXAMPLES[name]()
    posteriors, log_likelihoods = enumerated(name)
    tracker = example.filter(Limits.none(), assignment=Gibbs(300_000))
    beliefs, infos = run(tracker, example)
    for belief, info, hypotheses, log_likelihood in zip(beliefs, infos, posteriors, log_likelihoods, strict=True):
        # What a sampler never came across in so many sweeps has next to no weight, and what it found has its own.
        assert_same_weights(plain_glmb(belief), oracle.as_glmb(hypotheses), tolerance=5e-5)
        assert info.log_likelihood == pytest.approx(log_likelihood, abs=1e-4)


def test_gibbs_finds_every_hypothesis_of_an_even_scene() -> None:
    example = EXAMPLES["linear"]()
    for scan in (np.empty((0, 2)), np.array([[81.0, 40.0]])):
        tracker = example.filter(Limits.none(), assignment=Gibbs(20_000))
        belief, _ = tracker.step(tracker.initial(), scan, POSE, DT, 1, rng=np.random.default_rng(1))
        hypotheses, _ = oracle.step(oracle.no_target(), plain_births(1), list(scan), example.model)
        assert_same_density(plain_glmb(belief), oracle.as_glmb(hypotheses))


@each_example
def test_lmb_without_limits_is_the_enumeration(name: str) -> None:
    example = EXAMPLES[name]()
    tracker = example.lmb_filter(Limits.none())
    wanted: reference.Lmb = {}
    belief, rng = tracker.initial(), np.random.default_rng(0)
    for step, scan in enumerate(example.scans, 1):
        prior = wanted
        wanted = oracle.lmb_step(prior, plain_births(step), list(scan), example.model)
        belief, info = tracker.step(belief, scan, POSE, DT, step, rng=rng)
        belief.validate()
        found = plain_lmb(belief)
        assert found.keys() == wanted.keys()
        for label, (existence, mixture) in wanted.items():
            assert found[label][0] == pytest.approx(existence, abs=1e-10)
            mean, cov = plain_moments(mixture)
            found_mean, found_cov = plain_moments(found[label][1])
            np.testing.assert_allclose(found_mean, mean, rtol=1e-10, atol=1e-8)
            np.testing.assert_allclose(found_cov, cov, rtol=1e-10, atol=1e-7)
        assert info.log_likelihood == pytest.approx(_lmb_log_likelihood(example, prior, step, scan), abs=1e-10)
        assert info.num_inexact_clusters == 0
        assert info.dropped_existence == 0.0
        # As the filter has it from here on: the oracle's mixture grows without end.
        wanted = {label: (existence, mixture) for label, (existence, mixture) in found.items()}


def _lmb_log_likelihood(example: Example, prior: reference.Lmb, step: int, scan: Any) -> float:
    hypotheses: oracle.Hypotheses = {}
    for weight, tracks in oracle.expand_lmb(prior):
        hypotheses[tuple((label, ()) for label in sorted(tracks))] = (weight, tracks)
    _, total = oracle.step(hypotheses, plain_births(step), list(scan), example.model)
    return math.log(total) + sum(math.log(example.model.clutter_intensity(z)) for z in scan) - RATE


def _discarded_share(hypotheses: oracle.Hypotheses, kept: GLMB) -> float:
    """True share of the weight that is not among the kept hypotheses, all of the heaviest."""
    return 1.0 - sum(weight for weight, _ in oracle.as_glmb(hypotheses)[: kept.num_hyps])


@each_example
@pytest.mark.parametrize("cap", [1, 3, 6])
def test_the_bound_on_what_was_discarded(name: str, cap: int) -> None:
    example = EXAMPLES[name]()
    limits = dataclasses.replace(Limits.none(), max_hypotheses=cap, min_track_weight=1.0)
    belief, info = _first_step(example, example.scans[0], limits)
    hypotheses, _ = oracle.step(oracle.no_target(), plain_births(1), list(example.scans[0]), example.model)
    share = _discarded_share(hypotheses, belief)
    assert belief.num_hyps <= cap
    assert info.discarded_weight_bound >= share - 1e-12
    assert cap > 1 or share > 0.0


def _first_step(example: Example, scan: Any, limits: Limits) -> tuple[GLMB, FilterInfo]:
    tracker = example.filter(limits)
    return tracker.step(tracker.initial(), scan, POSE, DT, 1, rng=np.random.default_rng(0))


@each_example
@pytest.mark.parametrize("cap", [1, 2, 3, 4, 6])
def test_the_bound_is_attained_where_nothing_is_contested(name: str, cap: int) -> None:
    """No measurement at all, or one near each site, which the other site can never have caused."""
    example = EXAMPLES[name]()
    limits = dataclasses.replace(Limits.none(), max_hypotheses=cap, min_track_weight=1.0)
    for scan in (np.empty((0, 2)), example.scans[1]):
        belief, info = _first_step(example, scan, limits)
        hypotheses, _ = oracle.step(oracle.no_target(), plain_births(1), list(scan), example.model)
        assert info.discarded_weight_bound == pytest.approx(_discarded_share(hypotheses, belief), abs=1e-12)


@each_example
def test_marginalised_keeps_the_weights_of_label_sets(name: str) -> None:
    """At each step, from a prior that has been marginalised before."""
    example = EXAMPLES[name]()
    marginalised, plain = example.filter(Limits.none(), marginalised=True), example.filter(Limits.none())
    rng, belief = np.random.default_rng(0), marginalised.initial()
    for step, scan in enumerate(example.scans, 1):
        wanted, wanted_info = plain.step(belief, scan, POSE, DT, step, rng=rng)
        belief, info = marginalised.step(belief, scan, POSE, DT, step, rng=rng)
        assert belief.is_marginalised
        assert_same_density(plain_glmb(belief), plain_glmb(wanted))
        assert info.log_likelihood == wanted_info.log_likelihood
        # Fewer components do not change the weights of this step either.
        few = example.filter(dataclasses.replace(Limits.none(), max_components=1), marginalised=True)
        if step == 0:
            first, _ = few.step(few.initial(), scan, POSE, DT, step, rng=rng)
            assert_same_weights(plain_glmb(first), plain_glmb(wanted))


@pytest.mark.parametrize("order", [(1, 0), (0, 1)])
def test_the_order_of_the_scan_does_not_matter(order: Sequence[int]) -> None:
    example = EXAMPLES["ekf"]()
    shuffled = dataclasses.replace(example, scans=tuple(s[list(order)] if len(s) == 2 else s for s in example.scans))
    for kind in (example.filter(Limits.none()), example.lmb_filter(Limits.none())):
        first, second = run(kind, example)[0][-1], run(kind, shuffled)[0][-1]
        if isinstance(first, LMB):
            np.testing.assert_allclose(first.existence, second.existence, rtol=0, atol=1e-12)
        else:
            np.testing.assert_allclose(first.hyp_log_weights, second.hyp_log_weights, rtol=0, atol=1e-9)
