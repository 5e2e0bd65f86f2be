"""Model functions: the decorator that compiles a plain Python function, and calls of model functions from Python.

A model function receives one state at a time and writes its result into the last argument, `out`, or returns a number.
A function of kind `association_marginals` (`vedette.filters.CustomMarginals`) receives all options of a scan, and does
both. `out` has arbitrary contents: **every** entry must be written, zeros too.

| kind | arguments | result |
|---|---|---|
| `transition` | state, dt, params, out | out: (state_dim,) state after `dt` seconds, without noise |
| `transition_jacobian` | state, dt, params, out | out: (state_dim, state_dim) derivative of the transition |
| `process_noise_cov` | state, dt, params, out | out: (state_dim, state_dim) symmetric, positive semidefinite |
| `prob_survival` | state, dt, params | probability in [0, 1] of living through `dt` seconds |
| `measurement` | state, pose, params, out | out: (meas_dim,) measurement without noise |
| `measurement_jacobian` | state, pose, params, out | out: (meas_dim, state_dim) derivative of the measurement |
| `measurement_noise_cov` | state, pose, params, out | out: (meas_dim, meas_dim) symmetric, positive definite |
| `prob_detection` | state, pose, params | probability in [0, 1] |
| `mean_prob_detection` | mean, cov, pose, params | mean of `prob_detection` over states N(mean, cov) |
| `label_reward` | existence, mean, cov, the same of the update, params, out | out: what a target adds to a reward |
| `association_marginals` | offsets, columns, log_weights, params, out | out: log probabilities, see `CustomMarginals` |
| `log_clutter_intensity` | measurement, pose, params | log of the expected clutter per unit of measurement space |

`state[0:2]` is always the position in metres. `pose` is [px, py, heading_rad] and further components of the
platform. `params` is the model's parameter vector.
"""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from vedette.errors import InputError, ModelError
from vedette.kernels.base.compile import SIGNATURES, check_arguments, compile_model_function
from vedette.kernels.base.rows import fill_rows, numbers_of_rows
from vedette.kernels.base.types import Floats
from vedette.models.arguments import reject

ModelFunction = Callable[..., Any]


def model_function(kind: str) -> Callable[[Callable[..., Any]], ModelFunction]:
    """Return a decorator that compiles a plain Python function as a model function of `kind` (table above).

    The function may use `math`, indexing, loops, other compiled functions, and anything else that Numba compiles.

    Raises:
        InputError: an unknown kind, an object that is not a plain function, or a wrong number of arguments.
        ModelError: the body cannot be compiled. The message has the place.
    """
    if kind not in SIGNATURES:
        raise reject("model function kind", f"one of {', '.join(SIGNATURES)}", kind)

    def decorate(function: Callable[..., Any]) -> ModelFunction:
        if not inspect.isfunction(function) or hasattr(function, "kind"):
            raise reject(f"{kind} function", "a plain Python function", function)
        try:
            check_arguments(function, kind)
        except TypeError as error:
            raise InputError(str(error)) from None
        try:
            compiled: ModelFunction = compile_model_function(function, kind)
        except TypeError as error:
            raise ModelError(str(error)) from error
        return compiled

    return decorate


def require_kind(field: str, function: Any, kind: str) -> None:
    """Raise `InputError` unless `function` was made by `@model_function(kind)`."""
    given_kind = getattr(function, "kind", None)
    if given_kind == kind and callable(function):
        return
    description = repr(function) if given_kind is None else f"a function of kind {given_kind!r}"
    raise reject(field, f"a function decorated with @model_function({kind!r})", description)


def describe(function: ModelFunction, *args: Any) -> str:
    """Return the name, kind and arguments of a call, for messages."""
    kind = str(getattr(function, "kind", "model"))
    named = zip(SIGNATURES[kind][0], args, strict=False)
    given = ", ".join(f"{name} {value}" for name, value in named if name not in ("params", "out"))
    return f"{kind} function {getattr(function, '__name__', '?')!r} at {given}"


def call(function: ModelFunction, *args: Any) -> Any:
    """Call a model function. Any exception becomes a `ModelError` that names the function and its arguments."""
    try:
        return function(*args)
    except Exception as error:
        raise ModelError(f"{describe(function, *args)}: raised {type(error).__name__}: {error}") from error


def write_rows(function: ModelFunction, states: Floats, at: Floats | float, params: Floats, out: Floats) -> None:
    """Call a model function that writes a result at each of (n, state_dim) states, into the rows of `out` (n, ...).

    at: a pose, or a period in seconds. Raises `ModelError` like `call`.
    """
    try:
        fill_rows(function, states, at, params, out)
    except Exception:  # call one state at a time, to find the one that raised
        for state, row in zip(states, out, strict=True):
            call(function, state, at, params, row)


def numbers_at(function: ModelFunction, states: Floats, at: Floats | float, params: Floats) -> Floats:
    """Numbers that a model function returns at (n, state_dim) states, (n,), with `at` and errors as in `write_rows`."""
    try:
        return numbers_of_rows(function, states, at, params)
    except Exception:
        return np.array([call(function, state, at, params) for state in states], dtype=np.float64)
