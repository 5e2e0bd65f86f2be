"""What a matrix needs to be a covariance; apart from the models, so that files are checked without what they load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Squares and products of variances in this range are numbers.
SMALLEST_VARIANCE, LARGEST_VARIANCE = 1e-60, 1e60
# Of a correlation matrix: what is below is rounding, and no direction of the state is known so well.
LEAST_EIGENVALUE = 1e-13


def covariance_fault(matrix: NDArray[np.float64]) -> tuple[str, str] | None:
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
