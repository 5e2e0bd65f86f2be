"""Grid of equal cells over a region, and quadrature nodes for means over a cell."""

import math
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import dimension, instance, positive, reject
from vedette.models.fields import Count, check_fields
from vedette.models.region import Region

# A side that is a whole number of cells, apart from rounding, is divided into that number.
_ROUNDING = 1e-9
_MOST_CELLS = 10**9  # along a side


@dataclass(frozen=True, slots=True)
class CellGrid:
    """Equal rectangular cells that fill a region, numbered from the south-west corner, row after row to the north.

    Attributes:
        region: the region.
        columns: number of cells from west to east.
        rows: number of cells from south to north.
    """

    region: Region
    columns: Count
    rows: Count

    def __post_init__(self) -> None:
        check_fields(self, "CellGrid.")

    @classmethod
    def covering(cls, region: Region, cell_size: float) -> "CellGrid":
        """Return the grid with the fewest cells of at most `cell_size` m (above 0) per side. May raise `InputError`."""
        size = positive("cell_size", cell_size)
        instance("region", region, Region)
        width, height = region.x_max - region.x_min, region.y_max - region.y_min
        if max(width, height) / size > _MOST_CELLS:
            expected = f"at least {max(width, height) / _MOST_CELLS:g}, for cells that can be numbered"
            raise reject("cell_size", expected, cell_size)
        return cls(region, *(max(math.ceil(side / size - _ROUNDING), 1) for side in (width, height)))

    @property
    def num_cells(self) -> int:
        """Number of cells."""
        return self.columns * self.rows

    @property
    def cell_size(self) -> tuple[float, float]:
        """Width (west to east) and height (south to north) of a cell in m."""
        region = self.region
        return (region.x_max - region.x_min) / self.columns, (region.y_max - region.y_min) / self.rows

    @property
    def centres(self) -> Floats:
        """Centre of each cell in m, (num_cells, 2)."""
        return self.states(2, 1)[:, 0]

    def states(self, state_dim: int, nodes_a_side: int = 3) -> Floats:
        """Return states at rest at the nodes of each cell, (num_cells, num_nodes, state_dim).

        Args:
            state_dim: length of a state. Its first two components are the position, the others 0.
            nodes_a_side: number of Gauss-Legendre nodes along each side of a cell. `num_nodes` is its square.

        Raises:
            InputError: a `state_dim` below 2, or no nodes.
        """
        if dimension("state_dim", state_dim) < 2:
            raise reject("state_dim", "at least 2, px and py first", state_dim)
        nodes, _ = np.polynomial.legendre.leggauss(dimension("nodes_a_side", nodes_a_side))
        width, height = self.cell_size
        x = self.region.x_min + width * (np.arange(self.columns)[:, None] + 0.5 + 0.5 * nodes)
        y = self.region.y_min + height * (np.arange(self.rows)[:, None] + 0.5 + 0.5 * nodes)
        states = np.zeros((self.rows, self.columns, nodes_a_side, nodes_a_side, state_dim))
        states[..., 0] = x[None, :, None, :]
        states[..., 1] = y[:, None, :, None]
        return states.reshape(self.num_cells, nodes_a_side**2, state_dim)

    def cells_at(self, states: Floats) -> Ints:
        """Return the cell of each of (n, 2 or more) states, (n,), or -1 outside of the region."""
        corner, size = (self.region.x_min, self.region.y_min), np.array(self.cell_size)
        column, row = np.floor((states[:, :2] - corner) / size).astype(np.int64).T
        inside = (column >= 0) & (column < self.columns) & (row >= 0) & (row < self.rows)
        return np.where(inside, row * self.columns + column, -1)

    @staticmethod
    def node_weights(nodes_a_side: int = 3) -> Floats:
        """Return the weights of the nodes of `states` in a mean over a cell, (num_nodes,). They sum to 1."""
        _, weights = np.polynomial.legendre.leggauss(dimension("nodes_a_side", nodes_a_side))
        return np.outer(weights, weights).ravel() / 4.0

    @property
    def border(self) -> Floats:
        """Length of the region's border along each cell in m, (num_cells,), or 0 for inner cells."""
        width, height = self.cell_size
        lengths = np.zeros((self.rows, self.columns))
        for edge, length in (
            (np.s_[0, :], width),
            (np.s_[-1, :], width),
            (np.s_[:, 0], height),
            (np.s_[:, -1], height),
        ):
            lengths[edge] += length
        return lengths.ravel()
