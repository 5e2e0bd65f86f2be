"""Modes of motion in every filter: against the enumeration of mode sequences and associations, and a textbook IMM."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import reference
from filters.examples import DT, Scene, assert_same_glmb, assert_same_lmb, linear_scene, plain_glmb
from reference import Floats, gaussian
from reference import glmb as oracle
from vedette import models
from vedette.densities import LabelledDensity, Poisson, as_glmb, as_lmb
from vedette.errors import InputError
from vedette.filters import (
    CbMemberFilter,
    CphdFilter,
    DeltaGlmbFilter,
    FactoredGlmbFilter,
    Limits,
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    PhdFilter,
)
from vedette.kernels.base.types import Tracks
from vedette.kernels.gaussian.components import components_of
from vedette.kernels.gaussian.distances import reduction_bound
from vedette.kernels.gaussian.marks import marks_of
from vedette.kernels.gaussian.modes import LOG_LEAST, branched_tracks, mode_transitions, predicted_intensity
from vedette.kernels.gaussian.reduction import make_reduction_work
from vedette.tracking.births import births_from_scans

pytestmark = pytest.mark.lanes

MOTIONS = models.constant_velocity(3.0), models.constant_turn(0.3, 1.0)
SEEN = np.array([1.0, 0.4])
AT_BIRTH = np.array([0.7, 0.3])
# One step of `DT` is short in comparison, so that it is not divided.
MODES = models.Modes(MOTIONS, (12.0, 7.0), at_birth=AT_BIRTH, detection_factors=SEEN, merge_distance=0.0)


class WithModes(oracle.Model):
    """The oracle's model of states with their mode as the last component, -1 at birth."""

    def predictions(self, mean: Floats, cov: Floats) -> list[tuple[float, Floats, Floats]]:
        before, changes = int(mean[-1]), expm(MODES.rates * DT)
        shares = changes[before] if before >= 0 else AT_BIRTH
        return [(share, *self._moved(mean, cov, mode)) for mode, share in enumerate(shares)]

    def _moved(self, mean: Floats, cov: Floats, mode: int) -> tuple[Floats, Floats]:
        motion, slope = MOTIONS[mode], np.empty((4, 4))
        motion.transition_jacobian(mean[:4], DT, motion.transition_params, slope)  # type: ignore[misc]
        moved = slope @ cov[:4, :4] @ slope.T + motion.noise_cov(mean[:4], DT)
        return np.append(slope @ mean[:4], mode), np.pad(moved, ((0, 1), (0, 1)))


def scene_with_modes() -> Scene:
    """The linear scene, whose targets turn at times and are then seen less."""
    scene = linear_scene()
    rows = np.eye(2, 5)
    plain = WithModes(**{name: getattr(scene.plain, name) for name in scene.plain.__match_args__})
    given: dict[str, Any] = {
        "measurement_jacobian": lambda x: rows,
        "prob_detection": lambda x: 0.85 * (SEEN[int(x[-1])] if x[-1] >= 0.0 else 1.0),
    }
    return replace(scene, motion=MODES, plain=replace(plain, **given))


def births_of(scene: Scene, step: int) -> reference.Lmb:
    """The births of a step, of no mode yet."""
    return {
        label: (existence, [(w, np.append(m, -1.0), np.pad(c, ((0, 1), (0, 1)))) for w, m, c in mixture])
        for label, (existence, mixture) in scene.plain_births(step).items()
    }


def without_modes(mixture: reference.Mixture) -> reference.Mixture:
    return [(w, m[:4], c[:4, :4]) for w, m, c in mixture]


def ordered(hypotheses: reference.Glmb) -> reference.Glmb:
    """The hypotheses with the components of each track in one order, without their modes."""
    return [
        (weight, {label: sorted(without_modes(own), key=lambda each: tuple(each[1])) for label, own in tracks.items()})
        for weight, tracks in hypotheses
    ]


