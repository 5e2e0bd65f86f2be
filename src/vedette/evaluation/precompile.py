"""Compilation before the first run, by two processes in parallel, each with a small example."""

from collections.abc import Sequence
from dataclasses import replace
from multiprocessing import get_context
from typing import Any

import numpy as np

from vedette.control import JointPlanner
from vedette.densities import GLMB, LMB, FactoredGLMB, LabelledDensity
from vedette.fusion import requires_common_prior
from vedette.internal.processes import as_children, end_with_parent
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.sections.planners import NamedPlanner
from vedette.simulation.experiment import Experiment
from vedette.simulation.loop import run_stream

# Settings of a decision that is made only to compile the planner.
_QUICK_SETTINGS: dict[str, Any] = {"num_samples": 2, "horizon_steps": 1, "num_threads": 1, "confidence": None}


def precompile(scenario: Scenario, planners: Sequence[str] = ("jdm",)) -> None:
    """Compile the tracker of a scenario and its joint planners, in this process and another one at the same time.

    The other process compiles the fusion and the last of the joint planners, this one the tracker and the others. Each
    finds in the cache the code that the other has already compiled. Code that the other process does not compile (it
    may be forbidden, or fail) is compiled at its first use. No result depends on it.

    Args:
        scenario: with birth sites, at which targets are placed for the example. Without, only the tracker is compiled.
        planners: names of strategies. Those without joint decisions are left out.
    """
    experiment = build_experiment(scenario)
    has_labels = isinstance(experiment.tracker.initial().fused, LabelledDensity)
    if not (has_labels and experiment.tracker.targets.birth.num_sites):
        _compile_tracker(experiment)  # no fusion nor planning without labels; no example without birth sites
        return
    *local_planners, remote_planner = [name for name in planners if _joint_planner(scenario, name)] or ["jdm"]
    process = get_context("spawn").Process(target=_compile_elsewhere, args=(scenario, remote_planner), daemon=True)
    try:
        with as_children():
            process.start()
    except OSError:
        return
    _compile_tracker(experiment)
    for name in local_planners:
        _compile_planning(scenario, name)
    process.join()


def _joint_planner(scenario: Scenario, name: str) -> JointPlanner | None:
    """Return the planner of that name, or None if it is not a joint one."""
    planner = build_planner(scenario, name)
    planner = planner.planner if isinstance(planner, NamedPlanner) else planner
    return planner if isinstance(planner, JointPlanner) else None


def _compile_tracker(experiment: Experiment) -> None:
    tracker, num_sensors = experiment.tracker, experiment.num_sensors
    scans = [np.empty((0, sensor.meas_dim)) for sensor in tracker.sensors]
    tracker.step(tracker.initial(), scans, experiment.poses, 1.0, rngs=[run_stream(0, 0)] * num_sensors)


def _compile_elsewhere(scenario: Scenario, name: str) -> None:
    end_with_parent()
    _compile_planning(scenario, name)


def _compile_planning(scenario: Scenario, name: str) -> None:
    """Fuse, estimate and plan as if every birth site held a target, one of them in the belief of only one sensor."""
    experiment = build_experiment(scenario)
    planner = _joint_planner(scenario, name)
    assert planner is not None
    num_sites, num_others = experiment.tracker.targets.birth.num_sites, experiment.num_sensors - 1
    beliefs = (_belief(experiment, num_sites), *(_belief(experiment, max(num_sites - 1, 1)),) * num_others)
    fused = beliefs[0] if requires_common_prior(planner.fusion) else planner.fusion.fuse(beliefs)[0]
    experiment.estimate(fused, 1)
    quick_planner = replace(planner, settings=replace(planner.settings, **_QUICK_SETTINGS))
    state = replace(experiment.tracker.initial(), local=beliefs, fused=fused)
    quick_planner.plan(state, experiment.poses, rng=run_stream(0, 0))


def _belief(experiment: Experiment, num_targets: int) -> LabelledDensity:
    """Return one target at each of the first birth sites, in the filter's kind of density."""
    birth, labels = experiment.tracker.targets.birth, [(1, site) for site in range(num_targets)]
    sites = slice(num_targets)
    belief = LMB.from_bernoullis(labels, birth.existence[sites], birth.means[sites], birth.covs[sites])
    initial = experiment.tracker.initial().fused
    if initial.is_lmb or initial.is_product:
        return belief if initial.is_lmb else FactoredGLMB.of(belief)
    return GLMB.from_hypotheses(belief.tracks, [list(range(num_targets))], [1.0])
