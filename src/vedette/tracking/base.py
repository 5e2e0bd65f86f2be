"""Protocol of trackers, their state and report, timing of the stages of a step, and checks of its input."""

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
from vedette.models.scan_rows import table_of

# s. Without a period of births, the length of the first prediction has no effect, as there are no targets before.
_FIRST_PERIOD = 1.0
NUMBER_BYTES = 8  # bytes; each symmetric matrix is sent as its triangle, without compression
_NOTE_PREFIX = "stage: "


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class State(SummaryRepr):
    """State of a tracker after a scan.

    Attributes:
        local: belief of each sensor.
        fused: fused belief of all sensors.
        step: number of the scan, from 1, or 0 before the first.
        time: time of that scan in s, or None before the first.
        memory: data of the tracker itself for the next step, such as birth candidates, or None if it needs none.
        undetected: intensity of undetected targets, if `BirthModel.anywhere` has cells for those of the belief, or the
            tracker maintains it (`UndetectedTargetTracker`), else None.
        unseen: seconds since a scan had each label in view, if the tracker maintains them (`ViewTracker`), else None.
    """

    local: tuple[Any, ...]
    fused: Any
    step: int = 0
    time: float | None = None
    memory: Any = None
    undetected: UndetectedIntensity | None = None
    unseen: dict[tuple[int, int], float] | None = None

    def _summary(self) -> str:
        when = "before the first scan" if self.time is None else f"after scan {self.step}, at {self.time:g} s"
        undetected = "" if self.undetected is None else f", {self.undetected.total:.3g} not yet found"
        return f"{when}, of {pluralise(len(self.local), 'sensor')}{undetected}"

    def _detail(self) -> str:
        return f"fused: {in_short(self.fused)}"

    def _repr_html_(self) -> str:
        fused_html: str = self.fused._repr_html_() if isinstance(self.fused, SummaryRepr) else ""
        return f"<p><b>{escape(self.in_short())}</b></p>{fused_html}"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TrackerInfo(SummaryRepr):
    """Report of one step of a tracker.

    Attributes:
        filters: reports of the filters: one per sensor, or a single one for all sensors together.
        fusion: report of the fusion, or None without fusion.
        seconds: wall time by stage. The record of a run contains "filter" and "fusion".
        bytes_sent: bytes that each sensor sent, empty if the tracker sends nothing or does not count them.
    """

    filters: tuple[FilterInfo, ...]
    fusion: Any
    seconds: Mapping[str, float]
    bytes_sent: tuple[int, ...] = ()


@runtime_checkable
class Tracker(Protocol):
    """A tracker: updates the beliefs of all sensors scan by scan. Custom trackers implement this protocol."""

    @property
    def targets(self) -> TargetModel:
        """Target model that all sensors share."""

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """Model of each sensor, in the order of scans and poses."""

    def initial(self) -> State:
        """Return the state before the first scan."""

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Predict to `time` and update with the scans of that time.

        Args:
            state: state that the previous step returned.
            scans: one per sensor: (num, meas_dim) measurements, in any order, with angles in radians. Empty for a scan
                without detections. None for a sensor that did not scan at `time`.
            poses: (num_sensors, 3 or more) [px, py, heading_rad, ...] of each sensor at `time`.
            time: time in s, at least `state.time`. Equal for further scans of the same time: no motion, deaths or
                births in between. Networks exchange messages at each such step. Their delays count times.
            rngs: one per sensor, for filters that draw random numbers.

        Returns:
            The state after these scans, and a report.

        Raises:
            InputError: a number of scans, poses or generators that differs from the number of sensors, or a time before
                the last.
            ModelError, NumericalError: from the filters and the fusion. Every exception has a note with the stage that
                raised it (`vedette.tracking.failed_stage`).
        """


@dataclass(frozen=True, slots=True, eq=False)
class TrackerWrapper:
    """Base of trackers that wrap another tracker.

    Attributes:
        tracker: the wrapped tracker.

    Raises:
        InputError: `tracker` is not a tracker.
    """

    tracker: Tracker

    def __post_init__(self) -> None:
        if not isinstance(self.tracker, Tracker):
            raise reject("tracker", "a Tracker, with targets, sensors, initial() and step()", self.tracker)

    @property
    def targets(self) -> TargetModel:
        """Target model that all sensors share."""
        return self.tracker.targets

    @property
    def sensors(self) -> tuple[SensorModel, ...]:
        """Model of each sensor."""
        return self.tracker.sensors


def check_step(
    state: State,
    scans: Sequence[Any],
    poses: Any,
    time: float,
    rngs: Sequence[Any],
    tracker: Tracker,
    num_sensors: int,
) -> tuple[Floats, float]:
    """Return the poses as an array and the seconds since the last scan, at the first scan the period of births.

    Raises `InputError` as `Tracker.step` does.
    """
    if not isinstance(state, State):
        raise InputError(f"state: expected a State; got {type(state).__name__}")
    one_a_sensor(num_sensors, scans=scans, poses=poses, rngs=rngs)
    now = real("time", time)
    if state.time is not None and now < state.time:
        raise InputError(f"time: expected one from that of the last scan on, {state.time:g} s; got {now:g}")
    pose_array = float_array("poses", poses, (num_sensors, None))
    if state.time is None:
        return pose_array, tracker.targets.birth.period or _FIRST_PERIOD
    return pose_array, now - state.time


class StageTimer:
    """Stopwatch for the stages of a step. It also adds a note with the stage to an exception raised inside.

    Attributes:
        seconds: wall time by stage, in order of their first start.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def timing(self, name: str, sensor: int | None = None) -> Iterator[None]:
        """Time the code inside the context. sensor: number from 0, if the stage belongs to one sensor."""
        start = perf_counter()
        try:
            yield
        except BaseException as error:
            if failed_stage(error) is None:  # the innermost stage is the most precise
                error.add_note(f"{_NOTE_PREFIX}the {name}" + ("" if sensor is None else f" of sensor {sensor + 1}"))
            raise
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + perf_counter() - start


def failed_stage(error: BaseException) -> str | None:
    """Return the stage that raised an exception, such as "the filter of sensor 2", or None without a note of it."""
    notes = [note for note in getattr(error, "__notes__", ()) if note.startswith(_NOTE_PREFIX)]
    return notes[0].removeprefix(_NOTE_PREFIX) if notes else None


def scan_bytes(scan: Any, pose: Any) -> int:
    """Return the bytes of the measurements and of the sensor's pose, or 0 without a scan."""
    return 0 if scan is None else NUMBER_BYTES * (np.size(table_of(scan)) + len(pose))


def belief_bytes(belief: Any) -> int:
    """Return the bytes of labels, existences or hypotheses, and track components, or 0 for a density without labels."""
    if not isinstance(belief, LabelledDensity):
        return 0
    tracks = belief.tracks
    num, dim = len(tracks.labels), int(tracks.means.shape[1])
    numbers = 2 * num + len(tracks.log_weights) * (1 + dim + dim * (dim + 1) // 2)
    if belief.is_lmb:
        return NUMBER_BYTES * (numbers + num)
    factors = belief.to_factors()
    hyps = len(factors.hyp_log_weights) + len(factors.hyp_tracks)
    # A factor of one label is sent as its existence alone.
    num_single = int(np.count_nonzero(bernoulli_factors(factors))) if belief.is_product else 0
    return NUMBER_BYTES * (numbers + hyps - 2 * num_single)
