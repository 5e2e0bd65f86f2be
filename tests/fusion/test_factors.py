"""Fusion of products of GLMBs, factor by factor: against the fusion of all their combinations."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import random_covs, random_factor, random_factored
from fusion.examples import assert_same_glmb, by_label_set
from vedette.densities import GLMB, LMB, FactoredGLMB, TrackTable, as_glmb, as_lmb, resolve_labels
from vedette.errors import InputError, NumericalError
from vedette.fusion import ArithmeticAverage, Clmb, CmDeltaGlmb, FusionLimits, LabelMatchedFusion, match_labels

ALL = 10**6
THIRDS = (0.5, 0.3, 0.2)
LABELS = [(0, 1), (0, 2), (1, 0), (1, 4), (3, 2)]


def full_factor(rng, labels):
    """A GLMB of all sets of these labels, heaviest first; of one label, absent first. Each Gaussian near its place."""
    sets = [chosen for size in range(len(labels) + 1) for chosen in combinations(sorted(labels), size)]
    members = [label for chosen in sets for label in chosen]
    means = np.array([[3.0 * label[0], 2.0 * label[1]] for label in members]).reshape(-1, 2)
    tracks = TrackTable.from_gaussians(
        members, means + 0.5 * rng.normal(size=means.shape), random_covs(rng, len(members))
    )
    ends = np.cumsum([0, *(len(chosen) for chosen in sets)])
    hyps = [list(range(low, high)) for low, high in pairwise(ends)]
    weights = rng.dirichlet(np.ones(len(sets)))
    return GLMB.from_hypotheses(tracks, hyps, weights if len(labels) == 1 else -np.sort(-weights))


def full(rng, partition):
    return FactoredGLMB.from_factors([full_factor(rng, labels) for labels in partition], 2)


def all_of(density):
    return as_glmb(density, max_hypotheses=ALL)[0]


A, B, C, D, E = LABELS
PARTITIONS = [
    ([[A], [B], [C]], [[C], [A], [B]], [[B], [C], [A]]),
    ([[A, B], [C], [D, E]], [[C], [A, B], [D, E]], [[E, D], [B, A], [C]]),
    ([[A, B], [C], [D]], [[A], [B, C], [D]], [[D], [A], [B], [C]]),
    ([[A, B], [C, D]], [[B, C], [A], [D]], [[A, D], [B], [C]]),
]


@pytest.mark.parametrize("partitions", PARTITIONS)
def test_what_all_sensors_have_is_fused_as_all_combinations(partitions):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        beliefs = [full(rng, partition) for partition in partitions]
        rule = CmDeltaGlmb(THIRDS, limits=FusionLimits(max_hypotheses=ALL))
        fused, info = rule.fuse(beliefs)
        fused.validate()
        expected, wanted = rule.fuse([all_of(belief) for belief in beliefs])
        assert_same_glmb(all_of(fused), expected, 1e-10)
        assert info.log_normaliser == pytest.approx(wanted.log_normaliser, abs=1e-10)
        assert (info.missing_sets, info.missing_labels) == ((0, 0, 0), (0, 0, 0))
        assert info.num_lost_labels == wanted.num_lost_labels
        assert not info.empty_intersection
        assert info.discarded_weight == 0.0


def one_by_one(beliefs, rule):
    """Each label by itself: the GLMBs of one label, absent where a sensor lacks it."""
    fused = []
    for label in LABELS:
        own = []
        for belief in beliefs:
            of_label = [factor for factor in belief.factors if tuple(factor.tracks.labels[0].tolist()) == label]
            own.append(of_label[0] if of_label else GLMB.empty(2))
        fused.append(rule.fuse(own))
    return fused


@given(st.integers(0, 2**32 - 1), st.sampled_from(["moment_matched", "component_wise"]))
def test_labels_that_are_alone_are_fused_as_one_by_one(seed, mixture_power):
    rng = np.random.default_rng(seed)
    beliefs = []
    for _ in THIRDS:
        labels = [label for label in LABELS if rng.random() < 0.7]
        beliefs.append(random_factored(rng, [1] * len(labels), max_components=3, labels=rng.permutation(labels)))
        weights = beliefs[-1].hyp_log_weights.copy()
        for factor in np.flatnonzero(rng.random(len(labels)) < 0.2):
            weights[2 * factor : 2 * factor + 2] = [-math.inf, 0.0] if rng.random() < 0.5 else [0.0, -math.inf]
        beliefs[-1] = replace(beliefs[-1], hyp_log_weights=weights)
    rule = CmDeltaGlmb((0.47, 0.32, 0.21), mixture_power=mixture_power, missing_log_weight=math.log(0.01))
    fused, info = rule.fuse(beliefs)
    fused.validate()
    assert fused.is_bernoulli.all()
    expected = one_by_one(beliefs, rule)
    found = {tuple(own.tracks.labels[0].tolist()): own for own in fused.factors}
    assert list(found) == [label for label, (own, _) in zip(LABELS, expected, strict=True) if own.tracks.num_tracks]
    for label, (own, _) in zip(LABELS, expected, strict=True):
        if label in found:
            there = {
                len(own.hyp_tracks[low:high]): w
                for low, high, w in zip(own.hyp_offsets, own.hyp_offsets[1:], own.hyp_log_weights, strict=False)
            }
            got = found[label].hyp_log_weights
            np.testing.assert_allclose(np.exp(got), np.exp([there.get(0, -math.inf), there[1]]), atol=1e-12)
            np.testing.assert_allclose(found[label].tracks.means, own.tracks.means, rtol=1e-10, atol=1e-10)
            np.testing.assert_allclose(found[label].tracks.covs, own.tracks.covs, rtol=1e-10, atol=1e-10)
    # A label that no sensor has is not fused; one by one it has one label set.
    unknown = sum(all(label not in map(tuple, belief.tracks.labels.tolist()) for belief in beliefs) for label in LABELS)
    assert info.num_sets == sum(own.num_sets for _, own in expected) - unknown
    assert info.log_normaliser == pytest.approx(sum(own.log_normaliser for _, own in expected), abs=1e-10)
    for name in ("missing_sets", "missing_labels"):
        assert getattr(info, name) == tuple(np.sum([getattr(own, name) for _, own in expected], axis=0).tolist())
    assert info.num_lost_labels == sum(own.num_lost_labels for _, own in expected)
    assert info.empty_intersection == any(own.empty_intersection for _, own in expected)


@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 1000]))
def test_groups_with_missing_sets_are_fused_as_one_by_one(seed, most):
    """Each sensor's factors have other label sets, or all but one label of a group."""
    rng = np.random.default_rng(seed)
    groups = [[A, B], [C, D], [E]]
    own = [[random_factor(rng, labels if rng.random() < 0.8 else labels[:1]) for labels in groups] for _ in THIRDS]
    beliefs = [FactoredGLMB.from_factors([factors[i] for i in rng.permutation(3)], 2) for factors in own]
    rule = CmDeltaGlmb((0.47, 0.32, 0.21), missing_log_weight=math.log(0.01), limits=FusionLimits(max_hypotheses=most))
    fused, info = rule.fuse(beliefs)
    fused.validate()
    expected = [rule.fuse([factors[g] for factors in own]) for g in range(3)]
    found = {tuple(one.tracks.labels.min(axis=0).tolist()): one for one in fused.factors}
    for one, _ in expected:
        if one.tracks.num_tracks:
            got = found.pop(tuple(one.tracks.labels.min(axis=0).tolist()))
            there = {key: value for key, value in by_label_set(got).items() if value[0] > 0.0}
            assert {key: value[0] for key, value in there.items()} == pytest.approx(
                {key: value[0] for key, value in by_label_set(one).items()}, abs=1e-12
            )
    assert not found
    for name in ("missing_sets", "missing_labels"):
        assert getattr(info, name) == tuple(np.sum([getattr(one, name) for _, one in expected], axis=0).tolist())
    assert info.num_sets == sum(one.num_sets for _, one in expected)
    assert info.num_lost_labels == sum(one.num_lost_labels for _, one in expected)
    assert info.empty_intersection == any(one.empty_intersection for _, one in expected)
    assert info.log_normaliser == pytest.approx(sum(one.log_normaliser for _, one in expected), abs=1e-10)
    kept = np.prod([1.0 - one.discarded_weight for _, one in expected])
    assert info.discarded_weight == pytest.approx(1.0 - kept, abs=1e-12)


