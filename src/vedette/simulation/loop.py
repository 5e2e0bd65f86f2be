"""The one loop: scans, local filters, fusion, estimate, and at decision times a plan (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import Any, TypeAlias

import numpy as np

from vedette.control import Planner, RandomPlanner
from vedette.densities import Estimate
from vedette.errors import VedetteError
from vedette.kernels.base.types import Floats
from vedette.platforms import Fleet
from vedette.simulation.experiment import Experiment
from vedette.simulation.health import Health
from vedette.simulation.records import Decision, RunRecord
from vedette.simulation.scans import simulate_scan
from vedette.simulation.stopping import RunInterrupted, RunStopped
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
    """Seconds of wall time spent at each scan, by stage.

    `step` is the scan at hand, counted from 1, and `under_way` what was last begun, in words.
    """

    def __init__(self, num_scans: int) -> None:
        self.spent = {stage: np.zeros(num_scans) for stage in STAGES}
        self.step = 1
        self.under_way = "the start"

    @contextmanager
    def timing(self, stage: str, sensor: int | None = None) -> Iterator[None]:
        self.under_way = f"the {stage}" if sensor is None else f"the {stage} of sensor {sensor + 1}"
        start = perf_counter()
        try:
            yield
        finally:
            self.spent[stage][self.step - 1] += perf_counter() - start


class _Journal:
    """What a run has brought so far, and where it is."""

    def __init__(self, experiment: Experiment, planner: Planner | None, seed: int, run: int, truth: Truth) -> None:
        num_scans, num_sensors = len(experiment.times), len(experiment.sensors)
        self.experiment = experiment
        self.planner = planner.name if planner is not None else "still"
        self.seed, self.run = seed, run
        self.truth = truth
        self.watch = _Stopwatch(num_scans)
        self.health = Health.unreported(num_scans, num_sensors)
        self.poses: list[Floats] = []
        self.estimates: list[Estimate] = []
        self.decisions: list[Decision] = []

    @property
    def time(self) -> float:
        return float(self.experiment.times[self.watch.step - 1])

    def place(self) -> str:
        """Which run, where in it."""
        return (
            f"{self.experiment.name}, {self.planner}, seed {self.seed}, run {self.run}: stopped at step "
            f"{self.watch.step} of {len(self.experiment.times)} ({self.time:g} s), in {self.watch.under_way}"
        )

    def record(self, ospa: Floats, stopped: str | None = None) -> RunRecord:
        """Of the scans that have an estimate."""
        num = len(self.estimates)
        return RunRecord(
            scenario=self.experiment.name,
            planner=self.planner,
            seed=self.seed,
            run=self.run,
            times=self.experiment.times[:num],
            truth=self.truth.first(num),
            poses=np.array(self.poses[:num]),
            estimates=tuple(self.estimates),
            decisions=tuple(self.decisions),
            ospa=ospa,
            health=self.health.first(num),
            timings={stage: seconds[:num] for stage, seconds in self.watch.spent.items()},
            stopped=stopped,
        )

    def partial(self, score: Score, stopped: str) -> RunRecord | None:
        """The record of a run that stopped; None where no scan was finished. OSPA is NaN where it cannot be had."""
        num = len(self.estimates)
        if num == 0:
            return None
        try:
            ospa = score(self.truth.first(num), self.estimates)
        except VedetteError:
            ospa = np.full((num, 3), np.nan)
        return self.record(ospa, stopped)


def simulate(experiment: Experiment, planner: Planner | None, *, seed: int, run: int, score: Score) -> RunRecord:
    """One run of a strategy.

    Args:
        experiment: the parts of the run.
        planner: decides at the experiment's decision steps; None: the sensors never move, and no decision is made.
        seed, run: fix every random number; runs with equal seed and number are paired across planners.
        score: (num_scans, 3) OSPA of the estimates against the truth, see `vedette.evaluation.ospa_of_run`.

    Raises:
        VedetteError: the true targets cannot be had.
        RunStopped: models, filters, fusion, estimate, planner or score raised; it says where, is chained from what they
            raised, and carries the record of the scans before.
        RunInterrupted: a `KeyboardInterrupt`, likewise with the record of the scans before.
    """
    truth = experiment.targets.truth(experiment.times, rng=run_stream(seed, run, TRUTH))
    journal = _Journal(experiment, planner, seed, run, truth)
    try:
        _go(experiment, planner, journal)
        journal.watch.under_way = "the score"
        return journal.record(score(truth, journal.estimates))
    except KeyboardInterrupt as interrupt:
        message = f"{journal.place()}: interrupted"
        raise RunInterrupted(message, journal.partial(score, message)) from interrupt
    except Exception as error:
        cause = str(error) if isinstance(error, VedetteError) else f"{type(error).__name__}: {error}"
        message = f"{journal.place()}: {cause}"
        record = journal.partial(score, message)
        raise RunStopped(message, journal.watch.step, journal.time, journal.watch.under_way, record) from error


def _go(experiment: Experiment, planner: Planner | None, journal: _Journal) -> None:
    """Every scan of a run, one after the other, written down in the journal."""
    seed, run, watch, truth = journal.seed, journal.run, journal.watch, journal.truth
    num_sensors = len(experiment.sensors)
    scan_streams = [run_stream(seed, run, SCANS, sensor) for sensor in range(num_sensors)]
    filter_streams = [run_stream(seed, run, FILTER, sensor) for sensor in range(num_sensors)]
    planner_stream = run_stream(seed, run, RANDOM_CONTROL if isinstance(planner, RandomPlanner) else PLANNER)
    platforms = tuple(sensor.platform for sensor in experiment.sensors)
    under_way = experiment.first_actions if planner is not None else (None,) * num_sensors
    fleet = Fleet(platforms, experiment.poses, under_way, float(experiment.times[0]))
    beliefs: list[Any] = [sensor.filter.initial() for sensor in experiment.sensors]
    periods = np.diff(experiment.times, prepend=experiment.times[0] - _first_period(experiment.times))
    for step, period in enumerate(periods.tolist(), start=1):
        watch.step = step
        time = float(experiment.times[step - 1])
        poses = fleet.poses(time)
        journal.poses.append(poses)
        _, states = truth.at(step - 1)
        for s, sensor in enumerate(experiment.sensors):
            with watch.timing("scans", s):
                scan = simulate_scan(states, poses[s], sensor.filter.sensor, rng=scan_streams[s])
            with watch.timing("filter", s):
                beliefs[s], info = sensor.filter.step(
                    beliefs[s], scan.measurements, poses[s], period, step, rng=filter_streams[s]
                )
            journal.health.note_filter(step - 1, s, info)
        fused = beliefs[0]
        if experiment.fusion is not None:
            with watch.timing("fusion"):
                fused, report = experiment.fusion.fuse(beliefs)
            journal.health.note_fusion(step - 1, report)
        if experiment.feedback:
            beliefs = [fused] * num_sensors
        with watch.timing("estimate"):
            journal.estimates.append(experiment.estimate(fused, step))
        if planner is not None and step in experiment.decision_steps:
            with watch.timing("planning"):
                plan = planner.plan(beliefs, fused, poses, rng=planner_stream)
            journal.decisions.append(Decision(step, time, poses, plan))
            fleet = fleet.follow(plan.chosen_actions, time)


def _first_period(times: Floats) -> float:
    """Seconds before the first scan over which an empty belief is predicted: any will do."""
    return float(times[1] - times[0]) if len(times) > 1 else 1.0
