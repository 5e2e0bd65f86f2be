"""What a run has brought so far, and where it is; so that a run that stops leaves what was finished."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import TypeAlias

import numpy as np

from vedette.control import Plan
from vedette.densities import Estimate, UndetectedIntensity
from vedette.errors import VedetteError
from vedette.kernels.base.types import Bools, Floats
from vedette.simulation.health import Health
from vedette.simulation.records import Decision, RunRecord, ScansFile
from vedette.simulation.truth import Truth
from vedette.tracking import Stages, TrackerInfo, stage_of

Score: TypeAlias = Callable[[Truth, Sequence[Estimate]], Floats]

# What the time of a run is spent on. A tracker's own time is the filters', but for what it says was the fusion's.
STAGES = ("scans", "filter", "fusion", "estimate", "planning")


class Journal:
    """The scans of a run that have an estimate; `step` is the scan at hand, counted from 1."""

    def __init__(
        self,
        scenario: str,
        planner: str,
        seed: int,
        run: int,
        truth: Truth,
        num_sensors: int,
        *,
        explain: bool = True,
        recording: ScansFile | None = None,
    ) -> None:
        """Before the first scan; the arguments are those of the record, and whether explanations are kept."""
        self.scenario, self.planner, self.seed, self.run = scenario, planner, seed, run
        self.truth, self.recording, self._explain = truth, recording, explain
        self.step = 1
        self.estimates: list[Estimate] = []
        self._poses: list[Floats] = []
        self._off: list[Bools] = []
        self._decisions: list[Decision] = []
        self.health = Health.unreported(truth.num_scans, num_sensors)
        self._clocks: list[Stages] = [Stages()]
        self._fusion: list[float] = []

    @property
    def time(self) -> float:
        """Of the scan at hand, s."""
        return float(self.truth.times[self.step - 1])

    def begin(self, step: int) -> Stages:
        """Turn to a scan; its stopwatch."""
        self.step = step
        if step > 1:
            self._clocks.append(Stages())
        return self._clocks[-1]

    def timing(self, stage: str) -> AbstractContextManager[None]:
        """Take the time of a stage of the scan at hand."""
        return self._clocks[-1].timing(stage)

    def note(self, poses: Floats, off: Bools, info: TrackerInfo, estimate: Estimate) -> None:
        """Write down the scan at hand."""
        with self.timing("report of the tracker"):
            self.health.note_filters(self.step - 1, info.filters)
            self.health.note_fusion(self.step - 1, info.fusion)
            self.health.note_sent(self.step - 1, info.bytes_sent)
        self._fusion.append(float(info.seconds.get("fusion", 0.0)))
        self._poses.append(poses)
        self._off.append(off)
        self.estimates.append(estimate)

    def decide(self, plan: Plan, undetected: UndetectedIntensity | None = None) -> None:
        """Record the decision after the current scan, with its explanation if explanations are kept."""
        kept = plan.settled(explained=self._explain)
        found = undetected if self._explain and kept.explanation is not None else None
        self._decisions.append(Decision(self.step, self.time, self._poses[-1], kept, found))

    def stage(self, error: BaseException) -> str:
        """What was under way, in words."""
        return stage_of(error) or "the movement of the sensors"

    def place(self, error: BaseException) -> str:
        """Which run, where in it."""
        whose = f"{self.planner}, seed {self.seed}, run {self.run}" if self.recording is None else self.recording.name
        return (
            f"{self.scenario}, {whose}: stopped at step {self.step} of {self.truth.num_scans} ({self.time:g} s), in "
            f"{self.stage(error)}"
        )

    def record(self, ospa: Floats, stopped: str | None = None) -> RunRecord:
        """Of the scans that have an estimate."""
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
            recording=self.recording,
        )

    def _timings(self, num_scans: int) -> dict[str, Floats]:
        clocks, fusion = self._clocks[:num_scans], np.array(self._fusion[:num_scans])
        spent = {stage: np.array([clock.seconds.get(stage, 0.0) for clock in clocks]) for stage in STAGES}
        return spent | {"filter": np.maximum(spent["filter"] - fusion, 0.0), "fusion": fusion}

    def partial(self, score: Score, stopped: str) -> RunRecord | None:
        """The record of a run that stopped; None where no scan was finished. OSPA is NaN where it cannot be had."""
        num = len(self.estimates)
        if num == 0:
            return None
        try:
            ospa = score(self.truth.first(num), self.estimates)
        except VedetteError:
            ospa = np.full((num, 3), np.nan)
        return self.record(ospa, stopped)
