"""Distributed tracker: every sensor filters its own scans, and the beliefs are fused (paper, Algorithm 1)."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import FilterInfo
from vedette.fusion import FieldsOfView, Fusion, LabelMatchedFusion, SupportsLabelMatching, requires_common_prior
from vedette.kernels.base.types import Floats
from vedette.models import MeasurementBirth, TargetModel
from vedette.models.arguments import flag, instance, probability
from vedette.tracking.base import StageTimer, State, TrackerInfo, belief_bytes, check_step
from vedette.tracking.births import birth_candidates, births_from_scans, combine_births
from vedette.tracking.local import LocalFilters
from vedette.tracking.lost_labels import drop_forgotten_labels, undetected_intensity


@dataclass(frozen=True, slots=True, eq=False)
class Distributed(LocalFilters):
    """Tracker with a filter at each sensor and a fusion of their beliefs.

    Attributes:
        filters: one per sensor. All have the same target model.
        targets, sensors: as in `Tracker`.
        fusion: fusion of the beliefs after every scan, or None for a single sensor.
        feedback: True if the fused belief replaces the sensors' own (paper-notes 9). Without feedback, a fusion by
            views counts a sensor that did not scan as if it had, because its belief is its own, from its earlier scans.
        min_detection: without feedback and with births from measurements, a sensor drops labels that it would detect
            with less than this probability, once a birth would have more information (`drop_forgotten_labels`).
            Otherwise they would accumulate and be matched with other labels nearby. Their existence is added to
            `FilterInfo.dropped_existence`. 0: none is dropped.

    Raises:
        InputError: no filter, an object that is not a filter, filters with different target models, or several sensors
            without a fusion; without feedback, a fusion of beliefs that share their prediction, or births from
            measurements with a fusion by label; a `min_detection` that is not a probability.
    """

    fusion: Fusion | None = None
    feedback: bool = False
    min_detection: float = 0.1
    _requires_common_prior: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        LocalFilters.__post_init__(self)  # slots replace the class that super() looks for
        if self.fusion is None and len(self.filters) > 1:
            raise InputError(f"fusion: expected one for {len(self.filters)} sensors; got none")
        if self.fusion is not None:
            instance("fusion", self.fusion, Fusion)
        object.__setattr__(self, "_requires_common_prior", requires_common_prior(self.fusion))
        flag("feedback", self.feedback)
        probability("Distributed.min_detection", self.min_detection)
        if self.feedback or self.fusion is None:
            return
        if self._requires_common_prior:
            raise InputError("feedback: expected true, as the fusion is of beliefs that share their prediction")
        if len(self.filters) > 1:  # one sensor has nothing to match its labels with
            check_birth_labels(self.fusion, self.targets)

    def initial(self) -> State:
        """Return the state without targets. Its fused belief is the first sensor's."""
        local = tuple(local.initial() for local in self.filters)
        return State(local, local[0], undetected=undetected_intensity(local[0], self.targets.birth))

    def step(
        self, state: State, scans: Sequence[Any], poses: Any, time: float, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[State, TrackerInfo]:
        """Filter each sensor's scan, then fuse the beliefs. See `Tracker.step`."""
        pose_array, dt = check_step(state, scans, poses, time, rngs, self, len(self.filters))
        step, timer, num, birth = state.step + 1, StageTimer(), len(self.filters), self.birth
        births: Sequence[LMB | None] = (None,) * num
        if birth.from_measurements is not None:
            births = [birth_candidates(birth, step, dt, candidates) for candidates in state.memory or births]
        prediction, local, infos, scanned = None, [], [], []
        if self._requires_common_prior:
            with timer.timing("filter"):
                prediction, _ = self._predict(0, state.fused, dt, step, births[0])
        for s in range(num):
            with timer.timing("filter", s):
                if prediction is None:
                    belief, info = self._step_filter(
                        s, state.local[s], scans[s], pose_array[s], dt, step, births[s], rngs[s]
                    )
                else:
                    belief, info = self._update(s, prediction, scans[s], pose_array[s], rngs[s])
            local.append(belief)
            infos.append(info)
            # Without feedback, a sensor's belief still has the information of its earlier scans.
            scanned.append(scans[s] is not None or not self.feedback)
        fused, report, measured, rule = local[0], None, None, self.fusion
        sent: tuple[int, ...] = ()
        if rule is not None:
            sent = tuple(map(belief_bytes, local))
            views = FieldsOfView(self.sensors, pose_array, tuple(scanned), prediction)
            with timer.timing("fusion"):
                if birth.from_measurements is not None and not self.feedback and self.min_detection > 0.0:
                    local, infos = self._drop_forgotten(birth.from_measurements, local, infos, views)
                beliefs = self._for_fusion(local)
                if isinstance(rule, LabelMatchedFusion):
                    # The sensors keep the matched labels, which outlast the sensor that made them; decisions need them.
                    local, rule = rule.match(beliefs), rule.rule
                    beliefs = self._for_fusion(local)
                fused, report = rule.fuse(beliefs, views)
        if prediction is not None:
            fused = self._drop_labels(fused)
        if self.feedback:
            local = [self._as_filter_density(fused)] * num
        if birth.from_measurements is not None:
            with timer.timing("births"):
                measured = self._measured_births(local, scans, pose_array, step + 1)
                if dt == 0.0:
                    measured = tuple(
                        combine_births(birth, *candidates) for candidates in zip(state.memory, measured, strict=True)
                    )
        tracker_info = TrackerInfo(tuple(infos), report, timer.seconds, sent)
        undetected = undetected_intensity(fused, self.targets.birth)
        return State(tuple(local), fused, step, float(time), measured, undetected), tracker_info

    def _drop_forgotten(
        self, birth: MeasurementBirth, local: list[Any], infos: list[FilterInfo], views: FieldsOfView
    ) -> tuple[list[Any], list[FilterInfo]]:
        """Return the sensors' beliefs without forgotten labels, and their reports with the dropped existence."""
        kept, dropped = zip(
            *(drop_forgotten_labels(belief, birth, views, s, self.min_detection) for s, belief in enumerate(local)),
            strict=True,
        )
        reports = [
            replace(info, dropped_existence=info.dropped_existence + lost)
            for info, lost in zip(infos, dropped, strict=True)
        ]
        return list(kept), reports

    def _measured_births(
        self, local: Sequence[Any], scans: Sequence[Any], poses: Floats, step: int
    ) -> tuple[LMB | None, ...]:
        """Return each sensor's birth candidates for `step`, as one object for all sensors if they share a belief."""
        birth, sensors, motion = self.birth, self.sensors, self.targets.motion
        if self.feedback or len(local) == 1:
            return (births_from_scans(birth, local[0], sensors, scans, poses, step, motion=motion),) * len(local)
        return tuple(
            births_from_scans(
                birth, belief, sensors[s : s + 1], scans[s : s + 1], poses[s : s + 1], step, owner=s, motion=motion
            )
            for s, belief in enumerate(local)
        )


def check_birth_labels(fusion: Fusion, targets: TargetModel) -> None:
    """Raise `InputError` if sensors label births from their own measurements and the fusion is by label.

    A fusion that divides by a common prediction is accepted: a tracker gives it the labels of that prediction.
    """
    if targets.birth.from_measurements is None or requires_common_prior(fusion):
        return
    if not (isinstance(fusion, SupportsLabelMatching) and fusion.matches_labels):
        raise InputError(
            "fusion: expected one that matches labels, as sensors that do not share all they know make their own from "
            f"their measurements; got {type(fusion).__name__}, which fuses by label"
        )
