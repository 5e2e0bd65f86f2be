"""Settings of planners besides the models: the horizon, the number of samples, and limits on the work."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from vedette.densities import GLMB, LMB, LabelledDensity
from vedette.errors import InputError
from vedette.filters import Filter, Limits
from vedette.internal.threads import processors
from vedette.kernels.base.types import Bools, Floats
from vedette.kernels.planning.ideal import EXPECTED, IDEAL, SAMPLED
from vedette.models.arguments import float_array, reject
from vedette.models.fields import (
    Chance,
    Count,
    EnoughSamples,
    Natural,
    NonNegative,
    Positive,
    Probability,
    Real,
    Share,
    check_fields,
)
from vedette.platforms import Options, Platform
from vedette.platforms.base import Abilities, check_platform

Belief: TypeAlias = GLMB | LMB  # the beliefs that planners accept
IDEAL_MODES = {"ideal": IDEAL, "expected": EXPECTED, "sampled": SAMPLED}


def planning_limits() -> Limits:
    """Return the default limits of pseudo-updates: few hypotheses, one Gaussian per track, no dropped labels."""
    return Limits(
        max_hypotheses=10, min_relative_weight=1e-5, min_track_weight=1.0, max_components=1, min_existence=0.0
    )


@dataclass(frozen=True, slots=True)
class PlanningSettings:
    """Horizon, samples and caps of a decision.

    Attributes:
        horizon_steps: pseudo-updates over the horizon, H (paper: 5).
        horizon_period: time between pseudo-updates, T (paper: 2) [s].
        num_samples: multi-target samples of the expected reward, M, the same ones for every action and sensor (paper:
            40). With `confidence`, as many as needed instead.
        ideal_measurements: pseudo-measurements of a sample, never with clutter. "ideal": noise-free, of the targets
            whose detection probability is at least `detection_threshold`. "expected": noise-free, of targets detected
            at random with that probability, so that the mean over samples is the expectation over detections.
            "sampled": detected at random, with measurement noise.
        detection_threshold: minimum detection probability of a target in ideal measurements (paper-notes 12).
        association: pseudo-updates of LMB beliefs. "known": each pseudo-measurement comes from its own target or from
            clutter, so that labels are independent and rewards are sums over them, which is fast for any number of
            targets and sensors. "full": the filter's own update, with its data association.
        max_glmb_sensors: with more sensors GLMB beliefs are planned on as LMBs, and plans say so.
        max_glmb_targets: the same with more targets expected.
        undetected_target_value: value of finding a target of `undetected`: a factor on the reward's cost of a missed
            target (`missed_cost`: for the expected loss, its cutoff to the power of its order). For rewards without
            such a cost, a number in their units. none: 1 for the former, 0 for the latter. 0: undetected targets are
            ignored. Undetected targets are assumed not to move.
        end: s, time of the last scan, on the clock of `State.time`: later decisions are not planned for. None: no end.
        max_prior_hypotheses: most hypotheses, the heaviest, of each local posterior at the start of the horizon. An LMB
            is not reduced.
        max_version_divergence: densities of one label within this divergence of each other are merged into that of the
            heavier hypothesis at the start of the horizon. 0: none are [nats].
        max_bound_work: maximum number of ways to see a target, times samples, that are tried for the bound of a plan.
        confidence: samples are added until the choice is the best of its candidates with this confidence, regardless of
            `num_samples`. See `vedette.control.racing`.
        indifference: with `confidence`: acceptable shortfall from the best mean reward, as a fraction of its magnitude.
            0.01 is one per cent.
        max_samples: with `confidence`: number of samples after which the decision is taken as it stands.
        max_seconds: time after which the decision is taken as it stands, at the end of a round of samples, of which at
            least one is run. A search with rounds or restarts then ends with the best action found, after at least one.
            Results of a seed then depend on the speed of the machine. none: no limit [s].
        limits: caps of the pseudo-updates, whose hypotheses are ranked, not Gibbs sampled, whatever the filter does.
            Every label set of the prior keeps its heaviest hypothesis beyond these caps, and an LMB keeps all its
            labels. Tracks that are mixtures are replaced by one Gaussian of their moments beforehand.
        num_threads: threads that share a decision. 0: one per processor. The result does not depend on it.
    """

    horizon_steps: Count = 5
    horizon_period: Positive = 2.0
    num_samples: Count = 40
    ideal_measurements: Literal["ideal", "expected", "sampled"] = "ideal"
    detection_threshold: Probability = 0.5
    association: Literal["known", "full"] = "known"
    max_glmb_sensors: Natural = 4
    max_glmb_targets: Natural = 10
    max_prior_hypotheses: Count = 10
    max_version_divergence: NonNegative = 1e-3
    max_bound_work: Natural = 256
    undetected_target_value: NonNegative | None = None
    end: Real | None = None
    confidence: Chance | None = None
    indifference: Share = 0.0
    max_samples: EnoughSamples = 2000
    max_seconds: Positive | None = None
    limits: Limits = field(default_factory=planning_limits)
    num_threads: Natural = 0

    def __post_init__(self) -> None:
        check_fields(self)
        own = self.limits
        if own.max_components != 1 or own.min_existence != 0.0 or own.min_track_weight != 1.0:
            raise InputError(
                "limits: expected max_components 1, min_existence 0 and min_track_weight 1, as in planning_limits()"
            )

    def horizon_times(self) -> Floats:
        """Return (horizon_steps,) s, the times from the decision to each pseudo-update."""
        return self.horizon_period * np.arange(1.0, self.horizon_steps + 1)

    def threads(self) -> int:
        """Return the number of threads to use."""
        return self.num_threads or processors()


@dataclass(frozen=True, slots=True, eq=False)
class MobileSensor:
    """A sensor that a planner controls.

    Attributes:
        filter: its local filter, with the models of the targets and of the sensor. The joint and the independent
            planner need a labelled filter, whose belief is a `GLMB`, an `LMB` or a `FactoredGLMB`.
        platform: its possible actions, and the poses that follow.
        scan_times: s, increasing, as `State.time`: times of its scans. None: at every pseudo-update. A pseudo-update
            counts if it scans at least once in the period that ends with it.
        belief: type of the filter's labelled density, or None if it has no labels.
        abilities: optional members of the platform.

    Raises:
        InputError: an object other than a filter, a platform, or times in order.
    """

    filter: Filter
    platform: Platform
    scan_times: Floats | None = None
    belief: type[LabelledDensity] | None = field(init=False)
    abilities: Abilities = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.filter, Filter):
            raise reject("filter", "a Filter, with targets, sensor, initial() and step()", self.filter)
        check_platform("platform", self.platform)
        object.__setattr__(self, "abilities", Abilities.of(self.platform))
        initial = self.filter.initial()
        object.__setattr__(self, "belief", type(initial) if isinstance(initial, LabelledDensity) else None)
        if self.scan_times is not None:
            times = float_array("scan_times", self.scan_times, (None,))
            if (np.diff(times) <= 0.0).any():
                raise reject("scan_times", "times in increasing order", self.scan_times)
            object.__setattr__(self, "scan_times", times)

    def scans(self, now: float | None, settings: PlanningSettings) -> Bools:
        """Return (horizon_steps,) which pseudo-updates of a decision at time `now` count. None: not known, all."""
        num, period = settings.horizon_steps, settings.horizon_period
        if self.scan_times is None or now is None:
            return np.ones(num, np.bool_)
        # A scan at the time of a decision is already processed; sums of periods may differ from it in the last digit.
        ends = now + period * (np.arange(num + 1.0) + 1e-6)
        return np.asarray(np.diff(np.searchsorted(self.scan_times, ends, "right")) > 0)


def scans_within(
    sensors: Sequence[MobileSensor], options: Sequence[Options], now: float | None, settings: PlanningSettings
) -> tuple[Bools, ...]:
    """Return for each sensor (num_courses, horizon_steps) the pseudo-updates at which it scans."""
    scans = []
    for sensor, own in zip(sensors, options, strict=True):
        scans.append(own.scans if sensor.scan_times is None else own.scans & sensor.scans(now, settings))
    return tuple(scans)
