"""The parallel update of products of GLMBs and of mixtures: against updates in turn, and where LMBs lose targets."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vedette.densities import GLMB, LMB, FactoredGLMB, TrackTable, as_lmb, existence_probabilities, track_moments
from vedette.errors import InputError
from vedette.filters import FactoredGlmbFilter, Limits, LmbFilter
from vedette.fusion import FieldsOfView, ParallelUpdate
from vedette.models import (
    BirthModel,
    SensorModel,
    TargetModel,
    constant_detection,
    constant_noise,
    constant_survival,
    constant_velocity,
    measurement_space_clutter,
    position,
)

COV = np.diag([400.0, 400.0, 25.0, 25.0])
POSE = np.zeros(3)
RNG = np.random.default_rng(0)
TARGETS = TargetModel(constant_velocity(1.0), constant_survival(0.95), BirthModel.none(4))


def sensor(detected: float = 0.98) -> SensorModel:
    clutter = measurement_space_clutter(10.0, [-500.0, -500.0], [500.0, 500.0])
    return SensorModel(position(), constant_noise([10.0, 10.0]), constant_detection(detected), clutter)


def filter_of(own: SensorModel, split: float = 0.0) -> FactoredGlmbFilter:
    return FactoredGlmbFilter(TARGETS, own, Limits.none(), max_split_error=split, max_factor_labels=20)


def views(sensors: Any, prediction: Any) -> FieldsOfView:
    return FieldsOfView(tuple(sensors), np.zeros((len(sensors), 3)), (True,) * len(sensors), prediction)


def one_of_two(weights: Any, apart: float = 15.0) -> FactoredGLMB:
    """Two labels in one factor: neither, the first, the second, both."""
    means = [[0.0, 0.0, 1.0, 0.0], [apart, 0.0, -1.0, 0.0]]
    tracks = TrackTable.from_gaussians([(1, 0), (1, 1)], means, [COV, 1.5 * COV])
    return FactoredGLMB.of(GLMB.from_hypotheses(tracks, [[], [0], [1], [0, 1]], weights))


def in_turn(prediction: Any, sensors: Any, scans: Any) -> FactoredGLMB:
    belief = prediction
    for own, scan in zip(sensors, scans, strict=True):
        belief, _ = filter_of(own).update(belief, scan, POSE, rng=RNG)
    return belief


def in_parallel(prediction: Any, sensors: Any, scans: Any, split: float = 0.0) -> FactoredGLMB:
    posteriors = [
        filter_of(own, split).update(prediction, scan, POSE, rng=RNG)[0]
        for own, scan in zip(sensors, scans, strict=True)
    ]
    fused, _ = ParallelUpdate().fuse(posteriors, views(sensors, prediction))
    fused.validate()
    return fused


def moments(belief: Any) -> Any:
    lmb = as_lmb(belief)
    return lmb.existence, *track_moments(lmb.tracks)


@pytest.mark.parametrize("seed", range(5))
def test_labels_of_which_one_exists_are_as_after_updates_in_turn(seed: int) -> None:
    """Several measurements near them at each sensor: every set has one label at most, of a mixture, and is exact."""
    rng = np.random.default_rng(seed)
    prediction = one_of_two(np.array([0.2, 0.5, 0.3, 0.0]))
    sensors = [sensor(detected) for detected in (0.9, 0.7, 0.98)]
    scans = [rng.normal(size=(int(rng.integers(1, 4)), 2)) * 25.0 for _ in sensors]
    fused, exact = in_parallel(prediction, sensors, scans), in_turn(prediction, sensors, scans)
    for found, wanted in zip(moments(fused), moments(exact), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-3 * np.abs(wanted).max())


@pytest.mark.parametrize("seed", range(5))
def test_a_label_seen_among_clutter_is_as_after_updates_in_turn(seed: int) -> None:
    """One label: mixtures are divided by the prediction, and only then made small."""
    rng = np.random.default_rng(seed)
    prediction = LMB.from_bernoullis([(1, 0)], [0.3], [[5.0, 2.0, 1.0, 0.0]], [COV])
    sensors, scans = [sensor(0.9)] * 4, [rng.normal(size=(3, 2)) * 30.0 for _ in range(4)]
    belief: LMB = prediction
    posteriors = []
    for own, scan in zip(sensors, scans, strict=True):
        filter_ = LmbFilter(TARGETS, own, Limits.none())
        belief, _ = filter_.update(belief, scan, POSE, rng=RNG)
        posteriors.append(FactoredGLMB.of(filter_.update(prediction, scan, POSE, rng=RNG)[0]))
    fused, _ = ParallelUpdate().fuse(posteriors, views(sensors, prediction))
    for found, wanted in zip(moments(fused), moments(belief), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=1e-3 * np.abs(wanted).max())


def test_two_labels_of_one_target_stay_one_where_lmbs_lose_both() -> None:
    """Each of five sensors says that one of the two goes; label by label all say so of both."""
    means = np.array([[0.0, 0.0, 1.0, 0.0], [4.0, 0.0, 1.0, 0.0]])
    lmb = LMB.from_bernoullis([(1, 0), (1, 1)], [0.9, 0.9], means, [COV, COV])
    sensors, scans = [sensor()] * 5, [np.array([[2.0, 0.0]])] * 5
    exact = existence_probabilities(in_turn(FactoredGLMB.of(lmb), sensors, scans))[1]
    for split in (0.0, 0.7 / 5):
        fused = in_parallel(FactoredGLMB.of(lmb), sensors, scans, split)
        np.testing.assert_allclose(existence_probabilities(fused)[1], exact, atol=0.01)
    assert exact.sum() == pytest.approx(1.0, abs=0.01)
    posterior, _ = LmbFilter(TARGETS, sensors[0], Limits.none()).update(lmb, scans[0], POSE, rng=RNG)
    by_label, _ = ParallelUpdate().fuse([posterior] * 5, views(sensors, lmb))
    assert existence_probabilities(by_label)[1].sum() < 0.15


def test_who_sees_nothing_says_nothing_however_its_posterior_is_factored() -> None:
    prediction = one_of_two(np.array([0.05, 0.45, 0.48, 0.02]))
    scans = [np.array([[3.0, 1.0]]), np.array([[-6.0, 2.0], [20.0, 3.0]])]
    expected = in_parallel(prediction, [sensor(), sensor(0.9)], scans)
    told = [
        filter_of(own).update(prediction, scan, POSE, rng=RNG)[0]
        for own, scan in zip([sensor(), sensor(0.9)], scans, strict=True)
    ]
    apart = FactoredGLMB.of(as_lmb(prediction))
    for blind in (prediction, apart):
        fused, info = ParallelUpdate().fuse([*told, *[blind] * 14], views([sensor()] * 16, prediction))
        for found, wanted in zip(moments(fused), moments(expected), strict=True):
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
        assert info.missing_labels == (0,) * 16


def test_labels_far_from_all_others_are_those_of_lmbs() -> None:
    rng = np.random.default_rng(3)
    means = np.column_stack([[0.0, 300.0, -300.0], np.zeros((3, 3))])
    lmb = LMB.from_bernoullis([(1, 0), (1, 1), (2, 0)], [0.5, 0.9, 0.2], means, [COV] * 3)
    sensors, posteriors = [sensor(), sensor(0.6)], []
    for own in sensors:
        scan = means[:, :2] + rng.normal(size=(3, 2)) * 8.0
        limits = replace(Limits.none(), gate_probability=0.999, max_components=1)
        posteriors.append(LmbFilter(TARGETS, own, limits).update(lmb, scan, POSE, rng=RNG)[0])
    expected, told = ParallelUpdate().fuse(posteriors, views(sensors, lmb))
    fused, info = ParallelUpdate().fuse(
        [FactoredGLMB.of(own) for own in posteriors], views(sensors, FactoredGLMB.of(lmb))
    )
    for found, wanted in zip(moments(fused), moments(expected), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-12)
    assert replace(info, log_normaliser=0.0) == replace(told, log_normaliser=0.0)


def test_a_label_dropped_by_a_posterior_counts_as_in_lmbs() -> None:
    prediction = one_of_two(np.array([0.1, 0.4, 0.4, 0.1]))
    kept, _ = filter_of(sensor()).update(prediction, np.array([[1.0, 1.0]]), POSE, rng=RNG)
    fewer = FactoredGLMB.of(
        GLMB.from_hypotheses(TrackTable.from_gaussians([(1, 0)], [[0.0, 0.0, 1.0, 0.0]], [COV]), [[], [0]], [0.5, 0.5])
    )
    fused, info = ParallelUpdate(missing_existence=1e-3).fuse([kept, fewer], views([sensor()] * 2, prediction))
    assert info.missing_labels == (0, 1)
    alone, _ = ParallelUpdate().fuse([kept], views([sensor()], prediction))
    before, after = existence_probabilities(alone)[1], existence_probabilities(fused)[1]
    assert after[1] < 0.01 < before[1]
    assert after[0] > 0.5


def test_what_cannot_be_divided_is_refused() -> None:
    prediction = one_of_two(np.array([0.1, 0.4, 0.4, 0.1]))
    tracks = TrackTable.from_gaussians([(1, 0), (1, 0)], [[0.0] * 4, [9.0, 0.0, 0.0, 0.0]], [COV] * 2)
    versions = FactoredGLMB.of(GLMB.from_hypotheses(tracks, [[0], [1]], [0.5, 0.5]))
    with pytest.raises(InputError, match=r"views.prediction: expected one Gaussian for each of its 1 labels.*got 2"):
        ParallelUpdate().fuse([versions], views([sensor()], versions))
    with pytest.raises(InputError, match=r"beliefs\[1\]: expected labels of views.prediction.*got \[1, 0\]"):
        ParallelUpdate().fuse([FactoredGLMB.empty(4), prediction], views([sensor()] * 2, FactoredGLMB.empty(4)))
    fused, info = ParallelUpdate().fuse([FactoredGLMB.empty(4)], views([sensor()], FactoredGLMB.empty(4)))
    assert (fused.num_factors, info.num_sets) == (0, 0)
