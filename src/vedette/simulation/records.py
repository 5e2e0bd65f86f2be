"""Records of runs."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from vedette.control.plan import Plan
from vedette.densities import Estimate, UndetectedIntensity
from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr, TabularRepr
from vedette.internal.text import elided, pluralise
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.simulation.arrow import Columns
from vedette.simulation.health import FUSION_COLUMNS, Health
from vedette.simulation.truth import Truth

OSPA_COLUMNS = ("ospa_m", "localisation_m", "cardinality_m")


@dataclass(frozen=True, slots=True, repr=False)
class Decision(SummaryRepr):
    """A plan with its time.

    Attributes:
        step: number of the scan, from 1, after which the plan was made.
        time: time of that scan, s.
        poses: (num_sensors, 3 or more) poses [px, py, heading_rad, ...] of the sensors at that scan.
        plan: the chosen actions and their rewards.
        undetected: intensity of undetected targets, for search planners. None: not known, or not stored.
    """

    step: int
    time: float
    poses: Floats
    plan: Plan
    undetected: UndetectedIntensity | None = None

    def _summary(self) -> str:
        return f"after scan {self.step}, at {self.time:g} s: {self.plan.in_short()}"

    def _detail(self) -> str:
        return self.plan._detail()

    def check(self, times: Floats, poses: Floats) -> None:
        """Raise `InputError` unless the plan is valid, and time and poses are those of its scan of the run."""
        if not 1 <= self.step <= len(times):
            raise InputError(f"record.decisions: expected a step of 1 to {len(times)}; got {self.step}")
        if self.time != times[self.step - 1]:
            raise InputError(
                f"record.decisions: expected the time {times[self.step - 1]:g} s of step {self.step}; got {self.time:g}"
            )
        if not np.array_equal(self.poses, poses[self.step - 1]):
            raise InputError(f"record.decisions: expected the poses of step {self.step}; got others")
        if self.plan.num_sensors != len(self.poses):
            raise InputError(f"plan: expected {len(self.poses)} sensors; got {self.plan.num_sensors}")
        self.plan.validate()


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Part of a record that comparisons and reports use: no targets or tracks."""

    scenario: str  # as in the record, without explanations
    seed: int  # as in the record, without explanations
    run: int  # as in the record, without explanations
    times: Floats  # as in the record, without explanations
    decisions: tuple[Decision, ...]  # as in the record, without explanations
    ospa: Floats  # as in the record, without explanations
    num_targets: Ints  # (num_scans,) number of true targets
    health: Health  # as in the record, without explanations
    timings: dict[str, Floats]  # as in the record, without explanations


class ScansFile(NamedTuple):
    """File of recorded scans: its name without folders, and its SHA-256, "" for columns in memory."""

    name: str = "recorded scans"
    sha256: str = ""


