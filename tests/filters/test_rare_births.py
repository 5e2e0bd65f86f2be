"""Births that are rare next to clutter, and the invariances of filters: units, periods, sites and regions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.densities import LMB, cardinality_distribution, existence_probabilities
from vedette.filters import (
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Limits,
    LmbFilter,
    PhdFilter,
    SequentialFactoredFilter,
)

LABELLED = (FactoredGlmbFilter, LmbFilter, DeltaGlmbFilter)
EVERY = (*LABELLED, PhdFilter, CphdFilter, CbMemberFilter)
POSE, RNG = np.zeros(3), np.random.default_rng(0)  # Gibbs sampling is not used


@dataclass(frozen=True)
class Scene:
    """One target that moves straight on before a position sensor, in units of choice."""

    births: float = 1e-3  # a period
    clutter: float = 10.0  # a scan
    detection: float = 0.9
    side: float = 2000.0  # m
    metre: float = 1.0  # length units in a metre
    second: float = 1.0  # time units in a second
    sites: int = 1  # that share the births; 0: anywhere
    period: bool = False

    @property
    def region(self) -> models.Region:
        half = 0.5 * self.side * self.metre
        return models.Region(-half, half, -half, half)

    @property
    def birth(self) -> models.BirthModel:
        std = np.array([20.0, 20.0, 10.0 / self.second, 10.0 / self.second]) * self.metre
        period = self.second if self.period else None
        if self.sites == 0:
            measured = models.MeasurementBirth(self.births, 0.03, std, self.region)
            none = np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4))
            return models.BirthModel(*none, from_measurements=measured, period=period)
        covs = np.tile(np.diag(std**2), (self.sites, 1, 1))
        existence = np.full(self.sites, self.births / self.sites)
        return models.BirthModel(existence, np.zeros((self.sites, 4)), covs, period=period)

    def filter(self, kind: Callable[..., Any] = FactoredGlmbFilter, limits: Limits | None = None) -> Any:
        spread = 0.5 * self.metre / self.second**1.5
        moving = models.constant_velocity(spread, noise_model="continuous_white")
        survival = models.constant_survival(0.99, period=self.second)
        noise = models.constant_noise([10.0 * self.metre] * 2)
        clutter = models.region_clutter(self.clutter, self.region, "position")
        sensor = models.SensorModel(models.position(), noise, models.constant_detection(self.detection), clutter)
        given = models.TargetModel(moving, survival, self.birth), sensor
        return kind(*given) if limits is None else kind(*given, limits)

    def scans(self, num: int, seed: int) -> list[np.ndarray]:
        """Scans of a target from the origin at 5 m/s along x, with false measurements in 2 km around."""
        rng, found = np.random.default_rng(seed), []
        density = self.clutter / self.side**2
        for k in range(num):
            false = rng.uniform(-1000.0, 1000.0, (rng.poisson(density * 2000.0**2), 2))
            true = rng.normal([5.0 * k, 0.0], 10.0, (1, 2)) if rng.random() < self.detection else np.empty((0, 2))
            found.append(np.concatenate([true, false]) * self.metre)
        return found

    def run(self, scans: list[np.ndarray], kind: Callable[..., Any] = FactoredGlmbFilter, halves: int = 1) -> list[Any]:
        """Return the beliefs after each scan. halves: predictions, of equal length, between two scans."""
        tracker, beliefs = self.filter(kind), []
        belief = tracker.initial()
        for k, scan in enumerate(scans):
            for _ in range(halves - 1):
                belief, _ = tracker.predict(belief, self.second / halves, k + 1, births=_no_births(tracker))
            belief, _ = tracker.step(belief, scan, POSE, self.second / halves, k + 1, rng=RNG)
            beliefs.append(belief)
        return beliefs


def _no_births(tracker: Any) -> LMB:
    return LMB.empty(tracker.targets.state_dim)


def number(belief: Any) -> float:
    """Mean number of targets, undetected ones included."""
    probabilities = cardinality_distribution(belief)
    return float(probabilities @ np.arange(len(probabilities)))


def expected_total(belief: Any) -> float:
    """Sum of the existence of labels and of the intensity."""
    assert belief.undetected is not None
    return float(existence_probabilities(belief)[1].sum()) + float(belief.undetected.expected_number)


def scans_until_known(scene: Scene, kind: Callable[..., Any], seed: int) -> int:
    """Scans until the sum of existence near the target is above one half; 41: never in 40 scans."""
    for k, belief in enumerate(scene.run(scene.scans(40, seed), kind)):
        known = sum(t.existence for t in belief.targets() if np.hypot(t.mean[0] - 5.0 * k, t.mean[1]) < 60.0)
        if known > 0.5:
            return k + 1
    return 41


@pytest.mark.parametrize("kind", LABELLED)
@pytest.mark.parametrize("clutter", [1.0, 50.0])
def test_rarer_births_delay_a_target_by_a_scan_or_two_a_decade(kind: Any, clutter: float) -> None:
    """Each detection multiplies the odds by about P_D over the clutter in the area of the prediction."""
    waits = []
    # A list of 300 hypotheses over 50 false measurements holds no birth of 1e-8.
    for births in (1e-2, 1e-4, 1e-6) if kind is DeltaGlmbFilter else (1e-2, 1e-4, 1e-6, 1e-8, 1e-10):
        scene = Scene(births=births, clutter=clutter, sites=0 if kind is FactoredGlmbFilter else 1)
        waits.append(np.median([scans_until_known(scene, kind, seed) for seed in range(3)]))
    assert np.diff(waits).min() >= 0.0
    assert np.diff(waits).max() <= 4.0, waits
    assert waits[-1] <= 14.0, waits


@pytest.mark.parametrize("kind", [PhdFilter, CphdFilter, CbMemberFilter])
def test_filters_without_labels_find_a_target_of_rare_births(kind: Any) -> None:
    for births in (1e-3, 1e-6):
        scene = Scene(births=births, clutter=10.0, detection=0.95)
        known = max(number(belief) for belief in scene.run(scene.scans(30, 1), kind))
        assert known > 0.5, births


@pytest.mark.parametrize("sites", [0, 1, 10])
@pytest.mark.parametrize(
    ("births", "detection", "tolerance"), [(1e-6, 0.0, 1e-7), (1e-6, 0.7, 1e-5), (1e-3, 0.7, 1e-4), (0.05, 0.7, 5e-3)]
)
def test_the_expected_number_is_conserved(sites: int, births: float, detection: float, tolerance: float) -> None:
    """Dropped labels and measurements without a candidate return: from one prior, limits do not change the number.

    Without a target to rounding: all labels are faint. With one, to the competition of those left out.
    """
    scene = Scene(births=births, clutter=20.0, detection=max(detection, 0.7), sites=sites)
    usual = scene.filter()
    keeping = scene.filter(limits=replace(usual.limits, min_existence=0.0))
    belief = usual.initial()
    scans = (
        scene.scans(15, 2) if detection else [np.random.default_rng(k).uniform(-1e3, 1e3, (20, 2)) for k in range(15)]
    )
    for k, scan in enumerate(scans):
        whole, _ = keeping.step(belief, scan, POSE, 1.0, k + 1, rng=RNG)
        belief, info = usual.step(belief, scan, POSE, 1.0, k + 1, rng=RNG)
        total = expected_total(belief) + info.dropped_existence
        assert total == pytest.approx(expected_total(whole), rel=tolerance)


def test_a_prediction_conserves_the_expected_number() -> None:
    """Also of an intensity of more components than the limit, far lighter than a target."""
    scene = Scene(births=1e-12, sites=1)
    tracker = scene.filter(limits=Limits(max_intensity_components=3))
    certain = replace(tracker, targets=replace(tracker.targets, survival=models.constant_survival(1.0)))
    belief = certain.initial()
    for k in range(8):
        before = expected_total(belief)
        belief, _ = certain.predict(belief, 1.0, k + 1)
        assert expected_total(belief) - before == pytest.approx(1e-12, rel=1e-9)


def test_what_is_dropped_is_undetected_near_its_place() -> None:
    """A label far from the only site becomes a component of the intensity with its place and velocity."""
    scene = Scene(births=0.02, clutter=1.0, detection=0.999)
    tracker = scene.filter()
    belief = tracker.initial()
    for k in range(12):
        belief, _ = tracker.step(belief, [[60.0 * k, 0.0]], POSE, 1.0, k + 1, rng=RNG)
    for k in range(12, 20):
        belief, _ = tracker.step(belief, np.empty((0, 2)), POSE, 1.0, k + 1, rng=RNG)
        if not any(target.mean[0] > 500.0 for target in belief.targets()):
            break
    else:
        raise AssertionError("the label was not dropped")
    intensity = belief.undetected.intensity
    far = intensity.means[:, 0] > 500.0
    assert far.any()
    assert np.abs(intensity.means[far, 2] - 60.0).max() < 5.0


@pytest.mark.parametrize(
    ("kind", "births", "sites"), [*((kind, 0.02, 1) for kind in EVERY), (FactoredGlmbFilter, 1e-4, 0)]
)
def test_units_do_not_matter(kind: Any, births: float, sites: int) -> None:
    """Kilometres for metres, and milliseconds for seconds, births given for a period included."""
    scene = Scene(births=births, sites=sites, period=True)
    scans = scene.scans(10, 3)
    expected = [number(belief) for belief in scene.run(scans, kind)]
    for metre, second in ((1e-3, 1.0), (1.0, 1e3), (1e-3, 1e3)):
        other = replace(scene, metre=metre, second=second)
        found = [number(belief) for belief in other.run([scan * metre for scan in scans], kind)]
        np.testing.assert_allclose(found, expected, rtol=1e-7)


@pytest.mark.parametrize(("kind", "tolerance"), [(FactoredGlmbFilter, 1e-9), (PhdFilter, 1e-3)])
def test_one_site_may_be_split_into_ten(kind: Any, tolerance: float) -> None:
    """Exact for an intensity, in a PHD filter to its merging. An LMB forgets that ten labels exclude each other."""
    scene = Scene(births=1e-3)
    scans = scene.scans(12, 4)
    one, ten = (replace(scene, sites=sites).run(scans, kind) for sites in (1, 10))
    for first, second in zip(one, ten, strict=True):
        assert number(second) == pytest.approx(number(first), rel=tolerance)


@pytest.mark.parametrize("kind", LABELLED)
def test_a_period_may_be_split_into_empty_predictions(kind: Any) -> None:
    """Targets that are not born in between move and die alike in one prediction and in two."""
    scene = Scene(births=1e-3, period=True)
    scans = scene.scans(8, 5)
    one, two = scene.run(scans, kind), scene.run(scans, kind, halves=2)
    # Births of the first half are left out, which lowers every existence by about half.
    for first, second in zip(one, two, strict=True):
        assert 0.3 * number(first) <= number(second) <= 1.05 * number(first)
    born = scene.filter(kind)
    belief = one[-1]
    whole, _ = born.predict(belief, 1.0, 20, births=_no_births(born))
    half, _ = born.predict(belief, 0.5, 20, births=_no_births(born))
    halves, _ = born.predict(half, 0.5, 21, births=_no_births(born))
    assert number(halves) == pytest.approx(number(whole), rel=1e-5)  # of truncated predictions


def test_a_larger_region_of_equal_densities_is_the_same() -> None:
    """Births and clutter in proportion to the area: existence near the middle does not change."""
    scene = Scene(births=1e-3, clutter=20.0, sites=0)
    scans, found = scene.scans(8, 6), []
    for factor in (1.0, 4.0, 1000.0):
        area = factor**2
        larger = replace(scene, side=factor * scene.side, births=area * scene.births, clutter=area * scene.clutter)
        belief = larger.run(scans)[-1]
        found.append(sum(target.existence for target in belief.targets()))
    np.testing.assert_allclose(found, found[0], rtol=1e-4)  # cells are larger, too


def test_births_and_clutter_together_leave_the_first_odds() -> None:
    """The odds of a first detection are P_D times the density of undetected targets over that of clutter."""
    scene, found = Scene(births=1e-8, clutter=1e-2, sites=0), []
    for factor in (1.0, 1e2, 1e4):
        both = replace(scene, births=factor * scene.births, clutter=factor * scene.clutter)
        [belief] = both.run([np.array([[100.0, 50.0]])])
        found.append(float(existence_probabilities(belief)[1].sum()))
    np.testing.assert_allclose(found, found[0], rtol=1e-9)


def test_a_rare_site_next_to_a_frequent_one_is_followed() -> None:
    """The threshold is relative to the births of the place, not to those of the busiest place."""
    places = np.zeros((2, 4))
    places[1, 0] = 800.0
    std = np.diag([20.0, 20.0, 5.0, 5.0]) ** 2
    birth = models.BirthModel(np.array([0.1, 1e-6]), places, np.stack([std, std]))
    scene = Scene(clutter=20.0)
    tracker = replace(scene.filter(), targets=replace(scene.filter().targets, birth=birth))
    belief, rng = tracker.initial(), np.random.default_rng(7)
    for k in range(8):
        scan = np.vstack([rng.uniform(-1000.0, 1000.0, (20, 2)), rng.normal([800.0 + 3.0 * k, 0.0], 10.0, (1, 2))])
        belief, _ = tracker.step(belief, scan, POSE, 1.0, k + 1, rng=RNG)
    assert max(t.existence for t in belief.targets() if abs(t.mean[0] - 821.0) < 60.0) > 0.9


def test_a_full_budget_keeps_the_most_probable_labels() -> None:
    """With fewer places than false measurements a target is confirmed later, but it is confirmed."""
    scene = Scene(births=1e-5, clutter=100.0, sites=0)
    for most in (30, 1000):
        tracker = scene.filter(limits=Limits(max_labels=most))
        belief = tracker.initial()
        for k, scan in enumerate(scene.scans(25, 8)):
            belief, _info = tracker.step(belief, scan, POSE, 1.0, k + 1, rng=RNG)
            assert len(existence_probabilities(belief)[0]) <= most
        near = [t.existence for t in belief.targets() if math.hypot(t.mean[0] - 120.0, t.mean[1]) < 60.0]
        assert max(near) > 0.9, most


def test_a_second_sensor_confirms_a_faint_label() -> None:
    scene = Scene(births=1e-6, clutter=20.0, sites=0)
    one = scene.filter()
    tracker = SequentialFactoredFilter(one.targets, (one.sensor, one.sensor))
    belief, rng = tracker.initial(), np.random.default_rng(9)
    for k in range(4):
        scans = [
            np.vstack([rng.uniform(-1000.0, 1000.0, (20, 2)), rng.normal([5.0 * k, 0.0], 10.0, (1, 2))])
            for _ in range(2)
        ]
        belief, _ = tracker.step(belief, scans, [POSE, POSE], 1.0, k + 1, rng=RNG)
    assert max(t.existence for t in belief.targets() if abs(t.mean[0] - 15.0) < 60.0) > 0.9
