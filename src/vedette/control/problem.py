"""The search problem of a joint decision, and the upper bound on its reward."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards, value_found
from vedette.control.constraints.mask import Mask
from vedette.control.evaluator import Evaluator
from vedette.control.evidence import Evidence
from vedette.control.explanation import Bound
from vedette.control.inputs import check_choice, compiled_mask, single_mask, stationary_courses
from vedette.control.search.problem import JointProblem, JointSearch, all_joint_actions, first_best
from vedette.densities.checks import offsets_of
from vedette.internal.probabilities import expit
from vedette.internal.threads import run_chunks
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.bounds import Choices, best_of_labels, relaxed_bound
from vedette.kernels.planning.joint_values import label_values
from vedette.kernels.planning.label_values import EXPECTED_LOSS


def searched(
    search: JointSearch,
    evidence: Evidence,
    mask: Mask | None,
    *,
    late: Callable[[], bool] | None = None,
    rng: np.random.Generator,
) -> tuple[int, ...]:
    """Return the joint action that a search chooses. The evidence then contains it with the lines through it.

    late: see `JointProblem`.

    Raises `InputError` for an invalid joint action.
    """
    choice = check_choice(
        "search", search.search(joint_problem(evidence, mask)._replace(late=late), rng=rng), evidence.shape
    )
    note_lines(evidence, choice, mask)
    return choice


def joint_problem(evidence: Evidence, mask: Mask | None) -> JointProblem:
    """Return the search problem of a joint decision. Its evaluations are kept in the evidence."""
    evaluator = evidence.evaluator
    stay = cache(lambda: stationary_courses(evaluator.options, mask))

    def partial(actions: Ints) -> Floats:
        means = evidence.rewards(np.where(actions < 0, stay(), actions)).mean(axis=1)
        return np.where(np.isnan(means), -np.inf, means)

    plain = JointProblem(evidence.shape, evidence.evaluate, lambda: _independent(evidence, mask), mask, partial=partial)
    additive, allowed = evaluator.additive, compiled_mask(mask, evidence.shape)
    if additive is None:
        return plain

    def line(through: tuple[int, ...], sensor: int) -> Floats:
        rewards = additive.line(np.array(through), sensor)
        _note_lines(evidence, mask, through, [sensor], rewards)
        means = rewards.mean(axis=1)
        return np.where(np.isnan(means), -np.inf, means)

    def ascend(start: tuple[int, ...]) -> tuple[int, ...]:
        assert allowed is not None
        chosen, _, trace = additive.ascend(np.array(start), allowed)
        for num, best in zip(np.diff(trace.evaluations, prepend=0).tolist(), trace.best.tolist(), strict=True):
            evidence.progress(num, best)
        evaluator.counts["rewards"] += int(trace.evaluations[-1]) * additive.num_samples
        return tuple(chosen.tolist())

    def bound() -> float:
        found = upper_limit(evidence)
        return np.inf if found is None else found.upper

    compiled = additive.coefficients is not None and allowed is not None
    return plain._replace(line=line, ascend=ascend if compiled else None, bound=bound)


def note_lines(evidence: Evidence, choice: Sequence[int], mask: Mask | None) -> None:
    """Evaluate a joint action and, with sums over labels, all allowed ones that differ in one sensor's action."""
    evaluator, chosen = evidence.evaluator, np.array(choice, np.int64)
    if evidence.is_complete():
        return
    if not evidence.holds(choice):
        evidence.evaluate(chosen[np.newaxis])
    if evaluator.additive is not None and not evidence.is_complete():
        _note_lines(evidence, mask, choice, range(len(choice)), evaluator.additive.lines(chosen))


def _note_lines(
    evidence: Evidence, mask: Mask | None, through: Sequence[int], sensors: Sequence[int], rewards: Floats
) -> None:
    """Keep the rewards of the lines of some sensors through a joint action, one line after the other."""
    sizes = [evidence.shape[s] for s in sensors]
    actions = np.tile(np.array(through, np.int64), (len(rewards), 1))
    actions[np.arange(len(rewards)), np.repeat(sensors, sizes)] = np.concatenate([np.arange(size) for size in sizes])
    is_allowed = slice(None) if mask is None else mask.allows(actions)
    evidence.note(actions[is_allowed], rewards[is_allowed])


