"""The intensity of targets not yet found: what it holds, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.densities import UndetectedIntensity
from vedette.errors import InputError
from vedette.models import CellGrid, Region

pytestmark = pytest.mark.lanes

GRID = CellGrid(Region(0.0, 30.0, 0.0, 20.0), 3, 2)


def test_it_says_how_many_are_where() -> None:
    given = np.arange(6.0)
    intensity = UndetectedIntensity(GRID, given)
    given[0] = 7.0
    assert intensity.total == 15.0
    assert intensity.num_cells == 6
    assert intensity.region == GRID.region
    np.testing.assert_array_equal(intensity.table, [[0, 1, 2], [3, 4, 5]])
    np.testing.assert_allclose(intensity.centres[[0, 5]], [[5, 5], [25, 15]])
    intensity.table[0, 0] = 9.0
    assert intensity.expected[0] == 0.0
    np.testing.assert_allclose(UndetectedIntensity.uniform(GRID, 3.0).expected, np.full(6, 0.5))


@pytest.mark.parametrize(
    ("expected", "message"),
    [
        (np.zeros(5), r"UndetectedIntensity\.expected: expected shape \(6\); got \(5,\)"),
        ([0.0, 0.0, -0.5, 0.0, 0.0, 0.0], r"UndetectedIntensity\.expected\[2\]: expected a number of at least 0; got"),
        (np.full(6, np.inf), r"UndetectedIntensity\.expected\[0\]: expected a finite number; got inf"),
        (["a"] * 6, r"UndetectedIntensity\.expected: expected an array of numbers"),
    ],
)
def test_what_is_no_intensity_is_refused(expected: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        UndetectedIntensity(GRID, expected)


def test_it_is_of_a_grid() -> None:
    grid: Any = "grid"
    with pytest.raises(InputError, match=r"UndetectedIntensity\.grid: expected a CellGrid; got str"):
        UndetectedIntensity(grid, np.zeros(6))
    with pytest.raises(InputError, match="total: expected a number of at least 0; got -1"):
        UndetectedIntensity.uniform(GRID, -1.0)
