"""Central filters: one belief, updated by the scans that several sensors have taken at one time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.errors import InputError, NumericalError
from vedette.filters.info import FilterInfo
from vedette.filters.inputs import births_at, check_belief, check_scan, check_step, model_errors
from vedette.filters.limits import Limits
from vedette.kernels.base.types import Floats, ScanInput
from vedette.kernels.labelled.conversions import marginalise
from vedette.kernels.steps.glmb import StepReport, step_ranked
from vedette.kernels.steps.multi_sensor_combinations import SensorReport, extend_combinations, predict_combinations
from vedette.kernels.steps.multi_sensor_glmb import update_ranked
from vedette.kernels.steps.multi_sensor_lmb import update_lmb
from vedette.models import SensorModel, TargetModel, kernel_motion
from vedette.models.arguments import generator, pose_vector, positive


class _Look(NamedTuple):
    """One sensor's scan from one pose."""

    sensor: SensorModel
    scan: Floats
    pose: Floats


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorFilter:
    """The parts of a filter of several sensors.

    Attributes:
        targets: how targets move, live on and appear.
        sensors: what each sensor sees of them; they may measure different things.
        limits: caps and thresholds.

    Raises:
        InputError: a part of another kind, or no sensor.
    """

    targets: TargetModel
    sensors: tuple[SensorModel, ...]
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        for name, kind in (("targets", TargetModel), ("limits", Limits)):
            value = getattr(self, name)
            if not isinstance(value, kind):
                raise InputError(f"{name}: expected a {kind.__name__}; got {type(value).__name__}")
        if not isinstance(self.sensors, Sequence) or len(self.sensors) == 0:
            raise InputError(f"sensors: expected a sequence of at least one SensorModel; got {self.sensors!r}")
        for s, sensor in enumerate(self.sensors):
            if not isinstance(sensor, SensorModel):
                raise InputError(f"sensors[{s}]: expected a SensorModel; got {type(sensor).__name__}")
        object.__setattr__(self, "sensors", tuple(self.sensors))

    def _looks(self, scans: Any, poses: Any, rng: Any) -> tuple[list[_Look], int]:
        """What each sensor saw and from where, and how many measurements repeat another."""
        generator(rng)
        for name, given in (("scans", scans), ("poses", poses)):
            if given is None or len(given) != len(self.sensors):
                came = "None" if given is None else len(given)
                raise InputError(f"{name}: expected {len(self.sensors)}, one a sensor; got {came}")
        looks, num_duplicates = [], 0
        for s, sensor in enumerate(self.sensors):
            try:
                scan, num = check_scan(scans[s], sensor.measurement)
            except InputError as error:
                raise InputError(f"scans[{s}]: {error}") from None
            looks.append(_Look(sensor, scan, pose_vector(f"poses[{s}]", poses[s])))
            num_duplicates += num
        return looks, num_duplicates

    def _log_likelihood(self, log_total: float, reports: Sequence[SensorReport | StepReport]) -> float:
        """From joint weights relative to clutter to a density of the scans."""
        return log_total + sum(
            report.log_clutter - sensor.clutter.rate for report, sensor in zip(reports, self.sensors, strict=True)
        )


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorLmbFilter(MultiSensorFilter):
    """LMB filter of several sensors: the existences and densities of the exact posterior given all scans of a time.

    Every track is weighed under each combination of a miss or a gated measurement at every sensor, and the combinations
    of all tracks are summed jointly, no measurement twice; the posterior is projected to an LMB once, not after each
    sensor. The order of the sensors does not matter where models are linear and neither noise nor detection depends on
    the state; else a later sensor's model is linearised, and its noise and detection are taken, at what the earlier
    ones have left.

    What is cut, by `limits`, and counted: combinations of a track that are surely less probable than `min_existence`,
    or beyond the `max_hypotheses` heaviest at a sensor (`search_cut`; counted as they weigh there, before later sensors
    speak); and in a cluster of tracks that contend for many measurements, sets of taken measurements beyond the
    `max_hypotheses` heaviest, or lighter than `min_relative_weight` times the heaviest (`num_inexact_clusters`). All of
    it is in `discarded_weight_bound`. The number of combinations grows exponentially with the number of sensors that
    see a track, up to `max_hypotheses`.

    Attributes and errors: as `MultiSensorGlmbFilter`.
    """

    def initial(self) -> LMB:
        """The belief before the first scans: no target."""
        return LMB.empty(self.targets.state_dim)

    def step(
        self, belief: GLMB | LMB, scans: Any, poses: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[LMB, FilterInfo]:
        """Predict over `dt` seconds and update; arguments, results and errors as `MultiSensorGlmbFilter.step`.

        Nothing is drawn from `rng`; it is taken so that filters are interchangeable.
        """
        looks, num_duplicates = self._looks(scans, poses, rng)
        targets, limits = self.targets, self.limits
        prior = check_belief(belief, LMB, targets.state_dim)
        births = births_at(targets.birth, check_step(step, targets.birth, prior))
        motion, num_columns, reports = kernel_motion(targets.motion, targets.survival), 0, []
        reduction = limits.reduction()
        # A label that cannot exist has no density to be kept with.
        reduction = reduction._replace(min_existence_logit=max(reduction.min_existence_logit, -1e300))
        with model_errors():
            inputs = [ScanInput(births.to_kernel(), scan, pose, positive("dt", dt)) for _, scan, pose in looks]
            combinations = predict_combinations(prior.to_kernel(), inputs[0], len(looks), motion)
            for s, (sensor, scan, _) in enumerate(looks):
                truncation = limits.truncation(sensor.meas_dim)
                combinations, report = extend_combinations(
                    combinations, s, num_columns, inputs[s], sensor.to_kernel(), truncation
                )
                num_columns += len(scan)
                reports.append(report)
            posterior, joint = update_lmb(combinations, num_columns, truncation, reduction)
        if not math.isfinite(joint.sums.log_total):
            raise NumericalError(f"step {step}: no association has positive weight; do the models forbid these scans?")
        log_kept = joint.sums.log_kept + sum(report.log_kept for report in reports)
        info = FilterInfo(
            log_likelihood=self._log_likelihood(joint.sums.log_total, reports),
            num_hypotheses=1,
            num_tracks=len(posterior.existence_logit),
            discarded_weight_bound=max(0.0, -math.expm1(log_kept)),
            dropped_existence=float(joint.dropped_existence),
            num_clutter_raised=sum(int(report.num_raised) for report in reports),
            num_duplicates=num_duplicates,
            num_inexact_clusters=int(joint.sums.num_ranked),
            search_cut=any(report.log_kept < 0.0 for report in reports),
            cap_met=len(posterior.existence_logit) >= limits.max_labels,
        )
        return LMB.from_kernel(posterior), info


@dataclass(frozen=True, slots=True, eq=False)
class MultiSensorGlmbFilter(MultiSensorFilter):
    """delta-GLMB filter of several sensors: one prediction, then an update by each sensor's scan in turn.

    Without caps the posterior is the multi-sensor delta-GLMB (Vo, Vo and Beard 2019), whatever the order of the
    sensors, where models are linear and neither noise nor detection depends on the state; else a later sensor's model
    is linearised, and its noise and detection are taken, at what the earlier ones have left.

    With caps, hypotheses are cut after every sensor as they weigh then. One that the first sensors make unlikely is
    gone even where a later one would have raised it, so that the order of the sensors matters a little.
    `discarded_weight_bound` counts what is left out at each sensor by its weight there.

    Attributes:
        targets: how targets move, live on and appear.
        sensors: what each sensor sees of them; they may measure different things.
        limits: caps and thresholds.
        marginalised: collapse the posterior to one hypothesis a label set after each step, as `DeltaGlmbFilter`.

    Raises:
        InputError: a part of another kind, or no sensor.
    """

    marginalised: bool = False

    def initial(self) -> GLMB:
        """The belief before the first scans: no target."""
        return GLMB.empty(self.targets.state_dim)

    def step(
        self, belief: GLMB | LMB, scans: Any, poses: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[GLMB, FilterInfo]:
        """Predict over `dt` seconds and update with the scans of all sensors.

        Args:
            belief: posterior of the previous step.
            scans: one a sensor, in their order: (num, meas_dim) measurements in any order; angles in radians, in
                (-pi, pi].
            poses: one a sensor: [px, py, heading_rad, ...].
            dt: seconds since the previous step.
            step: number of this step, from 1 on; births are labelled with it.
            rng: nothing is drawn from it; it is taken so that filters are interchangeable.

        Returns:
            The posterior and a report on all scans together: log likelihoods, counts and bounds of all sensors.

        Raises:
            InputError: not one scan and one pose a sensor, or one of the wrong shape or kind; an angle beyond a full
                turn; a step below 1.
            ModelError: a model function raised or gave a value that is none of its kind.
            NumericalError: no hypothesis has positive weight.
        """
        looks, num_duplicates = self._looks(scans, poses, rng)
        targets, limits = self.targets, self.limits
        prior = check_belief(belief, GLMB, targets.state_dim)
        births = births_at(targets.birth, check_step(step, targets.birth, prior))
        posterior, reports, cap_met = prior.to_kernel(), [], False
        for s, (sensor, scan, pose) in enumerate(looks):
            given = ScanInput(births.to_kernel(), scan, pose, positive("dt", dt))
            own = (sensor.to_kernel(), limits.truncation(sensor.meas_dim))
            with model_errors():
                if s == 0:
                    motion = kernel_motion(targets.motion, targets.survival)
                    posterior, report = step_ranked(posterior, given, motion, *own)
                else:
                    posterior, report = update_ranked(posterior, given, *own)
            if len(posterior.hyp_log_weights) == 0:
                raise NumericalError(
                    f"step {step}, sensor {s}: no hypothesis has positive weight; do the models forbid this scan?"
                )
            reports.append(report)
            cap_met = cap_met or len(posterior.hyp_log_weights) >= limits.max_hypotheses
        if self.marginalised:
            posterior = marginalise(posterior, limits.track_caps())
        log_kept = sum(min(0.0, report.log_total - report.log_bound) for report in reports)
        info = FilterInfo(
            log_likelihood=self._log_likelihood(sum(report.log_total for report in reports), reports),
            num_hypotheses=len(posterior.hyp_log_weights),
            num_tracks=len(posterior.tracks.labels),
            discarded_weight_bound=-math.expm1(log_kept),
            dropped_existence=0.0,
            num_clutter_raised=sum(int(report.num_raised) for report in reports),
            num_duplicates=num_duplicates,
            num_inexact_clusters=0,
            search_cut=any(report.cut for report in reports),
            cap_met=cap_met,
        )
        return GLMB.from_kernel(posterior), info
