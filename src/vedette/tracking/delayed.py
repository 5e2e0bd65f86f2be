"""Tracker with delayed scans: it continues with the scans that have arrived and adds late ones on arrival."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import count, instance, positive, probability, real, reject
from vedette.tracking.base import AroundTracker, State, TrackerInfo, check_step
from vedette.tracking.late import LateScans, SensorScan, Timeline


@dataclass(frozen=True, slots=True)
class Delay:
    """Distribution of the delays of a sensor's scans.

    Attributes:
        share: probability that a scan is delayed.
        up_to: largest delay in s; delays are uniform from 0 to it.
        start, end: times in s; scans taken before `start` or after `end` arrive at once.
        window: s; a scan delayed by more than this is lost.

    Raises:
        InputError: a share that is not a probability, times that are not numbers, or an end before the start.
    """

    share: float
    up_to: float
    start: float = -math.inf
    end: float = math.inf
    window: float = math.inf

    def __post_init__(self) -> None:
        probability("Delay.share", self.share)
        positive("Delay.up_to", self.up_to)
        if not self.window >= 0.0:
            raise reject("Delay.window", "seconds, at least 0", self.window)
        if not self.start <= self.end:
            raise reject("Delay.end", f"a time from start on, {self.start:g} s", self.end)

    def drawn(self, time: float, rng: np.random.Generator) -> float:
        """Draw the delay of a scan of this time, in s; always draws two random numbers."""
        luck, part = rng.random(2).tolist()
        return self.up_to * part if self.start <= time <= self.end and luck < self.share else 0.0


class _Coming(NamedTuple):
    """A scan that has not arrived yet."""

    arrives: float  # s
    scan: SensorScan


class _Memory(NamedTuple):
    """Timeline of the scans that arrived (None before the first step), scans on their way, and seed for filters."""

    timeline: Timeline | None = None
    coming: tuple[_Coming, ...] = ()
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Delayed(AroundTracker):
    """Wrapper of a tracker that receives some scans late and processes them at their own time (`LateScans`).

    Its state is the belief at the current time from the scans that have arrived, predicted if the latest of them is
    older. Births are labelled by the wrapped tracker's steps, in order of time.

    Attributes:
        tracker: the wrapped tracker.
        delays: delay by the number of a sensor; scans of other sensors arrive at once.

    Raises:
        InputError: `tracker` is not a tracker, an unknown sensor, or a value that is not a `Delay`.
    """

    delays: Mapping[int, Delay]
    _window: float = field(init=False, repr=False)  # s; longer than every delay of a scan that is not lost

    def __post_init__(self) -> None:
        AroundTracker.__post_init__(self)
        for s, delay in self.delays.items():
            if count("delays", s) >= len(self.sensors):
                raise reject("delays", f"sensors from 0 to {len(self.sensors) - 1}", s)
            instance(f"delays[{s}]", delay, Delay)
        longest = (min(delay.up_to, delay.window) for delay in self.delays.values())
        object.__setattr__(self, "_window", max(longest, default=0.0) + 1.0)

    def initial(self) -> State:
        """Return the wrapped tracker's state before the first scan."""
        return replace(self.tracker.initial(), memory=_Memory())

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Send the scans of a time, and process those that have arrived by then; see `Tracker.step`.

        The delays of the scans of sensor s are drawn from `rngs[s]`.
        """
        at, _ = check_step(state, scans, poses, time, rngs, len(self.sensors))
        memory, now = state.memory, real("time", time)
        seed = int(rngs[0].integers(2**32)) if memory.timeline is None else memory.seed
        late = LateScans(self.tracker, at, self._window, seed)
        timeline = late.initial() if memory.timeline is None else memory.timeline
        coming = (*memory.coming, *self._sent(scans, at, now, rngs))
        timeline, taken = late.take(timeline, [own.scan for own in coming if own.arrives <= now])
        believed, info = late.predicted(timeline, now)
        if taken.steps:
            seconds = [*(own.seconds for own in taken.steps), info.seconds]
            spent = {stage: sum(own.get(stage, 0.0) for own in seconds) for stage in ("filter", "fusion")}
            info = replace(taken.steps[-1], seconds=spent)
        left = _Memory(timeline, tuple(own for own in coming if own.arrives > now), seed)
        return replace(believed, step=state.step + 1, time=now, memory=left), info

    def _sent(
        self, scans: Sequence[Any], poses: Floats, now: float, rngs: Sequence[np.random.Generator]
    ) -> list[_Coming]:
        """Return the scans of a time that arrive now or later; lost ones are left out."""
        found = []
        for s, scan in enumerate(scans):
            if scan is not None:
                delay = self.delays.get(s)
                by = 0.0 if delay is None else delay.drawn(now, rngs[s])
                if delay is None or by <= delay.window:
                    found.append(_Coming(now + by, SensorScan(s, now, scan, poses[s])))
        return found
