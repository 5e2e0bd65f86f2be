"""Races of joint actions: samples are added in rounds, and candidates that are worse with confidence are dropped.

All candidates of a round are evaluated on the same samples, so that common errors cancel. After round k, with n samples
in all, candidate a stays as long as the upper confidence bound of its mean difference to the present best b,

    U(a) = mean(d) + t(n - 1, 1 - alpha_k / (K - 1)) std(d) / sqrt(n),    d = reward(a) - reward(b), sample by sample,

is not below 0, with alpha_k = (1 - confidence) / (k (k + 1)) and K candidates at the start. The race is over when one
is left, or when U(a) of all others is at most the indifference. The alpha_k sum to 1 - confidence over any number of
rounds, and an error in a round is one of K - 1 comparisons with the true best (a union bound over both). So if
Student's t is valid, the choice is with `confidence` within the indifference of the best candidate, whenever the
race is stopped. The differences need not be normal. If they are far from it (a target that exists in every sample of
the first rounds, and is absent in one of a hundred), the confidence is only as good as the samples.

See O. Maron, A. W. Moore, "The racing algorithm: model selection for lazy learners", 1997 (races, paired differences);
S.-H. Kim, B. L. Nelson, "A fully sequential procedure for indifference-zone selection in simulation", 2001
(indifference, common random numbers, the union over candidates); E. Even-Dar, S. Mannor, Y. Mansour, "Action
elimination and stopping conditions for the multi-armed bandit and reinforcement learning problems", 2006 (a confidence
that is divided over rounds).
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from vedette.control.evidence import Evidence
from vedette.control.search.problem import first_best, tie_tolerance
from vedette.kernels.base.types import Bools, Floats, Ints

# Samples of the first round, and the factor by which each round adds to them (costs: docs/evidence/planning.md).
FIRST_ROUND = 8
_GROWTH = 1.5


def next_total(num_samples: int, max_samples: int) -> int:
    """Return the total number of samples after the next round, from the present number."""
    return min(max_samples, FIRST_ROUND if num_samples == 0 else math.ceil(_GROWTH * num_samples))


@dataclass(slots=True, eq=False)
class Race:
    """Candidates with their rewards so far."""

    actions: Ints  # (num_candidates, num_sensors) the joint actions at the start, in printed order
    confidence: float  # as in `PlanningSettings`
    indifference: float  # as in `PlanningSettings`
    sensor: int | None = None  # the sensor whose actions race. None: joint actions of all sensors, fused
    left: Ints = field(init=False)  # (num_left,) rows of `actions` that are not excluded
    rewards: Floats = field(init=False)  # (num_left, num_samples) their rewards
    # for each round, the rows that it excluded and their rewards until then
    excluded: list[tuple[Ints, Floats]] = field(default_factory=list)
    _round: int = 0
    _best: int = 0
    _doubt: float = math.inf
    _near: bool = False

    def __post_init__(self) -> None:
        self.left, self.rewards = np.arange(len(self.actions)), np.empty((len(self.actions), 0))

    @property
    def candidates(self) -> Ints:
        """The joint actions (num_left, num_sensors) that are not excluded, in the order of `rewards`."""
        return np.asarray(self.actions[self.left])

    @property
    def num_samples(self) -> int:
        """Number of samples of each candidate so far."""
        return int(self.rewards.shape[1])

    @property
    def best(self) -> tuple[int, ...]:
        """The candidate with the largest mean reward."""
        return tuple(self.candidates[self._best].tolist())

    @property
    def reached(self) -> float:
        """The confidence that the best is within the indifference of the best candidate, at most the one required."""
        return self.confidence if self.verdict else min(self.confidence, max(0.0, 1.0 - self._doubt))

    @property
    def verdict(self) -> Literal["one left", "indifferent"] | None:
        """Why the race is over, or None while it is not."""
        if len(self.left) == 1:
            return "one left"
        return "indifferent" if self._near else None

    def add(self, rewards: Floats) -> None:
        """Add a round: rewards (num_left, num_new) of the candidates, on samples that are the same for all.

        A candidate without a finite mean is excluded.
        """
        self._round += 1
        self.rewards = np.concatenate([self.rewards, rewards], axis=1)
        with np.errstate(invalid="ignore"):
            means = self.rewards.mean(axis=1)
        finite = np.isfinite(means)
        self._best = first_best(np.where(finite, means, -math.inf))
        self._judge(means, finite)

    def note(self, evidence: Evidence) -> None:
        """Store the rewards of the candidates, each on the samples of the rounds that it took part in."""
        for rows, rewards in (*self.excluded, (self.left, self.rewards)):
            if len(rows):
                evidence.note(self.actions[rows], rewards)

    def _judge(self, means: Floats, finite: Bools) -> None:
        """Drop candidates that are worse, and update the confidence in the best."""
        from scipy.special import stdtrit

        best, num = self._best, self.rewards.shape[1]
        with np.errstate(invalid="ignore"):
            behind = means[best] - means
            errors = np.std(self.rewards - self.rewards[best], axis=1, ddof=1) / math.sqrt(num)
        # Each comparison of each round gets one part in this number of the total error probability.
        parts = max(1, len(self.actions) - 1) * self._round * (self._round + 1)
        reach = -stdtrit(num - 1, (1.0 - self.confidence) / parts) * errors
        tie = tie_tolerance(float(means[best]))
        near = max(tie, self.indifference * abs(means[best]))
        stays = finite & (behind - reach <= tie)
        stays[best] = False  # the others
        self._near = bool((reach - behind <= near)[stays].all())
        self._doubt = parts * float(_chance_beyond(near + behind[stays], errors[stays], num).max(initial=0.0))
        stays[best] = True
        self.excluded.append((self.left[~stays], self.rewards[~stays]))
        self._best = int(stays[:best].sum())
        self.left, self.rewards = self.left[stays], self.rewards[stays]


def _chance_beyond(distances: Floats, errors: Floats, num_samples: int) -> Floats:
    """Return the probability that the error of a mean of `num_samples` samples exceeds a distance.

    It is positive except for ties.
    """
    from scipy.special import stdtr

    beyond = np.where(distances >= 0.0, 0.0, 1.0)
    sure = errors > 0.0
    beyond[sure] = stdtr(num_samples - 1, -distances[sure] / errors[sure])
    return beyond
