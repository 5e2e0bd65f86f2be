"""Trial calls of model functions: does this function, at this state, give a valid value of its kind?

A compiled function checks no index, so a slip in a user's function can otherwise end as a plausible wrong number. The
checks here call it once in plain Python, where an index is checked, and once compiled, on an `out` full of NaN.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.association.assignment import ABSENT, MISSED
from vedette.kernels.association.marginals import SUM_TOLERANCE
from vedette.kernels.base.compile import SIGNATURES
from vedette.kernels.base.types import Floats
from vedette.models.functions import ModelFunction, call, describe

# Relative to the largest entry: rounding of products of matrices is far below, a forgotten term far above.
SYMMETRY_TOLERANCE = 1e-9
EIGENVALUE_TOLERANCE = 1e-9


def _fault(function: ModelFunction, args: tuple[Any, ...], expected: str, got: Any) -> ModelError:
    return ModelError(f"{describe(function, *args)}: expected {expected}; got {got}")


def _copies(args: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(np.array(arg) if isinstance(arg, np.ndarray) else arg for arg in args)


def _check_indices(function: ModelFunction, args: tuple[Any, ...]) -> None:
    """Look for an index out of range. Other exceptions of plain Python do not count: compiled, 1 / 0 is inf."""
    plain = getattr(function, "py_func", function)
    try:
        with np.errstate(all="ignore"):
            plain(*_copies(args))
    except IndexError as error:
        raise ModelError(f"{describe(function, *args)}: reads or writes outside an array: {error}") from error
    except Exception:
        return


def _checked_call(function: ModelFunction, *args: Any) -> Any:
    """The function's result, once it is known to keep to its arrays and to leave its inputs alone."""
    _check_indices(function, args)
    before = _copies(args)
    result = call(function, *args)
    names = SIGNATURES[function.kind][0]  # type: ignore[attr-defined]
    for name, was, now in zip(names, before, args, strict=True):
        if name != "out" and isinstance(now, np.ndarray) and not np.array_equal(was, now, equal_nan=True):
            raise _fault(function, before, f"{name!r} to be left as it was", now)
    return result


def probe_array(function: ModelFunction, args: tuple[Any, ...], shape: tuple[int, ...]) -> Floats:
    """What `function(*args, out)` writes: every entry of an `out` of `shape` must be written and finite."""
    out = np.full(shape, np.nan)
    _checked_call(function, *args, out)
    if not np.isfinite(out).all():
        raise _fault(function, args, f"every entry of out, of shape {shape}, written and finite", out.tolist())
    return out


def probe_covariance(function: ModelFunction, args: tuple[Any, ...], dim: int, *, definite: bool) -> Floats:
    """What a covariance function writes: symmetric, and positive definite (or semidefinite)."""
    cov = probe_array(function, args, (dim, dim))
    scale = np.abs(cov).max()
    if np.abs(cov - cov.T).max() > SYMMETRY_TOLERANCE * scale:
        raise _fault(function, args, "a symmetric matrix", cov.tolist())
    variances = np.diagonal(cov)
    if (variances <= 0.0).any() if definite else (variances < 0.0).any():
        raise _fault(function, args, f"variances {'above 0' if definite else 'of at least 0'}", variances.tolist())
    # Eigenvalues of the correlation matrix, so that metres and radians can stand side by side.
    stds = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    lowest = float(np.linalg.eigvalsh(cov / np.outer(stds, stds))[0])
    if lowest <= 0.0 if definite else lowest < -EIGENVALUE_TOLERANCE:
        wanted = "a positive definite matrix" if definite else "a positive semidefinite matrix"
        raise _fault(function, args, wanted, cov.tolist())
    return cov


def probe_probability(function: ModelFunction, args: tuple[Any, ...]) -> float:
    """What a probability function returns: a number in [0, 1]."""
    value = float(_checked_call(function, *args))
    if not 0.0 <= value <= 1.0:
        raise _fault(function, args, "a probability in [0, 1]", value)
    return value


def probe_log_intensity(function: ModelFunction, args: tuple[Any, ...]) -> float:
    """What a log intensity function returns: a number below +inf; -inf says that no clutter falls there."""
    value = float(_checked_call(function, *args))
    if math.isnan(value) or value == math.inf:
        raise _fault(function, args, "a log intensity below +inf", value)
    return value


def probe_marginals(function: ModelFunction, params: Floats) -> None:
    """What an association function writes of two rows that contend for a measurement: distributions over options."""
    offsets, columns = np.array([0, 3, 7]), np.array([0, MISSED, ABSENT, 1, 0, MISSED, ABSENT])
    args = (offsets, columns, np.log([4.0, 0.5, 0.1, 3.0, 2.0, 0.3, 0.2]), params)
    out = np.full(len(columns), np.nan)
    log_total = float(_checked_call(function, *args, out))
    sums = np.add.reduceat(np.exp(out), offsets[:-1])
    if not (math.isfinite(log_total) and np.allclose(sums, 1.0, rtol=0.0, atol=SUM_TOLERANCE)):
        got = f"{out.tolist()} and {log_total}"
        raise _fault(
            function, args, "log probabilities that sum to 1 in each row, and the log of the total weight", got
        )


def probe_jacobian(
    function: ModelFunction, value_function: ModelFunction, args: tuple[Any, ...], shape: tuple[int, int], angular: Any
) -> Floats:
    """What a Jacobian function writes, compared with central differences of `value_function`.

    The comparison is loose (1 in 100 of the largest slope): it finds a wrong sign, place or unit, not a rounding.
    """
    jacobian = probe_array(function, args, shape)
    slopes = _central_differences(value_function, args, shape, angular)
    scale = np.maximum(np.abs(slopes).max(axis=1, keepdims=True), np.abs(jacobian).max(axis=1, keepdims=True))
    if np.isfinite(slopes).all() and (np.abs(jacobian - slopes) > 0.01 * scale + 1e-6).any():
        raise _fault(function, args, f"the derivative of the function, about {slopes.tolist()}", jacobian.tolist())
    return jacobian


def _central_differences(
    function: ModelFunction, args: tuple[Any, ...], shape: tuple[int, int], angular: Any
) -> Floats:
    state, rest = args[0], args[1:]
    slopes = np.empty(shape)
    ahead, behind = np.empty(shape[0]), np.empty(shape[0])
    for j in range(shape[1]):
        step = 1e-6 * max(1.0, abs(state[j]))
        moved = np.array(state)
        moved[j] = state[j] + step
        call(function, moved, *rest, ahead)
        moved[j] = state[j] - step
        call(function, moved, *rest, behind)
        change = ahead - behind
        change = np.where(angular, np.remainder(change + math.pi, 2.0 * math.pi) - math.pi, change)
        slopes[:, j] = change / (2.0 * step)
    return slopes
