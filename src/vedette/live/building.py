"""The live loop of a scenario."""

from contextlib import suppress
from typing import Any

import numpy as np

from vedette.control import ConstraintReportingPlanner, RequiresTruth
from vedette.errors import InputError
from vedette.evaluation.innovations import Assumed
from vedette.internal.quantities import COMPONENTS
from vedette.live.loop import LiveLoop
from vedette.models.arguments import reject
from vedette.recorded.extents import box_of
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.from_recording import LiveScenario
from vedette.scenarios.recorded_data import recorded_sensors, returns_models
from vedette.scenarios.sections.planners import NamedPlanner
from vedette.tracking import OutOfSequenceTracker, SensorScan


def build_live_loop(
    live_scenario: LiveScenario,
    planner: str = "jdm",
    *,
    max_delay: float = 30.0,
    max_lead: float = 60.0,
    decide_every: float | None = None,
    seed: int = 0,
    num_threads: int = 0,
) -> LiveLoop:
    """Return the live loop of a scenario.

    Args:
        live_scenario: scenario and conventions, see `vedette.scenarios.from_recording.scenario_from_sensors`.
        planner: name of the planner, used if there are decisions: at the scenario's times or every `decide_every`.
        max_delay: largest delay of a scan in s.
        max_lead: largest time in s by which a scan may be ahead of all others.
        decide_every: time between decisions in s. None: at the times of the scenario.
        seed: seed for decisions and for filters that draw random numbers.
        num_threads: number of threads for a decision. 0: one per processor.

    Raises:
        InputError: incompatible parts, a kind of measurement that lines cannot express, or a planner that needs the
            true targets.
    """
    model = live_scenario.scenario.model
    sites = tuple(recorded_sensors(model))
    for site in sites:
        if site.kind not in COMPONENTS:
            raise reject(f"sensor {site.name}", f"measurements of kind {', '.join(COMPONENTS)}", site.kind)
    experiment = build_experiment(live_scenario.scenario)
    built = None
    if decide_every is not None or experiment.decision_steps:
        built = build_planner(live_scenario.scenario, planner, num_threads)
        inner: Any = built
        while isinstance(
            inner, NamedPlanner | ConstraintReportingPlanner
        ):  # these pass the truth on and do not need it themselves
            inner = inner.planner
        if isinstance(inner, RequiresTruth):
            raise InputError(f"planner: expected one that does not know the targets; got {planner}")
    return LiveLoop(
        OutOfSequenceTracker(experiment.tracker, experiment.poses, max_delay, seed),
        sites,
        experiment.estimate,
        live_scenario.conventions,
        None if model.origin is None else model.origin.build(),
        first_time=float(experiment.times[0]),
        planner=built,
        decision_times=tuple(float(experiment.times[step - 1]) for step in experiment.decision_steps),
        decide_every=decide_every,
        max_lead=max_lead,
        seed=seed,
        classes=tuple(model.classes),
        modes=model.mode_names,
        valid_area=box_of(model.region.build().corners),
        extents=tuple(returns.extent or 0.0 for returns in returns_models(model)),
        assumed=Assumed.of(live_scenario.scenario),
    )


def warm_up(live: LiveLoop) -> None:
    """Compile what a loop calls by scans of a made-up target, one of them late, before the first line arrives.

    Their state is discarded, and no answer depends on it. What fails with them is compiled at its first use. Not for
    custom code, which may have a state of its own.
    """
    tracker, timeline = live.tracker.tracker, live.tracker.initial()
    with suppress(Exception):
        for time in (1.0, 2.0, 1.5):
            ones = (np.ones((1, sensor.meas_dim)) for sensor in tracker.sensors)
            scans = [SensorScan(s, time, rows, timeline.poses[s]) for s, rows in enumerate(ones)]
            timeline, _ = live.tracker.process(timeline, scans)
        live.estimate(timeline.state.fused, timeline.state.step)
        if live.planner is not None:
            live.planner.plan(timeline.state, timeline.poses, rng=np.random.default_rng(0))