def test_a_cap_of_one_takes_the_likelier_for_each_label():
    rng = np.random.default_rng(3)
    beliefs = [full(rng, [[label] for label in LABELS]) for _ in range(2)]
    rule = CmDeltaGlmb((0.5, 0.5), limits=FusionLimits(max_hypotheses=1))
    fused, info = rule.fuse(beliefs)
    fused.validate()
    likelier = [own for own, _ in one_by_one(beliefs, rule) if own.tracks.num_tracks]
    assert fused.tracks.labels.tolist() == [own.tracks.labels[0].tolist() for own in likelier]
    assert (as_lmb(fused).existence == 1.0).all()
    kept = np.prod([1.0 - own.discarded_weight for _, own in one_by_one(beliefs, rule)])
    assert info.discarded_weight == pytest.approx(1.0 - kept, abs=1e-12)


def test_products_beyond_the_cap_are_counted():
    rng = np.random.default_rng(4)
    beliefs = [full(rng, [[A], [B], [C]]), full(rng, [[A, B, C]])]
    rule = CmDeltaGlmb((0.5, 0.5), limits=FusionLimits(max_hypotheses=5))
    fused, info = rule.fuse(beliefs)
    product, discarded = as_glmb(beliefs[0], max_hypotheses=5)
    expected, wanted = rule.fuse([product, beliefs[1].factor(0)])
    assert_same_glmb(fused.factor(0), expected, 1e-12)
    assert fused.num_factors == 1
    assert info.discarded_weight == pytest.approx(1.0 - (1.0 - discarded) * (1.0 - wanted.discarded_weight), abs=1e-12)


