"""Joint actions drawn from a distribution that is drawn to the best of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vedette.control.constraints import Mask
from vedette.control.search.problem import JointProblem, RewardCache
from vedette.kernels.base.types import Floats, Ints
from vedette.models.fields import Chance, Checked, Count, Portion, part

# A distribution in which every sensor has an action of this probability has nothing more to find.
_DEGENERATE = 0.99


@part("cross_entropy", "search")
@dataclass(frozen=True, slots=True)
class CrossEntropy(Checked):
    """Cross-entropy method: joint actions are drawn, each sensor's action by probabilities of its own, and these are
    drawn to how often the best joint actions of the round have each action (Rubinstein 1999).

    The first round holds the independent decision, so that the result is never worse. It ends when the probabilities
    are degenerate (every sensor has an action of 0.99), when a round draws nothing new, or after `max_rounds`. No joint
    action is evaluated twice: what is drawn again keeps its reward.

    With a mask, each sensor's action is drawn from those that go with the sensors before it; where there are none, the
    joint action is moved to one near it that is allowed (`vedette.control.constraints.nearest_feasible`, `relaxed`).

    Attributes:
        num_samples: joint actions drawn in a round.
        elite_share: share of these that the probabilities are drawn to, in (0, 1).
        smoothing: how far they are drawn there in a round, in (0, 1]; 1: all the way.
        max_rounds: most rounds.

    Raises:
        InputError: a field out of range.
    """

    num_samples: Count = 200
    elite_share: Chance = 0.1
    smoothing: Portion = 0.7
    max_rounds: Count = 50

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The best of all that were drawn; of equal ones the first in printed order."""
        known = RewardCache(problem)
        probabilities = _uniform(known)
        num_elite = math.ceil(self.elite_share * self.num_samples)
        drawn = [known.allowed(problem.independent())]
        for _ in range(self.max_rounds):
            drawn += known.all_allowed(_draw(known.mask, probabilities, self.num_samples, rng))
            num_known = len(known.values)
            order = np.argsort(-known.rewards(drawn), kind="stable")
            elite = np.array([drawn[i] for i in order[:num_elite].tolist()])
            shares = (elite[:, :, np.newaxis] == np.arange(probabilities.shape[1])).mean(axis=0)
            probabilities += self.smoothing * (shares - probabilities)
            is_settled = len(known.values) == num_known or (probabilities.max(axis=1) >= _DEGENERATE).all()
            if is_settled or known.is_late():
                break
            drawn = []
        return known.best()


def _uniform(known: RewardCache) -> Floats:
    """(num_sensors, most courses) the same probability for all that a sensor may do; 0 elsewhere."""
    shape = known.problem.shape
    found = np.zeros((len(shape), max(shape)))
    for s in range(len(shape)):
        found[s, known.actions([-1] * len(shape), s)] = 1.0
    return np.asarray(found / found.sum(axis=1, keepdims=True))


def _draw(mask: Mask | None, probabilities: Floats, num: int, rng: np.random.Generator) -> Ints:
    """(num, num_sensors) drawn sensor by sensor, of what goes with those before it, if anything does."""
    at = np.empty((num, len(probabilities)), np.int64)
    for s, own in enumerate(probabilities):
        weights = np.tile(own, (num, 1))
        for other, clash in mask.others(s).items() if mask is not None else ():
            if other < s:
                weights[:, : clash.shape[1]] *= clash[at[:, other]] == 0
        weights[weights.sum(axis=1) == 0.0] = own
        ends = weights.cumsum(axis=1)
        # Below the last end, so that what cannot be drawn is not, whatever the rounding.
        drawn = np.minimum(rng.random(num) * ends[:, -1], np.nextafter(ends[:, -1], 0.0))
        at[:, s] = (drawn[:, np.newaxis] >= ends).sum(axis=1)
    return at
