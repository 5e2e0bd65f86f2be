"""CM-delta-GLMB fusion: properties, truncated label sets, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

from densities.examples import random_glmb
from fusion.examples import ALL_SETS, A, B, C, assert_same_glmb, by_label_set, full_glmbs, glmb
from vedette.densities import GLMB, TrackTable, marginalise
from vedette.fusion import CmDeltaGlmb, FusionLimits

HALVES = (0.5, 0.5)


def test_a_delta_glmb_is_marginalised_first():
    rng = np.random.default_rng(8)
    beliefs = [random_glmb(rng, 3, 10, 2) for _ in range(2)]
    assert_same_glmb(
        CmDeltaGlmb(HALVES, "moment_matched").fuse(beliefs)[0],
        CmDeltaGlmb(HALVES, "moment_matched").fuse([marginalise(belief) for belief in beliefs])[0],
        1e-10,
    )


def test_large_coordinates_cost_no_digits():
    beliefs = full_glmbs(2, np.random.default_rng(2), 4)
    shift = np.array([1.0e6, -1.0e6, 0.0, 0.0])
    moved = [
        GLMB(
            TrackTable(b.tracks.labels, b.tracks.offsets, b.tracks.log_weights, b.tracks.means + shift, b.tracks.covs),
            b.hyp_offsets,
            b.hyp_tracks,
            b.hyp_log_weights,
        )
        for b in beliefs
    ]
    near, far = (CmDeltaGlmb(HALVES).fuse(sensors)[0] for sensors in (beliefs, moved))
    # The coordinates themselves are only known to 1e-10 at 1e6.
    assert far.hyp_log_weights == pytest.approx(near.hyp_log_weights, abs=2e-9)
    assert far.tracks.means - shift == pytest.approx(near.tracks.means, abs=1e-9)


def test_a_truncated_label_set_gets_a_floor_and_the_marginal_density():
    rng = np.random.default_rng(4)
    first = full_glmbs(1, rng)[0]
    second = glmb({(): 0.1, (A,): 0.6, (B,): 0.3}, rng)
    fused, info = CmDeltaGlmb(HALVES, missing_log_weight=math.log(1e-3)).fuse([first, second])
    assert (info.num_missing_sets, info.num_missing_labels, info.empty_intersection) == (1, 0, False)
    # The same with the set written out: the floor, and of each label the only density that the sensor has.
    tracks = second.tracks
    log_weights = np.log([0.1, 0.6, 0.3, 1e-3]) - math.log(1.001)
    filled = GLMB(tracks, np.array([0, 0, 1, 2, 4]), np.array([0, 1, 0, 1]), log_weights)
    got, expected = by_label_set(fused), by_label_set(CmDeltaGlmb(HALVES).fuse([first, filled])[0])
    for labels in ALL_SETS:
        assert got[labels][0] == pytest.approx(expected[labels][0], rel=1e-12)
        for label in labels:
            assert got[labels][1][label][0] == pytest.approx(expected[labels][1][label][0], rel=1e-12)


def test_the_floor_is_never_above_the_weights_that_are_there():
    rng = np.random.default_rng(6)
    first = glmb({(A,): 0.5, (B,): 0.5}, rng)
    second = glmb({(A,): 1.0 - 1e-9, (): 1e-9}, rng)
    low, _ = CmDeltaGlmb(HALVES, missing_log_weight=math.log(0.1)).fuse([first, second])
    same, _ = CmDeltaGlmb(HALVES, missing_log_weight=math.log(1e-9)).fuse([first, second])
    # Sensor 1 lacks the empty set and its floors differ; of sensor 2 both use 1e-9.
    ratio = [by_label_set(fused)[(B,)][0] / by_label_set(fused)[(A,)][0] for fused in (low, same)]
    assert ratio[0] == pytest.approx(ratio[1], rel=1e-9)


def test_an_unknown_label_is_left_to_the_sensors_that_know_it():
    rng = np.random.default_rng(9)
    first, second = glmb({(A, B): 1.0}, rng), glmb({(A,): 1.0}, rng)
    third = glmb({(A, B): 0.4, (A,): 0.6}, rng)
    fused, info = CmDeltaGlmb((0.25, 0.5, 0.25)).fuse([first, second, third])
    assert (info.num_missing_sets, info.num_missing_labels, info.empty_intersection) == (2, 1, True)
    together, _ = CmDeltaGlmb((0.5, 0.5)).fuse([first, third])
    got, expected = by_label_set(fused)[A, B][1][B], by_label_set(together)[A, B][1][B]
    assert got[0] == pytest.approx(expected[0], rel=1e-12)
    assert got[1] == pytest.approx(expected[1], rel=1e-12)


def test_nothing_in_common_is_neither_a_crash_nor_empty():
    rng = np.random.default_rng(1)
    fused, info = CmDeltaGlmb(HALVES).fuse([glmb({(A,): 1.0}, rng), glmb({(B, C): 1.0}, rng)])
    fused.validate()
    assert fused.num_hyps == 2
    assert (info.num_missing_sets, info.num_missing_labels, info.empty_intersection) == (2, 3, True)
    assert info.log_normaliser == pytest.approx(0.5 * math.log(1e-6) + math.log(2.0), rel=1e-12)


def test_a_hypothesis_of_weight_zero_counts_as_missing():
    rng = np.random.default_rng(1)
    first, second = glmb({(A,): 1.0, (): 0.0}, rng), glmb({(A,): 0.5, (): 0.5}, rng)
    fused, info = CmDeltaGlmb(HALVES).fuse([first, second])
    assert info.num_missing_sets == 1
    assert fused.num_hyps == 2
    assert np.all(np.isfinite(fused.hyp_log_weights))


def test_sensors_far_apart_leave_finite_weights():
    rng = np.random.default_rng(3)
    first = glmb({(A,): 0.9, (): 0.1}, rng)
    tracks = first.tracks
    moved = TrackTable(tracks.labels, tracks.offsets, tracks.log_weights, tracks.means + 1e7, tracks.covs)
    second = GLMB(moved, first.hyp_offsets, first.hyp_tracks, first.hyp_log_weights)
    fused, _ = CmDeltaGlmb(HALVES).fuse([first, second])
    assert np.all(np.isfinite(fused.hyp_log_weights))
    assert by_label_set(fused)[()][0] == 1.0


def test_a_cap_reports_the_weight_beyond_it():
    rng = np.random.default_rng(11)
    beliefs = full_glmbs(2, rng)
    full, _ = CmDeltaGlmb(HALVES).fuse(beliefs)
    capped, info = CmDeltaGlmb(HALVES, limits=FusionLimits(max_hypotheses=2)).fuse(beliefs)
    capped.validate()
    assert capped.num_hyps == 2
    assert info.discarded_weight == pytest.approx(np.exp(full.hyp_log_weights[2:]).sum(), rel=1e-12)
    kept = np.exp(full.hyp_log_weights[:2])
    assert np.exp(capped.hyp_log_weights) == pytest.approx(kept / kept.sum(), rel=1e-12)


def test_sensors_that_contradict_each_other_beyond_all_measure():
    def belief(at, weights):
        means = [[at, 0.0, 0.0, 0.0], [at, 5.0, 0.0, 0.0]]
        tracks = TrackTable.from_gaussians([A, B], means, [1e-6 * np.eye(4)] * 2)
        return GLMB.from_hypotheses(tracks, [[0], [1], [0, 1]], weights)

    fused, _ = CmDeltaGlmb(HALVES).fuse([belief(0.0, [0.2, 0.3, 0.5]), belief(1e6, [0.4, 0.5, 0.1])])
    fused.validate()
