"""Data association methods of the filters."""

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Protocol, TypeAlias, runtime_checkable

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
    """A method by which an LMB filter computes association probabilities."""

    def to_kernel(self) -> Association | None:
        """Return the kernel form of the method, or None for the sums over clusters."""


@part("ranked", "assignment")
@dataclass(frozen=True, slots=True)
class RankedAssignment:
    """Joint associations in exact order, up to the number in `Limits`.

    For an LMB, the exact sum over all of them, except in clusters too large for that.
    """

    finds: ClassVar[str] = "choices and marginals"

    def to_kernel(self) -> None:
        """Return None: the sums over clusters."""


@part("gibbs", "assignment")
@dataclass(frozen=True, slots=True)
class Gibbs(Checked):
    """Joint associations drawn by a Gibbs sampler (Vo, Vo, Hoang 2017, Algorithm 1), for scenes too dense to rank.

    Attributes:
        num_samples: sweeps per scan, divided among the prior hypotheses.

    Raises:
        InputError: a number of samples below 1.
    """

    num_samples: Count = 1000
    finds: ClassVar[str] = "choices"


@dataclass(frozen=True, slots=True, eq=False)
class CustomMarginals:
    """Association marginals by a custom function, for filters that need nothing else from a scan: LMB filters.

    The function, of kind `association_marginals` (`vedette.models.model_function`), receives the options of each row of
    a scan, which is a track or a birth: options `offsets[i]:offsets[i + 1]` of row i, heaviest first. `columns` gives
    the meaning of an option: the index of a measurement, from 0 on, which one row may take; -1, present and missed; -2,
    absent. `log_weights` are relative to the measurement being clutter. The weight of a joint choice, one option per
    row, is their product. The function writes the log probability of each option into `out` and returns the log of the
    total weight of all joint choices, which gives the log likelihood of the scan, or -inf if none is possible.

    The result is not known to be exact, so `FilterInfo.truncation_error_bound` is NaN.

    Attributes:
        function: the function.
        params: its parameter vector.

    Raises:
        InputError: a function of another kind, or params that are not a vector.
        ModelError: on a small scan of two rows, and at every later scan, the function raises, reads or writes outside
            its arrays, or gives rows whose probabilities do not sum to 1.
    """

    function: ModelFunction
    params: Floats = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        require_kind("function", self.function, "association_marginals")
        object.__setattr__(self, "params", params_vector("params", self.params))
        probe_marginals(self.function, self.params)

    def to_kernel(self) -> Association:
        """Return the method in kernel form."""
        return Association(self.function, self.params)


@model_function("association_marginals")
def belief_propagation(offsets: Ints, columns: Ints, log_weights: Floats, params: Floats, out: Floats) -> float:
    """Marginals by belief propagation. params: largest number of sweeps, tolerance.

    See `vedette.kernels.association.propagation`.
    """
    return propagate_beliefs(offsets, columns, log_weights, int(params[0]), params[1], out)


@part("belief_propagation", "assignment")
@dataclass(frozen=True, slots=True)
class BeliefPropagation(Checked):
    """Association marginals by loopy belief propagation (Williams and Lau 2014), for an LMB.

    The cost grows with the number of options, however many tracks compete. The result is exact if the graph of tracks
    and gated measurements has no loop. Otherwise it is an approximation of unknown accuracy:
    `FilterInfo.truncation_error_bound` is NaN.

    Attributes:
        max_sweeps: largest number of sweeps over all options.
        tolerance: relative change of a message below which it counts as converged.

    Raises:
        InputError: no sweep, a negative tolerance.
    """

    max_sweeps: Count = 1000
    tolerance: NonNegative = 1e-6
    finds: ClassVar[str] = "marginals"

    def to_kernel(self) -> Association:
        """Return the method in kernel form."""
        return Association(belief_propagation, np.array([float(self.max_sweeps), float(self.tolerance)]))


JointAssociation: TypeAlias = RankedAssignment | Gibbs
Assignment: TypeAlias = JointAssociation | MarginalAssociation


def _check_marginals(field: str, value: Any) -> None:
    if not isinstance(value, MarginalAssociation):
        expected = "RankedAssignment, BeliefPropagation, CustomMarginals or another with to_kernel()"
        raise InputError(f"{field}: expected {expected}; got {type(value).__name__}")


LmbAssociation = Annotated[MarginalAssociation, _check_marginals]  # field of an LMB filter
