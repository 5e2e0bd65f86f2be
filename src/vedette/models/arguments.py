"""Checks of plain arguments, each raising `InputError` with the field, what was expected and what came."""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.kernels.types import Floats
from vedette.text import plain, printable

# Squares and products of variances in this range are numbers.
SMALLEST_VARIANCE, LARGEST_VARIANCE = 1e-60, 1e60
# Of a correlation matrix: what is below is rounding, and no direction of the state is known so well.
LEAST_EIGENVALUE = 1e-13


def reject(field: str, expected: str, got: Any) -> InputError:
    """The error for one bad argument; a long value is cut short."""
    text = printable(got if isinstance(got, str) else plain(got))
    return InputError(f"{field}: expected {expected}; got {text if len(text) <= 200 else text[:197] + '...'}")


def real(field: str, value: Any) -> float:
    """A finite real number."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
        raise reject(field, "a finite number", value)
    return float(value)


def positive(field: str, value: Any) -> float:
    """A finite number above zero."""
    if real(field, value) <= 0.0:
        raise reject(field, "a number above 0", value)
    return float(value)


def non_negative(field: str, value: Any) -> float:
    """A finite number of at least zero."""
    if real(field, value) < 0.0:
        raise reject(field, "a number of at least 0", value)
    return float(value)


def probability(field: str, value: Any) -> float:
    """A number in [0, 1]."""
    if not 0.0 <= real(field, value) <= 1.0:
        raise reject(field, "a probability in [0, 1]", value)
    return float(value)


def dimension(field: str, value: Any) -> int:
    """A whole number of at least one."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < 1:
        raise reject(field, "a whole number of at least 1", value)
    return int(value)


def float_array(field: str, values: Any, shape: tuple[int | None, ...], *, finite: bool = True) -> Floats:
    """A C-contiguous, writeable float64 copy of `values` with the given shape (None: any length).

    NaN is never accepted; infinities only where `finite` is false.
    """
    wanted = str(tuple("any" if length is None else length for length in shape)).replace("'any'", "any")
    try:
        array = np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise reject(field, f"numbers in an array of shape {wanted}", values) from None
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        raise reject(field, f"an array of shape {wanted}", f"shape {array.shape}")
    if not (np.isfinite(array).all() if finite else not np.isnan(array).any()):
        raise reject(field, "finite numbers" if finite else "numbers that are not NaN", values)
    return array


def params_vector(field: str, values: Any) -> Floats:
    """A parameter vector of a model function: any length, infinities allowed."""
    return float_array(field, values, (None,), finite=False)


def pose_vector(field: str, values: Any) -> Floats:
    """A sensor pose [px, py, heading_rad]."""
    return float_array(field, values, (3,))


def state_table(field: str, values: Any, state_dim: int | None = None) -> Floats:
    """(n, state_dim) states; one state may stand alone as a vector."""
    array = np.asarray(values)
    if array.ndim == 1 and array.size:
        return float_array(field, array[np.newaxis], (1, state_dim))
    return float_array(field, values, (None, state_dim))


def covariance_fault(matrix: Floats) -> tuple[str, str] | None:
    """What a square matrix lacks to be a covariance that filters can compute with, and what it is; None: nothing."""
    if not np.isfinite(matrix).all():
        return "finite numbers", "one that is not"
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        return "a symmetric matrix", "one that is not"
    variances = np.diagonal(matrix)
    wrong = (variances < SMALLEST_VARIANCE) | (variances > LARGEST_VARIANCE)
    if wrong.any():
        wanted = f"a positive definite matrix with variances from {SMALLEST_VARIANCE:g} to {LARGEST_VARIANCE:g}"
        return wanted, f"a variance of {float(variances[np.argmax(wrong)]):g}"
    stds = np.sqrt(variances)  # of the correlations, so that metres and radians can stand side by side
    least = float(np.linalg.eigvalsh(matrix / stds[:, np.newaxis] / stds)[0])
    if least <= LEAST_EIGENVALUE:
        return "a positive definite matrix", f"correlations with a least eigenvalue of {least:.3g}"
    return None


def positive_definite(field: str, matrix: Floats) -> None:
    """Raise unless `matrix` is symmetric positive definite, with variances that can be squared."""
    fault = covariance_fault(matrix)
    if fault is not None:
        raise reject(field, fault[0], f"{fault[1]}, in {plain(matrix)}")
