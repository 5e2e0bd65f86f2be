"""A model function at many states in one call, as a call from Python costs more than most functions compute."""

from typing import Any

import numpy as np

from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats


@kernel
def fill_rows(function: Any, states: Floats, at: Any, params: Floats, out: Floats) -> None:
    """Call a function that writes its result at each of (n, state_dim) states, each into a row of `out`.

    at: a pose, or a period in seconds.
    """
    for i in range(len(states)):
        function(states[i], at, params, out[i])


@kernel
def numbers_of_rows(function: Any, states: Floats, at: Any, params: Floats) -> Floats:
    """(n,) numbers that a function returns at (n, state_dim) states."""
    numbers = np.empty(len(states))
    for i in range(len(states)):
        numbers[i] = function(states[i], at, params)
    return numbers
