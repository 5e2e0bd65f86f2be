"""Trial calls of model functions, to check that they give valid values of their kind.

A compiled function does not check indices, so an error in a user's function could otherwise give a plausible wrong
number. The checks call it once in plain Python, which checks indices, and once compiled, with an `out` full of NaN.
"""

import math
from typing import Any

import numpy as np

from vedette.errors import ModelError
from vedette.kernels.association.assignment import ABSENT, MISSED
from vedette.kernels.association.marginals import SUM_TOLERANCE
from vedette.kernels.base.compile import SIGNATURES
from vedette.kernels.base.types import Floats
from vedette.models.functions import ModelFunction, call, describe

# Relative to the largest entry: rounding in products of matrices is far smaller, a missing term far larger.
SYMMETRY_TOLERANCE = 1e-9
EIGENVALUE_TOLERANCE = 1e-9


def _fault(function: ModelFunction, args: tuple[Any, ...], expected: str, got: Any) -> ModelError:
    return ModelError(f"{describe(function, *args)}: expected {expected}; got {got}")


def _copies(args: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(np.array(arg) if isinstance(arg, np.ndarray) else arg for arg in args)


def _check_indices(function: ModelFunction, args: tuple[Any, ...]) -> None:
    """Raise `ModelError` for an index out of range. Ignore other exceptions, since 1 / 0 is inf in compiled code."""
    plain = getattr(function, "py_func", function)
    try:
        with np.errstate(all="ignore"):
            plain(*_copies(args))
    except IndexError as error:
        raise ModelError(f"{describe(function, *args)}: reads or writes outside an array: {error}") from error
    except Exception:
        return


def _checked_call(function: ModelFunction, *args: Any) -> Any:
    """Return the function's result after checking that its indices are in range and its inputs unchanged."""
    _check_indices(function, args)
    before = _copies(args)
    result = call(function, *args)
    names = SIGNATURES[function.kind][0]  # type: ignore[attr-defined]
    for name, old, new in zip(names, before, args, strict=True):
        if name != "out" and isinstance(new, np.ndarray) and not np.array_equal(old, new, equal_nan=True):
            raise _fault(function, before, f"{name!r} to be left as it was", new)
    return result


def probe_array(function: ModelFunction, args: tuple[Any, ...], shape: tuple[int, ...]) -> Floats:
    """Return the `out` of `shape` that `function(*args, out)` writes. Every entry must be written and finite."""
    out = np.full(shape, np.nan)
    _checked_call(function, *args, out)
    if not np.isfinite(out).all():
        raise _fault(function, args, f"every entry of out, of shape {shape}, written and finite", out.tolist())
    return out


def probe_covariance(function: ModelFunction, args: tuple[Any, ...], dim: int, *, definite: bool) -> Floats:
    """Return the covariance that a function writes. It must be symmetric and positive definite (or semidefinite)."""
    cov = probe_array(function, args, (dim, dim))
    scale = np.abs(cov).max()
    if np.abs(cov - cov.T).max() > SYMMETRY_TOLERANCE * scale:
        raise _fault(function, args, "a symmetric matrix", cov.tolist())
    variances = np.diagonal(cov)
    if (variances <= 0.0).any() if definite else (variances < 0.0).any():
        raise _fault(function, args, f"variances {'above 0' if definite else 'of at least 0'}", variances.tolist())
    # Eigenvalues of the correlation matrix, so that units such as metres and radians do not matter.
    stds = np.sqrt(np.where(variances > 0.0, variances, 1.0))
    lowest = float(np.linalg.eigvalsh(cov / np.outer(stds, stds))[0])
    if lowest <= 0.0 if definite else lowest < -EIGENVALUE_TOLERANCE:
        expected = "a positive definite matrix" if definite else "a positive semidefinite matrix"
        raise _fault(function, args, expected, cov.tolist())
    return cov


def probe_probability(function: ModelFunction, args: tuple[Any, ...]) -> float:
    """Return the value of a probability function. It must be in [0, 1]."""
    value = float(_checked_call(function, *args))
    if not 0.0 <= value <= 1.0:
        raise _fault(function, args, "a probability in [0, 1]", value)
    return value


def probe_log_intensity(function: ModelFunction, args: tuple[Any, ...]) -> float:
    """Return the value of a log intensity function. It must be below +inf, and -inf means no clutter there."""
    value = float(_checked_call(function, *args))
    if math.isnan(value) or value == math.inf:
        raise _fault(function, args, "a log intensity below +inf", value)
    return value


def probe_marginals(function: ModelFunction, params: Floats) -> None:
    """Check an association function on two rows that share a measurement: each row must be a distribution."""
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
    """Return the Jacobian that a function writes, after comparing it with central differences of `value_function`.

    The tolerance is wide (1 % of the largest slope): it detects a wrong sign, index or unit, but not rounding.
    """
    jacobian = probe_array(function, args, shape)
    slopes = central_differences(value_function, args, shape, angular)
    scale = np.maximum(np.abs(slopes).max(axis=1, keepdims=True), np.abs(jacobian).max(axis=1, keepdims=True))
    if np.isfinite(slopes).all() and (np.abs(jacobian - slopes) > 0.01 * scale + 1e-6).any():
        raise _fault(function, args, f"the derivative of the function, about {slopes.tolist()}", jacobian.tolist())
    return jacobian


def central_differences(function: ModelFunction, args: tuple[Any, ...], shape: tuple[int, int], angular: Any) -> Floats:
    """Return the Jacobian of a model function at the first argument, by central differences.

    args: state and further arguments. shape: of the Jacobian. angular: which components of the result are angles.
    """
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
