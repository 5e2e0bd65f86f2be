"""Networks of sensors that send their scans: each sensor filters all scans that it receives, in order of time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import LMB
from vedette.filters import FilterInfo, with_labelled_births
from vedette.fusion import FieldsOfView, Fusion
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import reject
from vedette.tracking.base import StageTimer, State, TrackerInfo, check_step, scan_bytes
from vedette.tracking.births import births_from_received_scans, combine_births
from vedette.tracking.central import MultiSensorFilterTracker
from vedette.tracking.merging import merge_equally
from vedette.tracking.network import Network, hop_counts, message_bytes, received_from


class _SensorState(NamedTuple):
    """A sensor's belief after a step, its birth candidates for the next step, and its filter's report."""

    belief: Any
    births: LMB | None
    info: FilterInfo | None


class _Frame(NamedTuple):
    """The scans of one step, and the times at which each sensor receives them."""

    step: int
    time_index: int  # number of its time; delays are counted in these
    dt: float
    scans: tuple[Any, ...]
    poses: Floats
    arrives: Ints  # (num_sensors, num_sensors) from `Network.arrivals`


class _Memory(NamedTuple):
    """The steps for which messages may still arrive, and the state of every sensor before the first of them."""

    sensor_states: tuple[_SensorState, ...]
    frames: tuple[_Frame, ...]
    last: tuple[_Frame, ...]  # all steps of the last time
    time_index: int  # number of times so far


@dataclass(frozen=True, slots=True, eq=False)
class ScanNetwork(MultiSensorFilterTracker):
    """Tracker in which every sensor runs the same multi-sensor filter on all scans that it receives and its own.

    When a late scan arrives, the steps since its time are filtered again with it. Sensors that have received the same
    scans therefore have the same belief, in whatever order the scans arrived. If connected sensors have different
    beliefs (for example when two groups meet again), they merge them first, unless messages are delayed.

    Attributes:
        filter: multi-sensor filter. A scan that was not received is passed to it as None. Its births are labelled,
            because sensors with different scans would give different labels to first detections.
        network: radio network between the sensors.
        merging: fusion of beliefs with different histories. All its weights are replaced by equal ones. It also fuses
            the sensors' beliefs into the one that is reported if they differ.

    Raises:
        InputError: a filter or network of another kind, or a network with consensus.
    """

    network: Network
    merging: Fusion

    def __post_init__(self) -> None:
        MultiSensorFilterTracker.__post_init__(self)  # slots replace the class that super() looks for
        object.__setattr__(self, "filter", with_labelled_births(self.filter))
        if not isinstance(self.network, Network) or self.network.consensus_rounds is not None:
            raise reject("network", "a Network without consensus, as scans are no averages", self.network)

    def initial(self) -> State:
        """Return the state without targets."""
        belief = self.filter.initial()
        sensor_states = (_SensorState(belief, None, None),) * len(self.sensors)
        return State((belief,) * len(self.sensors), belief, memory=_Memory(sensor_states, (), (), 0))

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Send the scans and filter those that have arrived. See `Tracker.step`. Uses only `rngs[0]`."""
        pose_array, dt = check_step(state, scans, poses, time, rngs, self, len(self.sensors))
        timer, step, num = StageTimer(), state.step + 1, len(self.sensors)
        time_index = state.memory.time_index + (dt > 0.0)
        hops = hop_counts(self.network.links(pose_array, rngs[0]))
        frame = _Frame(step, time_index, dt, tuple(scans), pose_array, self.network.arrivals(hops, time_index))
        views = FieldsOfView(self.sensors, pose_array, tuple(scan is not None for scan in scans))
        sent = np.array(
            self.network.bytes_sent(hops, [scan_bytes(*each) for each in zip(scans, pose_array, strict=True)])
        )
        sensor_states = state.memory.sensor_states
        if self.network.delay == 0 and len({id(each.belief) for each in sensor_states}) > 1:
            sent += message_bytes(self.network, hops, [(each.belief,) for each in sensor_states])
            with timer.timing("fusion"):
                sensor_states = self._merge(state.memory, frame, views)
        frames, steps = (*state.memory.frames, frame), _SharedSteps(self, rngs[0])
        with timer.timing("filter"):
            current = tuple(steps.advance(sensor_states[i], frames, i, time_index) for i in range(num))
            while frames and time_index - frames[0].time_index >= self.network.longest_delay(num):
                sensor_states = tuple(steps.advance(sensor_states[i], frames[:1], i, time_index) for i in range(num))
                frames = frames[1:]
        with timer.timing("fusion"):
            fused, report = merge_equally(self.merging, [each.belief for each in current], range(num), views)
        infos = tuple(each.info for each in current if each.info is not None)
        info = TrackerInfo(infos, report, timer.seconds, tuple(sent.tolist()))
        local = tuple(each.belief for each in current)
        last = (frame,) if dt > 0.0 else (*state.memory.last, frame)
        return State(local, fused, step, float(time), _Memory(sensor_states, frames, last, time_index)), info

    def _merge(self, memory: _Memory, frame: _Frame, views: FieldsOfView) -> tuple[_SensorState, ...]:
        """Return each sensor's state after merging its belief with the beliefs it receives.

        Sensors that receive the same beliefs share one object. The beliefs are those before this step, so the merging
        takes all sensors to have scanned, whether or not they scan at this step.
        """
        merged: dict[tuple[int, ...], _SensorState] = {}
        received = [received_from(i, frame.arrives, frame.time_index) for i in range(len(self.sensors))]
        for senders in received:
            if senders not in merged:
                beliefs = [memory.sensor_states[j].belief for j in senders]
                belief, report = merge_equally(self.merging, beliefs, senders, views.if_all_scanned())
                if report is None:
                    merged[senders] = memory.sensor_states[senders[0]]
                else:
                    measured = None
                    for earlier_frame in memory.last:
                        measured = self._measured_births(measured, belief, earlier_frame, senders)
                    merged[senders] = _SensorState(belief, measured, None)
        return tuple(merged[senders] for senders in received)

    def _measured_births(self, earlier: LMB | None, belief: Any, frame: _Frame, senders: tuple[int, ...]) -> LMB | None:
        """Return the birth candidates after a step, from the scans of the sensors `senders`.

        earlier: candidates from earlier scans of the same time.
        """
        birth, next_step = self.targets.birth, frame.step + 1
        candidates = births_from_received_scans(
            birth, belief, self.sensors, frame.scans, frame.poses, next_step, senders, self.targets.motion
        )
        return combine_births(birth, earlier, candidates)

    def filter_scans(
        self, sensor_state: _SensorState, frame: _Frame, senders: tuple[int, ...], rng: np.random.Generator
    ) -> _SensorState:
        """Return a sensor's state after a step, given that it received the scans of the sensors `senders`."""
        scans = [scan if s in senders else None for s, scan in enumerate(frame.scans)]
        belief, info = self._filter(
            sensor_state.belief, sensor_state.births, scans, frame.poses, frame.dt, frame.step, rng
        )
        earlier = sensor_state.births if frame.dt == 0.0 else None
        return _SensorState(belief, self._measured_births(earlier, belief, frame, senders), info)


class _SharedSteps:
    """Steps of sensors, each computed once for all sensors with the same state and the same received scans."""

    def __init__(self, tracker: ScanNetwork, rng: np.random.Generator) -> None:
        self.tracker, self.rng = tracker, rng
        self.cache: dict[tuple[int, int, tuple[int, ...]], _SensorState] = {}
        self.alive: list[_SensorState] = []  # keeps the objects alive, so that their ids are not reused

    def advance(
        self, sensor_state: _SensorState, frames: Sequence[_Frame], sensor: int, time_index: int
    ) -> _SensorState:
        """Return a sensor's state after these steps, given the scans that it has received by the time `time_index`."""
        for frame in frames:
            senders = received_from(sensor, frame.arrives, time_index)
            key = id(sensor_state), frame.step, senders
            if key not in self.cache:
                self.alive.append(sensor_state)
                self.cache[key] = self.tracker.filter_scans(sensor_state, frame, senders, self.rng)
            sensor_state = self.cache[key]
        return sensor_state
