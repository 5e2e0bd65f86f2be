"""Prediction and update apart: together they are the step; several scans of one time, or none; births from outside."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from filters.examples import assert_same_lmb, plain_lmb
from filters.test_multi_sensor import DT, POSES, SCANS, SENSORS, TARGETS
from vedette import models
from vedette.densities import GLMB, LMB, as_lmb, existence_probabilities, track_moments
from vedette.filters import (
    DeltaGlmbFilter,
    Limits,
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    SequentialLmbFilter,
)

pytestmark = pytest.mark.lanes

LOCAL = [LmbFilter, DeltaGlmbFilter]
CENTRAL = [MultiSensorLmbFilter, MultiSensorGlmbFilter, SequentialLmbFilter]


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def test_a_prediction_is_survival_motion_and_birth() -> None:
    """Against the formulas: r+ = r P_S, m+ = F m, P+ = F P F' + Q; the sites as they are."""
    local = LmbFilter(TARGETS, SENSORS[0])
    posterior, _ = local.step(local.initial(), SCANS[0][0], POSES[0], DT, 1, rng=rng())
    born = LMB.from_bernoullis([[2, 7]], [0.01], [[1.0, 2.0, 3.0, 4.0]], [np.diag([9.0, 8.0, 7.0, 6.0])])
    predicted, info = local.predict(posterior, DT, 2, births=born)
    transition = np.eye(4)
    transition[0, 2] = transition[1, 3] = DT
    for i in range(posterior.tracks.num_tracks):
        rows = slice(posterior.tracks.offsets[i], posterior.tracks.offsets[i + 1])
        np.testing.assert_allclose(predicted.tracks.means[rows], posterior.tracks.means[rows] @ transition.T)
        noise = TARGETS.motion.noise_cov(posterior.tracks.means[rows][0], DT)
        wanted = transition @ posterior.tracks.covs[rows] @ transition.T + noise
        np.testing.assert_allclose(predicted.tracks.covs[rows], wanted)
    num = posterior.tracks.num_tracks
    np.testing.assert_allclose(predicted.existence[:num], 0.9 * posterior.existence, rtol=1e-12)
    assert predicted.existence[num] == pytest.approx(0.01, rel=1e-12)
    assert tuple(predicted.tracks.labels[num]) == (2, 7)
    assert info.num_tracks == num + 1
    # The same targets, hypothesis by hypothesis.
    glmb = DeltaGlmbFilter(TARGETS, SENSORS[0], Limits.none())
    joint, _ = glmb.step(glmb.initial(), SCANS[0][0], POSES[0], DT, 1, rng=rng())
    labels, before = existence_probabilities(joint)
    labels_after, after = existence_probabilities(glmb.predict(joint, DT, 2, births=born)[0])
    np.testing.assert_array_equal(labels_after[: len(labels)], labels)
    np.testing.assert_allclose(after, [*(0.9 * before), 0.01], rtol=1e-11)


def test_sequential_scans_are_updates_in_turn() -> None:
    """Labels are dropped after the last scan alone, and one sensor is the plain filter."""
    limits = Limits(min_existence=0.05)
    central = SequentialLmbFilter(TARGETS, SENSORS, limits)
    whole = [LmbFilter(TARGETS, sensor, dataclasses.replace(limits, min_existence=0.0)) for sensor in SENSORS]
    belief, info = central.step(central.initial(), SCANS[0], POSES, DT, 1, rng=rng())
    turn, log_likelihood = whole[0].predict(whole[0].initial(), DT, 1)[0], 0.0
    for local, scan in zip(whole, SCANS[0], strict=True):
        turn, one = local.update(turn, scan, POSES[0], rng=rng())
        log_likelihood += one.log_likelihood
    kept = turn.existence >= 0.05
    np.testing.assert_allclose(belief.existence, turn.existence[kept], rtol=1e-11)
    np.testing.assert_allclose(info.log_likelihood, log_likelihood, rtol=1e-11)
    alone = SequentialLmbFilter(TARGETS, SENSORS[:1], limits)
    local = LmbFilter(TARGETS, SENSORS[0], limits)
    mine, _ = alone.step(alone.initial(), SCANS[0][:1], POSES[:1], DT, 1, rng=rng())
    wanted, _ = local.step(local.initial(), SCANS[0][0], POSES[0], DT, 1, rng=rng())
    assert_same_lmb(mine, plain_lmb(wanted), 1e-11)


