"""Validity checks of covariance matrices. Separate from the models, so that checking a file does not import them."""

import numpy as np
from numpy.typing import NDArray

# Squares and products of variances in this range neither overflow nor underflow.
SMALLEST_VARIANCE, LARGEST_VARIANCE = 1e-60, 1e60
# Least eigenvalue of a correlation matrix; smaller values are rounding, and no state is known that precisely.
LEAST_EIGENVALUE = 1e-13


def covariance_fault(matrix: NDArray[np.float64]) -> tuple[str, str] | None:
    """Return (expected, got) if a square matrix is not a covariance that the filters can use, or None if it is one."""
    if not np.isfinite(matrix).all():
        return "finite numbers", "one that is not"
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0.0):
        return "a symmetric matrix", "one that is not"
    variances = np.diagonal(matrix)
    wrong = (variances < SMALLEST_VARIANCE) | (variances > LARGEST_VARIANCE)
    if wrong.any():
        wanted = f"a positive definite matrix with variances from {SMALLEST_VARIANCE:g} to {LARGEST_VARIANCE:g}"
        return wanted, f"a variance of {float(variances[np.argmax(wrong)]):g}"
    stds = np.sqrt(variances)  # scaled to correlations, as states mix metres and radians
    least = float(np.linalg.eigvalsh(matrix / stds[:, np.newaxis] / stds)[0])
    if least <= LEAST_EIGENVALUE:
        return "a positive definite matrix", f"correlations with a least eigenvalue of {least:.3g}"
    return None
