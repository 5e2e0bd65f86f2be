"""What a planner is told beside the models: how far it looks ahead, with how many samples, and at what cost."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from vedette.errors import InputError
from vedette.filters import Filter, Limits
from vedette.kernels.base.types import Bools, Floats
from vedette.kernels.planning.ideal import EXPECTED, IDEAL, SAMPLED
from vedette.models.arguments import (
    count,
    dimension,
    float_array,
    instance,
    non_negative,
    one_of,
    positive,
    probability,
    real,
    reject,
)
from vedette.platforms import Platform
from vedette.platforms.base import check_platform

# Of a search and the first round of a race (`vedette.control.rounds`).
_LEAST_SAMPLES = 24

IDEAL_MODES = {"ideal": IDEAL, "expected": EXPECTED, "sampled": SAMPLED}


def planning_limits() -> Limits:
    """Defaults of the pseudo-updates: few hypotheses, one Gaussian a track, and no label ever dropped."""
    return Limits(
        max_hypotheses=10, min_relative_weight=1e-5, min_track_weight=1.0, max_components=1, min_existence=0.0
    )


@dataclass(frozen=True, slots=True)
class PlanningSettings:
    """Horizon, samples and caps of a decision.

    Attributes:
        horizon_steps, horizon_period: H pseudo-updates, T seconds apart (paper: 5 and 2 s).
        num_samples: M multi-target samples, the same ones for every action and sensor (paper: 40). With `confidence`,
            as many as it takes, instead.
        ideal_measurements: "ideal": noise-free, of the sampled targets whose detection probability is at least
            `detection_threshold`; "expected": noise-free, each target seen with its detection probability, so that the
            mean over samples is the expectation over detections; "sampled": seen likewise, with measurement noise.
        detection_threshold: the probability from which on "ideal" measurements see a target (paper-notes 12).
        association: of LMBs. "known": each ideal measurement is of its own label or else clutter, so that labels are
            independent and rewards are sums over them, which is fast for any number of targets and sensors; "full":
            the filter's own update, which also asks which of several targets was measured.
        max_glmb_sensors, max_glmb_targets: with more sensors, or more targets expected, GLMBs are planned on their
            LMBs, which the plan then says.
        undetected_worth: of finding a target of `State.undetected`, in units of the reward (of the expected loss: m to
            the power of its order); 0: nobody is looked for. Targets not found are taken to stay where they are.
        end: s, time of the last scan, on the clock of `State.time`: no decision after it is planned for; None: none is.
        max_prior_hypotheses: heaviest hypotheses of each local posterior that enter the pseudo-updates. An LMB enters
            whole.
        max_version_divergence: nats within which a label's densities under two of these hypotheses are taken as one,
            the heavier hypothesis's; 0: none are.
        max_bound_work: ways to see a target, times samples, that are tried at most for the bound of a plan.
        confidence: with which the choice is to be the best of its candidates; samples are then added until it is, see
            `vedette.control.racing`. None: `num_samples`, whatever they can tell.
        indifference: with `confidence`, how much less than the best is good enough, relative to the magnitude of the
            best mean reward: 0.01 is one per cent of it.
        max_samples: with `confidence`, samples in all after which the decision is taken as it stands.
        max_seconds: s after which it is taken likewise, at the end of a round of samples; the first is always made. A
            plan then depends on how fast the machine is, not on its seed alone. None: no limit.
        limits: caps of the pseudo-updates, which are ranked, not Gibbs sampled, whatever the filter does. Every label
            set of the prior keeps its heaviest hypothesis beyond these caps, and an LMB keeps all its labels. Tracks
            that are mixtures are replaced by one Gaussian of their moments beforehand.
        num_threads: threads that share a decision; 0: one a processor. The result does not depend on it.

    Raises:
        InputError: a field out of range.
    """

    horizon_steps: int = 5
    horizon_period: float = 2.0
    num_samples: int = 40
    ideal_measurements: Literal["ideal", "expected", "sampled"] = "ideal"
    detection_threshold: float = 0.5
    association: Literal["known", "full"] = "known"
    max_glmb_sensors: int = 4
    max_glmb_targets: int = 10
    max_prior_hypotheses: int = 10
    max_version_divergence: float = 1e-3
    max_bound_work: int = 256
    undetected_worth: float = 0.0
    end: float | None = None
    confidence: float | None = None
    indifference: float = 0.0
    max_samples: int = 2000
    max_seconds: float | None = None
    limits: Limits = field(default_factory=planning_limits)
    num_threads: int = 0

    def __post_init__(self) -> None:
        for name in ("horizon_steps", "num_samples", "max_prior_hypotheses"):
            dimension(name, getattr(self, name))
        for name in ("max_glmb_sensors", "max_glmb_targets", "max_bound_work", "num_threads"):
            count(name, getattr(self, name))
        one_of("association", self.association, ("known", "full"))
        positive("horizon_period", self.horizon_period)
        probability("detection_threshold", self.detection_threshold)
        non_negative("undetected_worth", self.undetected_worth)
        non_negative("max_version_divergence", self.max_version_divergence)
        if self.end is not None:
            real("end", self.end)
        self._check_certainty()
        one_of("ideal_measurements", self.ideal_measurements, IDEAL_MODES)
        own = self.limits
        instance("limits", own, Limits)
        if own.max_components != 1 or own.min_existence != 0.0 or own.min_track_weight != 1.0:
            raise InputError(
                "limits: expected max_components 1, min_existence 0 and min_track_weight 1, as in planning_limits()"
            )

    def _check_certainty(self) -> None:
        if self.confidence is not None and not 0.0 < real("confidence", self.confidence) < 1.0:
            raise reject("confidence", "a probability between 0 and 1, neither of them", self.confidence)
        if non_negative("indifference", self.indifference) >= 1.0:
            raise reject("indifference", "a share of the best reward, from 0 to less than 1", self.indifference)
        if dimension("max_samples", self.max_samples) < _LEAST_SAMPLES:
            raise reject("max_samples", f"a whole number of at least {_LEAST_SAMPLES}", self.max_samples)
        if self.max_seconds is not None:
            positive("max_seconds", self.max_seconds)

    def horizon_times(self) -> Floats:
        """(horizon_steps,) s from the decision to each pseudo-update."""
        return self.horizon_period * np.arange(1.0, self.horizon_steps + 1)

    def threads(self) -> int:
        """Number of threads to use."""
        if self.num_threads:
            return self.num_threads
        affinity = getattr(os, "sched_getaffinity", None)
        return len(affinity(0)) if affinity else os.cpu_count() or 1


@dataclass(frozen=True, slots=True, eq=False)
class MobileSensor:
    """A sensor that a planner steers.

    Attributes:
        filter: its local filter, with the models of the targets and of the sensor. The joint and the independent
            planner need one that labels its targets: that believes in a `GLMB`, an `LMB` or a `FactoredGLMB`.
        platform: what it may do, and where that takes it.
        scan_times: s, increasing, as `State.time`: when it scans; None: whenever a decision looks ahead to. A
            pseudo-update counts where it scans at least once in the period that ends with it.

    Raises:
        InputError: something else than a filter, a platform, or times in order.
    """

    filter: Filter
    platform: Platform
    scan_times: Floats | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.filter, Filter):
            raise reject("filter", "a Filter, with targets, sensor, initial() and step()", self.filter)
        check_platform("platform", self.platform)
        if self.scan_times is not None:
            times = float_array("scan_times", self.scan_times, (None,))
            if (np.diff(times) <= 0.0).any():
                raise reject("scan_times", "times in increasing order", self.scan_times)
            object.__setattr__(self, "scan_times", times)

    def scans(self, now: float | None, settings: PlanningSettings) -> Bools:
        """(horizon_steps,) the pseudo-updates of a decision at time `now` that count; None: not known, all."""
        num, period = settings.horizon_steps, settings.horizon_period
        if self.scan_times is None or now is None:
            return np.ones(num, np.bool_)
        # A scan at the very time of a decision has been taken in; sums of periods differ from it in the last digit.
        ends = now + period * (np.arange(num + 1.0) + 1e-6)
        return np.asarray(np.diff(np.searchsorted(self.scan_times, ends, "right")) > 0)