def test_what_a_cap_cuts_of_the_combinations_of_a_track_is_told() -> None:
    """Of three options of a track, two are left; so it is for one sensor jointly, in turn, and updated apart."""
    born = LmbFilter(TARGETS, SENSORS[0]).predict(LMB.empty(4), DT, 1)[0]
    for limits, cut in ((Limits(max_hypotheses=2, min_existence=0.0), True), (Limits(), False)):
        local, given = LmbFilter(TARGETS, SENSORS[0], limits), (SCANS[0][:1], POSES[:1], DT, 1)
        infos = [local.update(born, SCANS[0][0], POSES[0], rng=rng())[1]]
        for kind in (SequentialLmbFilter, MultiSensorLmbFilter):
            central = kind(TARGETS, SENSORS[:1], limits)
            infos.append(central.step(central.initial(), *given, rng=rng())[1])
        assert [info.search_truncated for info in infos] == [cut] * 3
        assert all((info.truncation_error_bound > 0.0) == cut for info in infos)


def test_sequential_is_exact_for_one_target() -> None:
    """With a single possible target the projection to an LMB loses nothing but components that are merged."""
    birth = models.BirthModel(np.array([0.3]), TARGETS.birth.means[:1], TARGETS.birth.covs[:1], frozenset({1}))
    targets, limits = dataclasses.replace(TARGETS, birth=birth), Limits.none()
    central = [kind(targets, SENSORS, limits) for kind in CENTRAL]
    beliefs: list[Any] = [one.initial() for one in central]
    for step, scans in enumerate(SCANS, start=1):
        results = [one.step(b, scans, POSES, DT, step, rng=rng()) for one, b in zip(central, beliefs, strict=True)]
        beliefs = [belief for belief, _ in results]
        for _, info in results[1:]:
            assert info.log_likelihood == pytest.approx(results[0][1].log_likelihood, rel=1e-10)
    lmbs = [belief if isinstance(belief, LMB) else as_lmb(belief) for belief in beliefs]
    singles = [(lmb.existence, *track_moments(lmb.tracks)) for lmb in lmbs]
    for existence, mean, cov in singles[1:]:
        np.testing.assert_allclose(existence, singles[0][0], rtol=1e-10)
        np.testing.assert_allclose(mean, singles[0][1], rtol=1e-9)
        np.testing.assert_allclose(cov, singles[0][2], rtol=1e-8)


@pytest.mark.parametrize("kind", LOCAL)
def test_labels_that_nobody_has_seen_for_long_are_dropped(kind: Any) -> None:
    belief: Any = kind(TARGETS, SENSORS[0]).predict(kind(TARGETS, SENSORS[0]).initial(), DT, 1)[0]
    # Of the births, one has a least std of position of 15 m, the other of 10 m.
    limited = kind(TARGETS, SENSORS[0], Limits(max_position_std=12.0, min_existence=0.0))
    blind = dataclasses.replace(limited, sensor=dataclasses.replace(SENSORS[0], detection=models.constant_detection(0)))
    kept, info = blind.update(belief, np.empty((0, 2)), POSES[0], rng=rng())
    labels, existence = existence_probabilities(kept)
    np.testing.assert_array_equal(labels, [[1, 1]])
    np.testing.assert_allclose(existence, [0.2], rtol=1e-12)
    assert info.dropped_existence == pytest.approx(0.3, rel=1e-12)
    kept.validate()
    if isinstance(kept, GLMB):
        assert kept.num_hyps == 2
