"""Vectors and matrices side by side: one row of numbers for each entry, with a number for each of many Gaussians.

Symmetric matrices are lower triangles, row by row. Each loop writes one array, because the compiler does not vectorise
loops over many arrays that might overlap.
"""

from vedette.kernels.base.compile import inlined
from vedette.kernels.base.types import Floats


@inlined
def place(row: int, column: int) -> int:
    """Return the index of an entry in the lower triangle of a matrix, row by row."""
    return row * (row + 1) // 2 + column


@inlined
def place_in_symmetric(i: int, j: int) -> int:
    """Return the index of entry (i, j) of a symmetric matrix."""
    return place(i, j) if i >= j else place(j, i)


@inlined
def take_state(states: Floats, s: int, out: Floats) -> None:
    """Write out (state_dim,) = the state at index s of (state_dim, room)."""
    for j in range(len(out)):
        out[j] = states[j, s]


@inlined
def put_state(state: Floats, s: int, out: Floats) -> None:
    """Write a state (state_dim,) at index s of out (state_dim, room)."""
    for j in range(len(state)):
        out[j, s] = state[j]


@inlined
def take_matrix(lower: Floats, s: int, out: Floats) -> None:
    """Write out = the symmetric matrix at index s of lower triangles."""
    for i in range(out.shape[0]):
        for j in range(i + 1):
            out[i, j] = lower[place(i, j), s]
            out[j, i] = out[i, j]


@inlined
def put_matrix(matrix: Floats, s: int, out: Floats) -> None:
    """Write the lower triangle of a matrix at index s of out."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            out[place(i, j), s] = matrix[i, j]


@inlined
def put_rows(matrix: Floats, s: int, out: Floats) -> None:
    """Write all entries of a matrix, row by row, at index s of out."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i * matrix.shape[1] + j, s] = matrix[i, j]


@inlined
def set_row(value: float, num: int, out: Floats) -> None:
    """Set the first `num` numbers of a row."""
    for s in range(num):
        out[s] = value


@inlined
def copy_rows(rows: Floats, num: int, out: Floats) -> None:
    """Copy the first `num` numbers of as many rows as `out` has."""
    for i in range(out.shape[0]):
        given, written = rows[i], out[i]
        for s in range(num):
            written[s] = given[s]


@inlined
def add_scaled(scale: float, row: Floats, num: int, out: Floats) -> None:
    """Add the multiple of a row to a row."""
    if scale != 0.0:  # Jacobians of motion models are mostly zero.
        for s in range(num):
            out[s] += scale * row[s]


@inlined
def add_product(a: Floats, b: Floats, num: int, out: Floats) -> None:
    """Add the product of two rows to a row."""
    for s in range(num):
        out[s] += a[s] * b[s]


@inlined
def subtract_product(a: Floats, b: Floats, num: int, out: Floats) -> None:
    """Subtract the product of two rows from a row."""
    for s in range(num):
        out[s] -= a[s] * b[s]
