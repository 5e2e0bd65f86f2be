"""Tracker with delayed scans: it continues with the scans that have arrived and adds late ones on arrival."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import count, instance, real, reject
from vedette.models.fields import Positive, Probability, check_fields
from vedette.tracking.base import State, TrackerInfo, TrackerWrapper, check_step
from vedette.tracking.out_of_sequence import OutOfSequenceTracker, SensorScan, Timeline


@dataclass(frozen=True, slots=True)
class Delay:
    """Distribution of the delays of a sensor's scans.

    Attributes:
        probability: probability that a scan is delayed.
        max_delay: largest delay in s. Delays are uniform from 0 to it.
        start, end: times in s. Scans taken before `start` or after `end` arrive at once.
        window: s. A scan delayed by more than this is lost.

    Raises:
        InputError: a probability outside 0 to 1, times that are not numbers, or an end before the start.
    """

    probability: Probability
    max_delay: Positive
    start: float = -math.inf
    end: float = math.inf
    window: float = math.inf

    def __post_init__(self) -> None:
        check_fields(self, "Delay.")
        if not self.window >= 0.0:
            raise reject("Delay.window", "seconds, at least 0", self.window)
        if not self.start <= self.end:
            raise reject("Delay.end", f"a time from start on, {self.start:g} s", self.end)

    def sample(self, time: float, rng: np.random.Generator) -> float:
        """Draw the delay of a scan of this time, in s. Always draws two random numbers."""
        uniform, fraction = rng.random(2).tolist()
        return self.max_delay * fraction if self.start <= time <= self.end and uniform < self.probability else 0.0


class _PendingScan(NamedTuple):
    """A scan that has not arrived yet."""

    arrives: float  # s
    scan: SensorScan


class _Memory(NamedTuple):
    """Timeline of the scans that arrived (None before the first step), scans on their way, and seed for filters."""

    timeline: Timeline | None = None
    pending: tuple[_PendingScan, ...] = ()
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class DelayedScanTracker(TrackerWrapper):
    """Wrapper of a tracker that receives some scans late and processes them at their own time (`OutOfSequenceTracker`).

    Its state is the belief at the current time from the scans that have arrived, predicted if the latest of them is
    older. Births are labelled by the wrapped tracker's steps, in order of time.

    Attributes:
        tracker: the wrapped tracker.
        delays: delay by the number of a sensor. Scans of other sensors arrive at once.

    Raises:
        InputError: `tracker` is not a tracker, an unknown sensor, or a value that is not a `Delay`.
    """

    delays: Mapping[int, Delay]
    _window: float = field(init=False, repr=False)  # s; longer than every delay of a scan that is not lost

    def __post_init__(self) -> None:
        TrackerWrapper.__post_init__(self)
        for s, delay in self.delays.items():
            if count("delays", s) >= len(self.sensors):
                raise reject("delays", f"sensors from 0 to {len(self.sensors) - 1}", s)
            instance(f"delays[{s}]", delay, Delay)
        longest = (min(delay.max_delay, delay.window) for delay in self.delays.values())
        object.__setattr__(self, "_window", max(longest, default=0.0) + 1.0)

    def initial(self) -> State:
        """Return the wrapped tracker's state before the first scan."""
        return replace(self.tracker.initial(), memory=_Memory())

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Send the scans of a time, and process those that have arrived by then. See `Tracker.step`.

        The delays of the scans of sensor s are drawn from `rngs[s]`.
        """
        pose_array, _ = check_step(state, scans, poses, time, rngs, self, len(self.sensors))
        memory, now = state.memory, real("time", time)
        seed = int(rngs[0].integers(2**32)) if memory.timeline is None else memory.seed
        tracker = OutOfSequenceTracker(self.tracker, pose_array, self._window, seed)
        timeline = tracker.initial() if memory.timeline is None else memory.timeline
        pending = (*memory.pending, *self._sent(scans, pose_array, now, rngs))
        timeline, report = tracker.process(timeline, [each.scan for each in pending if each.arrives <= now])
        current, info = tracker.predict(timeline, now)
        if report.steps:
            seconds = [*(each.seconds for each in report.steps), info.seconds]
            stage_seconds = {stage: sum(each.get(stage, 0.0) for each in seconds) for stage in ("filter", "fusion")}
            info = replace(report.steps[-1], seconds=stage_seconds)
        remaining = _Memory(timeline, tuple(each for each in pending if each.arrives > now), seed)
        return replace(current, step=state.step + 1, time=now, memory=remaining), info

    def _sent(
        self, scans: Sequence[Any], poses: Floats, now: float, rngs: Sequence[np.random.Generator]
    ) -> list[_PendingScan]:
        """Return the scans of a time that arrive now or later. Lost ones are left out."""
        pending = []
        for s, scan in enumerate(scans):
            if scan is not None:
                delay = self.delays.get(s)
                seconds = 0.0 if delay is None else delay.sample(now, rngs[s])
                if delay is None or seconds <= delay.window:
                    pending.append(_PendingScan(now + seconds, SensorScan(s, now, scan, poses[s])))
        return pending
