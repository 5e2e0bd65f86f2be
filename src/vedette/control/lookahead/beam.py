"""Beam search over sequences: an ascent over the sensors, whose lines are searched by beams."""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from vedette.control.lookahead.courses import Sequence
from vedette.control.lookahead.problem import JointSequence, SequenceProblem
from vedette.control.search.problem import tie_tolerance
from vedette.models.fields import Checked, Count


@dataclass(frozen=True, slots=True)
class BeamSearch(Checked):
    """A search of one sensor at a time, with a beam of its best beginnings that grows decision by decision.

    The value of a beginning is that of the sequence that repeats its last action until the end. So the far future
    counts from the first decision on, and every evaluation is of a whole sequence. Ties are broken at random. Starting
    from the best known sequence (a single decision, repeated), sensor by sensor is searched until none alone improves
    it. Then, if the budget allows, all combinations of the sensors' beams are tried, and if one is better, the search
    continues from there. Finally the same is repeated from a start in which each sensor joins those before it, while
    the ones after it do not scan.

    Attributes:
        beam_width: beginnings that are kept at each decision.
    """

    beam_width: Count = 8

    def search(self, problem: SequenceProblem, *, rng: np.random.Generator) -> None:
        """Search until nothing is better, or the budget is used up."""
        best = problem.best()
        self._climb(problem, best.sequence, best.value, rng)
        if problem.left > 0:
            joint = self._joined(problem, rng)
            self._climb(problem, joint, problem.evaluate([joint])[0], rng)

    def _joined(self, problem: SequenceProblem, rng: np.random.Generator) -> JointSequence:
        """Return a joint sequence in which each sensor joins those before it, the ones after it not scanning."""
        scanning: list[Sequence | None] = [None] * problem.num_sensors
        # A sensor that does not scan yet still occupies its position.
        beside: list[Sequence | None] = [None] * problem.num_sensors
        if problem.rules is not None:
            beside[:] = problem.rules.start
        for s in range(problem.num_sensors):
            # The sensors share the budget equally; one evaluation is left for the result.
            share = (problem.left - 1) // (problem.num_sensors - s)
            scanning[s] = beside[s] = self._grow(problem, scanning, beside, s, share, rng)[0]
        return tuple(own for own in scanning if own is not None)

    def _climb(self, problem: SequenceProblem, joint: JointSequence, value: float, rng: np.random.Generator) -> None:
        """Improve a joint sequence until neither a sensor alone nor a combination of beams is better."""
        beams = [[own] for own in joint]
        while problem.left > 0:
            joint, value, beams = self._ascend(problem, joint, value, beams, rng)
            if math.prod(map(len, beams)) > problem.left:
                return
            combined: list[JointSequence] = list(itertools.product(*beams))
            values = problem.evaluate(combined)
            if not _is_better(max(values), value):
                return
            value = max(values)
            joint = combined[values.index(value)]

    def _ascend(
        self,
        problem: SequenceProblem,
        joint: JointSequence,
        value: float,
        beams: list[list[Sequence]],
        rng: np.random.Generator,
    ) -> tuple[JointSequence, float, list[list[Sequence]]]:
        """Search the sensors in turn until none alone improves the value."""
        settled, s, beams = 0, 0, list(beams)
        while settled < problem.num_sensors and problem.left > 0:
            beams[s] = self._grow(problem, list(joint), list(joint), s, problem.left, rng)
            other = (*joint[:s], beams[s][0], *joint[s + 1 :])
            reward, settled = problem.evaluate([other])[0], settled + 1
            if _is_better(reward, value):
                joint, value, settled = other, reward, 1
            s = (s + 1) % problem.num_sensors
        return joint, value, beams

    def _grow(
        self,
        problem: SequenceProblem,
        scanning: list[Sequence | None],
        beside: list[Sequence | None],
        sensor: int,
        max_evaluations: int,
        rng: np.random.Generator,
    ) -> list[Sequence]:
        """Return whole sequences of one sensor, the best first, found with at most `max_evaluations` evaluations.

        scanning: sequences of the others, None if they do not scan. beside: their sequences for the constraints, and
        the sensor's own if nothing else is found.
        """
        others = tuple(beside)
        ahead, behind = tuple(scanning[:sensor]), tuple(scanning[sensor + 1 :])
        num_first = len(problem.trees[sensor].allowed(()))
        beam: list[Sequence] = [()]
        for stages_left in reversed(range(problem.depth)):
            longer = ((*taken, k) for taken in beam for k in problem.after(sensor, taken, others))
            whole = ((taken, own) for taken in longer if (own := problem.completed(sensor, taken, others)) is not None)
            candidates = list(itertools.islice(whole, max(0, max_evaluations)))
            if not candidates:
                break
            values = problem.evaluate([(*ahead, own, *behind) for _, own in candidates])
            max_evaluations -= len(candidates)
            width = self.beam_width
            if stages_left > 0:
                width = min(width, max(1, max_evaluations // (stages_left * num_first)))
            beam = [candidates[i][0] for i in _ranked(values, rng)[:width]]
        completed = (problem.completed(sensor, taken, others) for taken in beam)
        return [own for own in completed if own is not None] or [own for own in [beside[sensor]] if own is not None]


def _is_better(value: float, reference: float) -> bool:
    return value > reference + tie_tolerance(reference) if math.isfinite(reference) else value > reference


def _ranked(values: list[float], rng: np.random.Generator) -> list[int]:
    """Return the indices of the values, the largest first, equal ones in random order."""
    scale = tie_tolerance(max(map(abs, filter(math.isfinite, values)), default=1.0))
    order = np.lexsort((rng.random(len(values)), -np.round(np.array(values) / scale)))
    return [int(place) for place in order]
