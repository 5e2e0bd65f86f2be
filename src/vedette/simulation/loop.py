"""The one loop: scans, local filters, fusion, estimate, and at decision times a plan (paper, Algorithm 1)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np

from vedette.control import Plan, Planner, RandomPlanner
from vedette.densities import Estimate
from vedette.kernels.types import Floats
from vedette.models.platforms import advance
from vedette.simulation.experiment import Experiment
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.scans import simulate_scan
from vedette.simulation.truth import Truth

Score: TypeAlias = Callable[[Truth, Sequence[Estimate]], Floats]

# Streams of one run: strategies meet the same truth and the same luck in the scans, whatever else they draw.
TRUTH, SCANS, FILTER, PLANNER, RANDOM_CONTROL = range(5)

# What the time of a run is spent on.
STAGES = ("scans", "filter", "fusion", "estimate", "planning")


def run_stream(seed: int, run: int, *stream: int) -> np.random.Generator:
    """The random numbers of one purpose in one run."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run, *stream)))


class _Stopwatch:
    """Seconds of wall time spent at each scan, by stage; `step` is the scan at hand, counted from 1."""

    def __init__(self, num_scans: int) -> None:
        self.spent = {stage: np.zeros(num_scans) for stage in STAGES}
        self.step = 1

    @contextmanager
    def timing(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.spent[stage][self.step - 1] += time.perf_counter() - start


class _Course:
    """Where the sensors are and how they move."""

    def __init__(self, experiment: Experiment) -> None:
        self.poses = experiment.poses.copy()
        self.speeds = np.array([sensor.speed for sensor in experiment.sensors])
        self.moving = experiment.moving.copy()

    def move(self, seconds: float) -> None:
        self.poses = advance(self.poses, self.poses[:, 2], np.where(self.moving, self.speeds, 0.0), seconds)

    def follow(self, plan: Plan) -> None:
        self.poses = self.poses.copy()
        self.poses[:, 2] = plan.chosen_headings
        self.moving = np.ones_like(self.moving)


def simulate(experiment: Experiment, planner: Planner | None, *, seed: int, run: int, score: Score) -> RunRecord:
    """One run of a strategy.

    Args:
        experiment: the parts of the run.
        planner: decides at the experiment's decision steps; None: the sensors never move, and no decision is made.
        seed, run: fix every random number; runs with equal seed and number are paired across planners.
        score: (num_scans, 3) OSPA of the estimates against the truth, see `vedette.evaluation.ospa_of_run`.

    Raises:
        VedetteError: what models, filters, fusion or planner raise.
    """
    truth = experiment.targets.truth(experiment.times, rng=run_stream(seed, run, TRUTH))
    num_sensors = len(experiment.sensors)
    scan_streams = [run_stream(seed, run, SCANS, sensor) for sensor in range(num_sensors)]
    filter_streams = [run_stream(seed, run, FILTER, sensor) for sensor in range(num_sensors)]
    planner_stream = run_stream(seed, run, RANDOM_CONTROL if isinstance(planner, RandomPlanner) else PLANNER)
    watch, course = _Stopwatch(len(experiment.times)), _Course(experiment)
    if planner is None:
        course.moving[:] = False
    beliefs: list[Any] = [sensor.filter.initial() for sensor in experiment.sensors]
    poses, estimates, decisions = [], [], []
    periods = np.diff(experiment.times, prepend=experiment.times[0] - _first_period(experiment.times))
    for step, period in enumerate(periods.tolist(), start=1):
        watch.step = step
        if step > 1:
            course.move(period)
        poses.append(course.poses)
        _, states = truth.at(step - 1)
        for s, sensor in enumerate(experiment.sensors):
            with watch.timing("scans"):
                scan = simulate_scan(states, course.poses[s], sensor.filter.sensor, rng=scan_streams[s])
            with watch.timing("filter"):
                beliefs[s], _ = sensor.filter.step(
                    beliefs[s], scan.measurements, course.poses[s], period, step, rng=filter_streams[s]
                )
        with watch.timing("fusion"):
            fused = beliefs[0] if experiment.fusion is None else experiment.fusion.fuse(beliefs)[0]
        if experiment.feedback:
            beliefs = [fused] * num_sensors
        with watch.timing("estimate"):
            estimates.append(experiment.estimate(fused, step))
        if planner is not None and step in experiment.decision_steps:
            with watch.timing("planning"):
                plan = planner.plan(beliefs, fused, course.poses, rng=planner_stream)
            decisions.append(Decision(step, float(experiment.times[step - 1]), course.poses, plan))
            course.follow(plan)
    return RunRecord(
        scenario=experiment.name,
        planner=planner.name if planner is not None else "still",
        seed=seed,
        run=run,
        times=experiment.times,
        truth=truth,
        poses=np.array(poses),
        estimates=tuple(estimates),
        decisions=tuple(decisions),
        ospa=score(truth, estimates),
        timings=watch.spent,
    )


def _first_period(times: Floats) -> float:
    """Seconds before the first scan over which an empty belief is predicted: any will do."""
    return float(times[1] - times[0]) if len(times) > 1 else 1.0
