"""The PHD, CPHD and CB-MeMBer filters against enumeration and against the published formulas."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from filters.examples import DT, SCENES, Scene, assert_same_mixtures, together
from reference import Mixture, unlabelled
from vedette.densities import IidCluster, MultiBernoulli, Poisson
from vedette.filters import CbMemberFilter, CphdFilter, Limits, PhdFilter

pytestmark = pytest.mark.lanes

every_scene = pytest.mark.parametrize("name", SCENES)


def make(kind, scene: Scene, limits: Limits | None = None):
    return kind(scene.targets, scene.sensor, limits or Limits.none())


def steps_of(scene: Scene) -> Iterator[tuple[int, float, Any]]:
    """Number, seconds and scan of each step; between the first two is one of no time."""
    yield 1, DT, scene.scans[0]
    yield 1, 0.0, scene.scans[1]
    for step, scan in enumerate(scene.scans[1:], 2):
        yield step, DT, scan


def mixture_of(density: Poisson | IidCluster, total: float = 1.0) -> Mixture:
    weights = total * np.exp(density.log_weights)
    return [(float(w), m, c) for w, m, c in zip(weights, density.means, density.covs, strict=True)]


def bernoullis_of(density: MultiBernoulli) -> unlabelled.Bernoullis:
    found = []
    for i, existence in enumerate(density.existence):
        run = slice(density.offsets[i], density.offsets[i + 1])
        weights = np.exp(density.log_weights[run])
        mixture = [(float(w), m, c) for w, m, c in zip(weights, density.means[run], density.covs[run], strict=True)]
        found.append((float(existence), mixture))
    return found


def births_of(scene: Scene, step: int) -> unlabelled.Bernoullis:
    return list(scene.plain_births(step).values())


def log_likelihood(ratio: float, scene: Scene, scan) -> float:
    """Of a scan, from its likelihood relative to clutter alone."""
    log_clutter = sum(math.log(scene.plain.clutter_intensity(z)) for z in scan)
    return math.log(ratio) + log_clutter - scene.sensor.clutter.rate


@every_scene
def test_phd_is_the_intensity_of_the_exact_posterior_of_a_poisson_prior(name: str) -> None:
    scene = SCENES[name]()
    tracker, rng = make(PhdFilter, scene), np.random.default_rng(0)
    belief = tracker.initial()
    for step, dt, scan in steps_of(scene):
        posterior, info = tracker.step(belief, scan, scene.pose, dt, step, rng=rng)
        posterior.validate()
        predicted = mixture_of(belief)
        if dt > 0.0:
            predicted = unlabelled.predict_intensity(predicted, births_of(scene, step), scene.plain)
        mean = sum(w for w, _, _ in predicted)
        density = [(w / mean, m, c) for w, m, c in predicted]
        numbers = unlabelled.poisson_distribution(mean, 22)
        _, intensity, total = unlabelled.correct_cluster(numbers, density, list(scan), scene.plain)
        assert_same_mixtures(together(mixture_of(posterior)), together(intensity), 1e-10)
        assert info.log_likelihood == pytest.approx(log_likelihood(total, scene, scan), abs=1e-9)
        assert info.num_tracks == len(posterior.log_weights)
        belief = posterior


@every_scene
def test_cphd_is_cardinality_and_intensity_of_the_exact_posterior_of_an_iid_cluster(name: str) -> None:
    scene = SCENES[name]()
    tracker, rng = make(CphdFilter, scene), np.random.default_rng(0)
    belief = tracker.initial()
    for step, dt, scan in steps_of(scene):
        posterior, info = tracker.step(belief, scan, scene.pose, dt, step, rng=rng)
        posterior.validate()
        predicted, intensity = np.exp(belief.log_cardinality), mixture_of(belief, belief.expected_number)
        if dt > 0.0:
            before, births = mixture_of(belief), births_of(scene, step)
            predicted, intensity = unlabelled.predict_cluster(predicted, before, births, scene.plain)
        mean = unlabelled.expected_number(predicted)
        assert sum(w for w, _, _ in intensity) == pytest.approx(mean, rel=1e-12)
        density = [(w / mean, m, c) for w, m, c in intensity]
        cardinality, corrected, total = unlabelled.correct_cluster(predicted, density, list(scan), scene.plain)
        np.testing.assert_allclose(np.exp(posterior.log_cardinality), cardinality, atol=1e-11)
        got = mixture_of(posterior, posterior.expected_number)
        assert_same_mixtures(together(got), together(corrected), 1e-10)
        assert info.log_likelihood == pytest.approx(log_likelihood(total, scene, scan), abs=1e-9)
        assert info.truncation_error_bound == 0.0
        belief = posterior


@every_scene
def test_cb_member_is_what_the_formulas_say(name: str) -> None:
    scene = SCENES[name]()
    tracker, rng = make(CbMemberFilter, scene), np.random.default_rng(0)
    belief = tracker.initial()
    for step, dt, scan in steps_of(scene):
        posterior, info = tracker.step(belief, scan, scene.pose, dt, step, rng=rng)
        posterior.validate()
        predicted = bernoullis_of(belief)
        if dt > 0.0:
            predicted = unlabelled.predict_bernoullis(predicted, births_of(scene, step), scene.plain)
        expected = unlabelled.correct_cb_member(predicted, list(scan), scene.plain)
        got = bernoullis_of(posterior)
        assert [r for r, _ in got] == pytest.approx([r for r, _ in expected], abs=1e-11)
        assert posterior.expected_number == pytest.approx(sum(r for r, _ in expected), abs=1e-10)
        for (_, mixture), (_, plain) in zip(got, expected, strict=True):
            assert_same_mixtures(together(mixture), together(plain), 1e-10)
        assert info.dropped_existence == 0.0
        assert math.isnan(info.log_likelihood)
        belief = posterior


@every_scene
@pytest.mark.parametrize("kind", [PhdFilter, CphdFilter, CbMemberFilter])
def test_gates_and_caps_at_rest_change_next_to_nothing(kind, name: str) -> None:
    scene = SCENES[name]()
    limits = Limits(merge_distance=0.0, min_component_weight=0.0, min_existence=0.0, min_relative_weight=0.0)
    exact, kept = make(kind, scene), make(kind, scene, limits)
    beliefs, rng = [exact.initial(), kept.initial()], np.random.default_rng(0)
    for step, scan in enumerate(scene.scans, 1):
        beliefs = [
            tracker.step(belief, scan, scene.pose, DT, step, rng=rng)[0]
            for tracker, belief in zip((exact, kept), beliefs, strict=True)
        ]
        assert beliefs[1].expected_number == pytest.approx(beliefs[0].expected_number, abs=2e-3)
