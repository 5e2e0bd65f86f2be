"""Journal of a run in progress, so that a run that stops leaves a record of the finished scans."""

import sysconfig
import traceback
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from vedette.control import Plan
from vedette.densities import Estimate, UndetectedIntensity
from vedette.errors import VedetteError
from vedette.kernels.base.types import Bools, Floats
from vedette.simulation.health import Health
from vedette.simulation.records import Decision, RunRecord, ScansFile
from vedette.simulation.truth import Truth
from vedette.tracking import StageTimer, TrackerInfo, failed_stage

Score: TypeAlias = Callable[[Truth, Sequence[Estimate]], Floats]

# Stages of a run. The time of the tracker counts as filter time, except what it reports as fusion time.
STAGES = ("scans", "filter", "fusion", "estimate", "planning")
_LIBRARIES = (str(Path(__file__).parents[1]), *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")))


def error_cause(error: Exception) -> str:
    """Return the message of an error, with its type and place in the user's code if the library did not raise it."""
    if isinstance(error, VedetteError):
        return str(error)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not frame.filename.startswith(_LIBRARIES)]
    place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno}, {frames[-1].name})" if frames else ""
    return f"{type(error).__name__}: {error}{place}"


class RunStopped(VedetteError):
    """A filter, a fusion, an estimator or a planner raised during a run, chained from that error.

    Attributes:
        step: scan at which it happened, counted from 1.
        time: time of that scan, s.
        stage: stage that failed, in words: "the filter of sensor 2".
        record: record of the finished scans, with the message in its field `stopped`, or None if there are none.
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
    """Ctrl-C during a run.

    Attributes:
        record: record of the finished scans, with the message in its field `stopped`, or None if there are none.
    """

    def __init__(self, message: str, record: RunRecord | None) -> None:
        super().__init__(message)
        self.record = record


class Journal:
    """Scans of a run that have an estimate. `step` is the present scan, counted from 1."""

    def __init__(
        self,
        scenario: str,
        planner: str,
        seed: int,
        run: int,
        truth: Truth,
        num_sensors: int,
        file: ScansFile | None = None,
    ) -> None:
        """Create an empty journal. file: file of recorded scans. None: scans are simulated."""
        self.scenario, self.planner, self.seed, self.run = scenario, planner, seed, run
        self.truth, self.file = truth, file
        self.step = 1
        self.estimates: list[Estimate] = []
        self._poses: list[Floats] = []
        self._off: list[Bools] = []
        self._decisions: list[Decision] = []
        self.health = Health.unreported(truth.num_scans, num_sensors)
        self._clocks: list[StageTimer] = [StageTimer()]
        self._fusion: list[float] = []

    @property
    def time(self) -> float:
        """Time of the present scan, s."""
        return float(self.truth.times[self.step - 1])

    def begin(self, step: int) -> StageTimer:
        """Start a scan, and return its stage timer."""
        self.step = step
        if step > 1:
            self._clocks.append(StageTimer())
        return self._clocks[-1]

    def timing(self, stage: str) -> AbstractContextManager[None]:
        """Context manager that times a stage of the present scan."""
        return self._clocks[-1].timing(stage)

    def note(self, poses: Floats, off: Bools, info: TrackerInfo, estimate: Estimate) -> None:
        """Record the present scan."""
        with self.timing("report of the tracker"):
            self.health.note_filters(self.step - 1, info.filters)
            self.health.note_fusion(self.step - 1, info.fusion)
            self.health.note_sent(self.step - 1, info.bytes_sent)
        self._fusion.append(float(info.seconds.get("fusion", 0.0)))
        self._poses.append(poses)
        self._off.append(off)
        self.estimates.append(estimate)

    def note_decision(self, plan: Plan, undetected: UndetectedIntensity | None = None, *, explain: bool) -> None:
        """Record the decision after the current scan, with its explanation if explanations are kept."""
        stored_plan = plan.without_evidence(explained=explain)
        stored_undetected = undetected if explain and stored_plan.explanation is not None else None
        self._decisions.append(Decision(self.step, self.time, self._poses[-1], stored_plan, stored_undetected))

    def stage(self, error: BaseException) -> str:
        """Return the stage that failed, in words."""
        return failed_stage(error) or "the movement of the sensors"

    def place(self, error: BaseException) -> str:
        """Return the run and the place in it where an error occurred, in words."""
        source = f"{self.planner}, seed {self.seed}, run {self.run}" if self.file is None else self.file.name
        place = f"step {self.step} of {self.truth.num_scans} ({self.time:g} s), in {self.stage(error)}"
        return f"{self.scenario}, {source}: stopped at {place}"

    def record(self, ospa: Floats, stopped: str | None = None) -> RunRecord:
        """Return the record of the scans that have an estimate."""
        num = len(self.estimates)
        return RunRecord(
            scenario=self.scenario,
            planner=self.planner,
            seed=self.seed,
            run=self.run,
            times=self.truth.times[:num],
            truth=self.truth.first(num),
            poses=np.array(self._poses[:num]),
            off=np.array(self._off[:num]),
            estimates=tuple(self.estimates),
            decisions=tuple(self._decisions),
            ospa=ospa,
            health=self.health.first(num),
            timings=self._timings(num),
            stopped=stopped,
            recording=self.file,
        )

    def _timings(self, num_scans: int) -> dict[str, Floats]:
        clocks, fusion = self._clocks[:num_scans], np.array(self._fusion[:num_scans])
        seconds = {stage: np.array([clock.seconds.get(stage, 0.0) for clock in clocks]) for stage in STAGES}
        return seconds | {"filter": np.maximum(seconds["filter"] - fusion, 0.0), "fusion": fusion}

    def _partial(self, score: Score | None, stopped: str) -> RunRecord | None:
        """Return the record of a run that stopped, or None if no scan is finished.

        OSPA is NaN if it cannot be computed.
        """
        if not self.estimates:
            return None
        try:
            return self.record(self._scored(score), stopped)
        except VedetteError:
            return self.record(self._scored(None), stopped)

    def _scored(self, score: Score | None) -> Floats:
        num = len(self.estimates)
        return np.full((num, 3), np.nan) if score is None else score(self.truth.first(num), self.estimates)

    def run_of(self, go: Callable[[], None], score: Score | None) -> RunRecord:
        """Return the record of a run. `go` processes its scans and notes each of them here.

        Args:
            go: processes the scans, one after the other.
            score: (num_scans, 3) OSPA of the estimates against the truth. None: NaN.

        Raises:
            RunStopped: `go` or the score raised. It is chained from that.
            RunInterrupted: a `KeyboardInterrupt`, likewise.
        """
        try:
            go()
            with self.timing("score"):
                return self.record(self._scored(score))
        except KeyboardInterrupt as interrupt:
            message = f"{self.place(interrupt)}: interrupted"
            raise RunInterrupted(message, self._partial(score, message)) from interrupt
        except Exception as error:
            message = f"{self.place(error)}: {error_cause(error)}"
            record = self._partial(score, message)
            raise RunStopped(message, self.step, self.time, self.stage(error), record) from error
