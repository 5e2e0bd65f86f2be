"""Distribution of the number of targets of a density, and existence probabilities of its labels."""

from __future__ import annotations

from typing import Any

from vedette.densities.containers import MultiTarget
from vedette.densities.labelled import LABELLED, LabelledDensity
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints


def cardinality_distribution(density: MultiTarget) -> Floats:
    """Probabilities of 0, 1, ..., n targets; they sum to one.

    n is the size of the largest hypothesis of a GLMB (of a product of GLMBs, the sum of theirs), the number of labels
    of an LMB and of Bernoullis of a multi-Bernoulli, and the largest number that an iid cluster holds. A Poisson
    density has no largest number: n is one beyond which less than 1e-20 remains.
    """
    if not isinstance(density, MultiTarget):
        raise InputError(f"density: expected a multi-target density; got {type(density).__name__}")
    return density.cardinality()


def existence_probabilities(density: LabelledDensity) -> tuple[Ints, Floats]:
    """(num_labels, 2) labels in increasing order and (num_labels,) the probability that each one's target exists."""
    return check_labelled(density).label_existence()


def check_labelled(density: Any) -> LabelledDensity:
    """The density. Raises `InputError` where it does not name its targets."""
    if not isinstance(density, LabelledDensity):
        raise InputError(f"density: expected {LABELLED}, which have labels; got {type(density).__name__}")
    return density