def mode_weights(belief: LabelledDensity) -> Floats:
    """Expected number of targets in each mode, and of those without one yet."""
    tracks = as_lmb(belief, max_components=10**6, merge_distance=0.0, log_min_weight=-math.inf)
    modes = tracks.tracks.modes
    existence = np.repeat(tracks.existence, np.diff(tracks.tracks.offsets)) * np.exp(tracks.tracks.log_weights)
    return np.array([existence[modes == mode].sum() for mode in (-1, 0, 1)])


def enumerated_weights(hypotheses: reference.Glmb) -> Floats:
    """The same, of the oracle."""
    every = [(w * own, m[-1]) for w, tracks in hypotheses for mix in tracks.values() for own, m, _ in mix]
    return np.array([sum(weight for weight, mode in every if mode == each) for each in (-1, 0, 1)])


@pytest.mark.parametrize("kind", [DeltaGlmbFilter, FactoredGlmbFilter, MultiSensorGlmbFilter])
def test_hypotheses_equal_the_enumeration(kind):
    scene, hypotheses = scene_with_modes(), oracle.no_target()
    central = kind is MultiSensorGlmbFilter
    tracker = kind(scene.targets, [scene.sensor] if central else scene.sensor, Limits.none())
    belief, rng = tracker.initial(), np.random.default_rng(0)
    for step, scan in enumerate(scene.scans, 1):
        hypotheses, _ = oracle.step(hypotheses, births_of(scene, step), list(scan), scene.plain)
        given = ([scan], [scene.pose]) if central else (scan, scene.pose)
        belief, _ = tracker.step(belief, *given, DT, step, rng=rng)
        belief.validate()
        wanted = oracle.as_glmb(hypotheses)
        assert_same_glmb(ordered(plain_glmb(as_glmb(belief, max_hypotheses=10**6)[0])), ordered(wanted))
        np.testing.assert_allclose(mode_weights(belief), enumerated_weights(wanted), rtol=0, atol=1e-10)


@pytest.mark.parametrize("kind", [LmbFilter, MultiSensorLmbFilter])
def test_an_lmb_equals_the_enumeration(kind):
    scene, lmb = scene_with_modes(), dict[Any, Any]()
    central = kind is MultiSensorLmbFilter
    tracker = kind(scene.targets, [scene.sensor] if central else scene.sensor, Limits.none())
    belief, rng = tracker.initial(), np.random.default_rng(0)
    for step, scan in enumerate(scene.scans, 1):
        lmb, _ = oracle.lmb_step(lmb, births_of(scene, step), list(scan), scene.plain)
        given = ([scan], [scene.pose]) if central else (scan, scene.pose)
        belief, _ = tracker.step(belief, *given, DT, step, rng=rng)
        belief.validate()
        assert_same_lmb(belief, {label: (r, without_modes(own)) for label, (r, own) in lmb.items()})
        wanted = [(1.0, {label: [(r * w, m, c) for w, m, c in own]}) for label, (r, own) in lmb.items()]
        np.testing.assert_allclose(mode_weights(belief), enumerated_weights(wanted), rtol=0, atol=1e-10)


def test_probabilities_of_modes_are_the_exponential():
    rng = np.random.default_rng(1)
    for num in (1, 2, 3, 5):
        rates = rng.exponential(1.0, (num, num)) * (1.0 - np.eye(num))
        rates -= np.diag(rates.sum(axis=1))
        for dt in (1e-9, 0.01, 1.0, 30.0):
            np.testing.assert_allclose(mode_transitions(rates, dt), expm(rates * dt), rtol=0, atol=1e-13)


def test_modes_after_a_long_time_do_not_depend_on_the_first():
    rates = np.array([[-0.2, 0.2], [0.05, -0.05]])
    for dt in (1e3, 1e5, 1e9):
        np.testing.assert_allclose(mode_transitions(rates, dt), [[0.2, 0.8]] * 2, rtol=1e-10)


@models.model_function("transition")
def drifting(state, dt, params, out):
    out[0], out[1] = state[0] + dt * params[0], state[1]


@models.model_function("process_noise_cov")
def diffusing(state, dt, params, out):
    out[0, 0] = out[1, 1] = dt * params[0]
    out[0, 1] = out[1, 0] = 0.0


