"""Joint actions drawn from a distribution that is drawn to the best of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vedette.control.search.known import Joint, Known
from vedette.control.search.problem import JointProblem
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import dimension, reject

# A distribution in which every sensor has an action of this probability has nothing more to find.
_DEGENERATE = 0.99


@dataclass(frozen=True, slots=True)
class CrossEntropy:
    """Cross-entropy method: joint actions are drawn, each sensor's action by probabilities of its own, and these are
    drawn to how often the best joint actions of the round have each action (Rubinstein 1999).

    The first round holds the independent decision, so that the result is never worse. It ends when the probabilities
    are degenerate (every sensor has an action of 0.99), when a round draws nothing new, or after `max_rounds`. No joint
    action is evaluated twice: what is drawn again keeps its reward.

    With a mask, courses that are forbidden are never drawn, and joint actions that are not allowed are moved to ones
    near them that are (`vedette.control.constraints.repaired`, `opened`).

    Attributes:
        num_samples: joint actions drawn in a round.
        elite_share: of these that the probabilities are drawn to, in (0, 1).
        smoothing: how far they are drawn there in a round, in (0, 1]; 1: all the way.
        max_rounds: most rounds.

    Raises:
        InputError: a field out of range.
    """

    num_samples: int = 200
    elite_share: float = 0.1
    smoothing: float = 0.7
    max_rounds: int = 50

    def __post_init__(self) -> None:
        dimension("num_samples", self.num_samples)
        dimension("max_rounds", self.max_rounds)
        if not 0.0 < self.elite_share < 1.0:
            raise reject("elite_share", "a number above 0 and below 1", self.elite_share)
        if not 0.0 < self.smoothing <= 1.0:
            raise reject("smoothing", "a number above 0, up to 1", self.smoothing)

    def search(self, problem: JointProblem, *, rng: np.random.Generator) -> tuple[int, ...]:
        """The best of all that were drawn; of equal ones the first in printed order."""
        known = Known(problem)
        probabilities = _uniform(known)
        num_elite = math.ceil(self.elite_share * self.num_samples)
        drawn = [known.allowed(problem.independent())]
        for _ in range(self.max_rounds):
            drawn += [known.allowed(joint) for joint in _draw(probabilities, self.num_samples, rng)]
            num_known = len(known.values)
            order = np.argsort(-known.rewards(drawn), kind="stable")
            elite = np.array([drawn[i] for i in order[:num_elite].tolist()])
            probabilities += self.smoothing * (_shares(elite, probabilities.shape[1]) - probabilities)
            if len(known.values) == num_known or (probabilities.max(axis=1) >= _DEGENERATE).all():
                break
            drawn = []
        return known.best()


def _uniform(known: Known) -> Floats:
    """(num_sensors, most courses) the same probability for all that a sensor may do; 0 elsewhere."""
    shape = known.problem.shape
    found = np.zeros((len(shape), max(shape)))
    for s in range(len(shape)):
        found[s, known.actions([-1] * len(shape), s)] = 1.0
    return np.asarray(found / found.sum(axis=1, keepdims=True))


def _draw(probabilities: Floats, num: int, rng: np.random.Generator) -> list[Joint]:
    """`num` joint actions, each sensor's by its own probabilities."""
    ends = probabilities.cumsum(axis=1)
    last = probabilities.shape[1] - 1 - (probabilities[:, ::-1] > 0.0).argmax(axis=1)
    at = (rng.random((num, len(ends)))[:, :, np.newaxis] >= ends).sum(axis=2)
    return list(map(tuple, np.minimum(at, last).tolist()))  # rounding may leave the last end below 1


def _shares(joint_actions: Ints, num_courses: int) -> Floats:
    """(num_sensors, num_courses) how often each action is in joint actions (num, num_sensors)."""
    return np.asarray((joint_actions[:, :, np.newaxis] == np.arange(num_courses)).mean(axis=0))
