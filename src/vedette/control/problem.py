"""What a search may ask of a decision: rewards of joint actions, of lines, and a compiled ascent where there is one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vedette.control.allowed import allowed_of, single_mask
from vedette.control.bounds import most_by_target
from vedette.control.constraints import Mask
from vedette.control.evidence import Evidence
from vedette.control.inputs import check_choice
from vedette.control.search import JointProblem, JointSearch, all_joint_actions, first_best
from vedette.kernels.base.types import Floats, Ints


def searched(
    search: JointSearch, evidence: Evidence, mask: Mask | None, *, rng: np.random.Generator
) -> tuple[int, ...]:
    """The joint action that a search chooses, which the evidence then holds with the lines through it.

    Raises `InputError` for what is no joint action.
    """
    choice = check_choice("search", search.search(joint_problem(evidence, mask), rng=rng), evidence.shape)
    note_lines(evidence, choice, mask)
    return choice


def joint_problem(evidence: Evidence, mask: Mask | None) -> JointProblem:
    """The search problem of a joint decision; what it evaluates is kept in the evidence."""
    evaluator = evidence.evaluator
    plain = JointProblem(evidence.shape, evidence.evaluate, lambda: _independent(evidence, mask), mask)
    additive, allowed = evaluator.additive, allowed_of(mask, evidence.shape)
    if additive is None:
        return plain

    def line(through: tuple[int, ...], sensor: int) -> Floats:
        rewards = additive.line(np.array(through), sensor)
        _note_line(evidence, mask, through, sensor, rewards)
        means = rewards.mean(axis=1)
        return np.where(np.isnan(means), -np.inf, means)

    def ascend(start: tuple[int, ...]) -> tuple[int, ...]:
        assert allowed is not None
        chosen, _, trace = additive.ascend(np.array(start), allowed)
        for num, best in zip(np.diff(trace.evaluations, prepend=0).tolist(), trace.best.tolist(), strict=True):
            evidence.progress(num, best)
        evaluator.counts["rewards"] += int(trace.evaluations[-1]) * additive.num_samples
        return tuple(chosen.tolist())

    def partial(actions: Ints) -> Floats:
        return np.asarray(additive(np.ascontiguousarray(actions, np.int64)).mean(axis=1))

    def bound() -> float:
        most = most_by_target(evidence)
        return np.inf if most is None else most[0]

    compiled = additive.coefficients is not None and allowed is not None
    return plain._replace(line=line, ascend=ascend if compiled else None, partial=partial, bound=bound)


def note_lines(evidence: Evidence, choice: Sequence[int], mask: Mask | None) -> None:
    """Evaluate a joint action, and with sums over labels all allowed ones that differ in one sensor's action."""
    evaluator, chosen = evidence.evaluator, np.array(choice, np.int64)
    if not evidence.holds(choice):
        evidence.evaluate(chosen[np.newaxis])
    if evaluator.additive is not None and not evidence.is_complete():
        rewards = evaluator.additive.lines(chosen)
        for s, own in enumerate(np.split(rewards, np.cumsum(evidence.shape)[:-1])):
            _note_line(evidence, mask, choice, s, own)


def _note_line(evidence: Evidence, mask: Mask | None, through: Sequence[int], sensor: int, rewards: Floats) -> None:
    actions = np.tile(np.array(through, np.int64), (evidence.shape[sensor], 1))
    actions[:, sensor] = np.arange(evidence.shape[sensor])
    kept = slice(None) if mask is None else mask.allows(actions)
    evidence.note(actions[kept], rewards[kept])


def _independent(evidence: Evidence, mask: Mask | None) -> tuple[int, ...]:
    """The course that is best for each sensor alone (paper, Algorithm 3), of those it may take."""
    evaluator, shape = evidence.evaluator, evidence.shape
    if evaluator.additive is not None:
        means = np.split(evaluator.additive.each_alone().mean(axis=1), np.cumsum(shape)[:-1])
    else:
        means = [evaluator.alone(s)(all_joint_actions((num,))).mean(axis=1) for s, num in enumerate(shape)]
    best = []
    for s, own in enumerate(means):
        best.append(first_best(np.where(np.isnan(own) | ~single_mask(mask, s, len(own)), -np.inf, own)))
    return tuple(best)
