"""The first start: what a run needs is compiled by two processes at once, each through a small example of its own."""

from __future__ import annotations

from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from vedette.control import JointPlanner
from vedette.densities import GLMB, LMB
from vedette.evaluation.runs import children_ignore_interrupts, strategy
from vedette.filters import labels_targets
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import run_stream


def precompile(scenario: Scenario) -> None:
    """Compile the filter of the scenario here; its fusion and joint planning in another process meanwhile.

    Each finds in the cache what the other has already compiled. Whatever the other process does not get done (it may be
    forbidden, or fail) is compiled where it is first used; no result depends on it.
    """
    experiment = build_experiment(scenario)
    if not labels_targets(experiment.sensors[0].filter):
        _compile_filter(experiment)  # there is no fusion nor planning without labels
        return
    other = get_context("spawn").Process(target=_compile_planning, args=(scenario,), daemon=True)
    try:
        with children_ignore_interrupts():
            other.start()
    except OSError:
        return
    _compile_filter(experiment)
    other.join()


def _compile_filter(experiment: Experiment) -> None:
    local: Any = experiment.sensors[0].filter
    scan = np.empty((0, local.sensor.meas_dim))
    local.step(local.initial(), scan, experiment.poses[0], 1.0, 1, rng=run_stream(0, 0))


def _compile_planning(scenario: Scenario) -> None:
    """Fuse, estimate and plan as if every birth site held a target, one of which a single sensor knows."""
    experiment = build_experiment(scenario)
    num_sites, num_sensors = experiment.sensors[0].filter.targets.birth.num_sites, len(experiment.sensors)
    beliefs = [_belief(experiment, num_sites), *[_belief(experiment, max(num_sites - 1, 1))] * (num_sensors - 1)]
    fusion = experiment.fusion
    fused = beliefs[0] if fusion is None else fusion.fuse(beliefs)[0]
    experiment.estimate(fused, 1)
    planner = strategy(scenario, "jdm")
    assert isinstance(planner, JointPlanner)
    quick = replace(planner, settings=replace(planner.settings, num_samples=2, horizon_steps=1, num_threads=1))
    quick.plan(beliefs, fused, experiment.poses, rng=run_stream(0, 0))


def _belief(experiment: Experiment, num_targets: int) -> GLMB | LMB:
    """One target at each of the first birth sites, in the kind of density that the filter keeps."""
    local = experiment.sensors[0].filter
    birth, labels = local.targets.birth, [(1, site) for site in range(num_targets)]
    sites = slice(num_targets)
    belief = LMB.from_bernoullis(labels, birth.existence[sites], birth.means[sites], birth.covs[sites])
    if isinstance(local.initial(), LMB):
        return belief
    return GLMB.from_hypotheses(belief.tracks, [list(range(num_targets))], [1.0])
