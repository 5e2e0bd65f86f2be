"""A model function at many states in one call: a call from Python costs more than most of them compute."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.bundle_types import typed_by_fields
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats


@typed_by_fields
class FunctionOfStates(NamedTuple):
    """A model function with all its arguments but the state, and `out` where it has that."""

    function: Any
    at: Any  # a pose, or a period in seconds
    params: Floats


@kernel
def fill_rows(model: FunctionOfStates, states: Floats, out: Floats) -> None:
    """Let a function that writes its result do so at each of (n, state_dim) states, each into a row of `out`."""
    function, at, params = model.function, model.at, model.params
    for i in range(len(states)):
        function(states[i], at, params, out[i])


@kernel
def numbers_of_rows(model: FunctionOfStates, states: Floats) -> Floats:
    """(n,) numbers that a function returns at (n, state_dim) states."""
    function, at, params = model.function, model.at, model.params
    numbers = np.empty(len(states))
    for i in range(len(states)):
        numbers[i] = function(states[i], at, params)
    return numbers


__all__ = ["FunctionOfStates", "fill_rows", "numbers_of_rows"]
