"""Eigenvalues of the small symmetric matrices of tracking."""

import math

from vedette.kernels.base.compile import borrowing
from vedette.kernels.base.types import Floats

_MAX_SWEEPS = 30  # of Jacobi rotations, which converge quadratically: a handful do


@borrowing
def _rotate(matrix: Floats, vectors: Floats, p: int, q: int) -> None:
    """One Jacobi rotation, after which matrix[p, q] is 0."""
    n = matrix.shape[0]
    theta = 0.5 * (matrix[q, q] - matrix[p, p]) / matrix[p, q]
    tangent = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
    if theta < 0.0:
        tangent = -tangent
    cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for k in range(n):
        a, b = matrix[k, p], matrix[k, q]
        matrix[k, p], matrix[k, q] = cosine * a - sine * b, sine * a + cosine * b
    for k in range(n):
        a, b = matrix[p, k], matrix[q, k]
        matrix[p, k], matrix[q, k] = cosine * a - sine * b, sine * a + cosine * b
    for k in range(n):
        a, b = vectors[k, p], vectors[k, q]
        vectors[k, p], vectors[k, q] = cosine * a - sine * b, sine * a + cosine * b
    matrix[p, q] = 0.0
    matrix[q, p] = 0.0


@borrowing
def diagonalise(matrix: Floats, vectors: Floats) -> None:
    """Eigenvalues of a symmetric matrix, on its diagonal, and its eigenvectors, the columns of `vectors`.

    By cyclic Jacobi rotations. `matrix` is used up. A diagonal matrix is left as it is.
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(_MAX_SWEEPS):
        rotated = False
        for p in range(n):
            for q in range(p + 1, n):
                # Beneath this an entry changes no eigenvalue of a double.
                if abs(matrix[p, q]) > 1e-17 * (abs(matrix[p, p]) + abs(matrix[q, q])):
                    _rotate(matrix, vectors, p, q)
                    rotated = True
        if not rotated:
            return


@borrowing
def clip_negative(matrix: Floats, rotated: Floats, vectors: Floats) -> None:
    """Set the negative eigenvalues of a symmetric matrix to 0. One without any is left as it is.

    rotated, vectors: of the same shape, working arrays.
    """
    n, negative = matrix.shape[0], False
    for i in range(n):
        for j in range(n):
            rotated[i, j] = matrix[i, j]
    diagonalise(rotated, vectors)
    for k in range(n):
        negative = negative or rotated[k, k] < 0.0
    if not negative:
        return
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += vectors[i, k] * max(rotated[k, k], 0.0) * vectors[j, k]
            matrix[i, j] = total
            matrix[j, i] = total
