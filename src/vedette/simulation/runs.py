"""What every run has, of simulated scans or of recorded ones: a tracker, its estimates, and an end, early or not."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import Estimate, Estimator
from vedette.errors import VedetteError
from vedette.kernels.base.types import Floats
from vedette.simulation.journal import Journal, Score
from vedette.simulation.records import RunRecord
from vedette.simulation.truth import Truth
from vedette.tracking import Central, Stages, State, Tracker, TrackerInfo

_LIBRARIES = (str(Path(__file__).parents[1]), *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")))


def cause_of(error: Exception) -> str:
    """What was raised, in words; where it is not this library's word, with the place in the user's own code."""
    if isinstance(error, VedetteError):
        return str(error)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not frame.filename.startswith(_LIBRARIES)]
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno}, {frames[-1].name})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


class RunStopped(VedetteError):
    """A filter, a fusion, an estimate or a planner raised in the middle of a run; chained from that error.

    Attributes:
        step: the scan at which it happened, counted from 1.
        time: of that scan, s.
        stage: what was under way, in words: "the filter of sensor 2".
        record: of the scans that were finished, its field `stopped` the message; None where not one was.
    """

    def __init__(self, message: str, step: int, time: float, stage: str, record: RunRecord | None) -> None:
        super().__init__(message)
        self.step = step
        self.time = time
        self.stage = stage
        self.record = record

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.step, self.time, self.stage, self.record)


class RunInterrupted(KeyboardInterrupt):
    """Ctrl-C in the middle of a run.

    Attributes:
        record: of the scans that were finished, its field `stopped` the message; None where not one was.
    """

    def __init__(self, message: str, record: RunRecord | None) -> None:
        super().__init__(message)
        self.record = record


class Tracked(NamedTuple):
    """What the tracker makes of one scan of all sensors."""

    state: State  # what the tracker believes now
    info: TrackerInfo  # what it reports
    estimate: Estimate  # read off the fused belief


class RunningTracker:
    """A tracker in the middle of a run.

    Args:
        tracker: follows the targets; one that is told the true targets is told these.
        estimate: reads the targets off the fused belief.
        truth: the targets of the run.
        rngs: for each sensor the random numbers of its filter.
    """

    def __init__(
        self, tracker: Tracker, estimate: Estimator, truth: Truth, rngs: Sequence[np.random.Generator]
    ) -> None:
        self._tracker = tracker.told(truth) if isinstance(tracker, Central) else tracker
        self._estimate, self._rngs, self._state = estimate, rngs, self._tracker.initial()

    def step(self, step: int, scans: Sequence[Any], poses: Floats, time: float, clock: Stages) -> Tracked:
        """Take the scans of a step and estimate the targets; raises as the tracker and the estimator do.

        Args:
            step: number of the scan, from 1.
            scans: for each sensor (num, meas_dim) measurements; None: it did not scan.
            poses: (num_sensors, 3 or more) of the sensors.
            time: s.
            clock: a stopwatch for "filter" and "estimate".
        """
        with clock.timing("filter"):
            state, info = self._tracker.step(self._state, scans, poses, time, rngs=self._rngs)
        with clock.timing("estimate"):
            estimate = self._estimate(state.fused, step)
        self._state = state
        return Tracked(state, info, estimate)


def record_of_run(journal: Journal, score: Score, go: Callable[[], None]) -> RunRecord:
    """Return the record of a run that is written down in a journal while `go` takes its scans.

    Raises:
        RunStopped: `go` or the score raised; it says where, is chained from what they raised, and carries the record of
            the scans before.
        RunInterrupted: a `KeyboardInterrupt`, likewise with the record of the scans before.
    """
    try:
        go()
        with journal.timing("score"):
            return journal.record(score(journal.truth, journal.estimates))
    except KeyboardInterrupt as interrupt:
        message = f"{journal.place(interrupt)}: interrupted"
        raise RunInterrupted(message, journal.partial(score, message)) from interrupt
    except Exception as error:
        message = f"{journal.place(error)}: {cause_of(error)}"
        record = journal.partial(score, message)
        raise RunStopped(message, journal.step, journal.time, journal.stage(error), record) from error
