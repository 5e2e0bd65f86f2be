"""Summary statistics of a density: cardinality distribution and existence probabilities."""

from typing import Any

from vedette.densities.containers import MultiTarget
from vedette.densities.labelled import LABELLED, LabelledDensity
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints


def cardinality_distribution(density: MultiTarget) -> Floats:
    """Return the probabilities of 0, 1, ..., n targets. They sum to one.

    n is the size of the largest hypothesis of a GLMB (for a product of GLMBs, the sum over factors), the number of
    labels of an LMB and of Bernoullis of a multi-Bernoulli, and the largest number in an iid cluster. A Poisson density
    has no largest number: beyond n, a probability of less than 1e-20 remains.
    """
    if not isinstance(density, MultiTarget):
        raise InputError(f"density: expected a multi-target density; got {type(density).__name__}")
    return density.cardinality()


def existence_probabilities(density: LabelledDensity) -> tuple[Ints, Floats]:
    """Return the labels (num_labels, 2) in increasing order and the existence probability of each, (num_labels,)."""
    return check_labelled(density).label_existence()


def check_labelled(density: Any) -> LabelledDensity:
    """Return the density. Raises `InputError` if it is not labelled."""
    if not isinstance(density, LabelledDensity):
        raise InputError(f"density: expected {LABELLED}, which have labels; got {type(density).__name__}")
    return density
