"""With caps on: what is thrown away is reported, and what is kept is the heaviest, and something of every track."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from filters.examples import DT, SCENES, assert_same_glmb, linear_scene, plain_glmb
from reference import glmb as oracle
from vedette.densities import GLMB, FactoredGLMB, TrackTable
from vedette.evaluation.runs import run_scenario
from vedette.filters import DeltaGlmbFilter, FactoredGlmbFilter, Gibbs, Limits, RankedAssignment
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_sensors
from vedette.scenarios.overrides import replace_fields
from vedette.simulation.replay import scans_of

pytestmark = pytest.mark.lanes


def step(tracker, belief, scene, at, seed=0):
    return tracker.step(belief, scene.scans[at], scene.pose, DT, at + 1, rng=np.random.default_rng(seed))


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("assignment", [RankedAssignment(), Gibbs(30)], ids=["ranked", "gibbs"])
def test_what_was_discarded_is_stated_though_measurements_are_contested(name, assignment):
    scene = SCENES[name]()
    exact, belief = scene.glmb_filter(), scene.glmb_filter().initial()
    for at in range(len(scene.scans)):
        _, whole = step(exact, belief, scene, at)
        for most, least in itertools.product((1, 2, 5, 20), (1.0, Limits.none().min_track_weight)):
            limits = replace(Limits.none(), max_hypotheses=most, min_track_weight=least)
            tracker = scene.glmb_filter(limits=limits, assignment=assignment)
            kept, info = step(tracker, belief, scene, at)
            kept.validate()
            assert kept.num_hyps <= most
            discarded = -math.expm1(info.log_likelihood - whole.log_likelihood)
            assert info.truncation_error_bound == pytest.approx(discarded, rel=1e-9, abs=1e-12)
            if most == 5:
                following = kept
        belief = following


@pytest.mark.parametrize("kind", [DeltaGlmbFilter, FactoredGlmbFilter])
@pytest.mark.parametrize("num", [2, 3, 5])
def test_nothing_is_stated_as_cut_off_where_nothing_was(kind, num):
    """Certain tracks in one place contend for as many measurements: of their row totals most is no joint choice."""
    scene = linear_scene()
    covs = np.broadcast_to(np.diag([20.0, 20.0, 5.0, 5.0]) ** 2, (num, 4, 4))
    tracks = TrackTable.from_gaussians([[-1, i] for i in range(num)], np.zeros((num, 4)), covs)
    whole, scan = GLMB.from_hypotheses(tracks, [list(range(num))], [1.0]), 3.0 * np.arange(2.0 * num).reshape(num, 2)
    known = scene.glmb_filter()
    belief: Any = FactoredGLMB.of(whole) if kind is FactoredGlmbFilter else whole
    tracker = kind(known.targets, known.sensor, Limits.none())
    _, info = tracker.step(belief, scan, scene.pose, DT, 9, rng=np.random.default_rng(0))
    assert info.truncation_error_bound == 0.0
    few = replace(Limits.none(), max_hypotheses=4, min_track_weight=1.0)
    _, cut = kind(known.targets, known.sensor, few).step(belief, scan, scene.pose, DT, 9, rng=np.random.default_rng(0))
    discarded = -math.expm1(cut.log_likelihood - info.log_likelihood)
    assert discarded > 0.01
    assert cut.truncation_error_bound == pytest.approx(discarded, rel=1e-9)


def test_more_contested_measurements_than_are_summed_are_bounded():
    """Eight tracks and eight measurements: the bound is from above, and still 0 without caps."""
    scene, num = linear_scene(), 8
    covs = np.broadcast_to(np.diag([20.0, 20.0, 5.0, 5.0]) ** 2, (num, 4, 4))
    tracks = TrackTable.from_gaussians([[-1, i] for i in range(num)], np.zeros((num, 4)), covs)
    belief, scan = GLMB.from_hypotheses(tracks, [list(range(num))], [1.0]), 3.0 * np.arange(2.0 * num).reshape(num, 2)
    few = scene.glmb_filter(limits=replace(Limits.none(), max_hypotheses=100, min_track_weight=1.0))
    _, info = few.step(belief, scan, scene.pose, DT, 9, rng=np.random.default_rng(0))
    assert 0.0 < info.truncation_error_bound <= 1.0


def far_apart():
    """Two certain tracks a kilometre apart and a measurement near each: nothing is contested."""
    scene = linear_scene()
    covs = np.broadcast_to(np.diag([20.0, 20.0, 5.0, 5.0]) ** 2, (2, 4, 4))
    tracks = TrackTable.from_gaussians([[-1, 0], [-1, 1]], [[-500.0, 0, 0, 0], [500.0, 0, 0, 0]], covs)
    return scene, GLMB.from_hypotheses(tracks, [[0, 1]], [1.0]), np.array([[-490.0, 5.0], [495.0, -9.0]])


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("most", [1, 2, 3, 4, 6])
def test_the_bound_is_attained_where_nothing_was_measured(name, most):
    scene = SCENES[name]()
    none = replace(Limits.none(), min_track_weight=1.0)
    infos = [
        tracker.step(tracker.initial(), np.empty((0, 2)), scene.pose, DT, 1, rng=np.random.default_rng(0))[1]
        for tracker in (scene.glmb_filter(), scene.glmb_filter(limits=replace(none, max_hypotheses=most)))
    ]
    discarded = -math.expm1(infos[1].log_likelihood - infos[0].log_likelihood)
    assert infos[1].truncation_error_bound == pytest.approx(discarded, abs=1e-12)
    assert (discarded > 0.0) == (most < 4)


def test_the_bound_is_attained_where_nothing_is_contested():
    scene, belief, scan = far_apart()
    gated = replace(Limits.none(), gate_probability=1.0 - 1e-12)
    whole = scene.glmb_filter(limits=gated).step(belief, scan, scene.pose, DT, 9, rng=np.random.default_rng(0))[1]
    assert whole.truncation_error_bound == pytest.approx(0.0, abs=1e-12)
    for most in (1, 2, 4):
        tracker = scene.glmb_filter(limits=replace(gated, max_hypotheses=most))
        _, info = tracker.step(belief, scan, scene.pose, DT, 9, rng=np.random.default_rng(0))
        discarded = -math.expm1(info.log_likelihood - whole.log_likelihood)
        assert discarded > 1e-9
        assert info.truncation_error_bound == pytest.approx(discarded, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("most", [1, 3, 8])
def test_capped_is_the_head_of_the_whole(most):
    scene = linear_scene()
    whole, _ = step(scene.glmb_filter(), scene.glmb_filter().initial(), scene, 0)
    limits = replace(Limits.none(), max_hypotheses=most, min_track_weight=1.0)
    head, _ = step(scene.glmb_filter(limits=limits), scene.glmb_filter().initial(), scene, 0)
    expected = plain_glmb(whole)[:most]
    total = sum(weight for weight, _ in expected)
    assert_same_glmb(plain_glmb(head), [(weight / total, tracks) for weight, tracks in expected])


@pytest.mark.parametrize("assignment", [RankedAssignment(), Gibbs(30)], ids=["ranked", "gibbs"])
def test_light_hypotheses_are_dropped(assignment):
    scene = linear_scene()
    limits = replace(Limits.none(), min_relative_weight=0.05, min_track_weight=1.0)
    tracker = scene.glmb_filter(limits=limits, assignment=assignment)
    posterior, info = step(tracker, tracker.initial(), scene, 0)
    relative = np.exp(posterior.hyp_log_weights - posterior.hyp_log_weights[0])
    assert relative.min() >= 0.05
    assert posterior.num_hyps > 1
    assert info.truncation_error_bound > 0.0


@pytest.mark.parametrize("assignment", [RankedAssignment(), Gibbs(30)], ids=["ranked", "gibbs"])
def test_every_way_a_target_may_be_seen_is_kept(assignment):
    scene = linear_scene(existence=0.02, prob_detection=0.6)
    few = replace(Limits.none(), max_hypotheses=12, min_track_weight=1.0)
    themes = {}
    for name, limits in (("few", few), ("covered", replace(few, min_track_weight=1e-6))):
        tracker = scene.glmb_filter(limits=limits, assignment=assignment)
        belief, info = step(tracker, tracker.initial(), scene, 0)
        belief.validate()
        assert info.num_hypotheses <= 12
        themes[name] = {tuple(label) for label in belief.tracks.labels.tolist()}, belief.tracks.num_tracks
    # 2 sites, each missed or detected as one of 2 measurements: all six, where the heaviest hypotheses alone lack some.
    assert themes["covered"] == ({(1, 0), (1, 1)}, 6)
    assert themes["few"][1] <= 6


def test_half_of_the_hypotheses_are_the_heaviest_whatever_is_kept_besides():
    scene = linear_scene(existence=0.02)
    belief, _ = step(scene.glmb_filter(), scene.glmb_filter().initial(), scene, 0)
    plain = replace(Limits.none(), max_hypotheses=20, min_track_weight=1.0)
    heaviest, _ = step(scene.glmb_filter(limits=plain), belief, scene, 1)
    covered, _ = step(scene.glmb_filter(limits=replace(plain, min_track_weight=1e-9)), belief, scene, 1)
    assert covered.num_hyps == heaviest.num_hyps
    assert covered.tracks.num_tracks > heaviest.tracks.num_tracks
    shift = heaviest.hyp_log_weights[0] - covered.hyp_log_weights[0]
    num = heaviest.num_hyps // 2
    np.testing.assert_allclose(covered.hyp_log_weights[:num] + shift, heaviest.hyp_log_weights[:num], atol=1e-9)


def test_gibbs_converges_to_ranked():
    scene = linear_scene()
    ranked, _ = step(scene.glmb_filter(), scene.glmb_filter().initial(), scene, 0)
    weights = oracle.label_set_weights(plain_glmb(ranked))
    distances = []
    for num_samples in (1, 30, 3000):
        tracker = scene.glmb_filter(assignment=Gibbs(num_samples))
        got = oracle.label_set_weights(plain_glmb(step(tracker, tracker.initial(), scene, 0, seed=4)[0]))
        distances.append(sum(abs(weights.get(labels, 0.0) - got.get(labels, 0.0)) for labels in weights | got))
    assert distances[0] > distances[1] > distances[2]
    assert distances[2] < 1e-6


@pytest.mark.slow
def test_in_the_paper_scenario_the_bound_is_what_was_cut_off():
    """Much of a scan's weight lies in variations beyond the cap, however little they matter."""
    fewer = {"time.num_steps": 14, "ospa.first_scan": 1, "ospa.last_scan": 14, "control.decision_steps": None}
    scenario = replace_fields(load_scenario("paper-a"), {**fewer, "filter.limits.max_hypotheses": 100})
    record = run_scenario(scenario, "stationary", seed=0, run=1, num_threads=1)
    tracker: Any = build_sensors(scenario)[0].filter
    scans: Any = scans_of(record, build_experiment(scenario))
    every = replace(tracker, limits=replace(tracker.limits, max_hypotheses=10**6, min_relative_weight=1e-16))
    belief, most = tracker.initial(), 0.0
    for at in range(record.num_scans):
        arguments = scans[at][0].measurements, record.poses[at, 0], 1.0, at + 1
        if at >= 8:
            _, whole = every.step(belief, *arguments, rng=np.random.default_rng(0))
            assert not whole.limit_reached
        belief, info = tracker.step(belief, *arguments, rng=np.random.default_rng(0))
        if at >= 8:
            discarded = -math.expm1(info.log_likelihood - whole.log_likelihood)
            assert discarded <= info.truncation_error_bound + 1e-9
            assert info.truncation_error_bound == pytest.approx(discarded, abs=2e-3)
            most = max(most, discarded)
    assert most > 0.5
