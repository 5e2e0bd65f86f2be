"""The first start: what a run needs is compiled by two processes at once, each through a small example of its own."""

from __future__ import annotations

from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from vedette.control import JointPlanner
from vedette.densities import GLMB, LMB, FactoredGLMB, Labelled
from vedette.fusion import shares_prediction
from vedette.processes import as_children, end_with_parent
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import run_stream
from vedette.tracking import State

# Of a decision that is made to be compiled.
_QUICK: dict[str, Any] = {"num_samples": 2, "horizon_steps": 1, "num_threads": 1, "confidence": None}


def precompile(scenario: Scenario) -> None:
    """Compile the tracker of the scenario here; its fusion and joint planning in another process meanwhile.

    Each finds in the cache what the other has already compiled. Whatever the other process does not get done (it may be
    forbidden, or fail) is compiled where it is first used; no result depends on it.
    """
    experiment = build_experiment(scenario)
    labelled = isinstance(experiment.tracker.initial().fused, Labelled)
    if not (labelled and experiment.tracker.targets.birth.num_sites):
        _compile_tracker(experiment)  # no fusion nor planning without labels; no example without birth sites
        return
    other = get_context("spawn").Process(target=_compile_planning, args=(scenario,), daemon=True)
    try:
        with as_children():
            other.start()
    except OSError:
        return
    _compile_tracker(experiment)
    other.join()


def _compile_tracker(experiment: Experiment) -> None:
    tracker, num_sensors = experiment.tracker, experiment.num_sensors
    scans = [np.empty((0, sensor.meas_dim)) for sensor in tracker.sensors]
    tracker.step(tracker.initial(), scans, experiment.poses, 1.0, rngs=[run_stream(0, 0)] * num_sensors)


def _compile_planning(scenario: Scenario) -> None:
    """Fuse, estimate and plan as if every birth site held a target, one of which a single sensor knows."""
    end_with_parent()
    experiment = build_experiment(scenario)
    planner = build_planner(scenario, "jdm")
    assert isinstance(planner, JointPlanner)
    num_sites, num_others = experiment.tracker.targets.birth.num_sites, experiment.num_sensors - 1
    beliefs = (_belief(experiment, num_sites), *(_belief(experiment, max(num_sites - 1, 1)),) * num_others)
    fused = beliefs[0] if shares_prediction(planner.fusion) else planner.fusion.fuse(beliefs)[0]
    experiment.estimate(fused, 1)
    quick = replace(planner, settings=replace(planner.settings, **_QUICK))
    state = State(beliefs, fused, undetected=experiment.tracker.initial().undetected)
    quick.plan(state, experiment.poses, rng=run_stream(0, 0))


def _belief(experiment: Experiment, num_targets: int) -> Labelled:
    """One target at each of the first birth sites, in the kind of density that the filter keeps."""
    birth, labels = experiment.tracker.targets.birth, [(1, site) for site in range(num_targets)]
    sites = slice(num_targets)
    belief = LMB.from_bernoullis(labels, birth.existence[sites], birth.means[sites], birth.covs[sites])
    initial = experiment.tracker.initial().fused
    if initial.is_lmb or initial.is_product:
        return belief if initial.is_lmb else FactoredGLMB.of(belief)
    return GLMB.from_hypotheses(belief.tracks, [list(range(num_targets))], [1.0])