def test_own_motions_are_modes_if_they_differ_in_parameters():
    slow, fast = (models.MotionModel(2, drifting, diffusing, np.array([v]), np.array([1.0])) for v in (1.0, 9.0))
    modes = models.Modes((slow, fast), (10.0, 30.0))
    np.testing.assert_array_equal(modes.propagate([[0.0, 0.0]], 2.0), [[18.0, 0.0]])
    rows = models.motion_of_filter(modes, models.constant_survival(1.0)).transition_params
    np.testing.assert_array_equal(rows, [[1.0], [9.0]])
    with pytest.raises(
        InputError, match=r"motions\[0\]: expected a built-in motion, or in all modes the same functions"
    ):
        models.Modes((slow, models.random_walk(1.0)), (10.0, 30.0))


def interacting_multiple_model(modes: models.Modes, scans: Floats, times: Floats, birth: Any, noise: Floats) -> Any:
    """Mean and covariance after each scan of position (Blom and Bar-Shalom 1988)."""
    rows, found = np.eye(2, 4), []
    means, covs, probs = [birth[0]], [birth[1]], np.ones(1)
    for step, (scan, dt) in enumerate(zip(scans, times, strict=True)):
        if step > 0:
            changes = modes.at_birth[np.newaxis] if len(means) == 1 else expm(modes.rates * dt)
            predicted = probs @ changes
            before, moved = list(zip(means, covs, strict=True)), []
            for mode, motion in enumerate(modes.motions):
                shares, slope = probs * changes[:, mode] / predicted[mode], np.empty((4, 4))
                mean, cov = _moments(shares, before)
                motion.transition_jacobian(mean, dt, motion.transition_params, slope)  # type: ignore[misc]
                moved.append((slope @ mean, slope @ cov @ slope.T + motion.noise_cov(mean, dt)))
            means, covs, probs = [mean for mean, _ in moved], [cov for _, cov in moved], predicted
        updated = [
            gaussian.ekf_update(mean, cov, scan, lambda x: x[:2], lambda _: rows, noise, (False, False))
            for mean, cov in zip(means, covs, strict=True)
        ]
        means, covs = [mean for mean, _, _ in updated], [cov for _, cov, _ in updated]
        probs = probs * [likelihood for _, _, likelihood in updated]
        probs /= probs.sum()
        found.append((*_moments(probs, list(zip(means, covs, strict=True))), probs))
    return found


def _moments(shares: Floats, gaussians: list[tuple[Floats, Floats]]) -> tuple[Floats, Floats]:
    mean = sum(share * each for share, (each, _) in zip(shares, gaussians, strict=True))
    spread = (cov + np.outer(each - mean, each - mean) for each, cov in gaussians)
    return np.asarray(mean), np.asarray(sum(share * cov for share, cov in zip(shares, spread, strict=True)))