@dataclass(frozen=True, slots=True, repr=False)
class RunRecord(TabularRepr):
    """Record of one run of one strategy on one scenario.

    Attributes:
        scenario: name of the scenario.
        planner: name of the strategy.
        seed: seed of the campaign. With `run` it determines every random number, for recorded scans only those of
            filters that draw.
        run: index of the run within the campaign.
        times: (num_scans,) s.
        truth: the targets, scan by scan.
        poses: (num_scans, num_sensors, 3 or more) sensor poses [px, py, heading_rad, ...] at each scan.
        off: (num_scans, num_sensors) whether the action of a sensor switched it off.
        estimates: one per scan.
        decisions: in order of time.
        ospa: (num_scans, 3) total, localisation and cardinality parts, m, without unit if whole states are compared.
        health: reports of the filters and the fusion.
        timings: for each stage (`scans`, `filter`, `fusion`, `estimate`, `planning`), (num_scans,) wall time at each
            scan, s, the only content that the seed does not determine.
        stopped: where and why the run ended before its last scan. None: it did not.
        recording: file of recorded scans. None: the scans were simulated.
    """

    scenario: str
    planner: str
    seed: int
    run: int
    times: Floats
    truth: Truth
    poses: Floats
    off: Bools
    estimates: tuple[Estimate, ...]
    decisions: tuple[Decision, ...]
    ospa: Floats
    health: Health
    timings: dict[str, Floats]
    stopped: str | None = None
    recording: ScansFile | None = None

    @property
    def source(self) -> str:
        """Source of the scans in words: `run 3`, or the file name of a recording."""
        return f"run {self.run}" if self.recording is None else self.recording.name

    @property
    def num_scans(self) -> int:
        """Number of scans."""
        return len(self.times)

    @property
    def num_sensors(self) -> int:
        """Number of sensors."""
        return int(self.poses.shape[1])

    def summary(self) -> RunSummary:
        """Return the part of the record that comparisons and reports use."""
        identity = (self.scenario, self.seed, self.run, self.times, self.decisions)
        return RunSummary(*identity, self.ospa, np.diff(self.truth.offsets), self.health, self.timings)

    def scan_columns(self) -> Columns:
        """Return the table `scans` of a saved run, one row per scan. See docs/results.md."""
        return {
            "step": np.arange(1, self.num_scans + 1),
            "time_s": self.times,
            "num_targets": np.diff(self.truth.offsets),
            "num_estimates": np.array([estimate.num_targets for estimate in self.estimates], np.int64),
            **dict(zip(OSPA_COLUMNS, self.ospa.T, strict=True)),
            **{name: getattr(self.health, name) for name in FUSION_COLUMNS},
        }

    def to_table(self) -> dict[str, list[Any]]:
        """Return the table `scans` as lists."""
        return {name: np.asarray(column).tolist() for name, column in self.scan_columns().items()}

    def check(self) -> None:
        """Raise `InputError` for a record that contradicts itself or holds an invalid plan."""
        num_scans = self.num_scans
        if num_scans == 0:
            raise InputError("record.times: expected one scan or more; got none")
        if not np.array_equal(self.truth.times, self.times):
            raise InputError("record.truth: expected the scan times of the record; got others")
        self.truth.validate()
        lengths = {"estimates": len(self.estimates), "poses": len(self.poses)}
        lengths |= {f"timings[{stage!r}]": len(seconds) for stage, seconds in self.timings.items()}
        for name, length in lengths.items():
            if length != num_scans:
                raise InputError(f"record.{name}: expected one entry for each of {num_scans} scans; got {length}")
        if self.ospa.shape != (num_scans, 3):
            raise InputError(f"record.ospa: expected shape {(num_scans, 3)}; got {self.ospa.shape}")
        if self.off.shape != self.poses.shape[:2] or self.off.dtype != np.bool_:
            raise InputError(f"record.off: expected booleans of {self.poses.shape[:2]}; got {self.off.shape}")
        self.health.check(num_scans, self.num_sensors)
        if self.recording is not None and self.decisions:
            raise InputError(f"record.decisions: expected none of a recording; got {len(self.decisions)}")
        for decision in self.decisions:
            decision.check(self.times, self.poses)

    def _summary(self) -> str:
        defined = self.ospa[:, 0][~np.isnan(self.ospa[:, 0])]
        error = f", mean OSPA {defined.mean():.4g}" if len(defined) else ""
        drawn = f"by {elided(self.planner)}, seed {self.seed}, run {self.run}"
        origin = f"of {elided(self.scenario)} {drawn if self.recording is None else f'from {elided(self.source)}'}"
        sizes = f"{pluralise(self.num_scans, 'scan')}, {pluralise(self.num_sensors, 'sensor')}"
        return f"{origin}: {sizes}, {pluralise(len(self.decisions), 'decision')}{error}"

    def _detail(self) -> str:
        return "" if self.stopped is None else f"stopped: {self.stopped}"


class Measure(Protocol):
    """Metric of a run."""

    def __call__(self, record: RunRecord) -> Any:
        """(num_scans,) numbers, NaN where undefined."""
