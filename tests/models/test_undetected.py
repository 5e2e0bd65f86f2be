"""Grids of cells, and targets not yet found on them: where they go, appear and end, against plain quadrature."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr

from vedette.errors import InputError
from vedette.models import CellGrid, Region, UndetectedModel
from vedette.models.undetected import cell_shares

pytestmark = pytest.mark.lanes

REGION = Region(-100.0, 140.0, 10.0, 90.0)
ANY: Any = "box"
HALF: Any = 2.5
GRID = CellGrid(REGION, 6, 4)  # cells of 40 m x 20 m


def share_by_quadrature(step: float, size: float, offset: int) -> float:
    """Mean over a cell [0, size] of the probability that a Gaussian step ends in the cell `offset` to its right."""
    low, high = offset * size, (offset + 1) * size
    around = [edge + 2.0 * k * step for edge in (low, high) for k in range(-5, 6)]
    points = [0.0, *sorted(at for at in around if 0.0 < at < size), size]
    pieces = [
        quad(lambda x: ndtr((high - x) / step) - ndtr((low - x) / step), start, end, epsabs=1e-16, epsrel=1e-12)[0]
        for start, end in itertools.pairwise(points)
    ]
    return sum(pieces) / size


@pytest.mark.parametrize("step", [0.05, 1.0, 7.0, 40.0, 300.0])
def test_shares_of_cells_are_their_integrals(step: float) -> None:
    shares = cell_shares(step, 20.0, 9)
    expected = [share_by_quadrature(step, 20.0, offset) for offset in range(9)]
    np.testing.assert_allclose(shares, expected[: len(shares)], rtol=1e-9, atol=1e-15)
    assert max(expected[len(shares) :], default=0.0) < 1e-16


@pytest.mark.parametrize("step", [1e-9, 0.02, 3.0, 50.0, 2000.0])
def test_shares_of_all_cells_sum_to_one(step: float) -> None:
    shares = cell_shares(step, 20.0, 10**6)
    assert (shares >= 0.0).all()
    assert shares[0] + 2.0 * shares[1:].sum() == pytest.approx(1.0, abs=1e-11)


def test_targets_leave_large_cells_too() -> None:
    """A step of 5 m out of a cell of 1 km: about its density at the edge times the mean step beyond it."""
    shares = cell_shares(5.0, 1000.0, 3)
    assert shares[1] == pytest.approx(5.0 / 1000.0 / math.sqrt(2.0 * math.pi), rel=1e-12)
    assert shares[0] == pytest.approx(1.0 - 2.0 * shares[1], rel=1e-14)


def test_who_stands_still_stays() -> None:
    np.testing.assert_array_equal(cell_shares(0.0, 20.0, 9), [1.0])


def test_prediction_is_the_map_of_all_pairs_of_cells() -> None:
    rng = np.random.default_rng(1)
    model = UndetectedModel(GRID, rng.uniform(0.0, 2.0, 24), birth_rate=0.3, birth_density="boundary", speed=9.0)
    at_first = model.initial()
    survival, dt = rng.uniform(0.5, 1.0, 24), 2.0
    expected = model.births(dt)
    for i in range(24):
        for j in range(24):
            across, along = abs(i % 6 - j % 6), abs(i // 6 - j // 6)
            chance = share_by_quadrature(18.0, 40.0, across) * share_by_quadrature(18.0, 20.0, along)
            expected[j] += chance * survival[i] * at_first[i]
    np.testing.assert_allclose(model.predict(at_first, dt, survival), expected, rtol=1e-10)


def as_matrix(model: UndetectedModel, dt: float) -> Any:
    """(num_cells, num_cells) the prediction of one target in each cell."""
    return np.array([model.predict(unit, dt, 1.0) for unit in np.eye(model.grid.num_cells)]).T


def test_targets_are_lost_over_the_edge_alone() -> None:
    matrix = as_matrix(UndetectedModel(GRID, 0.0, speed=6.0), 3.0)
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-13)
    kept = matrix.sum(axis=0).reshape(4, 6)
    assert (kept < 1.0).all()
    np.testing.assert_allclose(kept, kept[::-1], rtol=1e-13)
    np.testing.assert_allclose(kept, kept[:, ::-1], rtol=1e-13)
    ways = [
        sum(share_by_quadrature(18.0, size, j - i) for j in range(num)) for size, num, i in [(40, 6, 1), (20, 4, 2)]
    ]
    assert kept[2, 1] == pytest.approx(math.prod(ways), rel=1e-10)
    wide = UndetectedModel(CellGrid(REGION, 61, 61), 0.0, speed=1.0)
    middle = np.zeros(61 * 61)
    middle[61 * 30 + 30] = 2.5
    assert wide.predict(middle, 1.0, 1.0).sum() == pytest.approx(2.5, rel=1e-13)
    assert wide.predict(middle, 1.0, 0.75).sum() == pytest.approx(0.75 * 2.5, rel=1e-13)


def test_prediction_of_no_time_changes_nothing() -> None:
    model = UndetectedModel(GRID, np.arange(24.0), birth_rate=1.0, speed=5.0)
    before = model.initial()
    np.testing.assert_array_equal(model.predict(before, 0.0, 1.0), np.arange(24.0))
    model.predict(before, 1.0, 0.5)
    np.testing.assert_array_equal(before, np.arange(24.0))


@pytest.mark.parametrize(("columns", "rows"), [(6, 4), (1, 4), (3, 1), (1, 1)])
def test_who_enters_at_the_border_appears_along_it(columns: int, rows: int) -> None:
    grid = CellGrid(REGION, columns, rows)
    width, height = grid.cell_size
    lengths = np.zeros((rows, columns))
    for r in range(rows):
        for c in range(columns):
            lengths[r, c] = width * ((r == 0) + (r == rows - 1)) + height * ((c == 0) + (c == columns - 1))
    assert lengths.sum() == pytest.approx(2 * (240.0 + 80.0))
    born = UndetectedModel(grid, 0.0, birth_rate=0.2, birth_density="boundary").births(3.0)
    np.testing.assert_allclose(born, 0.6 * lengths.ravel() / lengths.sum(), rtol=1e-12)
    anywhere = UndetectedModel(grid, 0.0, birth_rate=0.2).births(3.0)
    np.testing.assert_allclose(anywhere, np.full(columns * rows, 0.6 / (columns * rows)), rtol=1e-14)


def test_a_number_for_the_region_is_spread_evenly() -> None:
    np.testing.assert_allclose(UndetectedModel(GRID, 6.0).initial(), np.full(24, 0.25))


def test_cells_go_from_the_south_west_row_after_row() -> None:
    assert GRID.num_cells == 24
    assert GRID.cell_size == (40.0, 20.0)
    np.testing.assert_allclose(GRID.centres[[0, 1, 6, 23]], [[-80, 20], [-40, 20], [-80, 40], [120, 80]])


def test_means_over_a_cell_are_exact_for_polynomials() -> None:
    states, weights = GRID.states(4), GRID.node_weights()
    assert states.shape == (24, 9, 4)
    assert states.flags.c_contiguous
    assert weights.sum() == pytest.approx(1.0, rel=1e-15)
    assert not states[..., 2:].any()
    x, y = states[7, :, 0] + 40.0, states[7, :, 1] - 40.0  # from the middle of cell 7
    assert weights @ (x**4 * y**2) == pytest.approx(20.0**4 / 5 * 10.0**2 / 3, rel=1e-12)
    assert abs(weights @ (x**3 * y)) < 1e-9
    np.testing.assert_allclose(GRID.states(2, 1)[:, 0], GRID.centres)


@pytest.mark.parametrize(
    ("cell_size", "columns", "rows"), [(40.0, 6, 2), (39.9, 7, 3), (1e6, 1, 1), (0.1, 2400, 800), (80.0 / 3.0, 9, 3)]
)
def test_a_grid_of_cells_up_to_a_size(cell_size: float, columns: int, rows: int) -> None:
    grid = CellGrid.covering(REGION, cell_size)
    assert (grid.columns, grid.rows) == (columns, rows)


BAD: list[tuple[Any, str]] = [
    (lambda: CellGrid(REGION, 0, 4), "CellGrid.columns: expected a whole number of at least 1; got 0"),
    (lambda: CellGrid(REGION, 3, HALF), "CellGrid.rows: expected a whole number of at least 1; got 2.5"),
    (lambda: CellGrid(ANY, 3, 2), "CellGrid.region: expected a Region; got str"),
    (lambda: CellGrid.covering(REGION, 0.0), "cell_size: expected a number above 0; got 0"),
    (lambda: GRID.states(1), "state_dim: expected at least 2, px and py first; got 1"),
    (lambda: GRID.states(4, 0), "nodes_a_side: expected a whole number of at least 1; got 0"),
    (lambda: UndetectedModel(ANY, 1.0), "UndetectedModel.grid: expected a CellGrid; got str"),
    (lambda: UndetectedModel(GRID, -1.0), "UndetectedModel.expected: expected a number of at least 0; got -1"),
    (lambda: UndetectedModel(GRID, np.ones(1)), r"UndetectedModel.expected: expected an array of shape \(24,\)"),
    (lambda: UndetectedModel(GRID, -np.ones(24)), "UndetectedModel.expected: expected numbers of at least 0; got"),
    (lambda: UndetectedModel(GRID, np.full(24, np.nan)), "UndetectedModel.expected: expected finite numbers"),
    (lambda: UndetectedModel(GRID, 1.0, birth_rate=-1.0), "UndetectedModel.birth_rate: expected a number of at least"),
    (lambda: UndetectedModel(GRID, 1.0, speed=math.inf), "UndetectedModel.speed: expected a finite number; got inf"),
    (
        lambda: UndetectedModel(GRID, 1.0, birth_density="sea"),  # type: ignore[arg-type]
        "UndetectedModel.birth_density: expected one of uniform, boundary; got sea",
    ),
    (lambda: UndetectedModel(GRID, 1.0, survival=1.5), "UndetectedModel.survival: expected a probability"),
    (lambda: UndetectedModel(GRID, 1.0).predict(np.zeros(24), -1.0, 1.0), "dt: expected a number of at least 0"),
]


@pytest.mark.parametrize(("make", "message"), BAD, ids=lambda part: part if isinstance(part, str) else "")
def test_what_is_no_grid_or_model_is_refused(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
