"""The loop over recorded scans: for each instant, a step of the tracker and an estimate."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vedette.densities import Estimator
from vedette.errors import InputError
from vedette.recorded.scan_times import RecordedScans
from vedette.simulation.journal import Journal, Score
from vedette.simulation.loop import FILTER, RunningTracker, sensor_streams
from vedette.simulation.records import RunRecord
from vedette.simulation.truth import Truth
from vedette.tracking import TraceEntry, Tracker


@dataclass(frozen=True, slots=True, eq=False)
class Tracking:
    """A recording with its tracker.

    Attributes:
        name: of the scenario, for records.
        recording: the scans.
        tracker: of its sensors.
        estimate: estimates the targets from the fused belief, given the number of the instant (from 1).
        truth: the targets at the times of the recording, or no targets if they are unknown.

    Raises:
        InputError: a tracker of other sensors, or targets at other times.
    """

    name: str
    recording: RecordedScans
    tracker: Tracker
    estimate: Estimator
    truth: Truth

    def __post_init__(self) -> None:
        if (num_tracked := len(self.tracker.sensors)) != (num_sensors := self.recording.poses.shape[1]):
            raise InputError(f"tracker: expected the {num_sensors} sensors of the recording; got {num_tracked}")
        if not np.array_equal(self.truth.times, self.recording.times):
            raise InputError("truth: expected the times of the recording; got others")

    def first(self, num: int) -> "Tracking":
        """Return the tracking of only the first `num` instants."""
        later = [*self.recording.times[: num + 1].tolist(), np.inf][num]
        return replace(self, recording=self.recording.between(0.0, later), truth=self.truth.first(num))

    def run(
        self,
        score: Score | None,
        *,
        seed: int = 0,
        run: int = 0,
        progress: Callable[[int], None] | None = None,
        trace: list[TraceEntry] | None = None,
    ) -> RunRecord:
        """Track the targets. Raises `RunStopped` and `RunInterrupted` like `vedette.simulation.simulate`.

        Args:
            score: (num_scans, 3) OSPA of the estimates against the truth. None: NaN.
            seed, run: fix the random numbers of filters that draw.
            progress: called with the number of each instant after it.
            trace: list to which each instant is added, for `vedette.tracking.smooth`.
        """
        recording, num_sensors = self.recording, len(self.tracker.sensors)
        journal = Journal(self.name, "recorded", seed, run, self.truth, num_sensors, recording.file)

        def go() -> None:
            running = RunningTracker(
                self.tracker, self.estimate, self.truth, sensor_streams(seed, run, FILTER, num_sensors)
            )
            instants = zip(recording.times.tolist(), recording.scans, recording.poses, strict=True)
            for step, (time, scans, poses) in enumerate(instants, start=1):
                state, info, estimate = running.step(step, scans, poses, time, journal.begin(step))
                journal.note(poses, np.zeros(num_sensors, np.bool_), info, estimate)
                if trace is not None:
                    trace.append(TraceEntry(time, state.fused, estimate))
                if progress is not None:
                    progress(step)

        return journal.run_of(go, score)