@pytest.mark.parametrize(
    "kind",
    [DeltaGlmbFilter, LmbFilter, FactoredGlmbFilter, PhdFilter, CphdFilter, CbMemberFilter],
    ids=lambda k: k.__name__,
)
def test_one_target_is_an_interacting_multiple_model(kind):
    motions = models.constant_velocity(0.5), models.constant_turn(0.2, 1.0), models.constant_turn(-0.2, 1.0)
    modes = models.Modes(motions, (20.0, 8.0, 9.0), merge_distance=math.inf)
    region, rng = models.Region(-2000.0, 2000.0, -2000.0, 2000.0), np.random.default_rng(3)
    mean, cov = np.array([0.0, 0.0, 10.0, 0.0]), np.diag([25.0, 25.0, 9.0, 9.0])
    birth = models.BirthModel(np.array([0.9999]), mean[None], cov[None], steps=frozenset({1}))
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([3.0, 3.0]),
        models.constant_detection(1.0 - 1e-12),
        models.region_clutter(1e-12, region, "position"),
    )
    tracker = kind(
        models.TargetModel(modes, models.constant_survival(1.0), birth), sensor, Limits(max_existence=1.0 - 1e-12)
    )
    times, state, scans = rng.uniform(0.3, 1.8, 30), mean, []
    for step, dt in enumerate(times):
        state = motions[step // 10].propagate(state, dt)[0]
        scans.append(state[:2] + 3.0 * rng.standard_normal(2))
    wanted = interacting_multiple_model(modes, np.array(scans), times, (mean, cov), 9.0 * np.eye(2))
    belief = tracker.initial()
    for step, (scan, dt) in enumerate(zip(scans, times, strict=True)):
        belief, _ = tracker.step(belief, scan[None], np.zeros(3), float(dt), step + 1, rng=rng)
        own = belief.tracks if isinstance(belief, LabelledDensity) else belief
        weights = np.exp(own.log_weights) / np.exp(own.log_weights).sum()
        found = _moments(weights, list(zip(own.means, own.covs, strict=True)))
        np.testing.assert_allclose(found[0], wanted[step][0], rtol=0, atol=1e-6)
        np.testing.assert_allclose(found[1], wanted[step][1], rtol=0, atol=1e-6)
        if step > 0:
            assert sorted(own.modes) == [0, 1, 2]
            order = np.argsort(own.modes)
            np.testing.assert_allclose(weights[order], wanted[step][2], rtol=0, atol=1e-8)


def seen_and_dim(factor: float, **more: Any) -> models.Modes:
    """A target at rest, detected with the sensor's probability or a factor of it."""
    still = models.constant_velocity(0.0)
    return models.Modes((still, still), (1e9, 1e9), detection_factors=(1.0, factor), merge_distance=0.0, **more)


def disc_sensor(reach: float) -> models.SensorModel:
    """Positions of targets within a distance."""
    return models.SensorModel(
        models.position(),
        models.constant_noise([5.0, 5.0]),
        models.limited_range(0.95, reach),
        models.region_clutter(1e-3, models.Region(-500.0, 500.0, -500.0, 500.0), "position"),
        detection_at="mean",
    )


def after_two_scans(modes: models.Modes, sensor: models.SensorModel, last: Floats) -> LabelledDensity:
    """A target at (100, 0) m after a scan from afar and one from the origin."""
    mean, cov = np.array([100.0, 0.0, 0.0, 0.0]), np.diag([100.0, 100.0, 1e-6, 1e-6])
    birth = models.BirthModel(np.array([0.9]), mean[None], cov[None], steps=frozenset({1}))
    tracker = LmbFilter(models.TargetModel(modes, models.constant_survival(1.0), birth), sensor, Limits.none())
    rng, none = np.random.default_rng(0), np.empty((0, 2))
    belief, _ = tracker.step(tracker.initial(), none, np.array([1e5, 0.0, 0.0]), DT, 1, rng=rng)
    return tracker.step(belief, last, np.zeros(3), DT, 2, rng=rng)[0]


def test_at_the_edge_of_view_a_miss_counts_the_factor_of_the_mode():
    belief = after_two_scans(seen_and_dim(0.6, at_birth=(0.5, 0.5)), disc_sensor(100.0), np.empty((0, 2)))
    points = np.random.default_rng(1).normal(size=(400_000, 2)) * 10.0 + [100.0, 0.0]
    visible = 0.95 * (np.hypot(*points.T) <= 100.0)
    order = np.argsort(belief.tracks.modes)
    totals = []
    for c, factor in zip(order, (1.0, 0.6), strict=True):
        weights = 1.0 - factor * visible
        totals.append(weights.mean())
        mean = weights @ points / weights.sum()
        spread = points - mean
        np.testing.assert_allclose(belief.tracks.means[c, :2], mean, atol=0.6)
        assert mean[0] > 102.0
        np.testing.assert_allclose(
            belief.tracks.covs[c, :2, :2], (weights * spread.T) @ spread / weights.sum(), atol=14.0
        )
    weights = np.exp(belief.tracks.log_weights[order])
    np.testing.assert_allclose(weights, np.array(totals) / sum(totals), atol=0.02)


def test_a_hidden_target_explains_no_measurement():
    sensor, scan = disc_sensor(1e4), np.array([[101.0, 2.0]])
    measured = models.MeasurementBirth(0.1, 0.05, np.array([5.0, 5.0, 1.0, 1.0]))
    birth = models.BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), from_measurements=measured)
    for at_birth, hidden in (((0.0, 1.0), True), ((1.0, 0.0), False)):
        modes = seen_and_dim(0.0, at_birth=at_birth)
        belief = after_two_scans(modes, sensor, np.empty((0, 2)))
        found = births_from_scans(birth, belief, [sensor], [scan], [np.zeros(3)], 3, motion=modes)
        assert found is not None
        assert (len(found.existence) == 1 and found.existence[0] > 0.04) == hidden


