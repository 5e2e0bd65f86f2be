"""Pseudo-updates: what each sensor would believe at the end of the horizon, for each of its actions and each sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.priors import ALWAYS_SURVIVES, heaviest_hypotheses, share_versions
from vedette.control.settings import IDEAL_MODES, MobileSensor, PlanningSettings
from vedette.densities import GLMB, LMB, MultiTargetSamples
from vedette.densities.cases import LabelledCases
from vedette.densities.checks import offsets_of
from vedette.densities.label_sets import label_sets
from vedette.densities.samples import sample_labelled
from vedette.densities.tracks import places_of, single_gaussians
from vedette.filters import shared_targets
from vedette.filters.inputs import model_errors
from vedette.filters.lmb import association_of
from vedette.kernels.association.marginals import Association
from vedette.kernels.base.types import Bools, Floats, Ints, Motion, Sensor
from vedette.kernels.gaussian.sigma_points import LINEARISED
from vedette.kernels.planning.forms import ANY, BEARING_RANGE, CONSTANT, GAUSSIAN, GROWING, POSITION, SAME, Forms
from vedette.kernels.planning.ideal import Decision, Futures, Horizon, propagate_samples
from vedette.kernels.planning.known import pseudo_update_known
from vedette.kernels.planning.pseudo_glmb import GlmbResults, pseudo_update_glmb
from vedette.kernels.planning.pseudo_lmb import LmbResults, pseudo_update_lmb
from vedette.kernels.planning.reach import Belief as KnownBelief
from vedette.kernels.planning.reach import label_radii, predict_paths
from vedette.models import (
    bearing_range,
    constant_detection,
    constant_noise,
    constant_velocity,
    gaussian_detection,
    kernel_motion,
    position,
    range_dependent_noise,
)
from vedette.models.detection_functions import MAX_PROB_DETECTION
from vedette.threads import run_chunks

# By the functions themselves: a model of a user's own is none of these.
_LINEAR = {
    (own.transition, own.process_noise_cov)
    for own in (constant_velocity(1.0, acceleration=kind) for kind in ("held", "continuous"))
}

_MEASUREMENTS = {bearing_range().function: BEARING_RANGE, position().function: POSITION}

_NOISES = {
    range_dependent_noise(1.0, 0.0, 1.0, 0.0).function: GROWING,
    constant_noise([1.0]).function: CONSTANT,
}

_DETECTIONS = {gaussian_detection(1.0).function: GAUSSIAN, constant_detection(0.5).function: SAME}


def draw_paths(
    fused: Belief, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
) -> tuple[MultiTargetSamples, Floats]:
    """Samples of the fused density, and (horizon_steps, num_targets, state_dim) where they go without noise."""
    targets = shared_targets([sensor.filter for sensor in sensors])
    samples = sample_labelled(fused, settings.num_samples, rng=rng)
    with model_errors():
        motion = kernel_motion(targets.motion, targets.survival)
        states = propagate_samples(motion, samples.states, float(settings.horizon_period), int(settings.horizon_steps))
    return samples, states


def draw_futures(
    fused: Belief, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
) -> tuple[Ints, tuple[Futures, ...]]:
    """Samples of the fused density carried over the horizon without noise; the same states for every sensor.

    Returns the labels (num_targets, 2) of the sampled targets, and the future as each sensor meets it. The random
    numbers of detections and noise are each sensor's own, and the same for all its actions.
    """
    samples, states = draw_paths(fused, sensors, settings, rng=rng)
    futures = []
    for sensor in sensors:
        shape = (settings.horizon_steps, len(samples.states))
        uniforms = rng.random(shape)
        normals = rng.standard_normal((*shape, sensor.filter.sensor.meas_dim))
        futures.append(Futures(samples.offsets, states, uniforms, normals))
    return samples.labels, tuple(futures)


def pseudo_posteriors(
    belief: Belief,
    sensor: MobileSensor,
    courses: Floats,
    labels: Ints,
    futures: Futures,
    settings: PlanningSettings,
    scans: Bools,
) -> LabelledCases:
    """Run the sensor's filter over the horizon for every course and sample, without births or deaths.

    courses: (num_courses, horizon_steps, pose_dim) poses at the pseudo-updates. labels: of the targets of `futures`.
    scans: (horizon_steps,) at which of them it scans. The belief is one of the filter's kind. Raises `ModelError` and
    `NumericalError` as the filter.
    """
    decision = decision_of(sensor, courses, futures, settings, scans)
    num_cases = len(courses) * settings.num_samples
    if not belief.is_lmb:
        return _run_glmb(belief, decision, settings, num_cases)
    targets = targets_of(belief.tracks.labels, labels, futures.offsets)
    return _run_lmb(belief, decision, association_of(sensor.filter), settings, num_cases, targets)


def decision_of(
    sensor: MobileSensor,
    courses: Floats,
    futures: Futures,
    settings: PlanningSettings,
    scans: Bools,
    detection_at: str | None = None,
) -> Decision:
    """What the pseudo-updates of a sensor depend on besides its prior.

    scans: (horizon_steps,) at which of them it scans. detection_at: as of `SensorModel.to_kernel`.
    """
    horizon = Horizon(
        np.ascontiguousarray(courses),
        scans,
        float(settings.horizon_period),
        IDEAL_MODES[settings.ideal_measurements],
        float(settings.detection_threshold),
    )
    targets, own = sensor.filter.targets, sensor.filter.sensor
    motion, sees = kernel_motion(targets.motion, ALWAYS_SURVIVES), own.to_kernel(detection_at)
    return Decision(
        LMB.empty(targets.state_dim).to_kernel(),
        motion,
        sees,
        forms_of(motion, sees, horizon.dt, targets.state_dim),
        horizon,
        futures,
        settings.limits.truncation(own.meas_dim),
    )


def targets_of(table: Ints, labels: Ints, offsets: Ints) -> Ints:
    """(num_labels, num_samples) place of the target of each label of `table` in each sample, -1 where it is not there.

    labels: of the sampled targets, which are `offsets[i]:offsets[i + 1]` of sample i.
    """
    rows = places_of(labels, table)
    of_sample = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    targets, known = np.full((len(table), len(offsets) - 1), -1), rows >= 0
    targets[rows[known], of_sample[known]] = np.flatnonzero(known)
    return targets


def _run_glmb(belief: GLMB, decision: Decision, settings: PlanningSettings, num_cases: int) -> LabelledCases:
    heaviest = heaviest_hypotheses(belief, settings.max_prior_hypotheses)
    single = heaviest.with_fields(tracks=single_gaussians(heaviest.tracks))
    prior = share_versions(single, settings.max_version_divergence)
    found, dim = label_sets(prior), prior.tracks.state_dim
    set_offsets = offsets_of([len(labels) for labels in found.sets])
    results = GlmbResults(
        set_offsets,
        np.empty((num_cases, len(found.sets))),
        np.empty((num_cases, int(set_offsets[-1]), dim)),
        np.empty((num_cases, int(set_offsets[-1]), dim, dim)),
    )
    kernel_prior = prior.to_kernel()

    def work(first: int, last: int) -> None:
        pseudo_update_glmb(kernel_prior, found.groups, decision, first, last, results)

    with model_errors():
        run_chunks(work, num_cases, settings.threads())
    return LabelledCases.of_glmbs(found.sets, results.log_weights, results.means, results.covs, **_counts(settings))


def _run_lmb(
    belief: LMB,
    decision: Decision,
    association: Association | None,
    settings: PlanningSettings,
    num_cases: int,
    targets: Ints,
) -> LabelledCases:
    num, dim = belief.tracks.num_tracks, belief.tracks.state_dim
    results = LmbResults(
        np.empty((num_cases, num)), np.empty((num_cases, num, dim)), np.empty((num_cases, num, dim, dim))
    )
    prior = belief.with_fields(tracks=single_gaussians(belief.tracks)).to_kernel()

    with model_errors():
        if settings.association == "known":
            horizon, tracks = decision.horizon, prior.tracks
            paths = predict_paths(decision.motion, horizon.dt, settings.horizon_steps, tracks.means, tracks.covs)
            own = KnownBelief(prior, paths, targets, label_radii(paths, targets, decision.futures.states))
            num_courses = len(decision.horizon.poses)
            run_chunks(
                lambda first, last: pseudo_update_known(own, decision, first, last, results),
                num_courses,
                settings.threads(),
            )
        else:
            run_chunks(
                lambda first, last: pseudo_update_lmb(prior, decision, association, first, last, results),
                num_cases,
                settings.threads(),
            )
    labels = [tuple(label) for label in belief.tracks.labels.tolist()]
    return LabelledCases.of_lmbs(labels, results.logits, results.means, results.covs, **_counts(settings))


def _counts(settings: PlanningSettings) -> dict[str, int]:
    return {"num_samples": settings.num_samples, "num_threads": settings.threads()}


def forms_of(motion: Motion, sensor: Sensor, dt: float, state_dim: int) -> Forms:
    """The forms of models as kernels take them, over steps of `dt` seconds."""
    transition, noise = np.zeros((state_dim, state_dim)), np.zeros((state_dim, state_dim))
    is_linear = motion.method == LINEARISED and (motion.transition, motion.process_noise_cov) in _LINEAR
    if is_linear:
        anywhere = np.zeros(state_dim)
        motion.transition_jacobian(anywhere, dt, motion.transition_params, transition)
        motion.process_noise_cov(anywhere, dt, motion.noise_params, noise)
    return Forms(
        int(is_linear),
        transition,
        noise,
        _MEASUREMENTS.get(sensor.measurement, ANY),
        _NOISES.get(sensor.measurement_noise_cov, ANY),
        _DETECTIONS.get(sensor.prob_detection, ANY),
        MAX_PROB_DETECTION,
    )
