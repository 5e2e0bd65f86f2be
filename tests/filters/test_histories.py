"""What each track of a delta-GLMB was before and which measurement updated it: enumerated, and by Kalman's sums."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from filters.examples import DT, SCENES, Scene, linear_scene
from reference import glmb as oracle
from vedette.densities import GLMB, FactoredGLMB, as_lmb, marginalise
from vedette.densities.label_sets import without_labels
from vedette.densities.tracks import UNSCANNED
from vedette.filters import (
    FactoredGlmbFilter,
    Gibbs,
    Limits,
    LmbFilter,
    MultiSensorGlmbFilter,
    SequentialFactoredFilter,
)

every_scene = pytest.mark.parametrize("name", SCENES)
two_scenes = pytest.mark.parametrize("name", ["linear", "ekf"])
RNG = np.random.default_rng(0)


def followed(belief: GLMB, before: Sequence[oracle.History]) -> list[oracle.History]:
    """What each scan did to each track; before: the same of the belief that was stepped."""
    assert belief.tracks.sources is not None
    found: list[oracle.History] = []
    for track, measurement in belief.tracks.sources.tolist():
        kept = () if track < 0 else before[track]
        found.append(kept if measurement == UNSCANNED else (*kept, measurement))
    return found


def weights_of(belief: GLMB, histories: Sequence[oracle.History]) -> dict[oracle.Key, float]:
    found = {}
    for hyp in belief.hypotheses(10**9):
        own = [histories[track] for track in hyp.tracks]
        found[tuple(zip(hyp.labels, own, strict=True))] = hyp.weight
        if hyp.measurements is not None:
            assert hyp.measurements == tuple(None if history[-1] < 0 else history[-1] for history in own)
    assert len(found) == belief.num_hyps
    return found


@functools.cache
def enumerated(name: str) -> list[dict[oracle.Key, float]]:
    """Weight of every set of labels with their histories, after each scan."""
    scene, hypotheses, found = SCENES[name](), oracle.no_target(), []
    for step, scan in enumerate(scene.scans, 1):
        hypotheses, _ = oracle.step(hypotheses, scene.plain_births(step), list(scan), scene.plain)
        found.append({key: weight for key, (weight, _) in hypotheses.items()})
    return found


def stepped(scene: Scene, **options: Any) -> list[dict[oracle.Key, float]]:
    tracker, histories, found = scene.glmb_filter(**options), list[oracle.History](), []
    belief = tracker.initial()
    for step, scan in enumerate(scene.scans, 1):
        belief, _ = tracker.step(belief, scan, scene.pose, DT, step, rng=np.random.default_rng(step))
        histories = followed(belief, histories)
        found.append(weights_of(belief, histories))
    return found


@every_scene
def test_with_nothing_cut_all_histories_are_those_of_the_enumeration(name: str) -> None:
    for found, expected in zip(stepped(SCENES[name]()), enumerated(name), strict=True):
        assert found.keys() == expected.keys()
        assert found == pytest.approx(expected, abs=1e-10)


@two_scenes
def test_at_default_limits_the_heaviest_are(name: str) -> None:
    """What is cut is spread over the rest; no history is kept that there is not."""
    for found, expected in zip(stepped(SCENES[name](), limits=Limits()), enumerated(name), strict=True):
        assert found.keys() <= expected.keys()
        assert found == pytest.approx({key: expected[key] for key in found}, abs=2e-3, rel=0.1)
        assert sum(expected[key] for key in found) > 0.95
        assert max(found, key=lambda key: found[key]) == max(expected, key=lambda key: expected[key])


@two_scenes
def test_those_that_are_drawn_are_among_them(name: str) -> None:
    drawn = stepped(SCENES[name](), limits=Limits(), assignment=Gibbs(300))
    assert all(found.keys() <= expected.keys() for found, expected in zip(drawn, enumerated(name), strict=True))


@two_scenes
def test_each_prediction_and_its_update_make_the_same_histories(name: str) -> None:
    scene = SCENES[name]()
    tracker, histories = scene.glmb_filter(), list[oracle.History]()
    belief = tracker.initial()
    for step, (scan, expected) in enumerate(zip(scene.scans, enumerated(name), strict=True), 1):
        predicted, _ = tracker.predict(belief, DT, step)
        assert predicted.tracks.measurements is None
        assert all(hyp.measurements is None for hyp in predicted.hypotheses())
        histories = followed(predicted, histories)
        belief, _ = tracker.update(predicted, scan, scene.pose, rng=RNG)
        histories = followed(belief, histories)
        assert weights_of(belief, histories) == pytest.approx(expected, abs=1e-10)


@every_scene
@pytest.mark.parametrize("limits", [Limits(), Limits.none()])
def test_the_named_measurement_makes_the_track_of_the_one_before(name: str, limits: Limits) -> None:
    scene = SCENES[name]()
    tracker, rng = scene.glmb_filter(limits=limits), np.random.default_rng(7)
    belief = tracker.initial()
    for step in (1, 2, 3):
        scan = np.concatenate([scene.scans[step - 1], scene.scans[0] + rng.normal(0.0, [0.02, 3.0], (2, 2))])
        posterior, _ = tracker.step(belief, scan, scene.pose, DT, step, rng=RNG)
        before, tracks = belief.tracks, posterior.tracks
        assert tracks.sources is not None
        assert set(tracks.sources[:, 1].tolist()) <= set(range(-1, len(scan)))
        for i, (was, taken) in enumerate(tracks.sources.tolist()):
            label = tracks.labels[i].tolist()
            if was < 0:
                assert label[0] == step
                mean, cov = scene.births.means[label[1]], scene.births.covs[label[1]]
            else:
                assert label == before.labels[was].tolist()
                mean, cov = scene.plain.predict(before.means[was], before.covs[was])
            if taken >= 0:
                mean, cov, _ = scene.plain.update(mean, cov, scan[taken])
            stds = np.sqrt(np.diagonal(cov))
            np.testing.assert_allclose(tracks.means[i] / stds, mean / stds, rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(tracks.covs[i] / np.outer(stds, stds), cov / np.outer(stds, stds), atol=1e-9)
        belief = posterior


@pytest.mark.lanes
def test_rows_are_those_of_the_scan_as_it_was_given() -> None:
    scene = linear_scene()
    tracker, (first, second) = scene.glmb_filter(), scene.scans[0]
    plain, _ = tracker.step(tracker.initial(), [first, second], scene.pose, DT, 1, rng=RNG)
    repeated, info = tracker.step(tracker.initial(), [first, first, first, second], scene.pose, DT, 1, rng=RNG)
    assert info.num_duplicates == 2
    rows = {-1: -1, 0: 0, 1: 3}
    assert plain.tracks.measurements is not None
    assert repeated.tracks.measurements is not None
    assert repeated.tracks.measurements.tolist() == [rows[taken] for taken in plain.tracks.measurements.tolist()]
    assert set(repeated.tracks.measurements.tolist()) == set(rows.values())


@pytest.mark.lanes
def test_a_missed_target_is_told_from_one_of_which_nothing_is_known() -> None:
    scene = linear_scene()
    tracker = scene.glmb_filter()
    belief, _ = tracker.step(tracker.initial(), [], scene.pose, DT, 1, rng=RNG)
    assert {hyp.measurements for hyp in belief.hypotheses()} == {(), (None,), (None, None)}
    belief, _ = tracker.step(belief, scene.scans[0], scene.pose, DT, 2, rng=RNG)
    assert belief.to_table()["measurement"][:2] != [None, None]
    for density in (marginalise(belief), as_lmb(belief)):
        assert density.tracks.measurements is density.tracks.sources is None
        assert "measurement" not in density.to_table()


@pytest.mark.parametrize("kind", [LmbFilter, FactoredGlmbFilter])
def test_filters_whose_tracks_are_of_all_measurements_keep_none(kind: Any) -> None:
    scene = linear_scene()
    tracker = kind(scene.targets, scene.sensor)
    belief, _ = tracker.step(tracker.initial(), scene.scans[0], scene.pose, DT, 1, rng=RNG)
    assert all(hyp.measurements is None for hyp in belief.hypotheses())
    collapsed = scene.glmb_filter(marginalised=True)
    belief, _ = collapsed.step(collapsed.initial(), scene.scans[0], scene.pose, DT, 1, rng=RNG)
    assert belief.tracks.sources is None


@pytest.mark.parametrize("kind", [MultiSensorGlmbFilter, SequentialFactoredFilter])
def test_of_several_sensors_one_alone_leaves_a_history(kind: Any) -> None:
    scene = linear_scene()
    tracker, lists = kind(scene.targets, [scene.sensor] * 2, Limits.none()), kind is MultiSensorGlmbFilter
    alone, (one, other) = scene.glmb_filter(), scene.scans[:2]

    def tracks_after(*scans: Any) -> Any:
        return tracker.step(tracker.initial(), scans, [scene.pose] * 2, DT, 1, rng=RNG)[0].tracks

    both, single, nobody = tracks_after(one, other), tracks_after(None, other), tracks_after(None, None)
    assert both.sources is nobody.measurements is None
    if lists:
        expected = alone.step(alone.initial(), other, scene.pose, DT, 1, rng=RNG)[0].tracks
        np.testing.assert_array_equal(single.sources, expected.sources)
        np.testing.assert_array_equal(nobody.sources, [[-1, UNSCANNED]] * 2)
    else:
        assert single.sources is nobody.sources is None


@pytest.mark.lanes
def test_dropping_a_label_leaves_the_sources_of_the_others() -> None:
    scene = linear_scene()
    tracker = scene.glmb_filter()
    belief, _ = tracker.step(tracker.initial(), scene.scans[0], scene.pose, DT, 1, rng=RNG)
    kept, _ = without_labels(belief, np.array([[1, 0]]))
    own = belief.tracks.labels[:, 1] == 1
    assert kept.tracks.sources is not None
    assert belief.tracks.sources is not None
    np.testing.assert_array_equal(kept.tracks.sources, belief.tracks.sources[own])
    np.testing.assert_array_equal(kept.tracks.means, belief.tracks.means[own])
    assert {hyp.measurements for hyp in kept.hypotheses()} == {(), (None,), (0,), (1,)}
    named = belief.with_labels(7 - belief.tracks.labels)
    np.testing.assert_array_equal(named.tracks.sources, belief.tracks.sources)
    both = [
        {frozenset(zip(hyp.labels, hyp.measurements or (), strict=True)) for hyp in b.hypotheses()}
        for b in (belief, named)
    ]
    assert both[1] == {frozenset(((7 - a, 7 - b), z) for (a, b), z in hyp) for hyp in both[0]}
    whole = FactoredGLMB.of(belief)
    assert [hyp.measurements for hyp in whole.hypotheses()] == [hyp.measurements for hyp in belief.hypotheses()]
    np.testing.assert_array_equal(whole.factor(0).tracks.sources, belief.tracks.sources)
