"""The loop over recorded scans: for each instant a step of the tracker and an estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vedette.densities import Estimator
from vedette.errors import InputError
from vedette.models.arguments import reject
from vedette.recorded.instants import RecordedScans
from vedette.simulation.journal import Journal, Score
from vedette.simulation.loop import FILTER, sensor_streams
from vedette.simulation.records import RunRecord
from vedette.simulation.runs import RunningTracker, record_of_run
from vedette.simulation.truth import Truth
from vedette.speaking import Speaking
from vedette.tracking import Tracker

STRATEGY = "recorded"  # that the record names: where the sensors went was decided before


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Tracking(Speaking):
    """A recording and what tracks its targets.

    Attributes:
        name: of the scenario, for records.
        recording: the scans.
        tracker: of its sensors.
        estimate: reads the targets off the fused belief, given the number of the instant (from 1).
        truth: the targets at the times of the recording; none where they are unknown.

    Raises:
        InputError: no tracker, or parts that do not fit together.
    """

    name: str
    recording: RecordedScans
    tracker: Tracker
    estimate: Estimator
    truth: Truth

    def __post_init__(self) -> None:
        if not isinstance(self.tracker, Tracker):
            raise reject("tracker", "a Tracker, with targets, sensors, initial() and step()", self.tracker)
        num = self.recording.poses.shape[1]
        if len(self.tracker.sensors) != num:
            raise InputError(f"tracker: expected the {num} sensors of the recording; got {len(self.tracker.sensors)}")
        if not np.array_equal(self.truth.times, self.recording.times):
            raise InputError("truth: expected the times of the recording; got others")

    def first(self, num: int) -> Tracking:
        """Of the first instants alone."""
        later = [*self.recording.times.tolist(), np.inf][min(num, len(self.recording.times))]
        return replace(self, recording=self.recording.between(0.0, later), truth=self.truth.first(num))


def track(
    tracking: Tracking, *, score: Score, seed: int = 0, run: int = 0, watch: Callable[[int], None] | None = None
) -> RunRecord:
    """Track the targets of a recording.

    Args:
        tracking: the recording and its tracker.
        score: (num_scans, 3) OSPA of the estimates against the truth, see `vedette.evaluation.ospa_of_run`.
        seed, run: fix the random numbers of filters that draw.
        watch: told the number of every instant that is done.

    Raises:
        RunStopped, RunInterrupted: tracker, estimate or score raised, see `vedette.simulation.runs.record_of_run`.
    """
    recording, num = tracking.recording, len(tracking.tracker.sensors)
    journal = Journal(tracking.name, STRATEGY, seed, run, tracking.truth, num, recording=recording.file)

    def go() -> None:
        streams = sensor_streams(seed, run, FILTER, num)
        running = RunningTracker(tracking.tracker, tracking.estimate, tracking.truth, streams)
        instants = zip(recording.times.tolist(), recording.scans, recording.poses, strict=True)
        for step, (time, scans, poses) in enumerate(instants, start=1):
            _, info, estimate = running.step(step, scans, poses, time, journal.begin(step))
            journal.note(poses, np.zeros(num, np.bool_), info, estimate)
            if watch is not None:
                watch(step)

    return record_of_run(journal, score, go)
