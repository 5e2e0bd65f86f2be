"""What a planner is told beside the models: how far it looks ahead, with how many samples, and at what cost."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Literal

from vedette.control.actions import ActionSet, HeadingActions
from vedette.errors import InputError
from vedette.filters import Limits, LocalFilter
from vedette.kernels.ideal import EXPECTED, IDEAL, SAMPLED

IDEAL_MODES = {"ideal": IDEAL, "expected": EXPECTED, "sampled": SAMPLED}


def planning_limits() -> Limits:
    """Defaults of the pseudo-updates: few hypotheses, one Gaussian a track, and no label ever dropped."""
    return Limits(max_hypotheses=40, min_relative_weight=1e-5, max_components=1, min_existence=0.0)


@dataclass(frozen=True, slots=True)
class PlanningSettings:
    """Horizon, samples and caps of a decision.

    Attributes:
        horizon_steps, horizon_period: H pseudo-updates, T seconds apart (paper: 5 and 2 s).
        num_samples: M multi-target samples, the same ones for every action and sensor (paper: 40).
        ideal_measurements: "ideal": noise-free, of the sampled targets whose detection probability is at least
            `detection_threshold`; "expected": noise-free, each target seen with its detection probability, so that the
            mean over samples is the expectation over detections; "sampled": seen likewise, with measurement noise.
        max_prior_hypotheses: heaviest hypotheses of each local posterior that enter the pseudo-updates. An LMB enters whole.
        limits: caps of the pseudo-updates, which are ranked, not Gibbs sampled, whatever the filter does. Every label set of
            the prior keeps its heaviest hypothesis beyond these caps.
        num_threads: threads that share a decision; 0: one a processor. The result does not depend on it.

    Raises:
        InputError: a field out of range.
    """

    horizon_steps: int = 5
    horizon_period: float = 2.0
    num_samples: int = 40
    ideal_measurements: Literal["ideal", "expected", "sampled"] = "ideal"
    detection_threshold: float = 0.5
    max_prior_hypotheses: int = 10
    limits: Limits = field(default_factory=planning_limits)
    num_threads: int = 0

    def __post_init__(self) -> None:
        for name in ("horizon_steps", "num_samples", "max_prior_hypotheses"):
            if not getattr(self, name) >= 1:
                raise InputError(f"{name}: expected at least 1; got {getattr(self, name)!r}")
        if not self.horizon_period > 0.0:
            raise InputError(f"horizon_period: expected seconds above 0; got {self.horizon_period!r}")
        if self.ideal_measurements not in IDEAL_MODES:
            raise InputError(f"ideal_measurements: expected one of {', '.join(IDEAL_MODES)}; got {self.ideal_measurements!r}")
        if not 0.0 <= self.detection_threshold <= 1.0:
            raise InputError(f"detection_threshold: expected a probability; got {self.detection_threshold!r}")
        if self.limits.max_components != 1 or self.limits.min_existence != 0.0:
            raise InputError("limits: expected max_components 1 and min_existence 0 for planning, see planning_limits()")
        if not self.num_threads >= 0:
            raise InputError(f"num_threads: expected 0 or more; got {self.num_threads!r}")

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
        filter: its local filter, with the models of the targets and of the sensor.
        speed: m/s, constant along its heading once it moves.
        actions: the headings it may take.
    """

    filter: LocalFilter
    speed: float
    actions: ActionSet = field(default_factory=HeadingActions)

    def __post_init__(self) -> None:
        if not 0.0 <= self.speed < float("inf"):
            raise InputError(f"speed: expected a finite number of m/s of at least 0; got {self.speed!r}")
