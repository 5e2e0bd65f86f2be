"""The first start: what a run needs is compiled by two processes at once, each through a small example of its own."""

from __future__ import annotations

from multiprocessing import get_context

import numpy as np

from vedette.control.priors import label_sets, predicted, single_labels
from vedette.control.pseudo import PseudoPosteriors
from vedette.control.tables import fused_rewards
from vedette.densities import GLMB, LMB
from vedette.filters import LmbFilter
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import run_stream


def precompile(scenario: Scenario) -> None:
    """Compile the filter of the scenario here, and its fusion and rewards in another process meanwhile.

    Planning compiles on top of both when the first decision is made. Whatever the other process does not get done (it
    may be forbidden, or fail) is compiled where it is first used; no result depends on it.
    """
    other = get_context("spawn").Process(target=_compile_fusion, args=(scenario,), daemon=True)
    try:
        other.start()
    except OSError:
        return
    _compile_filter(build_experiment(scenario))
    other.join()


def _compile_filter(experiment: Experiment) -> None:
    local = experiment.sensors[0].filter
    scan = np.empty((0, local.sensor.meas_dim))
    local.step(local.initial(), scan, experiment.poses[0], 1.0, 1, rng=run_stream(0, 0))


def _compile_fusion(scenario: Scenario) -> None:
    experiment = build_experiment(scenario)
    local = experiment.sensors[0].filter
    birth = local.birth
    labels = [(1, site) for site in range(birth.num_sites)]
    newborn = LMB.from_bernoullis(labels, birth.existence, birth.means, birth.covs)
    everyone = tuple((step, site) for step, site in newborn.tracks.labels.tolist())
    belief: GLMB | LMB = newborn
    if not isinstance(local, LmbFilter):
        belief = GLMB.from_hypotheses(newborn.tracks, [list(range(len(everyone)))], [1.0])
    fusion = experiment.fusion
    fused = belief if fusion is None else fusion.fuse([belief] * len(experiment.sensors))[0]
    experiment.estimate(fused)
    if isinstance(fusion, CmDeltaGlmb | Clmb) and isinstance(fused, type(belief)):
        ahead = predicted(fused, local, 1, 1.0)
        own = _one_case(belief)
        fused_rewards([own] * len(experiment.sensors), ahead, fusion, 1, 1.0, 1)(
            np.zeros((1, len(experiment.sensors)), np.int64)
        )


def _one_case(belief: GLMB | LMB) -> PseudoPosteriors:
    """The belief as if it were the only pseudo-posterior of a sensor."""
    is_lmb = isinstance(belief, LMB)
    sets = single_labels(belief) if isinstance(belief, LMB) else label_sets(belief).sets
    weights = belief.existence_logit if isinstance(belief, LMB) else belief.hyp_log_weights
    tracks = belief.tracks
    return PseudoPosteriors(sets, weights[np.newaxis].copy(), tracks.means[np.newaxis], tracks.covs[np.newaxis], is_lmb)
