"""How far from the best a joint decision can be."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.evidence import Evidence
from vedette.control.explanation import Bound
from vedette.densities.checks import offsets_of
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.bounds import Choices, best_of_labels, losses_at_least
from vedette.kernels.planning.label_values import EXPECTED_LOSS
from vedette.threads import run_chunks


def bound_of(evidence: Evidence, choice: Sequence[int]) -> Bound | None:
    """The bound of a decision on its own samples; None where nothing is known.

    After every joint action was evaluated, the best of them. Otherwise, for rewards that are sums over targets, each
    target is given the joint action that is best for it, and what is left of targets that were not found is found by
    whoever sees it best: no joint action can be better than that for all of them. Where more ways to see a target are
    possible than `PlanningSettings.max_bound_work` allows to try, the expected loss has a bound of its own (see
    `vedette.kernels.planning.bounds`), and of another reward nothing is known for that target.
    """
    reward = evidence.mean_of(choice)
    if evidence.is_complete():
        return Bound(evidence.best, reward, "exhaustive")
    most = most_by_target(evidence)
    return None if most is None else Bound(most[0], reward, "by target", most[1])


def most_by_target(evidence: Evidence) -> tuple[float, int] | None:
    """What no joint action has a larger mean reward than, and of how many targets nothing is known; worked out once.

    None of rewards that are no sums over targets.
    """
    evaluator, known = evidence.evaluator, evidence.most_by_target
    additive = evaluator.additive
    if not known and additive is not None and additive.coefficients is not None:
        best = best_values(additive, evaluator.settings.max_bound_work)
        unknown = np.isinf(best).reshape(additive.looks, -1).any(axis=0)
        known.append((float(best.sum()) + _most_found(additive), int(unknown.sum())))
    return known[0] if known else None


def best_values(additive: AdditiveRewards, max_work: int) -> Floats:
    """(num_labels,) the most that each label can add to the mean reward; inf where that is not known.

    max_work: ways to see a label, times samples, that are tried at most.
    """
    table, coefficients = additive.table, additive.coefficients
    assert coefficients is not None
    if len(table.start) == 0:
        return np.empty(0)
    choices = choices_of(table)
    ways = _ways(choices, len(table.start))
    best = np.where(ways * additive.num_samples <= max_work, 0.0, math.nan)

    def work(first: int, last: int) -> None:
        best_of_labels(table, additive.valuation, coefficients, choices, first, last, best)

    run_chunks(work, len(best), additive.num_threads, first_piece=32)
    if np.isnan(best).any():
        others = np.full(len(best), math.inf)
        if additive.valuation.kind == EXPECTED_LOSS:
            losses_at_least(table, additive.valuation, choices, others)
        best = np.where(np.isnan(best), others, best)
    return best


def choices_of(table: Table) -> Choices:
    """Of every label, the sensors that may see it and what each may say."""
    num_courses, num_labels = len(table.offsets) - 1, len(table.start)
    sizes = np.diff(table.first_courses)
    courses = np.repeat(np.arange(num_courses), np.diff(table.offsets))
    sensors = np.repeat(np.arange(len(sizes)), sizes)[courses]
    entries = np.arange(table.offsets[0], table.offsets[-1])
    order = np.lexsort((entries, sensors, table.labels))
    pairs = table.labels[order] * len(sizes) + sensors[order]
    distinct, starts, counts = np.unique(pairs, return_index=True, return_counts=True)
    # Courses of the sensor that do not reach the label are one choice more.
    spare = (counts < sizes[distinct % len(sizes)]).astype(np.int64)
    offsets = offsets_of(counts + spare)
    found = np.full(offsets[-1], -1)
    found[np.arange(len(order)) + np.repeat(offsets[:-1] - starts, counts)] = order
    label_offsets = offsets_of(np.bincount(distinct // len(sizes), minlength=num_labels))
    return Choices(label_offsets, distinct % len(sizes), offsets, found)


def _ways(choices: Choices, num_labels: int) -> Floats:
    """(num_labels,) numbers of joint choices, which may be inf."""
    logs = np.log(np.diff(choices.entry_offsets))
    of_label = np.repeat(np.arange(num_labels), np.diff(choices.label_offsets))
    with np.errstate(over="ignore"):
        return np.asarray(np.exp(np.bincount(of_label, logs, num_labels)))


def _most_found(additive: AdditiveRewards) -> float:
    """What is found where every sensor sees of every cell what any of its courses sees of it."""
    cells, totals = additive.cells, np.zeros(len(additive.cells.worth))
    firsts: Ints = additive.table.first_courses
    for first, last in zip(firsts[:-1].tolist(), firsts[1:].tolist(), strict=True):
        least = np.zeros(len(totals))
        entries = slice(cells.offsets[first], cells.offsets[last])
        np.minimum.at(least, cells.cells[entries], cells.log_miss[entries])
        totals += least
    return float(-(cells.worth @ np.expm1(totals)))
