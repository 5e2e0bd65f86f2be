"""Networks of sensors that send their scans: each sensor filters all scans that it receives, in order of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB
from vedette.filters import FilterInfo, with_labelled_births
from vedette.fusion import FieldsOfView, Fusion
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import reject
from vedette.tracking.base import Stages, State, TrackerInfo, bytes_of_scan, check_step
from vedette.tracking.births import births_heard, births_waiting
from vedette.tracking.central import OfAllScans
from vedette.tracking.merging import merged
from vedette.tracking.network import Network, bytes_of_messages, heard_by, hop_counts


class _Known(NamedTuple):
    """A sensor's belief after a step, its birth candidates for the next step, and its filter's report."""

    belief: Any
    births: LMB | None
    info: FilterInfo | None


class _Frame(NamedTuple):
    """The scans of one step, and the times at which each sensor receives them."""

    step: int
    instant: int  # number of its time; delays are counted in these
    dt: float
    scans: tuple[Any, ...]
    poses: Floats
    arrives: Ints  # (num_sensors, num_sensors) from `Network.arrivals`


class _Memory(NamedTuple):
    """The steps for which messages may still arrive, and the state of every sensor before the first of them."""

    known: tuple[_Known, ...]
    frames: tuple[_Frame, ...]
    last: tuple[_Frame, ...]  # all steps of the last time
    instant: int  # number of times so far


@dataclass(frozen=True, slots=True, eq=False)
class ScanNetwork(OfAllScans):
    """Tracker in which every sensor runs the same multi-sensor filter on all scans that it receives and its own.

    When a late scan arrives, the steps since its time are filtered again with it. Sensors that have received the same
    scans therefore have the same belief, in whatever order the scans arrived. If connected sensors have different
    beliefs (for example when two groups meet again), they merge them first, unless messages are delayed.

    Attributes:
        filter: multi-sensor filter; a scan that was not received is passed to it as None. Its births are labelled,
            because sensors with different scans would give different labels to first detections.
        network: radio network between the sensors.
        merging: fusion of beliefs with different histories; all its weights are replaced by equal ones. It also fuses
            the sensors' beliefs into the one that is reported if they differ.

    Raises:
        InputError: a filter or network of another kind, or a network with consensus.
    """

    network: Network
    merging: Fusion

    def __post_init__(self) -> None:
        OfAllScans.__post_init__(self)  # slots replace the class that super() looks for
        object.__setattr__(self, "filter", with_labelled_births(self.filter))
        if not isinstance(self.network, Network) or self.network.consensus_rounds is not None:
            raise reject("network", "a Network without consensus, as scans are no averages", self.network)

    def initial(self) -> State:
        """Return the state without targets."""
        belief = self.filter.initial()
        known = (_Known(belief, None, None),) * len(self.sensors)
        return State((belief,) * len(self.sensors), belief, memory=_Memory(known, (), (), 0))

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Send the scans and filter those that have arrived; see `Tracker.step`. Uses only `rngs[0]`."""
        at, dt = check_step(state, scans, poses, time, rngs, len(self.sensors))
        stages, step, num = Stages(), state.step + 1, len(self.sensors)
        instant = state.memory.instant + (dt > 0.0)
        hops = hop_counts(self.network.links(at, rngs[0]))
        frame = _Frame(step, instant, dt, tuple(scans), at, self.network.arrivals(hops, instant))
        views = FieldsOfView(self.sensors, at, tuple(scan is not None for scan in scans))
        sent = np.array(self.network.bytes_sent(hops, [bytes_of_scan(*own) for own in zip(scans, at, strict=True)]))
        known = state.memory.known
        if self.network.delay == 0 and len({id(own.belief) for own in known}) > 1:
            sent += bytes_of_messages(self.network, hops, [(own.belief,) for own in known])
            with stages.timing("fusion"):
                known = self._merge(state.memory, frame, views)
        frames, runs = (*state.memory.frames, frame), _Runs(self, rngs[0])
        with stages.timing("filter"):
            now = tuple(runs.through(known[i], frames, i, instant) for i in range(num))
            while frames and instant - frames[0].instant >= self.network.longest_delay(num):
                known = tuple(runs.through(known[i], frames[:1], i, instant) for i in range(num))
                frames = frames[1:]
        with stages.timing("fusion"):
            fused, report = merged(self.merging, [own.belief for own in now], range(num), views)
        infos = tuple(own.info for own in now if own.info is not None)
        info = TrackerInfo(infos, report, stages.seconds, tuple(sent.tolist()))
        local = tuple(own.belief for own in now)
        last = (frame,) if dt > 0.0 else (*state.memory.last, frame)
        return State(local, fused, step, float(time), _Memory(known, frames, last, instant)), info

    def _merge(self, memory: _Memory, frame: _Frame, views: FieldsOfView) -> tuple[_Known, ...]:
        """Return each sensor's state after merging its belief with the beliefs it receives.

        Sensors that receive the same beliefs share one object. The beliefs are those before this step, so the merging
        takes all sensors to have scanned, whether or not they scan at this step.
        """
        found: dict[tuple[int, ...], _Known] = {}
        everyone = [heard_by(i, frame.arrives, frame.instant) for i in range(len(self.sensors))]
        for heard in everyone:
            if heard not in found:
                beliefs = [memory.known[j].belief for j in heard]
                belief, report = merged(self.merging, beliefs, heard, views.if_all_scanned())
                if report is None:
                    found[heard] = memory.known[heard[0]]
                else:
                    measured = None
                    for own in memory.last:
                        measured = self._measured(measured, belief, own, heard)
                    found[heard] = _Known(belief, measured, None)
        return tuple(found[heard] for heard in everyone)

    def _measured(self, before: LMB | None, belief: Any, frame: _Frame, heard: tuple[int, ...]) -> LMB | None:
        """Return the birth candidates after a step, from the scans of the sensors `heard`.

        before: candidates from earlier scans of the same time.
        """
        birth, after = self.targets.birth, frame.step + 1
        found = births_heard(birth, belief, self.sensors, frame.scans, frame.poses, after, heard)
        return births_waiting(birth, before, found)

    def filtered(self, known: _Known, frame: _Frame, heard: tuple[int, ...], rng: np.random.Generator) -> _Known:
        """Return a sensor's state after a step, given that it received the scans of the sensors `heard`."""
        scans = [scan if s in heard else None for s, scan in enumerate(frame.scans)]
        belief, info = self._filtered(known.belief, known.births, scans, frame.poses, frame.dt, frame.step, rng)
        before = known.births if frame.dt == 0.0 else None
        return _Known(belief, self._measured(before, belief, frame, heard), info)


class _Runs:
    """Steps of sensors, each computed once for all sensors with the same state and the same received scans."""

    def __init__(self, tracker: ScanNetwork, rng: np.random.Generator) -> None:
        self.tracker, self.rng = tracker, rng
        self.done: dict[tuple[int, int, tuple[int, ...]], _Known] = {}
        self.kept: list[_Known] = []  # keeps the objects alive, so that their ids are not reused

    def through(self, known: _Known, frames: Sequence[_Frame], sensor: int, now: int) -> _Known:
        """Return a sensor's state after these steps, given the scans that it has received by the instant `now`."""
        for frame in frames:
            heard = heard_by(sensor, frame.arrives, now)
            key = id(known), frame.step, heard
            if key not in self.done:
                self.kept.append(known)
                self.done[key] = self.tracker.filtered(known, frame, heard, self.rng)
            known = self.done[key]
        return known
