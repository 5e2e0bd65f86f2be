"""Scans that come late in a loop that goes on meanwhile: a tracker that is told of them when they arrive."""

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
    """How the scans of a sensor come late.

    Attributes:
        share: probability that a scan does.
        up_to: s; by how much, uniform from 0.
        start, end: s; scans taken before or after these times come at once.
        window: s; a scan that is later than this is lost.

    Raises:
        InputError: a share that is no probability, times that are no numbers or in another order.
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
        """s by which a scan of this time is late; two numbers are drawn, whatever comes of them."""
        luck, part = rng.random(2).tolist()
        return self.up_to * part if self.start <= time <= self.end and luck < self.share else 0.0


class _Coming(NamedTuple):
    """A scan on its way."""

    arrives: float  # s
    scan: SensorScan


class _Memory(NamedTuple):
    """What has arrived, what has not, and the seed of filters that draw; nothing before the first step."""

    timeline: Timeline | None = None
    coming: tuple[_Coming, ...] = ()
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Delayed(AroundTracker):
    """Another tracker, which hears of some scans late and puts them in their places (`LateScans`).

    Its state is what is believed of now by what has arrived, predicted to now where the latest scan is older. Births
    are named after the scans that the other tracker has taken, in order of time.

    Attributes:
        tracker: any.
        delays: by the number of a sensor; scans of others come at once.

    Raises:
        InputError: something else than a tracker, a sensor that there is not, no delay.
    """

    delays: Mapping[int, Delay]
    _window: float = field(init=False, repr=False)  # s, in which nothing that is not lost is too late

    def __post_init__(self) -> None:
        AroundTracker.__post_init__(self)
        for s, delay in self.delays.items():
            if count("delays", s) >= len(self.sensors):
                raise reject("delays", f"sensors from 0 to {len(self.sensors) - 1}", s)
            instance(f"delays[{s}]", delay, Delay)
        longest = (min(delay.up_to, delay.window) for delay in self.delays.values())
        object.__setattr__(self, "_window", max(longest, default=0.0) + 1.0)

    def initial(self) -> State:
        """As the tracker's."""
        return replace(self.tracker.initial(), memory=_Memory())

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Send the scans of a time, and take in what has arrived by then; see `Tracker.step`.

        The delays of a sensor's scans are drawn from its own of `rngs`.
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
        """The scans of a time that arrive, now or later."""
        found = []
        for s, scan in enumerate(scans):
            if scan is not None:
                delay = self.delays.get(s)
                by = 0.0 if delay is None else delay.drawn(now, rngs[s])
                if delay is None or by <= delay.window:
                    found.append(_Coming(now + by, SensorScan(s, now, scan, poses[s])))
        return found