def _independent(evidence: Evidence, mask: Mask | None) -> tuple[int, ...]:
    """Return the best feasible course of each sensor alone (paper, Algorithm 3)."""
    evaluator, shape = evidence.evaluator, evidence.shape
    if evaluator.additive is not None:
        means = np.split(evaluator.additive.each_alone().mean(axis=1), np.cumsum(shape)[:-1])
    else:
        means = [evaluator.alone(s)(all_joint_actions((num,))).mean(axis=1) for s, num in enumerate(shape)]
    best = []
    for s, own in enumerate(means):
        best.append(first_best(np.where(np.isnan(own) | ~single_mask(mask, s, len(own)), -np.inf, own)))
    if mask is None or mask.active is None:
        return tuple(best)
    gains = [own[course] - own[off[course]] for own, course, off in zip(means, best, mask.active.off, strict=True)]
    return mask.active.within_limit(best, gains)


# Fraction of the likely detected targets that are beyond the cutoff, above which a note is given. On paper-a up to half
# with cutoffs of 20 and 25 m, which cost 2.3 and 2.1 m of OSPA, up to a quarter with 30 m (0.6 m), none with 40 m.
_SHARE = 0.1


def upper_bound(evidence: Evidence, choice: Sequence[int]) -> Bound | None:
    """Return an upper bound on the best mean reward, from the decision's samples, or None if no bound is available.

    If every joint action was evaluated, the bound is the best of them. Otherwise see `upper_limit`.
    """
    reward = evidence.mean_of(choice)
    if evidence.is_complete():
        return Bound(evidence.best, reward, "exhaustive")
    found = upper_limit(evidence)
    return None if found is None else replace(found, reward=reward)


def upper_limit(evidence: Evidence) -> Bound | None:
    """Return the upper bound without a choice's reward (cached), or None if rewards are not linear in sums of targets.

    Each target gets the joint action that is best for it, and each sensor finds of the undetected targets in every cell
    what its best course there finds. No joint action can be better than that for all of them. Every sensor pays its
    lowest price. If the number of ways to see a target exceeds `PlanningSettings.max_bound_work`, this bound does not
    cover the target. The expected loss also has a bound by relaxation, usually the smaller one
    (`vedette.kernels.planning.bounds`).
    """
    evaluator, cached = evidence.evaluator, evidence.upper_limit
    additive = evaluator.additive
    if not cached and additive is not None and additive.coefficients is not None:
        best = label_upper_bounds(additive, evaluator.settings.max_bound_work)
        unknown = np.isinf(best).reshape(additive.num_horizons, -1).any(axis=0)
        cheapest = np.minimum.reduceat(additive.prices, additive.table.first_courses[:-1]).sum()
        upper = float(best.sum()) + _most_found(additive) - float(cheapest)
        cached.append(Bound(upper, -math.inf, "by target", int(unknown.sum())))
        if additive.valuation.kind == EXPECTED_LOSS:
            relaxed = relaxed_bound(additive.table, additive.valuation, additive.cells, additive.prices)
            if relaxed < upper:
                cached[0] = Bound(relaxed, -math.inf, "relaxed")
    return cached[0] if cached else None


def label_upper_bounds(additive: AdditiveRewards, max_work: int) -> Floats:
    """Return (num_labels,) upper bounds on the contribution of each label to the mean reward, or inf if not known.

    max_work: maximum number of ways to see a label, times samples, that are tried.
    """
    table, coefficients = additive.table, additive.coefficients
    assert coefficients is not None
    if len(table.start) == 0:
        return np.empty(0)
    choices = choices_of(table)
    num_choices = _ways(choices, len(table.start))
    best = np.where(num_choices * additive.num_samples <= max_work, 0.0, math.inf)

    def work(first: int, last: int) -> None:
        best_of_labels(table, additive.valuation, coefficients, choices, first, last, best)

    run_chunks(work, len(best), additive.num_threads, first_piece=32)
    return best