def test_a_light_component_of_many_targets_is_kept_as_that_of_one():
    modes = models.Modes(
        (models.constant_velocity(1.0), models.constant_velocity(1.0)), (1e3, 1e3), at_birth=(0.5, 0.5)
    )
    motion = models.motion_of_filter(modes, models.constant_survival(1.0))
    for num in (1, 1000):
        weights = np.append(np.ones(num), 1e-4)
        means = np.zeros((num + 1, 4))
        means[:, 0] = 1e3 * np.arange(num + 1)
        intensity = Poisson(np.log(weights), means, np.tile(np.eye(4), (num + 1, 1, 1))).to_kernel()
        for scale in (1.0, 1.0 / weights.sum()):  # a CPHD filter's weights sum to 1
            scaled = intensity._replace(log_weights=intensity.log_weights + math.log(scale))
            moved = predicted_intensity(scaled, motion, 1.0)
            assert np.count_nonzero(moved.means[:, 0] > 1e3 * num - 500.0) == 2


def tracks_of(weights: list[float], modes: list[int]) -> Tracks:
    """One track of components at rest at the origin."""
    num = len(weights)
    marks = marks_of(modes=np.array(modes))
    components = components_of(np.log(weights), np.zeros((num, 4)), np.tile(np.eye(4), (num, 1, 1)), marks)
    return Tracks(np.zeros((1, 2), np.int64), np.array([0, num]), components)


def test_a_mode_that_is_rarely_entered_stays_possible_at_any_rate_of_scans():
    modes = models.Modes((models.constant_velocity(1.0), models.constant_velocity(9.0)), (1e4, 1e4))
    motion = models.motion_of_filter(modes, models.constant_survival(1.0))
    moved, _ = branched_tracks(tracks_of([1.0], [0]), motion, 1e-3, LOG_LEAST)
    order = np.argsort(moved.components.marks[:, 0])
    np.testing.assert_allclose(np.exp(moved.components.log_weights[order]), expm(modes.rates * 1e-3)[0], rtol=1e-9)


def test_light_branches_are_dropped_and_their_weight_is_shared():
    modes = models.Modes((models.constant_velocity(1.0), models.constant_velocity(9.0)), (10.0, 10.0))
    motion = models.motion_of_filter(modes, models.constant_survival(1.0))
    shares = expm(modes.rates)[0]
    for light, kept in ((1e-5, 1.0), (1e-2, 1.0 - 1e-2)):
        moved, _ = branched_tracks(tracks_of([1.0 - light, light], [0, 1]), motion, 1.0, LOG_LEAST)
        order = np.argsort(moved.components.marks[:, 0])
        wanted = kept * shares + (1.0 - kept) * shares[::-1]
        np.testing.assert_allclose(np.exp(moved.components.log_weights[order]), wanted, rtol=1e-9)


def test_a_reduced_mixture_that_lacks_a_mode_is_as_far_as_its_weight():
    both = tracks_of([0.9, 0.1], [0, 1]).components
    one = tracks_of([1.0], [0]).components
    work = make_reduction_work(2, both)
    assert reduction_bound(both, 2, one, 0, 1, work) == pytest.approx(0.2)
    same = tracks_of([0.9, 0.1], [0, 0]).components
    assert reduction_bound(same, 2, one, 0, 1, work) == pytest.approx(0.0, abs=1e-6)
