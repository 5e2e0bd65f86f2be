"""The live loop: a function from (state, line) to (state, answers), without other input or output."""

import math
from bisect import bisect_right
from dataclasses import dataclass, field, replace

import numpy as np

from vedette.control import Planner
from vedette.densities import Estimator
from vedette.errors import VedetteError
from vedette.evaluation.innovations import Assumed
from vedette.evaluation.track_formats import utc_text
from vedette.internal.quantities import PLACED
from vedette.kernels.base.types import Floats
from vedette.live.answers import Answer, plan_answer, track_answers
from vedette.live.fit import LiveFit
from vedette.live.messages import Message, read_message
from vedette.models.arguments import reject
from vedette.models.scan_rows import as_scan
from vedette.platforms.compass import Compass, PlaneCompass
from vedette.recorded import Conventions, Origin, RecordedSensor
from vedette.recorded.extents import beyond_reach, is_within, places_of
from vedette.recorded.merging import Spread, merged_scan
from vedette.simulation.journal import error_cause
from vedette.simulation.loop import PLANNER
from vedette.tracking import OutOfSequenceTracker, SensorScan, Timeline

# Number of consecutive scans that must agree on a time far ahead before it is accepted, since all sensors may have been
# silent for long. If they are all from one of several sensors, more are needed, as it may only be the fastest one.
_MIN_AGREEING, _MIN_AGREEING_ALONE = 3, 10


@dataclass(frozen=True, slots=True, eq=False)
class LiveState:
    """Complete state of the loop.

    Attributes:
        timeline: timeline of the scans that were processed.
        num_lines: number of lines that arrived.
        num_errors: number of errors in lines and plans.
        start: offset in s from times of the timeline to times in lines, or None before the first scan.
        is_utc: True if times in lines are seconds since 1970.
        latest: (num_sensors,) time of the latest scan of each sensor in s, or -inf before its first.
        claimed: time of the latest scan that was far ahead, in s. inf: none.
        claimants: sensors of the consecutive scans that agreed on it.
        due: time of the next decision in s. inf: none.
        num_decisions: number of decisions so far.
        spreads: of the returns of each sensor.
        fit: of the assumed model to the latest scans.
    """

    timeline: Timeline
    num_lines: int = 0
    num_errors: int = 0
    start: float | None = None
    is_utc: bool = False
    latest: tuple[float, ...] = ()
    claimed: float = math.inf
    claimants: tuple[int, ...] = ()
    due: float = math.inf
    num_decisions: int = 0
    spreads: tuple[Spread, ...] = ()
    fit: LiveFit = field(default_factory=LiveFit)