def choices_of(table: Table) -> Choices:
    """Return for each label the sensors that may see it, and the entries of each."""
    num_courses, num_labels = len(table.offsets) - 1, len(table.start)
    sizes = np.diff(table.first_courses)
    courses = np.repeat(np.arange(num_courses), np.diff(table.offsets))
    sensors = np.repeat(np.arange(len(sizes)), sizes)[courses]
    entries = np.arange(table.offsets[0], table.offsets[-1])
    order = np.lexsort((entries, sensors, table.labels))
    pairs = table.labels[order] * len(sizes) + sensors[order]
    distinct, starts, counts = np.unique(pairs, return_index=True, return_counts=True)
    # Courses of the sensor that do not reach the label are one additional choice.
    spare = (counts < sizes[distinct % len(sizes)]).astype(np.int64)
    offsets = offsets_of(counts + spare)
    choice_entries = np.full(offsets[-1], -1)
    choice_entries[np.arange(len(order)) + np.repeat(offsets[:-1] - starts, counts)] = order
    label_offsets = offsets_of(np.bincount(distinct // len(sizes), minlength=num_labels))
    return Choices(label_offsets, distinct % len(sizes), offsets, choice_entries)


def _ways(choices: Choices, num_labels: int) -> Floats:
    """Return the number (num_labels,) of joint choices, which may be inf."""
    logs = np.log(np.diff(choices.entry_offsets))
    of_label = np.repeat(np.arange(num_labels), np.diff(choices.label_offsets))
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(np.bincount(of_label, logs, num_labels)))


def _most_found(additive: AdditiveRewards) -> float:
    """Return the value of undetected targets found if each sensor sees each cell as its best course there does."""
    cells, totals = additive.cells, np.zeros(len(additive.cells.worth))
    firsts: Ints = additive.table.first_courses
    for first, last in zip(firsts[:-1].tolist(), firsts[1:].tolist(), strict=True):
        least = np.zeros(len(totals))
        entries = slice(cells.offsets[first], cells.offsets[last])
        np.minimum.at(least, cells.cells[entries], cells.log_miss[entries])
        totals += least
    return value_found(cells.worth, totals)


def beyond_cutoff(evaluator: Evaluator, choice: Sequence[int]) -> Iterator[str]:
    """Yield a note on targets beyond the cutoff, which no longer count in the loss.

    These targets are likely to be detected, yet their errors at the end of the horizon are expected to exceed the
    cutoff. Reducing these errors gains nothing, so the choice gives these targets up for others.

    choice: the course of each sensor.
    """
    additive = evaluator.additive
    if additive is None or additive.valuation.kind != EXPECTED_LOSS:
        return
    valuation = additive.valuation
    cutoff, num_labels = math.sqrt(valuation.params[0]), len(valuation.prior) // additive.num_horizons
    existence = expit(valuation.prior[:num_labels, -2])
    detected, errors = _errors(additive, choice)
    likely, errors = detected[:num_labels] >= 0.5, errors[:num_labels]
    lost = likely & (errors > cutoff)
    num_beyond, expected = float(existence[lost].sum()), float(existence[likely].sum())
    if num_beyond > _SHARE * expected:
        yield (
            f"cutoff of the expected loss, {cutoff:.4g} m: {num_beyond:.2g} of {expected:.2g} targets that are likely "
            f"to be detected stay beyond it and do not count, with errors up to {errors[lost].max():.3g} m; take a "
            "larger one"
        )


def _errors(additive: AdditiveRewards, choice: Sequence[int]) -> tuple[Floats, Floats]:
    """Return (num_labels,) the probability that any scan detects each label, and its error in that case, m."""
    valuation, rows = additive.valuation, additive.with_scans(np.array(choice))
    predicted_square = valuation.covs[:, 0, 0] + valuation.covs[:, 1, 1]
    detected = -np.expm1(rows[:, -1, 0])
    # Without a cutoff the loss of a label is r (q tr P+ + (1 - q) tr P).
    without_cutoff = valuation._replace(own=predicted_square[:, np.newaxis], params=np.array([math.inf, 1.0, 1.0]))
    losses = -label_values(rows, without_cutoff)[:, 0, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = (losses / expit(valuation.prior[:, -2]) - (1.0 - detected) * predicted_square) / detected
    return detected, np.sqrt(np.where(detected > 0.0, squares, predicted_square))
