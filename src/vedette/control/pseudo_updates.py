"""Pseudo-updates: each sensor's belief at the end of the horizon, for each of its actions and each sample.

A filter keeps a density for each label of each hypothesis. The densities of a label in two hypotheses differ by how
these explain the measurements of other labels, which is often negligible: of the 26 tracks that ten label sets of
`paper-a` have under an M-delta-GLMB, each label's are within 1e-3 nats of one another. A planner that predicts and
updates all of them does the same work six times.
"""

from collections.abc import Sequence

import numpy as np

from vedette.control.known_models import decision_of
from vedette.control.prediction import draw_paths, targets_of
from vedette.control.settings import Belief, MobileSensor, PlanningSettings
from vedette.densities import (
    GLMB,
    LMB,
)
from vedette.densities.batches import DensityBatch
from vedette.densities.checks import offsets_of
from vedette.densities.containers import for_kernel
from vedette.densities.label_sets import label_sets, take_hypotheses, with_replaced_tracks
from vedette.densities.tracks import single_gaussians
from vedette.filters.inputs import model_errors
from vedette.filters.lmb import association_of
from vedette.internal.threads import run_chunks
from vedette.kernels.association.marginals import Association
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.planning.ideal import Decision, SampledTrajectories
from vedette.kernels.planning.known_changes import pseudo_update_known
from vedette.kernels.planning.pseudo_glmb import GlmbResults, pseudo_update_glmb
from vedette.kernels.planning.pseudo_lmb import LmbResults, pseudo_update_lmb
from vedette.kernels.planning.reach import Belief as KnownBelief
from vedette.kernels.planning.reach import label_radii, predict_paths


def draw_futures(
    fused: Belief, sensors: Sequence[MobileSensor], settings: PlanningSettings, *, rng: np.random.Generator
) -> tuple[Ints, tuple[SampledTrajectories, ...]]:
    """Return samples of the fused density propagated over the horizon without noise. All sensors share the states.

    Returns the labels (num_targets, 2) of the sampled targets, and the trajectories for each sensor. The random numbers
    of detections and noise are each sensor's own, and the same for all its actions.
    """
    samples, states = draw_paths(fused, sensors, settings, rng=rng)
    futures = []
    for sensor in sensors:
        shape = (settings.horizon_steps, len(samples.states))
        uniforms = rng.random(shape)
        normals = rng.standard_normal((*shape, sensor.filter.sensor.meas_dim))
        futures.append(SampledTrajectories(samples.offsets, states, uniforms, normals))
    return samples.labels, tuple(futures)


def pseudo_posteriors(
    belief: Belief,
    sensor: MobileSensor,
    courses: Floats,
    labels: Ints,
    futures: SampledTrajectories,
    settings: PlanningSettings,
    scans: Bools,
) -> DensityBatch:
    """Run the sensor's filter over the horizon for every course and sample, without births or deaths.

    courses: (num_courses, horizon_steps, pose_dim) poses at the pseudo-updates. labels: of the targets of `futures`.
    scans: (num_courses, horizon_steps) whether it scans at each step. The belief has the type of the filter. Raises
    `ModelError` and `NumericalError` as the filter.
    """
    decision = decision_of(sensor, courses, futures, settings, scans)
    num_cases = len(courses) * settings.num_samples
    if not belief.is_lmb:
        return _run_glmb(belief, decision, settings, num_cases)
    targets = targets_of(belief.tracks.labels, labels, futures.offsets)
    return _run_lmb(belief, decision, association_of(sensor.filter), settings, num_cases, targets)


def _run_glmb(belief: GLMB, decision: Decision, settings: PlanningSettings, num_cases: int) -> DensityBatch:
    heaviest = heaviest_hypotheses(belief, settings.max_prior_hypotheses)
    single = heaviest.with_fields(tracks=single_gaussians(heaviest.tracks))
    prior = merge_similar_tracks(single, settings.max_version_divergence)
    sets, dim = label_sets(prior), prior.tracks.state_dim
    set_offsets = offsets_of([len(labels) for labels in sets.sets])
    results = GlmbResults(
        set_offsets,
        np.empty((num_cases, len(sets.sets))),
        np.empty((num_cases, int(set_offsets[-1]), dim)),
        np.empty((num_cases, int(set_offsets[-1]), dim, dim)),
    )
    kernel_prior = prior.to_kernel()

    def work(first: int, last: int) -> None:
        pseudo_update_glmb(kernel_prior, sets.groups, decision, first, last, results)

    with model_errors():
        run_chunks(work, num_cases, settings.threads())
    return DensityBatch.of_glmbs(sets.sets, results.log_weights, results.means, results.covs, **_counts(settings))


