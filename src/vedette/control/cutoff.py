"""Whether the expected loss sees the errors that a decision is about: its cutoff must lie above them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.bounds import best_values
from vedette.control.evaluator import Evaluator
from vedette.densities.checks import offsets_of
from vedette.kernels.base.types import Floats
from vedette.kernels.planning.label_values import EXPECTED_LOSS
from vedette.probabilities import expit

# Of the targets that are likely to be detected, so many beyond the cutoff are told of. On paper-a they are up to half
# with cutoffs of 20 and 25 m, which cost 2.3 and 2.1 m of OSPA, up to a quarter with 30 m (0.6 m), none with 40 m.
_SHARE = 0.1


def beyond_cutoff(evaluator: Evaluator, choice: Sequence[int]) -> Iterator[str]:
    """What a reader of a decision must know of targets beyond the cutoff, of which the loss counts no more.

    They are likely to be detected, and though they are, their errors at the end of the horizon are expected to be
    beyond it: nothing is gained by bringing them nearer to it, and the choice gives them up for others.

    choice: the course of each sensor.
    """
    additive = evaluator.additive
    if additive is None or additive.valuation.kind != EXPECTED_LOSS:
        return
    valuation = additive.valuation
    cutoff, num = math.sqrt(valuation.params[0]), len(valuation.prior) // additive.looks
    existence = expit(valuation.prior[:num, -2])
    detected, errors = (own[:num] for own in _errors(additive, choice))
    likely = detected >= 0.5
    lost = likely & (errors > cutoff)
    uncounted, expected = float(existence[lost].sum()), float(existence[likely].sum())
    if uncounted > _SHARE * expected:
        yield (
            f"cutoff of the expected loss, {cutoff:.4g} m: {uncounted:.2g} of {expected:.2g} targets that are likely "
            f"to be detected stay beyond it and do not count, with errors up to {errors[lost].max():.3g} m; take a "
            "larger one"
        )


def _errors(additive: AdditiveRewards, choice: Sequence[int]) -> tuple[Floats, Floats]:
    """(num_labels,) probability that any scan detects each label, and its error then, m."""
    covs = additive.valuation.covs
    table, unseen = additive.table, covs[:, 0, 0] + covs[:, 1, 1]
    courses = table.first_courses[:-1] + np.array(choice)
    entries = np.concatenate([np.arange(*table.offsets[[course, course + 1]]) for course in courses])
    labels, changes = table.labels[entries], np.ascontiguousarray(table.changes[entries])
    offsets = offsets_of(np.diff(table.offsets)[courses])
    taken = table._replace(first_courses=np.arange(len(courses) + 1), offsets=offsets, labels=labels, changes=changes)
    uncut = additive.valuation._replace(own=unseen[:, np.newaxis], params=np.array([math.inf, 1.0, 1.0]))
    # Each sensor has one course: the best of all is the loss -r (q tr P+ + (1 - q) tr P) itself.
    losses = -best_values(replace(additive, table=taken, valuation=uncut), max_work=len(courses) + 1)
    detected = -np.expm1(np.bincount(labels, changes[:, -1, 0], len(unseen)))
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = (losses / expit(additive.valuation.prior[:, -2]) - (1.0 - detected) * unseen) / detected
    return detected, np.sqrt(np.where(detected > 0.0, squares, unseen))
