"""Pseudo-updates: what each sensor would believe at the end of the horizon, for each of its actions and each sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.priors import heaviest_hypotheses
from vedette.control.settings import IDEAL_MODES, MobileSensor, PlanningSettings
from vedette.densities import GLMB, LMB, sample_glmb, sample_lmb
from vedette.densities.cases import LabelledCases
from vedette.densities.checks import unchecked
from vedette.densities.label_sets import label_sets, offsets_of, single_gaussians
from vedette.filters import shared_targets
from vedette.filters.inputs import model_errors
from vedette.kernels.base.types import Floats
from vedette.kernels.planning.ideal import Decision, Futures, Horizon, propagate_samples
from vedette.kernels.planning.pseudo_glmb import GlmbResults, pseudo_update_glmb
from vedette.kernels.planning.pseudo_lmb import LmbResults, pseudo_update_lmb
from vedette.models import constant_survival, kernel_motion
from vedette.threads import run_chunks


def draw_futures(
    fused: Belief, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
) -> tuple[Futures, ...]:
    """Samples of the fused density carried over the horizon without noise; the same states for every sensor.

    The random numbers of detections and noise are each sensor's own, and the same for all its actions.
    """
    targets = shared_targets([sensor.filter for sensor in sensors])
    motion = kernel_motion(targets.motion, targets.survival)
    num = settings.num_samples
    samples = sample_glmb(fused, num, rng=rng) if isinstance(fused, GLMB) else sample_lmb(fused, num, rng=rng)
    with model_errors():
        states = propagate_samples(motion, samples.states, float(settings.horizon_period), int(settings.horizon_steps))
    futures = []
    for sensor in sensors:
        shape = (settings.horizon_steps, len(samples.states))
        uniforms = rng.random(shape)
        normals = rng.standard_normal((*shape, sensor.filter.sensor.meas_dim))
        futures.append(Futures(samples.offsets, states, uniforms, normals))
    return tuple(futures)


def pseudo_posteriors(
    belief: Belief, sensor: MobileSensor, courses: Floats, futures: Futures, settings: PlanningSettings
) -> LabelledCases:
    """Run the sensor's filter over the horizon for every course and sample, without births or deaths.

    courses: (num_courses, horizon_steps, pose_dim) poses at the pseudo-updates.
    The belief is one of the filter's kind. Raises `ModelError` and `NumericalError` as the filter.
    """
    horizon = Horizon(
        courses,
        float(settings.horizon_period),
        IDEAL_MODES[settings.ideal_measurements],
        float(settings.detection_threshold),
    )
    decision = Decision(
        LMB.empty(belief.state_dim).to_kernel(),
        kernel_motion(sensor.filter.targets.motion, constant_survival(1.0)),
        sensor.filter.sensor.to_kernel(),
        horizon,
        futures,
        settings.limits.truncation(sensor.filter.sensor.meas_dim),
    )
    num_cases = len(courses) * settings.num_samples
    if isinstance(belief, GLMB):
        return _run_glmb(belief, decision, settings, num_cases)
    return _run_lmb(belief, decision, settings, num_cases)


def _run_glmb(belief: GLMB, decision: Decision, settings: PlanningSettings, num_cases: int) -> LabelledCases:
    heaviest = heaviest_hypotheses(belief, settings.max_prior_hypotheses)
    prior = unchecked(GLMB, single_gaussians(heaviest.tracks), *heaviest.to_kernel()[1:])
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


def _run_lmb(belief: LMB, decision: Decision, settings: PlanningSettings, num_cases: int) -> LabelledCases:
    num, dim = belief.tracks.num_tracks, belief.tracks.state_dim
    results = LmbResults(
        np.empty((num_cases, num)), np.empty((num_cases, num, dim)), np.empty((num_cases, num, dim, dim))
    )
    prior = unchecked(LMB, single_gaussians(belief.tracks), belief.existence_logit).to_kernel()

    def work(first: int, last: int) -> None:
        pseudo_update_lmb(prior, decision, first, last, results)

    with model_errors():
        run_chunks(work, num_cases, settings.threads())
    labels = [tuple(label) for label in belief.tracks.labels.tolist()]
    return LabelledCases.of_lmbs(labels, results.logits, results.means, results.covs, **_counts(settings))


def _counts(settings: PlanningSettings) -> dict[str, int]:
    return {"num_samples": settings.num_samples, "num_threads": settings.threads()}
