"""Fusion that goes by what each sensor can see: against plain NumPy, and what a blind sensor may change."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import logit

from fusion.sights import BLIND, LABELS, PLACES, assert_same_bits, belief, informed, moments, sensor, views
from vedette.densities import LMB, TrackTable
from vedette.errors import InputError
from vedette.fusion import ArithmeticAverage, Clmb, FieldsOfView
from vedette.models import constant_detection

QUARTERS = (0.25, 0.25, 0.5)
RULES: list[Any] = [Clmb, ArithmeticAverage]


def by_hand(shares: Any, logits: Any, means: Any, covs: Any) -> tuple[float, Any, Any]:
    """GCI of single Gaussians with powers `shares`: logit, mean and covariance."""
    informations = [np.linalg.inv(cov) for cov in covs]
    information = sum(w * y for w, y in zip(shares, informations, strict=True))
    cov = np.linalg.inv(information)
    mean = cov @ sum(w * y @ m for w, y, m in zip(shares, informations, means, strict=True))
    log_overlap = -0.5 * np.linalg.slogdet(information)[1]
    for w, y, m in zip(shares, informations, means, strict=True):
        log_overlap += 0.5 * w * (np.linalg.slogdet(y)[1] - (m - mean) @ y @ (m - mean))
    return float(np.dot(shares, logits) + log_overlap), mean, cov


def test_weights_are_those_of_the_detection_at_each_label() -> None:
    rng = np.random.default_rng(1)
    beliefs = [belief((0.9, 0.8, 0.3), rng), belief((0.95, 0.4, 0.7), rng)]
    seen = views([0.9, constant_detection(0.3)])
    fused, info = Clmb((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, seen)
    fused.validate()
    own: Any = moments(fused)
    parts: Any = [moments(each) for each in beliefs]
    for label, chances in zip(LABELS, ([0.9, 0.3], [0.0, 0.3], [0.0, 0.3]), strict=True):
        expected = by_hand(informed(*chances), *zip(*(part[label] for part in parts), strict=True))
        for found, wanted in zip(own[label], expected, strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-10)
    assert info.num_missing_labels == 0


def test_a_sensor_that_sees_the_place_and_lacks_the_label_has_its_floor() -> None:
    rng = np.random.default_rng(2)
    first, second = belief((0.9, 0.9), rng, (0, 1)), belief((0.8,), rng, (0,))
    seen = views([constant_detection(0.9), 0.6])
    fused, info = Clmb((0.5, 0.5), field_of_view_weighting=True, missing_existence=1e-3).fuse([first, second], seen)
    assert fused.existence_logit[1] == pytest.approx(logit(0.9), rel=1e-12)
    assert info.missing_labels == (0, 0)
    fused, info = Clmb((0.5, 0.5), field_of_view_weighting=True, missing_existence=1e-3).fuse(
        [first, second], views([constant_detection(0.9), constant_detection(0.6)])
    )
    surer, other = informed(0.9, 0.6)
    assert fused.existence_logit[1] == pytest.approx(surer * logit(0.9) + other * logit(1e-3), rel=1e-12)
    assert info.missing_labels == (0, 1)
    np.testing.assert_allclose(fused.tracks.means[1], first.tracks.means[1], rtol=1e-12)
    # All that see the place lack the label: the floor, at the density of those that have it.
    fused, _ = Clmb((0.5, 0.5), field_of_view_weighting=True, missing_existence=1e-3).fuse(
        [first, second], views([0.9, constant_detection(0.6)])
    )
    assert fused.existence_logit[1] == pytest.approx(logit(1e-3), rel=1e-12)
    np.testing.assert_allclose(fused.tracks.means[1], first.tracks.means[1], rtol=1e-12)


def test_where_nobody_sees_those_that_have_the_label_keep_their_weights() -> None:
    rng = np.random.default_rng(3)
    beliefs = [belief((0.9, 0.6), rng, (0, 2)), belief((0.8, 0.5), rng, (0, 2)), belief((0.8,), rng, (0,))]
    fused, info = Clmb((0.2, 0.3, 0.5), field_of_view_weighting=True).fuse(beliefs, views([0.9, 0.5, 0.7]))
    parts = [moments(each)[LABELS[2]] for each in beliefs[:2]]
    expected = by_hand(np.array([0.4, 0.6]), *zip(*parts, strict=True))
    own: Any = moments(fused)[LABELS[2]]
    for found, wanted in zip(own, expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-10)
    assert info.missing_labels == (0, 0, 0)


@pytest.mark.parametrize("rule", RULES)
def test_where_nobody_has_scanned_sensors_count_by_what_they_would_see(rule: Any) -> None:
    rng = np.random.default_rng(8)
    beliefs = [belief((0.95, 0.9, 0.1), rng), belief((0.1, 0.2, 0.9), rng)]
    at = [PLACES[0, 0], PLACES[2, 0]]
    expected, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, views([0.9, 0.9], at))
    fused, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, views([0.9, 0.9], at, [False, False]))
    assert_same_bits(fused, expected)
    # The second has scanned, and does not see the first target.
    fused, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, views([0.9, 0.9], at, [False, True]))
    assert fused.existence[[0, 2]] == pytest.approx([0.95, 0.9])


@pytest.mark.parametrize("rule", RULES)
def test_many_that_hardly_see_do_not_outvote_a_few_that_do(rule: Any) -> None:
    """Fourteen that detect a fifth of what is there and lack the label, beside two that see it."""
    rng = np.random.default_rng(9)
    sees, hardly = belief((0.99, 0.99, 0.99), rng), belief((0.5,), rng, (1,))
    chances = [constant_detection(0.98)] * 2 + [constant_detection(0.2)] * 14
    fused, info = rule(np.full(16, 1.0 / 16), field_of_view_weighting=True).fuse(
        [sees] * 2 + [hardly] * 14, views(chances)
    )
    assert (fused.existence > 0.95).all()
    assert (info.missing_labels, info.num_lost_labels) == ((0, 0, *(2,) * 14), 0)


@pytest.mark.parametrize("rule", RULES)
def test_one_that_misses_nothing_and_lacks_a_label_decides(rule: Any) -> None:
    rng = np.random.default_rng(10)
    beliefs = [belief((0.9,), rng, (0,)), belief((0.9,), rng, (1,))]
    fused, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse(
        beliefs, views([constant_detection(0.5), constant_detection(1.0)])
    )
    assert fused.existence[fused.tracks.labels[:, 1] == 0] < 0.01
    assert np.isfinite(fused.existence_logit).all()


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("why", ["sees nothing", "did not scan"])
def test_a_blind_sensor_changes_nothing_to_the_last_bit(rule: Any, why: str) -> None:
    rng = np.random.default_rng(4)
    beliefs = [belief((0.9, 0.8, 0.3), rng), belief((0.95, 0.4, 0.7), rng)]
    blind = BLIND if why == "sees nothing" else constant_detection(0.9)
    seen = views([0.9, constant_detection(0.6), blind], scanned=[True, True, why == "sees nothing"])
    expected, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, views([0.9, constant_detection(0.6)]))
    for third in (belief((1.0 - 1e-9,) * 3, rng), belief((0.001,), rng, (1,)), LMB.empty(2)):
        fused, _ = rule(QUARTERS, field_of_view_weighting=True).fuse([*beliefs, third], seen)
        assert_same_bits(fused, expected)


@pytest.mark.parametrize("rule", RULES)
def test_the_order_of_sensors_and_many_blind_ones_change_nothing(rule: Any) -> None:
    rng = np.random.default_rng(5)
    beliefs = [belief(rng.uniform(0.1, 0.9, 3).tolist(), rng) for _ in range(12)]
    detections = [constant_detection(0.8) if s in (2, 9) else BLIND for s in range(12)]
    fused, _ = rule(np.full(12, 1.0 / 12), field_of_view_weighting=True).fuse(beliefs, views(detections))
    two, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse(
        [beliefs[2], beliefs[9]], views([constant_detection(0.8)] * 2)
    )
    np.testing.assert_allclose(fused.existence_logit, two.existence_logit, rtol=1e-12)
    np.testing.assert_allclose(fused.tracks.means, two.tracks.means, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("rule", RULES)
def test_certain_labels_and_sensors_of_weight_zero(rule: Any) -> None:
    rng = np.random.default_rng(6)
    sure, unsure = belief((1.0, 1.0, 1.0), rng), belief((0.2, 0.0, 0.3), rng)
    fused, _ = rule((0.5, 0.5), field_of_view_weighting=True).fuse([unsure, sure], views([0.9, BLIND]))
    assert fused.existence[0] == pytest.approx(0.2)
    assert not np.isnan(fused.existence_logit).any()
    fused, _ = rule((0.0, 1.0), field_of_view_weighting=True).fuse([unsure, sure], views([0.9, 0.9]))
    assert (fused.existence == 1.0).all()


def test_detection_is_the_mean_over_the_mixture_and_nothing_without_a_scan() -> None:
    tracks = TrackTable.from_mixtures(
        LABELS[:2],
        [([0.25, 0.75], [[0.0, 0.0], [900.0, 0.0]], [np.eye(2)] * 2), ([1.0], [[5.0, 0.0]], [np.eye(2)])],
    )
    seen = views([0.8, constant_detection(0.5), constant_detection(0.5)], scanned=[True, True, False])
    np.testing.assert_allclose(seen.detection(tracks), [[0.2, 0.5, 0.0], [0.8, 0.5, 0.0]], rtol=1e-12)
    assert seen.detection(TrackTable.empty(2)).shape == (0, 3)


def test_views_that_are_missing_or_do_not_fit() -> None:
    rng = np.random.default_rng(7)
    beliefs = [belief((0.9,), rng, (0,))] * 2
    with pytest.raises(InputError, match=r"views: expected the fields of view .* field_of_view_weighting; got None"):
        Clmb((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs)
    with pytest.raises(InputError, match=r"views.sensors: expected 2, one for each fusion weight; got 3"):
        Clmb((0.5, 0.5), field_of_view_weighting=True).fuse(beliefs, views([0.9] * 3))
    model = sensor(BLIND)
    with pytest.raises(InputError, match=r"views.sensors: expected at least one SensorModel"):
        FieldsOfView((), np.zeros((0, 3)), ())
    with pytest.raises(InputError, match=r"views.poses: expected an array of shape \(1, any\)"):
        FieldsOfView((model,), np.zeros((2, 3)), (True,))
    with pytest.raises(InputError, match=r"views.scanned: expected 1, one a sensor; got 2"):
        FieldsOfView((model,), np.zeros((1, 3)), (True, False))
    with pytest.raises(
        InputError, match=r"views.prediction: expected a GLMB, an LMB or a FactoredGLMB, or None; got int"
    ):
        FieldsOfView((model,), np.zeros((1, 3)), (True,), 3)  # type: ignore[arg-type]


def test_the_density_of_a_sensor_that_cannot_see_its_own_label_does_not_count() -> None:
    """The first is surer, but of a place that it does not see; at the place that the second sees both see it."""
    lmbs = [
        LMB.from_bernoullis([LABELS[0]], [r], [[x, 0.0]], [9.0 * np.eye(2)]) for r, x in ((0.99, 190.0), (0.5, 120.0))
    ]
    fused, _ = Clmb((0.5, 0.5), field_of_view_weighting=True).fuse(lmbs, views([0.9, constant_detection(0.9)]))
    parts = [moments(each)[LABELS[0]] for each in lmbs]
    expected = by_hand(np.array([0.5, 0.5]), *zip(*parts, strict=True))
    own: Any = moments(fused)[LABELS[0]]
    for found, wanted in zip(own, expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_a_sensor_without_a_label_is_no_surer_of_it_than_of_its_least_label() -> None:
    rng = np.random.default_rng(12)
    first, second = belief((0.9,), rng, (0,)), belief((1e-6,), rng, (1,))
    fused, _ = Clmb((0.5, 0.5), missing_existence=1e-3).fuse([first, second])
    assert fused.existence_logit[0] == pytest.approx(0.5 * (logit(0.9) + logit(1e-6)), rel=1e-12)
    assert fused.existence_logit[1] == pytest.approx(0.5 * (logit(1e-6) + logit(1e-3)), rel=1e-12)
