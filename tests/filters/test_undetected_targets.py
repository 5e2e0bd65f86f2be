"""Undetected targets as a Poisson intensity: closed forms, enumeration, and numbers that do not depend on the sites."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vedette import models
from vedette.densities import LMB, cardinality_distribution, existence_probabilities
from vedette.errors import InputError
from vedette.filters import FactoredGlmbFilter, Limits, SequentialFactoredFilter
from vedette.kernels.gaussian.components import components_of
from vedette.kernels.steps.faint_labels import Background, with_returned

pytestmark = pytest.mark.lanes

REGION = models.Region(-500.0, 500.0, -500.0, 500.0)
STD = np.array([20.0, 20.0, 5.0, 5.0])  # of a birth
NOISE, POSE = 10.0, np.zeros(3)
RNG = np.random.default_rng(0)  # nothing is drawn


def sensor(detection: float = 0.9, clutter: float = 5.0, region: models.Region = REGION) -> models.SensorModel:
    return models.SensorModel(
        models.position(),
        models.constant_noise([NOISE, NOISE]),
        models.constant_detection(detection),
        models.region_clutter(clutter, region, "position"),
    )


def targets(birth: models.BirthModel, survival: float = 0.99) -> models.TargetModel:
    return models.TargetModel(models.constant_velocity(1.0), models.constant_survival(survival, period=1.0), birth)


def sites(existence: Any, places: Any, std: Any = STD, **more: Any) -> models.BirthModel:
    means = np.zeros((len(places), 4))
    means[:, :2] = places
    covs = np.tile(np.diag(np.asarray(std) ** 2), (len(places), 1, 1))
    return models.BirthModel(np.broadcast_to(existence, len(places)).astype(float), means, covs, **more)


def number(belief: Any) -> float:
    """Mean number of targets."""
    probabilities = cardinality_distribution(belief)
    return float(probabilities @ np.arange(len(probabilities)))


def one_measurement(num: int, existence: float, detection: float, clutter: float) -> np.ndarray:
    """Probabilities of 0, 1, ... targets of equal sites at a place, measured once there, before any scan.

    Of k targets all are missed and the measurement is clutter, or one of them is detected.
    """
    peak, kappa = 1.0 / (2.0 * math.pi * (STD[0] ** 2 + NOISE**2)), clutter / REGION.area
    weights = [
        math.comb(num, k)
        * existence**k
        * (1.0 - existence) ** (num - k)
        * ((1.0 - detection) ** k * kappa + k * detection * peak * (1.0 - detection) ** max(k - 1, 0))
        for k in range(min(num, 40) + 1)
    ]
    return np.array(weights) / np.sum(weights)


@pytest.mark.parametrize("num", [1, 3, 7, 20, 45, 100])
@pytest.mark.parametrize(("total", "detection", "clutter"), [(0.3, 0.9, 5.0), (0.08, 0.6, 30.0), (0.14, 0.95, 0.5)])
def test_equal_sites_have_the_number_of_targets_in_closed_form(
    num: int, total: float, detection: float, clutter: float
) -> None:
    tracker = FactoredGlmbFilter(targets(sites(total / num, np.zeros((num, 2)))), sensor(detection, clutter))
    belief, info = tracker.step(tracker.initial(), [[0.0, 0.0]], POSE, 1.0, 1, rng=RNG)
    exact, found = one_measurement(num, total / num, detection, clutter), cardinality_distribution(belief)
    assert number(belief) == pytest.approx(float(exact @ np.arange(len(exact))), abs=0.02)
    size = min(len(exact), len(found), 4)
    np.testing.assert_allclose(found[:size], exact[:size], atol=0.03)
    assert 0.0 <= info.independence_error_bound < 0.2


@pytest.mark.parametrize("num", [10, 40, 100])
def test_one_target_stays_one_however_many_sites_it_may_come_from(num: int) -> None:
    tracker = FactoredGlmbFilter(targets(sites(0.3 / num, np.zeros((num, 2)))), sensor())
    belief = tracker.initial()
    for step in range(1, 7):
        belief, _ = tracker.step(belief, [[0.0, 0.0]], POSE, 1.0, step, rng=RNG)
    assert number(belief) == pytest.approx(1.05, abs=0.05)


def test_the_number_does_not_depend_on_how_often_is_predicted() -> None:
    """Births by rates, over three seconds before a scan."""
    places, found = np.array([[-100.0, 0.0], [100.0, 0.0]]), []
    for num in (3, 10, 30, 300):
        tracker = FactoredGlmbFilter(targets(sites(0.27, places, period=1.0)), sensor())
        belief = tracker.initial()
        for step in range(1, num + 1):
            belief, _ = tracker.predict(belief, 3.0 / num, step)
        found.append((number(belief), number(tracker.update(belief, places, POSE, rng=RNG)[0])))
    np.testing.assert_allclose(found[2], found[3], atol=0.03)
    after = [last for _, last in found]
    assert max(after) - min(after) < 0.15  # a birth a second at most, or as many as rates say


def test_scans_of_elsewhere_begin_nothing() -> None:
    """One radar scans twenty times a second what lies far away, another sees both targets every three seconds."""
    places, rng = np.array([[-100.0, 0.0], [100.0, 0.0]]), np.random.default_rng(4)
    away = models.Region(5000.0, 6000.0, -500.0, 500.0)
    found = []
    for rate in (1, 20):
        tracker = SequentialFactoredFilter(
            targets(sites(0.03, places, period=1.0)), (sensor(0.0, 2.0, away), sensor(0.95))
        )
        belief = tracker.initial()
        for step in range(1, 12 * rate + 1):
            elsewhere = rng.uniform([5000.0, -500.0], [6000.0, 500.0], (2, 2))
            seen = places + rng.normal(0.0, NOISE, places.shape) if step % (3 * rate) == 0 else None
            belief, _ = tracker.step(belief, [elsewhere, seen], np.zeros((2, 3)), 1.0 / rate, step, rng=RNG)
        found.append(number(belief))
    assert found == pytest.approx([2.1, 2.1], abs=0.1)


def test_born_anywhere_by_a_grid_of_weak_sites_is_one_target() -> None:
    middles, rng = np.linspace(-450.0, 450.0, 19), np.random.default_rng(5)
    places = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    tracker = FactoredGlmbFilter(targets(sites(0.05 / 361, places, [30.0, 30.0, 5.0, 5.0])), sensor())
    belief = tracker.initial()
    for step in range(1, 7):
        clutter = rng.uniform(-500.0, 500.0, (rng.poisson(5.0), 2))
        scan = np.vstack([np.array([13.0 + 3.0 * step, 7.0]) + rng.normal(0.0, NOISE, 2), clutter])
        belief, _ = tracker.step(belief, scan, POSE, 1.0, step, rng=RNG)
    assert number(belief) == pytest.approx(1.1, abs=0.15)
    assert len(existence_probabilities(belief)[0]) < 60


def test_two_sites_and_two_births_make_no_second_target() -> None:
    """P(2) after the second detection of a target between two sites, by a delta-GLMB of 5,000 hypotheses .07."""
    birth = sites(0.1, [[-20.0, 0.0], [20.0, 0.0]], steps=frozenset({1, 2}))
    tracker = FactoredGlmbFilter(targets(birth), sensor(0.8))
    belief = tracker.initial()
    for step in (1, 2):
        belief, _ = tracker.step(belief, [[0.0, 0.0]], POSE, 1.0, step, rng=RNG)
    assert cardinality_distribution(belief)[2] == pytest.approx(0.07, abs=0.05)


def test_a_scan_has_the_posterior_of_poisson_births_in_closed_form() -> None:
    """Existence rho / (rho + kappa), the rest thinned by 1 - P_D, and the likelihood of the scan."""
    existence, places = np.array([0.04, 0.01]), np.array([[0.0, 0.0], [60.0, 0.0]])
    detection, clutter, scan = 0.7, 4.0, np.array([[12.0, 5.0], [55.0, -9.0], [400.0, 400.0]])
    tracker = FactoredGlmbFilter(targets(sites(existence, places)), sensor(detection, clutter), Limits.none())
    belief, info = tracker.step(tracker.initial(), scan, POSE, 1.0, 3, rng=RNG)
    kappa, spread = clutter / REGION.area, (STD[0] ** 2 + NOISE**2) * np.eye(2)
    density = np.array([multivariate_normal(place, spread).pdf(scan) for place in places])
    rho = detection * existence @ density
    labels, found = existence_probabilities(belief)
    assert labels.tolist() == [[3, 2], [3, 3], [3, 4]]
    np.testing.assert_allclose(found, rho / (rho + kappa), rtol=1e-9, atol=1e-12)
    assert belief.undetected is not None
    assert belief.undetected.expected_number == pytest.approx((1.0 - detection) * existence.sum(), rel=1e-9)
    expected = -clutter - detection * existence.sum() + np.log(kappa + rho).sum()
    assert info.log_likelihood == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("limits", [Limits(max_labels=1), Limits(max_position_std=1.0)])
def test_labels_that_are_dropped_are_undetected_targets_again(limits: Limits) -> None:
    birth = sites([0.1, 0.12, 0.05], [[-200.0, 0.0], [200.0, 0.0], [0.0, 200.0]])
    scan = [[-190.0, 4.0], [210.0, 3.0], [0.0, 190.0]]
    numbers = []
    for each in (Limits(), limits):
        tracker = FactoredGlmbFilter(targets(birth), sensor(clutter=60.0), each)
        belief, _ = tracker.step(tracker.initial(), scan, POSE, 1.0, 1, rng=RNG)
        assert belief.undetected is not None
        numbers.append(number(belief))
    assert len(existence_probabilities(belief)[0]) < 3
    assert numbers[1] == pytest.approx(numbers[0], rel=0.01, abs=0.02)


def test_a_first_detection_that_does_not_bend_beside_an_intensity_that_does() -> None:
    """A wide birth site close to a radar, and a narrow one far away, where alone something is measured."""
    radar = models.SensorModel(
        models.bearing_range(),
        models.constant_noise([math.radians(0.5), 5.0]),
        models.constant_detection(0.9),
        models.region_clutter(5.0, models.Region(-500.0, 3000.0, -1500.0, 1500.0), "bearing_range"),
    )
    means = np.array([[150.0, 0.0, 0.0, 0.0], [2500.0, 0.0, 0.0, 0.0]])
    covs = np.array([np.diag([std, std, 5.0, 5.0]) ** 2 for std in (60.0, 1.0)])
    birth = models.BirthModel(np.array([0.05, 0.05]), means, covs)
    tracker = FactoredGlmbFilter(targets(birth, 0.999), radar)
    belief, _ = tracker.step(tracker.initial(), [[0.0, 2500.0]], POSE, 1.0, 1, rng=RNG)
    [label], [existence] = existence_probabilities(belief)
    assert label.tolist() == [1, 2]
    assert existence > 0.9


def test_births_that_are_given_are_instead_of_those_anywhere() -> None:
    """Else a filter inside one of a user's, whose tracker gives births from measurements, would count them twice."""
    measured = models.MeasurementBirth(2.0, 0.03, STD, REGION)
    birth = models.BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), from_measurements=measured)
    tracker = FactoredGlmbFilter(targets(birth), sensor())
    belief, _ = tracker.step(tracker.initial(), [[0.0, 0.0]], POSE, 1.0, 1, rng=RNG, births=LMB.empty(4))
    assert number(belief) == 0.0
    belief, _ = tracker.step(tracker.initial(), [[0.0, 0.0]], POSE, 1.0, 1, rng=RNG)
    assert number(belief) > 0.2


