"""Rewards of a decision by plain loops over the library's public filter, fusion and divergence: the slow oracle."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np

from control.examples import Situation
from vedette import models
from vedette.control import MobileSensor, PlanningSettings
from vedette.densities import GLMB, LMB, TrackTable, marginalise, sample_glmb, sample_lmb, track_moments
from vedette.divergence import cauchy_schwarz, reference_unit_volume
from vedette.filters import DeltaGlmbFilter, LmbFilter
from vedette.platforms import HeadingPlatform

_BLIND = models.SensorModel(
    models.position(),
    models.constant_noise([1.0, 1.0]),
    models.constant_detection(0.0),
    models.measurement_space_clutter(0.0, [-1.0, -1.0], [1.0, 1.0]),
)


def scans_then(sensor: MobileSensor, h: int, settings: PlanningSettings, now: float = 1.0) -> bool:
    """Whether a sensor scans in the period of the horizon that ends with its step h, from 0; now: of `Situation`."""
    end = now + (h + 1) * settings.horizon_period
    times = [end] if sensor.scan_times is None else sensor.scan_times
    return any(end - settings.horizon_period < time <= end for time in times)


def plain_rewards(situation: Situation, unit_volume: Any, seed: int) -> tuple[Any, list[Any]]:
    """Joint rewards (num_joint, num_samples), the last sensor's action fastest, and (num_actions, num_samples) of each
    sensor alone."""
    settings, num_samples = situation.settings, situation.settings.num_samples
    motion = situation.sensors[0].filter.targets.motion
    futures = _draw(situation, np.random.default_rng(seed))
    updated = [
        [
            [
                _updated(belief, sensor, _path(sensor, pose, action, settings), *future, sample, settings)
                for sample in range(num_samples)
            ]
            for action in sensor.platform.actions(pose)
        ]
        for belief, sensor, pose, future in zip(
            situation.beliefs, situation.sensors, situation.poses, futures, strict=True
        )
    ]
    predicted = _predicted(situation.fused, motion, settings)
    volume = reference_unit_volume(predicted) if unit_volume == "reference" else unit_volume

    def reward(density: Any) -> float:
        return cauchy_schwarz(predicted, density, unit_volume=volume, support="common")

    alone = [np.array([[reward(density) for density in action] for action in actions]) for actions in updated]
    joint = [
        [reward(situation.fusion.fuse([action[m] for action in actions])[0]) for m in range(num_samples)]
        for actions in itertools.product(*updated)
    ]
    return np.array(joint), alone


def _draw(situation: Situation, rng: np.random.Generator) -> list[tuple[Any, Any, Any]]:
    """For each sensor: the states of each sample at each step, and the uniforms and normals of its measurements."""
    settings, fused = situation.settings, situation.fused
    draw: Any = sample_glmb if isinstance(fused, GLMB) else sample_lmb
    samples = draw(fused, settings.num_samples, rng=rng)
    states, at = [], samples.states
    for _ in range(settings.horizon_steps):
        at = situation.sensors[0].filter.targets.motion.propagate(at, settings.horizon_period)
        states.append([at[samples.offsets[m] : samples.offsets[m + 1]] for m in range(settings.num_samples)])
    drawn = []
    for sensor in situation.sensors:
        shape = settings.horizon_steps, len(at)
        uniforms = np.split(rng.random(shape), samples.offsets[1:-1], axis=1)
        normals = rng.standard_normal((*shape, sensor.filter.sensor.meas_dim))
        drawn.append((states, uniforms, np.split(normals, samples.offsets[1:-1], axis=1)))
    return drawn


def _path(sensor: MobileSensor, pose: Any, action: Any, settings: PlanningSettings) -> list[Any]:
    platform = sensor.platform
    assert isinstance(platform, HeadingPlatform)
    heading = math.radians(action[0])
    away = np.array([np.cos(heading), np.sin(heading)]) * platform.speed * settings.horizon_period
    return [np.array([*(pose[:2] + (h + 1) * away), heading]) for h in range(settings.horizon_steps)]


def _scan(sensor: models.SensorModel, pose: Any, states: Any, uniforms: Any, normals: Any, settings: Any) -> Any:
    """The ideal measurements of one sample at one step."""
    probabilities = sensor.detection.prob(states, pose)
    ideal = settings.ideal_measurements == "ideal"
    seen = probabilities >= settings.detection_threshold if ideal else uniforms < probabilities
    scan = sensor.measurement.measure(states[seen], pose)
    if settings.ideal_measurements == "sampled":
        factors = np.linalg.cholesky(sensor.noise.covs(states[seen], pose, sensor.meas_dim))
        scan = scan + np.einsum("nij,nj->ni", factors, normals[seen])
        angles = sensor.measurement.angular
        scan[:, angles] = np.arctan2(np.sin(scan[:, angles]), np.cos(scan[:, angles]))
    return scan


def _updated(
    belief: Any, sensor: MobileSensor, path: Any, states: Any, uniforms: Any, normals: Any, m: int, settings: Any
) -> Any:
    """The belief after the pseudo-updates of one sample, one Gaussian a track."""
    own: Any = sensor.filter
    kind: Any = LmbFilter if isinstance(belief, LMB) else DeltaGlmbFilter
    if isinstance(belief, GLMB):
        belief = _cut(belief, settings.max_prior_hypotheses)
    belief = replace(belief, tracks=TrackTable.from_gaussians(belief.tracks.labels, *track_moments(belief.tracks)))
    looking, blind = (kind(_immortal(own.targets.motion), seen, settings.limits) for seen in (own.sensor, _BLIND))
    for h, pose in enumerate(path):
        if not scans_then(sensor, h, settings):
            belief, _ = blind.step(belief, [], pose, settings.horizon_period, h + 1, rng=np.random.default_rng(0))
            continue
        scan = _scan(own.sensor, pose, states[h][m], uniforms[m][h], normals[m][h], settings)
        belief, _ = looking.step(belief, scan, pose, settings.horizon_period, h + 1, rng=np.random.default_rng(0))
    return marginalise(belief, max_components=1) if isinstance(belief, GLMB) else belief


def _immortal(motion: models.MotionModel) -> models.TargetModel:
    return models.TargetModel(motion, models.constant_survival(1.0), models.BirthModel.none(motion.state_dim))


def _cut(belief: GLMB, most: int) -> GLMB:
    heaviest = sorted(range(belief.num_hyps), key=lambda h: -belief.hyp_log_weights[h])[:most]
    hyps = [belief.hyp_tracks[belief.hyp_offsets[h] : belief.hyp_offsets[h + 1]] for h in heaviest]
    weights = np.exp(belief.hyp_log_weights[heaviest])
    return GLMB.from_hypotheses(belief.tracks, [hyp.tolist() for hyp in hyps], weights / weights.sum())


def _predicted(fused: Any, motion: models.MotionModel, settings: PlanningSettings) -> Any:
    """The fused belief, one Gaussian a track, after scans of a sensor that never sees anything."""
    belief: Any
    if isinstance(fused, LMB):
        belief = LMB.from_bernoullis(fused.tracks.labels, fused.existence, *track_moments(fused.tracks))
    else:
        belief = marginalise(fused, max_components=1)
    kind: Any = LmbFilter if isinstance(fused, LMB) else DeltaGlmbFilter
    local = kind(_immortal(motion), _BLIND, settings.limits)
    for h in range(settings.horizon_steps):
        belief, _ = local.step(belief, [], np.zeros(3), settings.horizon_period, h + 1, rng=np.random.default_rng(0))
    return belief
