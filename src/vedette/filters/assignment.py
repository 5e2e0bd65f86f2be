"""How filters ask which measurement is of which target: data association, as an argument."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

import numpy as np

from vedette.errors import InputError
from vedette.kernels.association.marginals import Association
from vedette.kernels.association.propagation import propagate_beliefs
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import params_vector
from vedette.models.fields import Checked, Count, NonNegative, part
from vedette.models.functions import ModelFunction, model_function, require_kind
from vedette.models.probe import probe_marginals


@runtime_checkable
class MarginalAssociation(Protocol):
    """How an LMB filter has the probabilities of associations."""

    def to_kernel(self) -> Association | None:
        """Who gives them, as kernels take it; None: the sums over clusters."""
        ...


@part("ranked", "assignment")
@dataclass(frozen=True, slots=True)
class RankedAssignment:
    """Joint choices in exact order, as many as `Limits` lets; for an LMB the exact sum over all of them, but in
    clusters too large for that.
    """

    finds: ClassVar[str] = "choices and marginals"

    def to_kernel(self) -> None:
        """None: the sums over clusters."""


@part("gibbs", "assignment")
@dataclass(frozen=True, slots=True)
class Gibbs(Checked):
    """Joint choices drawn by a Gibbs sampler (Vo, Vo, Hoang 2017, Algorithm 1), for scenes too busy to rank.

    Attributes:
        num_samples: sweeps a scan, shared out over the prior hypotheses.

    Raises:
        InputError: a number of samples below 1.
    """

    num_samples: Count = 1000
    finds: ClassVar[str] = "choices"


@dataclass(frozen=True, slots=True, eq=False)
class CustomMarginals:
    """Association marginals by a function of your own, for filters that ask no more of a scan: LMB filters.

    The function, of kind `association_marginals` (`vedette.models.model_function`), is told what may happen to each row
    of a scan, a track or a birth: the options `offsets[i]:offsets[i + 1]` of row i, heaviest first. `columns` says what
    an option is: the number of a measurement, from 0 on, which one row may take; -1, there and missed; -2, not there.
    `log_weights` are relative to the measurement being clutter; a joint choice, one option a row, weighs their product.
    It writes into `out` the log probability of each option and returns the log of the total weight of all joint
    choices, on which the log likelihood of the scan goes; -inf where none is possible.

    What it gives is not known to be exact, so `FilterInfo.discarded_weight_bound` is NaN.

    Attributes:
        function: the function.
        params: its own vector.

    Raises:
        InputError: a function of another kind, or params that are no vector.
        ModelError: on a small scan of two rows the function raises, reads or writes outside its arrays, or gives rows
            whose probabilities do not sum to 1; as at every scan thereafter.
    """

    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        require_kind("function", self.function, "association_marginals")
        object.__setattr__(self, "params", params_vector("params", self.params))
        probe_marginals(self.function, self.params)

    def to_kernel(self) -> Association:
        """The same, as kernels take it."""
        return Association(self.function, self.params)


@model_function("association_marginals")
def belief_propagation(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    """params: most sweeps, tolerance. See `vedette.kernels.association.propagation`."""
    return propagate_beliefs(offsets, columns, log_weights, int(params[0]), params[1], out)


@part("belief_propagation", "assignment")
@dataclass(frozen=True, slots=True)
class BeliefPropagation(Checked):
    """Association marginals by loopy belief propagation (Williams and Lau 2014), for an LMB.

    Its cost grows with the number of options, however many tracks contend. Exact where the tracks and measurements that
    may be of each other make no loop; elsewhere an approximation, and nothing says how good a one:
    `FilterInfo.discarded_weight_bound` is NaN.

    Attributes:
        max_sweeps: sweeps over all options at most.
        tolerance: relative change of a message below which it stands still.

    Raises:
        InputError: no sweep, a negative tolerance.
    """

    max_sweeps: Count = 1000
    tolerance: NonNegative = 1e-6
    finds: ClassVar[str] = "marginals"

    def to_kernel(self) -> Association:
        """The same, as kernels take it."""
        return Association(belief_propagation, np.array([float(self.max_sweeps), float(self.tolerance)]))


JointAssociation: TypeAlias = RankedAssignment | Gibbs
Assignment: TypeAlias = JointAssociation | MarginalAssociation


def check_marginals(value: Any) -> None:
    """`InputError` unless an LMB filter can associate so."""
    if not isinstance(value, MarginalAssociation):
        expected = "RankedAssignment, BeliefPropagation, CustomMarginals or another with to_kernel()"
        raise InputError(f"assignment: expected {expected}; got {type(value).__name__}")