def test_labels_of_steps_in_the_past_are_refused() -> None:
    tracker = FactoredGlmbFilter(targets(sites([0.05], [[0.0, 0.0]])), sensor())
    belief, _ = tracker.step(tracker.initial(), [[0.0, 0.0]], POSE, 1.0, 5, rng=RNG)
    with pytest.raises(InputError, match="of which the last is 5; got 4"):
        tracker.step(belief, [[0.0, 0.0]], POSE, 1.0, 4, rng=RNG)


@pytest.mark.parametrize("log_number", [-3.0, -711.0, -735.0])
def test_faint_labels_return_to_any_number_of_undetected_targets(log_number: float) -> None:
    """After a thousand empty scans, with a recorded camera, the number has no inverse in floating point."""
    means, covs = np.array([[0.0, 0.0, 1.0, 0.0]]), np.diag([4.0, 4.0, 1.0, 1.0])[np.newaxis]
    intensity = components_of(np.array([log_number]), means, covs)
    returned = components_of(np.array([log_number - math.log(3.0)]), means + np.array([2.0, 0.0, 0.0, 0.0]), covs)
    sites = np.array([[math.exp(log_number), 0.0, 0.0, 4.0, 4.0, 0.0]])
    found = with_returned(intensity, np.empty((0, 0)), Background(sites, np.empty(0), np.zeros(6)), returned)
    assert found.log_weights == pytest.approx([log_number + math.log(4.0 / 3.0)])
    np.testing.assert_allclose(found.means, [[0.5, 0.0, 1.0, 0.0]])
    np.testing.assert_allclose(found.covs[0], np.diag([4.75, 4.0, 1.0, 1.0]), atol=1e-15)


