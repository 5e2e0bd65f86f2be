"""What every tracker is: its state between scans, what it reports, its stopwatch, the checks of what it is given."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

import numpy as np

from vedette.densities import LabelledDensity, UndetectedIntensity
from vedette.densities.factored import bernoulli_factors
from vedette.errors import InputError
from vedette.filters import FilterInfo
from vedette.internal.representation import SummaryRepr, in_short
from vedette.internal.text import pluralise
from vedette.kernels.base.types import Floats
from vedette.models import SensorModel, TargetModel
from vedette.models.arguments import float_array, one_a_sensor, real, reject

# s. The belief before the first scan holds no target, so that the time before it changes nothing.
FIRST_PERIOD = 1.0
NUMBER = 8  # bytes; each symmetric matrix is sent as its triangle, nothing is compressed
_NOTE = "stage: "


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class State(SummaryRepr):
    """What is believed after a scan.

    Attributes:
        local: the belief of each sensor.
        fused: that of all together.
        step: number of the scan, from 1; 0 before the first.
        time: s, of that scan; None before the first.
        memory: what the tracker itself must know at the next step, such as who may then be born; None: nothing.
        undetected: the targets that no sensor has found yet, where `BirthModel.anywhere` has cells for those of the
            belief, or the tracker keeps account of them (`Searching`).
    """

    local: tuple[Any, ...]
    fused: Any
    step: int = 0
    time: float | None = None
    memory: Any = None
    undetected: UndetectedIntensity | None = None

    def _summary(self) -> str:
        when = "before the first scan" if self.time is None else f"after scan {self.step}, at {self.time:g} s"
        unfound = "" if self.undetected is None else f", {self.undetected.total:.3g} not yet found"
        return f"{when}, of {pluralise(len(self.local), 'sensor')}{unfound}"

    def _detail(self) -> str:
        return f"fused: {in_short(self.fused)}"

    def _repr_html_(self) -> str:
        said: str = self.fused._repr_html_() if isinstance(self.fused, SummaryRepr) else ""
        return f"<p><b>{escape(self.in_short())}</b></p>{said}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TrackerInfo(SummaryRepr):
    """Report of one step of a tracker.

    Attributes:
        filters: what the filters reported: one a sensor, or a single one for all sensors together.
        fusion: what the fusion reported; None where nothing was fused.
        seconds: wall time by stage, of which "filter" and "fusion" are kept in the record of a run.
        bytes_sent: for each sensor, the bytes that it sent; empty where the tracker does not count them.
    """

    filters: tuple[FilterInfo, ...]
    fusion: Any
    seconds: Mapping[str, float]
    bytes_sent: tuple[int, ...] = ()


@runtime_checkable
class Tracker(Protocol):
    """Carries the beliefs of all sensors from scan to scan; one of your own is as good as those that are here."""

    @property
    def targets(self) -> TargetModel:
        """The targets as all sensors know them."""
        ...

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """What each sensor sees, in the order of scans and poses."""
        ...

    def initial(self) -> State:
        """The state before the first scan."""
        ...

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Predict to `time` and take in the scans of that time.

        Args:
            state: as the step before left it.
            scans: one a sensor: (num, meas_dim) measurements, in any order; angles in radians. Empty where a scan
                has found nothing; None of a sensor that did not scan at `time`.
            poses: (num_sensors, 3 or more) [px, py, heading_rad, ...] of each sensor at `time`.
            time: s, after `state.time`; or the same, for scans of that time that come apart: nobody then moves, dies
                or is born in between. Networks exchange messages at each such step; their delays count times.
            rngs: one a sensor, for filters that draw.

        Returns:
            The state after these scans, and a report.

        Raises:
            InputError: another number of scans, poses or generators than of sensors; a time before the last.
            ModelError, NumericalError: as the filters and the fusion. Any exception has a note that says in which
                stage it was raised (`vedette.tracking.stage_of`).
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class AroundTracker:
    """What the trackers share that are another one, and something more.

    Attributes:
        tracker: any.

    Raises:
        InputError: something else than a tracker.
    """

    tracker: Tracker

    def __post_init__(self) -> None:
        if not isinstance(self.tracker, Tracker):
            raise reject("tracker", "a Tracker, with targets, sensors, initial() and step()", self.tracker)

    @property
    def targets(self) -> TargetModel:
        """The targets as all sensors know them."""
        return self.tracker.targets

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """What each sensor sees."""
        return self.tracker.sensors


def check_step(
    state: State, scans: Sequence[Any], poses: Any, time: float, rngs: Sequence[Any], num_sensors: int
) -> tuple[Floats, float]:
    """The poses as an array, and the seconds since the last scan; `InputError` as `Tracker.step` says."""
    if not isinstance(state, State):
        raise InputError(f"state: expected a State; got {type(state).__name__}")
    one_a_sensor(num_sensors, scans=scans, poses=poses, rngs=rngs)
    now = real("time", time)
    if state.time is not None and now < state.time:
        raise InputError(f"time: expected one from that of the last scan on, {state.time:g} s; got {now:g}")
    at = float_array("poses", poses, (num_sensors, None))
    return at, FIRST_PERIOD if state.time is None else now - state.time


class Stages:
    """A stopwatch for the parts of a step, which also notes on an exception in which part it was raised.

    Attributes:
        seconds: wall time by the name of the part, in order of their first start.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def timing(self, name: str, sensor: int | None = None) -> Iterator[None]:
        """Take the time of what runs inside. sensor: counted from 0, where the part is of one sensor alone."""
        start = perf_counter()
        try:
            yield
        except BaseException as error:
            if stage_of(error) is None:  # the innermost part says it best
                error.add_note(f"{_NOTE}the {name}" + ("" if sensor is None else f" of sensor {sensor + 1}"))
            raise
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


def stage_of(error: BaseException) -> str | None:
    """Where an exception was raised, as a stopwatch noted it: "the filter of sensor 2"; None where none did."""
    notes = [note for note in getattr(error, "__notes__", ()) if note.startswith(_NOTE)]
    return notes[0].removeprefix(_NOTE) if notes else None


def bytes_of_scan(scan: Any, pose: Any) -> int:
    """The measurements, and the pose that they were taken from; 0 where there was no scan."""
    return 0 if scan is None else NUMBER * (np.size(scan) + len(pose))


def bytes_of_belief(belief: Any) -> int:
    """Labels, existences or hypotheses, and the components of all tracks; 0 of a density without labels."""
    if not isinstance(belief, LabelledDensity):
        return 0
    tracks = belief.tracks
    num, dim = len(tracks.labels), int(tracks.means.shape[1])
    numbers = 2 * num + len(tracks.log_weights) * (1 + dim + dim * (dim + 1) // 2)
    if belief.is_lmb:
        return NUMBER * (numbers + num)
    own = belief.to_factors()
    hyps = len(own.hyp_log_weights) + len(own.hyp_tracks)
    # Of those of one label an existence says all.
    singles = int(np.count_nonzero(bernoulli_factors(own))) if belief.is_product else 0
    return NUMBER * (numbers + hyps - 2 * singles)