def _run_lmb(
    belief: LMB,
    decision: Decision,
    association: Association | None,
    settings: PlanningSettings,
    num_cases: int,
    targets: Ints,
) -> DensityBatch:
    num, dim = belief.tracks.num_tracks, belief.tracks.state_dim
    results = LmbResults(
        np.empty((num_cases, num)), np.empty((num_cases, num, dim)), np.empty((num_cases, num, dim, dim))
    )
    prior = belief.with_fields(tracks=single_gaussians(belief.tracks)).to_kernel()

    with model_errors():
        if settings.association == "known":
            dt, gaussians = decision.horizon.dt, prior.tracks.components
            paths = predict_paths(decision.motion, dt, settings.horizon_steps, gaussians.means, gaussians.covs)
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
    return DensityBatch.of_lmbs(labels, results.logits, results.means, results.covs, **_counts(settings))


def _counts(settings: PlanningSettings) -> dict[str, int]:
    return {"num_samples": settings.num_samples, "num_threads": settings.threads()}


def heaviest_hypotheses(belief: GLMB, max_hypotheses: int) -> GLMB:
    """Return the `max_hypotheses` heaviest hypotheses of positive weight, normalised, of equal weights the first."""
    order = np.argsort(-belief.hyp_log_weights, kind="stable")[:max_hypotheses]
    heaviest = take_hypotheses(belief, order[belief.hyp_log_weights[order] > -np.inf])
    log_weights = heaviest.hyp_log_weights - log_sum(for_kernel(heaviest.hyp_log_weights))
    return heaviest.with_fields(hyp_log_weights=log_weights)


def merge_similar_tracks(belief: GLMB, max_divergence: float) -> GLMB:
    """Return the belief with tracks of a label replaced by one from which they diverge by at most `max_divergence`.

    belief: one Gaussian per track, its hypotheses heaviest first. The tracks of heavier hypotheses stay, and those of
    lighter ones are replaced by the first of them that is near enough. Hypotheses that then have the same tracks are
    merged, and their weights are added. max_divergence: in nats. 0 leaves everything unchanged.
    """
    if max_divergence == 0.0 or len(belief.hyp_tracks) == 0:
        return belief
    return with_replaced_tracks(
        belief, _leaders(belief, _divergences(belief.tracks.means, belief.tracks.covs), max_divergence)
    )


def _divergences(means: Floats, covs: Floats) -> Floats:
    """Return (num, num) the Kullback-Leibler divergence of Gaussian i from Gaussian j, in nats."""
    precisions, log_dets = np.linalg.inv(covs), np.linalg.slogdet(covs)[1]
    offsets = means[:, np.newaxis] - means
    traces = np.einsum("iab,jba->ij", covs, precisions)
    squares = np.einsum("ija,jab,ijb->ij", offsets, precisions, offsets, optimize=True)
    return np.asarray(0.5 * (traces + squares - means.shape[1] + log_dets - log_dets[:, np.newaxis]))


def _leaders(belief: GLMB, divergences: Floats, max_divergence: float) -> Ints:
    """Return (num_tracks,) the track that replaces each, or its own index if it stays, or if no hypothesis has it."""
    labels, leaders = belief.tracks.labels.tolist(), np.arange(belief.tracks.num_tracks)
    leaders_of: dict[tuple[int, ...], list[int]] = {}
    for track in dict.fromkeys(belief.hyp_tracks.tolist()):
        own = leaders_of.setdefault(tuple(labels[track]), [])
        near = [leader for leader in own if divergences[track, leader] <= max_divergence]
        if near:
            leaders[track] = near[0]
        else:
            own.append(track)
    return leaders
