"""Simulation loop: scans, a step of the tracker, an estimate, and at decision times a plan (paper, Algorithm 1)."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from vedette.control import Planner, RandomPlanner, RequiresTruth
from vedette.densities import Estimate, Estimator
from vedette.errors import InputError
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.kernels.base.types import Bools, Floats
from vedette.simulation.experiment import Experiment
from vedette.simulation.journal import Journal, Score
from vedette.simulation.records import RunRecord
from vedette.simulation.scans import Scan, active_scans, simulate_scans
from vedette.simulation.true_sensors import ErrorMemory
from vedette.simulation.truth import Truth
from vedette.tracking import Central, StageTimer, State, Tracker, TrackerInfo

# Streams of one run, so that truth and scans do not depend on what a strategy draws.
TRUTH, SCANS, FILTER, PLANNER, RANDOM_CONTROL, DROP_OUTS, SCENES = range(7)


def run_stream(seed: int, run: int, *stream: int) -> np.random.Generator:
    """Return the random number generator of one purpose in one run."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run, *stream)))


def sensor_streams(seed: int, run: int, stream: int, num_sensors: int) -> tuple[np.random.Generator, ...]:
    """Return the random number generators of one purpose in one run, one per sensor."""
    return tuple(run_stream(seed, run, stream, sensor) for sensor in range(num_sensors))


def scan_flags_of_run(
    scans_at: Bools | None, scan_loss_probability: Sequence[float], num_scans: int, seed: int, run: int
) -> Bools | None:
    """(num_sensors, num_scans or more) whether each sensor scans in a run, without lost scans. None: always.

    scans_at, scan_loss_probability: see `Experiment`. Each sensor loses scans by random numbers of its own. Its other
    scans are therefore those of a run without losses, except for the numbers drawn meanwhile.
    """
    if not scan_loss_probability:
        return scans_at
    streams = sensor_streams(seed, run, DROP_OUTS, len(scan_loss_probability))
    taking_place = np.array(
        [rng.random(num_scans) >= share for rng, share in zip(streams, scan_loss_probability, strict=True)]
    )
    return taking_place if scans_at is None else taking_place & scans_at[:, :num_scans]


class RunningTracker:
    """A tracker with its state during a run. A filter that needs the true targets receives them."""

    def __init__(
        self, tracker: Tracker, estimate: Estimator, truth: Truth, rngs: Sequence[np.random.Generator]
    ) -> None:
        self._tracker = tracker.with_truth(truth) if isinstance(tracker, Central) else tracker
        self._estimate, self._rngs, self._state = estimate, rngs, self._tracker.initial()

    def step(
        self, step: int, scans: Sequence[Any], poses: Floats, time: float, clock: StageTimer
    ) -> tuple[State, TrackerInfo, Estimate]:
        """Process the scans of a step, and return the new state, the tracker's report and the estimate."""
        with clock.timing("filter"):
            state, info = self._tracker.step(self._state, scans, poses, time, rngs=self._rngs)
        with clock.timing("estimate"):
            estimate = self._estimate(state.fused, step)
        self._state = state
        return state, info, estimate


class ScanOutcome(NamedTuple):
    """Result of one scan of all sensors."""

    step: int  # number of the scan, from 1
    time: float  # s
    poses: Floats  # (num_sensors, 3 or more) poses of the sensors at the scan
    measurements: tuple[Floats | None, ...]  # (num, meas_dim) per sensor; None if it did not scan
    scans: tuple[Scan | None, ...]  # the same with their true origins, for evaluation
    off: Bools  # (num_sensors,) whether the action of a sensor switched it off
    state: State  # state of the tracker after the scan
    info: TrackerInfo  # report of the tracker
    estimate: Estimate  # estimate from the fused density


