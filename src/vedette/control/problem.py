"""What a search may ask of a decision: rewards of joint actions, of lines, and a compiled ascent where there is one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.control.additive.evaluator import AdditiveEvaluator
from vedette.control.evidence import Evidence
from vedette.control.search import JointProblem, all_joint_actions, first_best
from vedette.kernels.base.types import Floats
from vedette.kernels.planning.ascent import Allowed


def joint_problem(evidence: Evidence) -> JointProblem:
    """The search problem of a joint decision; what it evaluates is kept in the evidence."""
    evaluator = evidence.evaluator
    if not isinstance(evaluator, AdditiveEvaluator):
        return JointProblem(evidence.shape, evidence.evaluate, lambda: _independent(evidence))
    additive = evaluator.additive
    allowed = Allowed(np.ones(sum(evidence.shape), np.bool_), np.ones((0, 0), np.bool_))

    def line(through: tuple[int, ...], sensor: int) -> Floats:
        return evidence.note(_line_of(evidence.shape, through, sensor), additive.line(np.array(through), sensor))

    def ascend(start: tuple[int, ...]) -> tuple[int, ...]:
        chosen, _, trace = additive.ascend(np.array(start), allowed)
        for num, best in zip(np.diff(trace.evaluations, prepend=0).tolist(), trace.best.tolist(), strict=True):
            evidence.progress(num, best)
        evaluator.counts["rewards"] += int(trace.evaluations[-1]) * additive.num_samples
        return tuple(chosen.tolist())

    return JointProblem(
        evidence.shape,
        evidence.evaluate,
        lambda: _independent(evidence),
        line=line,
        ascend=None if additive.coefficients is None else ascend,
        partial=lambda actions: np.asarray(additive(np.asarray(actions, np.int64)).mean(axis=1)),
    )


def note_lines(evidence: Evidence, choice: Sequence[int]) -> None:
    """Evaluate a joint action, and with sums over labels all that differ from it in one sensor's action."""
    evaluator, chosen = evidence.evaluator, np.array(choice, np.int64)
    if not isinstance(evaluator, AdditiveEvaluator):
        evidence.evaluate(chosen[np.newaxis])
        return
    for s in range(len(chosen)):
        evidence.note(_line_of(evidence.shape, choice, s), evaluator.additive.line(chosen, s))


def _line_of(shape: Sequence[int], through: Sequence[int], sensor: int) -> np.ndarray:
    actions = np.tile(np.array(through, np.int64), (shape[sensor], 1))
    actions[:, sensor] = np.arange(shape[sensor])
    return actions


def _independent(evidence: Evidence) -> tuple[int, ...]:
    """The course that is best for each sensor alone (paper, Algorithm 3); of equal ones the first."""
    evaluator = evidence.evaluator
    means = [
        evaluator.alone(s)(all_joint_actions((num,))).mean(axis=1) for s, num in enumerate(evaluator.joint_shape())
    ]
    return tuple(first_best(np.where(np.isnan(own), -np.inf, own)) for own in means)