@dataclass(frozen=True, slots=True, eq=False)
class LiveLoop:
    """A loop that processes lines with scans, in any order of time, and answers each.

    The same lines in the same order have the same answers, byte for byte.

    Attributes:
        tracker: tracker for scans in any order of arrival.
        sites: the sensors, as in `read_message`.
        estimate: estimator of the targets.
        conventions, origin: conventions of the lines, and origin of the plane.
        first_time: time of the first scan on the clock of the tracker, in s, if times are dates. Other times are
            unchanged.
        planner: planner of the decisions. None: no decisions.
        decision_times: times of the decisions in s, increasing.
        decide_every: time between decisions in s, from the first scan on, instead of `decision_times`.
        max_lead: s. A scan further ahead of all others is refused unless several in a row agree, because one wrong
            clock would otherwise end the window of all other sensors.
        seed: seed of the decisions.
        classes: names of the classes of targets, or () if they have none.
        modes: names of the modes of motion, or () if there is one.
        valid_area: (2, 2) lower left and upper right corner of the area of valid measurements, in m. Others are left
            out and counted in the answer as `beyond`. None: no limit.
        extents: for each sensor, the largest distance in m between neighbouring returns of a target. 0: returns are
            not merged.
        assumed: models that are tested against the latest scans. None: no tests.
    """

    tracker: OutOfSequenceTracker
    sites: tuple[RecordedSensor, ...]
    estimate: Estimator
    conventions: Conventions
    origin: Origin | None = None
    first_time: float = 0.0
    planner: Planner | None = None
    decision_times: tuple[float, ...] = ()
    decide_every: float | None = None
    max_lead: float = 60.0
    seed: int = 0
    classes: tuple[str, ...] = ()
    modes: tuple[str, ...] = ()
    valid_area: Floats | None = None
    extents: tuple[float, ...] = ()
    assumed: Assumed | None = None

    @property
    def compass(self) -> Compass | None:
        """Compass of directions in answers. None: angles in the plane, counter-clockwise from east."""
        if self.origin is not None:
            return self.origin
        return PlaneCompass() if any(site.compass for site in self.sites) else None

    def initial(self) -> LiveState:
        """Return the state before the first line."""
        num = len(self.sites)
        return LiveState(self.tracker.initial(), latest=(-math.inf,) * num, spreads=(Spread(),) * num)

    def process(self, state: LiveState, line: bytes) -> tuple[LiveState, tuple[Answer, ...]]:
        """Process a line, and answer with the estimates and, if one was due, a plan, or with the error in the line.

        Returns:
            The state after the line, and the answers. `encode_line` converts each into a line.
        """
        state = replace(state, num_lines=state.num_lines + 1)
        place = f"line {state.num_lines}"
        try:
            message = read_message(line, place, self.sites, self.conventions, self.origin)
            checked, time = self._on_clock(state, message, place)
            if checked.claimants:
                expected = f"at most {self.max_lead:g} s after the latest, or {_MIN_AGREEING} scans in a row that agree"
                expected += f" ({_MIN_AGREEING_ALONE} of one sensor)" if len(self.sites) > 1 else ""
                fault = str(reject(f"{place}, time", expected, f"{time - (state.timeline.newest or 0.0):g} s after it"))
                return _error_answer(checked, fault)
            scan, num_beyond = self._drop_invalid(message.scan)
            checked, scan = self._merge_returns(checked, scan)
            timeline, _ = self.tracker.process(state.timeline, [replace(scan, time=time)])
            latest = list(state.latest)
            latest[message.scan.sensor] = max(latest[message.scan.sensor], time)
            processed = replace(checked, timeline=timeline, latest=tuple(latest))
            answer = self._estimates(processed) | ({"beyond": num_beyond} if num_beyond else {})
        except Exception as error:  # custom code may raise anything; the loop continues with the next line
            text = str(error) if isinstance(error, VedetteError) else error_cause(error)
            return _error_answer(state, text if text.startswith(place) else f"{place}: {text}")
        processed, remarks = self._tested(state, processed)
        if self._is_due(processed):
            processed, plan = self._decide(processed)
            return processed, (answer, *remarks, plan)
        return processed, (answer, *remarks)

    def _tested(self, before: LiveState, after: LiveState) -> tuple[LiveState, tuple[Answer, ...]]:
        """Return the state with its fit to the instants that left the timeline, and an answer if findings changed."""
        if self.assumed is None:
            return after, ()
        try:
            fit = before.fit.continued(before.timeline, after.timeline, self.estimate, self.assumed)
        except Exception as error:  # of custom models; tests never stop the stream
            fit = LiveFit(searched=f"nothing, as {error_cause(error)}")
        if fit.found is before.fit.found:  # most lines test nothing
            return replace(after, fit=fit), ()
        new, gone = fit.without(before.fit.fit.findings), before.fit.without(fit.fit.findings)
        remark = {"line": after.num_lines, **self._line_time(after, after.timeline.newest or 0.0)}
        remark["fit"] = {"new": [x.text for x in new], "gone": [x.text for x in gone], **fit.fit.to_dict()}
        return replace(after, fit=fit), (remark,) if new or gone else ()

    def _drop_invalid(self, scan: SensorScan) -> tuple[SensorScan, int]:
        """Return the scan without measurements outside `valid_area` or the sensor's reach, and the number removed."""
        site, pose = self.sites[scan.sensor], np.asarray(scan.pose)
        if self.valid_area is None or site.kind not in PLACED:
            return scan, 0
        rows = as_scan(scan.measurements)
        places = places_of(rows, pose, site.kind)
        inside = is_within(places, self.valid_area) & ~beyond_reach(places, pose[:2], site.reach)
        return replace(scan, measurements=rows[inside]), int(np.count_nonzero(~inside))

    def _merge_returns(self, state: LiveState, scan: SensorScan) -> tuple[LiveState, SensorScan]:
        """Return the scan with one measurement a target. Its noise grows by the spread of all returns so far."""
        s, rows = scan.sensor, as_scan(scan.measurements)
        if not self.extents or self.extents[s] <= 0.0 or not len(rows):
            return state, scan
        kind = self.sites[s].kind
        means, _, own = merged_scan(rows, np.asarray(scan.pose), kind, self.extents[s])
        spread = state.spreads[s] + own
        state = replace(state, spreads=(*state.spreads[:s], spread, *state.spreads[s + 1 :]))
        return state, replace(scan, measurements=spread.added_to(means, kind) if spread.squares else means)

    def _on_clock(self, state: LiveState, message: Message, place: str) -> tuple[LiveState, float]:
        """Return the state with the form and offset of times set, and the scan's time on the clock of the tracker.

        The state has claimants if the scan's time is not accepted.
        """
        line_time = message.scan.time
        if state.start is None:
            start = line_time - self.first_time if message.is_utc else 0.0
            time = line_time - start
            state = replace(state, start=start, is_utc=message.is_utc, due=self._next_decision_time(time, time))
        elif message.is_utc != state.is_utc:
            given = utc_text(line_time) if message.is_utc else f"{line_time:g}"
            raise reject(f"{place}, time", "dates, as before" if state.is_utc else "seconds, as before", given)
        assert state.start is not None
        time, newest = line_time - state.start, state.timeline.newest
        if newest is None or time <= newest + self.max_lead:
            return replace(state, claimed=math.inf, claimants=()), time
        agreed = state.claimants if abs(time - state.claimed) <= self.max_lead else ()
        claimants = (*agreed, message.scan.sensor)
        needed = _MIN_AGREEING if len(set(claimants)) > 1 or len(self.sites) == 1 else _MIN_AGREEING_ALONE
        return replace(state, claimed=time, claimants=() if len(claimants) >= needed else claimants), time

    def _line_time(self, state: LiveState, time: float) -> Answer:
        """Return a time of the tracker's clock in the form of times in lines."""
        line_time = time + (state.start or 0.0)
        return {"time": line_time, "utc": utc_text(line_time)} if state.is_utc else {"time": line_time}

    def _estimates(self, state: LiveState) -> Answer:
        timeline = state.timeline
        belief = timeline.state
        assert belief.time is not None  # a scan was taken, or one before it
        estimate = self.estimate(belief.fused, belief.step)
        state_components = self.tracker.tracker.targets.motion.components
        tracks = track_answers(estimate, self.classes, self.modes, self.origin, self.compass, state_components)
        counts = {"late": timeline.num_late, "dropped": timeline.num_dropped, "repeated": timeline.num_repeated}
        return {"line": state.num_lines, **self._line_time(state, belief.time), "tracks": tracks, **counts}

    def _next_decision_time(self, first: float, now: float) -> float:
        """Return the time of the first decision after `now`, in s."""
        if self.planner is None:
            return math.inf
        if self.decide_every is not None:
            return first + (math.floor((now - first) / self.decide_every) + 1.0) * self.decide_every
        index = bisect_right(self.decision_times, now)
        return self.decision_times[index] if index < len(self.decision_times) else math.inf

    def _is_due(self, state: LiveState) -> bool:
        """Return True if all scans up to the time of the next decision have arrived, or a later one has."""
        newest = state.timeline.newest
        return newest is not None and (newest > state.due or min(state.latest) >= state.due)

    def _decide(self, state: LiveState) -> tuple[LiveState, Answer]:
        """Return the state after a decision from the current belief, and its plan or error."""
        assert self.planner is not None
        timeline, now = state.timeline, state.timeline.state.time
        assert now is not None
        after = replace(state, due=self._next_decision_time(state.due, now), num_decisions=state.num_decisions + 1)
        seeds = np.random.SeedSequence(self.seed, spawn_key=(0, PLANNER, state.num_decisions))
        try:
            plan = self.planner.plan(timeline.state, timeline.poses, rng=np.random.default_rng(seeds))
            answer = plan_answer(plan, [site.name for site in self.sites])
            return after, {"line": state.num_lines, "plan": {**self._line_time(state, now), **answer}}
        except Exception as error:  # as above; the scan itself was processed
            answer = {
                "line": state.num_lines,
                "error": f"line {state.num_lines}, plan at {now:g} s: {error_cause(error)}",
            }
            return replace(after, num_errors=after.num_errors + 1), answer


def _error_answer(state: LiveState, text: str) -> tuple[LiveState, tuple[Answer, ...]]:
    return replace(state, num_errors=state.num_errors + 1), ({"line": state.num_lines, "error": text},)