def test_sensors_of_weight_zero_and_of_plain_glmbs():
    rng = np.random.default_rng(6)
    first, second = full(rng, [[A, B], [C]]), full(rng, [[A], [B], [C]])
    other = random_factored(rng, [1, 2])
    fused, info = CmDeltaGlmb((0.5, 0.0, 0.5)).fuse([first, other, all_of(second)])
    expected, _ = CmDeltaGlmb((0.5, 0.5)).fuse([all_of(first), all_of(second)])
    assert_same_glmb(all_of(fused), expected, 1e-10)
    assert info.missing_sets == (0, 0, 0)


def test_nobody_and_nowhere():
    nobody = FactoredGLMB.empty(2)
    fused, info = CmDeltaGlmb((0.5, 0.5)).fuse([nobody, nobody])
    fused.validate()
    assert (fused.num_factors, info.num_sets, info.empty_intersection) == (0, 0, False)
    certain = [
        FactoredGLMB.of(LMB.from_bernoullis([A], [1.0], [[place, 0.0]], [1e-6 * np.eye(2)])) for place in (0.0, 1e200)
    ]
    with pytest.raises(NumericalError):
        CmDeltaGlmb((0.5, 0.5)).fuse(certain)
    with pytest.raises(InputError, match=r"beliefs\[1\]: expected GLMB or FactoredGLMB; got LMB"):
        CmDeltaGlmb((0.5, 0.5)).fuse([nobody, LMB.empty(2)])  # type: ignore[type-var]


@pytest.mark.parametrize("rule", [Clmb(THIRDS, "moment_matched"), ArithmeticAverage(THIRDS)])
def test_fusions_of_lmbs_take_the_lmbs(rule):
    rng = np.random.default_rng(7)
    beliefs = [full(rng, partition) for partition in PARTITIONS[2]]
    fused, info = rule.fuse(beliefs)
    expected, wanted = (
        rule.fuse(
            [as_lmb(belief, max_components=10**9, log_min_weight=-np.inf, merge_distance=0.0) for belief in beliefs]
        )
        if isinstance(rule, ArithmeticAverage)
        else rule.fuse([as_lmb(belief) for belief in beliefs])
    )
    np.testing.assert_array_equal(fused.tracks.labels, expected.tracks.labels)
    np.testing.assert_allclose(fused.existence, expected.existence, rtol=1e-12)
    assert info.missing_sets == wanted.missing_sets


def test_labels_are_matched_across_sensors():
    rng = np.random.default_rng(8)
    first = full(rng, [[A, B], [C]])
    names = {A: (5, 1), B: (4, 2), C: (6, 0)}
    labels = np.array([names[label] for label in map(tuple, first.tracks.labels.tolist())])
    moved = replace(first.tracks, labels=labels)
    order = np.concatenate(
        [
            np.sort(first.hyp_tracks[low:high])[np.lexsort(labels[np.sort(first.hyp_tracks[low:high])].T[::-1])]
            for low, high in zip(first.hyp_offsets, first.hyp_offsets[1:], strict=False)
        ]
    ).astype(np.int64)
    second = replace(first, tracks=moved, hyp_tracks=order)
    same, matched = match_labels([first, second])
    assert same is first
    matched.validate()
    assert isinstance(matched, FactoredGLMB)
    assert_same_glmb(all_of(matched), all_of(first), 1e-12)
    fused, _ = LabelMatchedFusion(CmDeltaGlmb((0.5, 0.5))).fuse([first, second])
    settled = FactoredGLMB.of(resolve_labels(first, max_components=10))  # names that are open are not matched
    assert_same_glmb(all_of(fused), all_of(CmDeltaGlmb((0.5, 0.5)).fuse([settled, settled])[0]), 1e-9)
