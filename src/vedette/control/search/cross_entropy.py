"""Cross-entropy search: joint actions are drawn from a distribution that moves towards the best of them."""

import math
from dataclasses import dataclass

import numpy as np

from vedette.control.constraints.mask import Mask
from vedette.control.search.problem import JointProblem, RewardCache
from vedette.kernels.base.types import Floats, Ints
from vedette.models.fields import Chance, Checked, Count, Portion, part

# The search ends when every sensor has an action of this probability.
_DEGENERATE = 0.99


@part("cross_entropy", "search")
@dataclass(frozen=True, slots=True)
class CrossEntropy(Checked):
    """A cross-entropy search, which draws joint actions from probabilities of each sensor's actions.

    After each round the probabilities move towards the frequencies of the actions in the best joint actions of the
    round (Rubinstein 1999). The first round contains the independent decision, so the result is never worse. The search
    ends when the probabilities are degenerate (every sensor has an action of 0.99), when a round draws nothing new, or
    after `max_rounds`. No joint action is evaluated twice: one that is drawn again keeps its reward.

    With a mask, each sensor's action is drawn from those compatible with the sensors before it. If there are none, the
    joint action is replaced by an allowed one near it (`vedette.control.constraints.nearest_feasible`, `relaxed`).

    Attributes:
        num_samples: joint actions drawn in a round.
        elite_fraction: fraction of these that the probabilities move towards, in (0, 1).
        smoothing: step size of the probabilities in a round, in (0, 1]. 1: a full step.
        max_rounds: maximum number of rounds.
    """

    num_samples: Count = 200
    elite_fraction: Chance = 0.1
    smoothing: Portion = 0.7
    max_rounds: Count = 50

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """Return the best joint action drawn, of equal ones the first in printed order."""
        cache = RewardCache(problem)
        probabilities = _uniform(cache)
        num_elite = math.ceil(self.elite_fraction * self.num_samples)
        drawn = [cache.allowed(problem.independent())]
        for _ in range(self.max_rounds):
            drawn += cache.all_allowed(_draw(cache.mask, probabilities, self.num_samples, rng))
            num_known = len(cache.values)
            order = np.argsort(-cache.rewards(drawn), kind="stable")
            elite = np.array([drawn[i] for i in order[:num_elite].tolist()])
            shares = (elite[:, :, np.newaxis] == np.arange(probabilities.shape[1])).mean(axis=0)
            probabilities += self.smoothing * (shares - probabilities)
            is_settled = len(cache.values) == num_known or (probabilities.max(axis=1) >= _DEGENERATE).all()
            if is_settled or cache.is_late():
                break
            drawn = []
        return cache.best()


def _uniform(cache: RewardCache) -> Floats:
    """Return (num_sensors, most courses) equal probabilities for all feasible courses of a sensor, and 0 elsewhere."""
    shape = cache.problem.shape
    probabilities = np.zeros((len(shape), max(shape)))
    for s in range(len(shape)):
        probabilities[s, cache.actions([-1] * len(shape), s)] = 1.0
    return np.asarray(probabilities / probabilities.sum(axis=1, keepdims=True))


def _draw(mask: Mask | None, probabilities: Floats, num: int, rng: np.random.Generator) -> Ints:
    """Return (num, num_sensors) drawn sensor by sensor, compatible with the sensors before if possible."""
    at = np.empty((num, len(probabilities)), np.int64)
    for s, own in enumerate(probabilities):
        weights = np.tile(own, (num, 1))
        for other, clash in mask.others(s).items() if mask is not None else ():
            if other < s:
                weights[:, : clash.shape[1]] *= clash[at[:, other]] == 0
        weights[weights.sum(axis=1) == 0.0] = own
        ends = weights.cumsum(axis=1)
        # Below the last cumulative probability, so that actions of probability 0 are never drawn, despite rounding.
        drawn = np.minimum(rng.random(num) * ends[:, -1], np.nextafter(ends[:, -1], 0.0))
        at[:, s] = (drawn[:, np.newaxis] >= ends).sum(axis=1)
    return at
