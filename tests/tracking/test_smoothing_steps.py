"""Steps of the smoother against enumerations: components, modes and existence; sigma points; irregular times."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
import pytest

from vedette import models
from vedette.densities import LMB, Estimate, best_estimate
from vedette.densities.tracks import TrackTable
from vedette.errors import InputError
from vedette.filters import SequentialFactoredFilter
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.marks import marks_of
from vedette.tracking import Central, TraceEntry, smooth

PRIOR_STD = np.array([50.0, 50.0, 8.0, 8.0])
LABEL = np.array([[1, 0]])
STDS = (5.0, 20.0)


def target_model(motion: models.MotionModel | None = None, survival: float = 0.99) -> models.TargetModel:
    """Targets that are born once, at the first step, near the origin."""
    birth = models.BirthModel(
        np.array([0.9]), np.zeros((1, 4)), np.diag(PRIOR_STD**2)[np.newaxis], steps=frozenset([1])
    )
    own = models.constant_velocity(0.5, noise_model="continuous_white") if motion is None else motion
    return models.TargetModel(own, models.constant_survival(survival), birth)


def sensors(prob_detection: float) -> tuple[models.SensorModel, ...]:
    clutter = models.region_clutter(1e-9, models.Region(-1e4, 1e4, -1e4, 1e4), "position")
    seen = models.constant_detection(prob_detection)
    noises = (models.constant_noise([std, std]) for std in STDS)
    return tuple(models.SensorModel(models.position(), noise, seen, clutter) for noise in noises)


def transition(dt: float) -> Floats:
    return np.block([[np.eye(2), dt * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])


def batch(
    targets: models.TargetModel, times: Sequence[float], measured: Sequence[tuple[Floats, float] | None]
) -> tuple[Floats, Floats]:
    """Means and covariances of all states given all measurements, by the precision of the whole trajectory."""
    num, seen = len(times), np.eye(2, 4)
    precision, linear = np.zeros((4 * num, 4 * num)), np.zeros(4 * num)
    precision[:4, :4] = np.diag(1.0 / PRIOR_STD**2)
    for k, (before, after) in enumerate(pairwise(times)):
        both, change = slice(4 * k, 4 * k + 8), np.hstack([-transition(after - before), np.eye(4)])
        noise = targets.motion.noise_cov(np.zeros(4), after - before)
        precision[both, both] += change.T @ np.linalg.inv(noise) @ change
    for k, given in enumerate(measured):
        if given is not None:
            own = slice(4 * k, 4 * k + 4)
            precision[own, own] += seen.T @ seen / given[1] ** 2
            linear[own] += seen.T @ given[0] / given[1] ** 2
    covs = np.linalg.inv(precision)
    each = range(0, 4 * num, 4)
    return (covs @ linear).reshape(num, 4), np.array([covs[i : i + 4, i : i + 4] for i in each])


def one_target(
    seed: int, *, missing: bool = False
) -> tuple[list[float], list[list[Floats | None]], list[tuple[Floats, float] | None]]:
    """Irregular times, the scans of two sensors in turn, and their measurements of one target."""
    rng, targets = np.random.default_rng(seed), target_model()
    times = np.cumsum(rng.uniform(0.2, 4.0, 25)).tolist()
    state, scans, measured = rng.normal(0.0, PRIOR_STD), list[list[Floats | None]](), []
    for k, time in enumerate(times):
        if k:
            dt = time - times[k - 1]
            state = rng.multivariate_normal(transition(dt) @ state, targets.motion.noise_cov(np.zeros(4), dt))
        s, lost = k % 2, missing and k % 4 == 2
        z = state[:2] + rng.normal(0.0, STDS[s], 2)
        given: list[Floats | None] = [None, None]
        given[s] = None if lost and k % 8 == 2 else np.empty((0, 2)) if lost else z[np.newaxis]
        scans.append(given)
        measured.append(None if lost else (z, STDS[s]))
    return times, scans, measured


def trace_of(
    targets: models.TargetModel, prob_detection: float, times: Sequence[float], scans: Sequence[list[Floats | None]]
) -> list[TraceEntry]:
    tracker, entries = Central(SequentialFactoredFilter(targets, sensors(prob_detection))), []
    state, rngs = tracker.initial(), [np.random.default_rng(0)] * 2
    for step, (time, given) in enumerate(zip(times, scans, strict=True), start=1):
        state, _ = tracker.step(state, given, np.zeros((2, 3)), time, rngs=rngs)
        entries.append(TraceEntry(time, state.fused, best_estimate(state.fused, step)))
    return entries


@pytest.mark.parametrize("missing", [False, True])
@pytest.mark.parametrize("method", ["auto", "ukf", "ckf"])
def test_one_track_is_the_batch_solution_at_irregular_times(method: str, missing: bool) -> None:
    """Sigma points are exact for a linear motion."""
    given = target_model().motion
    parts = given.transition, given.process_noise_cov, given.transition_params, given.noise_params
    jacobian = given.transition_jacobian if method == "auto" else None
    targets = target_model(models.MotionModel(4, *parts, jacobian, method, given.components))
    times, scans, measured = one_target(3, missing=missing)
    trace = trace_of(targets, 0.5 if missing else 0.999, times, scans)
    means, covs = batch(targets, times, measured)
    found = smooth(trace, targets)
    assert [estimate.num_targets for estimate in found] == [1] * len(times)
    np.testing.assert_allclose(np.concatenate([each.means for each in found]), means, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(np.concatenate([each.covs for each in found]), covs, rtol=1e-9, atol=1e-7)


def gaussian(x: Floats, mean: Floats, cov: Floats) -> float:
    return float(np.exp(-0.5 * (x - mean) @ np.linalg.solve(cov, x - mean)) / np.sqrt(np.linalg.det(2 * np.pi * cov)))


def mixture(weights: Sequence[float], means: Floats, covs: Floats, modes: Sequence[int]) -> LMB:
    """The density of one label."""
    marks = marks_of(modes=np.array(modes))
    return LMB(TrackTable(LABEL, np.array([0, len(weights)]), np.log(weights), means, covs, marks), np.array([2.0]))


def test_later_scans_choose_between_components_and_modes() -> None:
    """One step of the smoother of Kim (1994), written out."""
    motions = [models.constant_velocity(std, noise_model="continuous_white") for std in (0.3, 3.0)]
    targets, dt = target_model(models.Modes(motions, (20.0, 5.0))), 2.0
    means = np.array([[0.0, 0.0, 1.0, 0.0], [40.0, 0.0, 0.0, 1.0], [20.0, 30.0, 0.0, 0.0]])
    covs, weights, starts = np.array([np.diag([9.0, 9.0, 4.0, 4.0])] * 3), [0.5, 0.3, 0.2], [0, 0, 1]
    end_mean, end_cov, end_modes = np.array([30.0, 2.0, -1.0, 1.0]), np.diag([4.0, 4.0, 1.0, 1.0]), [0.25, 0.75]
    own = end_mean[np.newaxis], end_cov[np.newaxis]
    last = Estimate(LABEL, *own, np.array([0.9]), mode_probs=np.array([end_modes]))
    trace = [
        TraceEntry(0.0, mixture(weights, means, covs, starts), Estimate.empty(4)),
        TraceEntry(dt, mixture([1.0], *own, [1]), last),
    ]
    found = smooth(trace, targets)[0]

    a, b = 1 / 20.0, 1 / 5.0  # rates of change; a chain of two modes in closed form
    kept = np.exp(-(a + b) * dt)
    chain = np.array([[b + a * kept, a - a * kept], [b - b * kept, a + b * kept]]) / (a + b)
    parts, move = [], transition(dt)
    for mode, motion in enumerate(motions):
        rows = []
        for weight, mean, cov, start in zip(weights, means, covs, starts, strict=True):
            predicted = move @ cov @ move.T + motion.noise_cov(mean, dt)
            gain = cov @ move.T @ np.linalg.inv(predicted)
            likelihood = weight * chain[start, mode] * gaussian(end_mean, move @ mean, predicted)
            smoothed = mean + gain @ (end_mean - move @ mean)
            rows.append((likelihood, smoothed, cov + gain @ (end_cov - predicted) @ gain.T, start))
        total = sum(row[0] for row in rows)
        parts += [(end_modes[mode] * row[0] / total, *row[1:]) for row in rows]
    mean = np.sum([weight * m for weight, m, _, _ in parts], axis=0)
    cov = np.sum([weight * (p + np.outer(m - mean, m - mean)) for weight, m, p, _ in parts], axis=0)
    np.testing.assert_allclose(found.means[0], mean, rtol=1e-9)
    np.testing.assert_allclose(found.covs[0], cov, rtol=1e-9, atol=1e-9)
    fast = sum(weight for weight, *_, start in parts if start == 1)
    np.testing.assert_allclose(found.mode_probs[0], [1.0 - fast, fast], rtol=1e-9)
    assert mean[0] > 25.0  # the later state rules the first component out


def still(existence: float) -> LMB:
    return LMB.from_bernoullis(LABEL, [existence], np.zeros((1, 4)), np.eye(4)[np.newaxis])


def reported(lmb: LMB) -> Estimate:
    return Estimate(lmb.tracks.labels, lmb.tracks.means, lmb.tracks.covs, lmb.existence)


def test_existence_is_that_of_all_lives_of_a_target() -> None:
    """Enumeration of death at each scan, with P_D .7 and measurements .2 times as likely to be false."""
    survival, detection, birth, false, detected = 0.9, 0.7, 0.6, 0.2, (False, True, False, True, False)
    lives = []
    for alive in product([True, False], repeat=len(detected)):
        if any(after and not before for before, after in pairwise(alive)):
            continue
        p = birth if alive[0] else 1.0 - birth
        for before, after in pairwise(alive):
            p *= (survival if after else 1.0 - survival) if before else 1.0
        for there, hit in zip(alive, detected, strict=True):
            p *= (detection if hit else 1.0 - detection) if there else (false if hit else 1.0)
        lives.append((p, alive))
    total = sum(p for p, _ in lives)
    expected = [sum(p for p, alive in lives if alive[k]) / total for k in range(len(detected))]

    trace, r = [], birth / survival
    for k, hit in enumerate(detected):
        r *= survival
        r = r * detection / (r * detection + (1 - r) * false) if hit else r * (1 - detection) / (1 - r * detection)
        trace.append(TraceEntry(float(k), still(r), reported(still(r))))
    found = smooth(trace, target_model(survival=survival))
    np.testing.assert_allclose([estimate.existence[0] for estimate in found], expected, rtol=1e-12)


def test_tracks_begin_and_end_when_later_scans_say_so() -> None:
    lmbs, none = [still(r) for r in (0.4, 0.9999, 0.6, 0.01)], Estimate.empty(4)
    estimates = [none, reported(lmbs[1]), reported(lmbs[2]), none]
    trace = [TraceEntry(float(k), *pair) for k, pair in enumerate(zip(lmbs, estimates, strict=True))]
    found = smooth(trace, target_model())
    assert [estimate.num_targets for estimate in found] == [1, 1, 0, 0]


def test_empty_scans_and_classes_are_kept() -> None:
    """The class is that of the last estimate, also where a scan has no estimate."""
    marks = marks_of(np.log([[0.3, 0.7]]))
    lmb = LMB(TrackTable(LABEL, np.array([0, 1]), np.zeros(1), np.zeros((1, 4)), np.eye(4)[None], marks), np.ones(1))
    estimates = [Estimate.empty(4), best_estimate(lmb, 2), Estimate.empty(4)]
    trace = [TraceEntry(float(k), lmb, estimate) for k, estimate in enumerate(estimates)]
    found = smooth(trace, target_model())
    assert [estimate.num_targets for estimate in found] == [1, 1, 0]
    np.testing.assert_allclose(found[0].class_probs, [[0.3, 0.7]], rtol=1e-12)
    nothing = LMB.empty(4)
    assert [len(each) for each in smooth([TraceEntry(0.0, nothing, Estimate.empty(4))] * 2, target_model())] == [0, 0]


def test_densities_of_other_targets_are_refused() -> None:
    plane = LMB.from_bernoullis(LABEL, [0.9], np.zeros((1, 2)), np.eye(2)[np.newaxis])
    with pytest.raises(
        InputError, match=r"density: expected states and modes of targets.motion, of dimension 4.*got 2"
    ):
        smooth([TraceEntry(0.0, plane, reported(plane))], target_model())
    turning = mixture([1.0], np.zeros((1, 4)), np.eye(4)[np.newaxis], [1])
    with pytest.raises(InputError, match="modes up to 1"):
        smooth([TraceEntry(0.0, turning, Estimate.empty(4))], target_model())
    other = reported(still(0.9).with_labels(np.array([[2, 0]])))
    with pytest.raises(InputError, match=r"estimate\.labels: expected labels of the density; got .*2, 0"):
        smooth([TraceEntry(0.0, still(0.9), other)], target_model())