class SimulationRun:
    """Simulation of one run that the caller advances scan by scan, choosing the sensor actions.

    Attributes:
        experiment: the parts of the run.
        seed, run: determine every random number: the targets and scans equal those of that run of a campaign.
        truth: the targets at all scans, for scoring.
        fleet: the sensor platforms and their motion.
        outcome: result of the last scan, or None before the first.
    """

    def __init__(
        self, experiment: Experiment, *, seed: int, run: int = 0, moving: bool = True, truth: Truth | None = None
    ) -> None:
        """Start before the first scan. To repeat a run, create another object.

        Args:
            experiment, seed, run: as above.
            moving: whether the sensors move at all.
            truth: the targets, if known already (`truth_of_run`). None: they are drawn.

        Raises `VedetteError` if the true targets cannot be drawn.
        """
        self.experiment, self.seed, self.run = experiment, seed, run
        self.truth = truth_of_run(experiment, seed, run) if truth is None else truth
        scans, filters = (sensor_streams(seed, run, stream, experiment.num_sensors) for stream in (SCANS, FILTER))
        self._scan_rngs, self._memories = scans, [ErrorMemory() for _ in scans]
        self._scans_at = scan_flags_of_run(
            experiment.scans_at, experiment.scan_loss_probability, len(experiment.times), seed, run
        )
        self._tracker = RunningTracker(experiment.tracker, experiment.estimate, self.truth, filters)
        self.fleet = experiment.fleet(moving=moving)
        self.outcome: ScanOutcome | None = None

    @property
    def is_over(self) -> bool:
        """Whether the last scan is done."""
        return self.outcome is not None and self.outcome.step == len(self.experiment.times)

    def follow(self, actions: Sequence[Floats | None]) -> None:
        """Start actions of the sensors at their present poses, one row of `Platform.actions` each. None: stay.

        Raises `InputError` for invalid actions, or before the first scan.
        """
        if self.outcome is None:
            raise InputError("world: expected a scan before the sensors are sent anywhere; got none yet")
        self.fleet = self.fleet.follow(actions, self.outcome.time)

    def step(self, actions: Sequence[Floats | None] | None = None, *, stages: StageTimer | None = None) -> ScanOutcome:
        """Simulate one scan of every sensor, process it in the tracker, and estimate the targets.

        Args:
            actions: actions to start first, see `follow`. None: the sensors continue as they are.
            stages: stage timer for "scans", "filter" and "estimate".

        Raises:
            InputError: the last scan is done, or as `follow`.
            VedetteError: as the models, the tracker and the estimator.
        """
        if self.is_over:
            raise InputError(f"world: expected one of {len(self.experiment.times)} scans to come; all are done")
        if actions is not None:
            self.follow(actions)
        experiment, clock = self.experiment, StageTimer() if stages is None else stages
        step = 1 if self.outcome is None else self.outcome.step + 1
        time = float(experiment.times[step - 1])
        poses, off = self.fleet.poses(time), self.fleet.off(time)
        with clock.timing("scans"):
            ids, states = self.truth.at(step - 1)
            sensors = experiment.sensors_at(step, self._scans_at)
            factors = self.truth.detection_factors_at(step - 1)
            drawn = simulate_scans(
                states,
                poses,
                sensors,
                ids=ids,
                detection_factors=factors,
                rngs=self._scan_rngs,
                memories=self._memories,
                time=time,
            )
            scans = active_scans(drawn, off)
            measurements = tuple([None if scan is None else scan.measurements for scan in scans])
        tracked = self._tracker.step(step, measurements, poses, time, clock)
        self.outcome = ScanOutcome(step, time, poses, measurements, scans, off, *tracked)
        return self.outcome


def truth_of_run(experiment: Experiment, seed: int, run: int) -> Truth:
    """Return the targets of a run at all scans. Raises `VedetteError` if they cannot be drawn."""
    return experiment.targets.truth(experiment.times, rng=run_stream(seed, run, TRUTH))


def advance(world: SimulationRun, journal: Journal, progress: Callable[[int], None] | None = None) -> list[ScanOutcome]:
    """Simulate the scans up to the next decision or the end, note each in the journal, and return their outcomes.

    progress: called with the number of every finished scan. Raises as `SimulationRun.step`.
    """
    first, steps = 1 if world.outcome is None else world.outcome.step + 1, world.experiment.decision_steps
    moments: list[ScanOutcome] = []
    for step in range(first, len(world.experiment.times) + 1):
        moments.append(world.step(stages=journal.begin(step)))
        journal.note(moments[-1].poses, moments[-1].off, moments[-1].info, moments[-1].estimate)
        if progress is not None:
            progress(step)
        if step in steps:
            break
    return moments


def simulate(
    experiment: Experiment,
    planner: Planner | None,
    *,
    seed: int,
    run: int,
    score: Score | None,
    progress: Callable[[int], None] | None = None,
) -> RunRecord:
    """Return the record of one run of a strategy.

    Args:
        experiment: the parts of the run.
        planner: decides at the experiment's decision steps. None: the sensors never move, and no decision is made.
        seed, run: determine every random number. Runs with equal seed and number are paired across planners.
        score: (num_scans, 3) OSPA of the estimates against the truth, see `vedette.evaluation.ospa_of_run`. None: NaN.
        progress: called with the number of every finished scan.

    Raises:
        VedetteError: the true targets cannot be drawn.
        RunStopped, RunInterrupted: models, tracker, estimate, planner or score raised, see `Journal.run_of`.
    """
    name = "stationary" if planner is None else planner.name
    truth = truth_of_run(experiment, seed, run)
    journal = Journal(experiment.name, name, seed, run, truth, experiment.num_sensors)
    with suppress_unit_warnings():  # no warnings of implausible numbers in simulated scans
        return journal.run_of(partial(_run_scans, experiment, planner, journal, progress), score)


def _run_scans(experiment: Experiment, planner: Any, journal: Journal, progress: Callable[[int], None] | None) -> None:
    """Simulate every scan of a run, one after the other, and note each in the journal."""
    if isinstance(planner, RequiresTruth):
        planner = planner.with_truth(journal.truth)
    stream = RANDOM_CONTROL if isinstance(planner, RandomPlanner) else PLANNER
    planner_rng = run_stream(journal.seed, journal.run, stream)
    world = SimulationRun(
        experiment, seed=journal.seed, run=journal.run, moving=planner is not None, truth=journal.truth
    )
    while not world.is_over:
        moment = advance(world, journal, progress)[-1]
        if planner is not None and moment.step in experiment.decision_steps:
            with journal.timing("planning"):
                plan = planner.plan(moment.state, moment.poses, rng=planner_rng)
            journal.note_decision(plan, moment.state.undetected, explain=experiment.explain)
            world.follow(plan.chosen_actions)