@pytest.mark.parametrize("seed", [5, 22, 31])
def test_of_two_close_births_in_clutter_none_is_lost(seed: int) -> None:
    """Four sensors of P_D .6 with 60 false measurements; births 13 to 21 m apart, within their spread, at one step."""
    rng = np.random.default_rng(seed)
    angle, middle = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(-200.0, 200.0, 2)
    offset = 0.5 * rng.uniform(13.0, 21.0) * np.array([math.cos(angle), math.sin(angle)])
    births = np.array([middle - offset, middle + offset])
    velocities = rng.uniform(-5.0, 5.0, (2, 2))
    tracker = SequentialFactoredFilter(
        targets(sites(0.5, births, steps=frozenset({1}))), (sensor(0.6, 60.0),) * 4, Limits(max_hypotheses=100)
    )
    belief = tracker.initial()
    for step in range(1, 21):
        places = births + step * velocities
        scans = []
        for _ in range(4):
            seen = places[rng.random(2) < 0.6]
            clutter = rng.uniform(-500.0, 500.0, (rng.poisson(60.0), 2))
            scans.append(np.vstack([seen + rng.normal(0.0, NOISE, seen.shape), clutter]))
        belief, _ = tracker.step(belief, scans, np.zeros((4, 3)), 1.0, step, rng=RNG)
    assert number(belief) == pytest.approx(2.0, abs=0.2)
