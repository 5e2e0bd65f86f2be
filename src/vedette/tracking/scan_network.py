"""Sensors that send their scans: each updates with all that it hears, and puts what is late where it belongs."""

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
    """What a sensor believes after a step, who may be born at the next, and what its filter said."""

    belief: Any
    births: LMB | None
    info: FilterInfo | None


class _Frame(NamedTuple):
    """The scans of one step, and when each sensor has them."""

    step: int
    instant: int  # number of its time, by which messages are late
    dt: float
    scans: tuple[Any, ...]
    poses: Floats
    arrives: Ints  # (num_sensors, num_sensors) as of `Network.arrivals`


class _Memory(NamedTuple):
    """What every sensor knew before the first of the steps that messages may still arrive for, and these steps."""

    known: tuple[_Known, ...]
    frames: tuple[_Frame, ...]
    last: tuple[_Frame, ...]  # all steps of the last time
    instant: int  # times so far


@dataclass(frozen=True, slots=True, eq=False)
class ScanNetwork(OfAllScans):
    """Every sensor runs the same filter of several sensors on the scans that it hears, its own among them.

    A scan that comes late is put in its place: the steps since then are filtered again with it, so that sensors that
    have heard the same believe the same, whatever came when. Where sensors that hear each other believe different
    things (as two groups that have met again), they merge their beliefs first, unless messages are delayed.

    Attributes:
        filter: of all sensors' scans; a scan that was not heard is None to it. Its births are labelled, as sensors that
            know different scans would name first detections differently.
        network: who hears whom.
        merging: fusion of beliefs of different pasts; all its weights are replaced by equal ones. It also makes the one
            belief that is reported where sensors believe different things.

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
        """No target."""
        belief = self.filter.initial()
        known = (_Known(belief, None, None),) * len(self.sensors)
        return State((belief,) * len(self.sensors), belief, memory=_Memory(known, (), (), 0))

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Send the scans and filter what has arrived; see `Tracker.step`. Only the first of `rngs` is drawn from."""
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
        """Each sensor's belief and those of all that it hears as one; the same for those who hear the same.

        Who scans at this step is not asked, as the beliefs are those of before.
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
        """Who may be born after a step of which these sensors' scans are known. before: after those of its time."""
        birth, after = self.targets.birth, frame.step + 1
        found = births_heard(birth, belief, self.sensors, frame.scans, frame.poses, after, heard)
        return births_waiting(birth, before, found)

    def filtered(self, known: _Known, frame: _Frame, heard: tuple[int, ...], rng: np.random.Generator) -> _Known:
        """What a sensor knows after a step of which it has heard these sensors' scans."""
        scans = [scan if s in heard else None for s, scan in enumerate(frame.scans)]
        belief, info = self._filtered(known.belief, known.births, scans, frame.poses, frame.dt, frame.step, rng)
        before = known.births if frame.dt == 0.0 else None
        return _Known(belief, self._measured(before, belief, frame, heard), info)


class _Runs:
    """Steps of sensors, each computed once for all sensors that knew the same and heard the same."""

    def __init__(self, tracker: ScanNetwork, rng: np.random.Generator) -> None:
        self.tracker, self.rng = tracker, rng
        self.done: dict[tuple[int, int, tuple[int, ...]], _Known] = {}
        self.kept: list[_Known] = []  # so that no two of the ids are of one after the other

    def through(self, known: _Known, frames: Sequence[_Frame], sensor: int, now: int) -> _Known:
        """What a sensor knows after these steps, by what of them it has heard by now."""
        for frame in frames:
            heard = heard_by(sensor, frame.arrives, now)
            key = id(known), frame.step, heard
            if key not in self.done:
                self.kept.append(known)
                self.done[key] = self.tracker.filtered(known, frame, heard, self.rng)
            known = self.done[key]
        return known
