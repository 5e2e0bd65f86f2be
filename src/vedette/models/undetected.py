"""Model of undetected targets on a grid: initial number, births, motion and survival."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vedette.kernels.base.types import Floats
from vedette.kernels.steps.undetected import moved_in_cells
from vedette.models.arguments import float_array, non_negative, reject
from vedette.models.fields import NonNegative, Positive, Probability, check_fields
from vedette.models.grid import CellGrid

# Standard deviations beyond which a Gaussian is taken as 0: the mass there is below the rounding of a sum.
_REACH = 8.5
LEARNT: Literal["learnt"] = "learnt"  # in place of an unknown birth rate


@dataclass(frozen=True, slots=True, eq=False)
class UndetectedModel:
    """Model of the expected number of undetected targets in each cell of a grid over time.

    Targets are uniform within a cell. Each moves with its own velocity, drawn again at every prediction from a Gaussian
    with mean 0. Targets that leave the region are lost.

    Attributes:
        grid: the cells.
        expected: mean number of undetected targets in the region just before the first scan, spread evenly, or
            (num_cells,) mean number in each cell.
        birth_rate: mean number of targets that appear in the region per second. learnt: estimated from the first
            detections, in beliefs that have an intensity of undetected targets [1/s].
        birth_density: where targets appear: uniformly in the region, or in the cells along its boundary.
        speed: standard deviation of each of the two components of the velocity [m/s].
        survival: probability of surviving one second. none: that of the survival model over a scan, for a target at
            rest at the centre of a cell.
        prior_rate: mean of the prior density of a learnt birth rate, a gamma density of shape 1/2 [1/s].
    """

    grid: CellGrid
    expected: float | Floats
    birth_rate: NonNegative | Literal["learnt"] = 0.0
    birth_density: Literal["uniform", "boundary"] = "uniform"
    speed: NonNegative = 0.0
    survival: Probability | None = None
    prior_rate: Positive = 0.1

    def __post_init__(self) -> None:
        check_fields(self, "UndetectedModel.")
        if not self.is_learnt:
            object.__setattr__(self, "birth_rate", non_negative("UndetectedModel.birth_rate", self.birth_rate))
        field = "UndetectedModel.expected"
        if np.ndim(self.expected) == 0:
            object.__setattr__(self, "expected", non_negative(field, self.expected))
            return
        values = float_array(field, self.expected, (self.grid.num_cells,))
        if (values < 0.0).any():
            raise reject(field, "numbers of at least 0", values[values < 0.0])
        object.__setattr__(self, "expected", values)

    def initial(self) -> Floats:
        """Return the mean number of undetected targets in each cell just before the first scan, (num_cells,)."""
        num_cells = self.grid.num_cells
        return np.full(num_cells, self.expected / num_cells) if np.ndim(self.expected) == 0 else np.array(self.expected)

    @property
    def is_learnt(self) -> bool:
        """True if the birth rate is learnt."""
        return isinstance(self.birth_rate, str) and self.birth_rate == LEARNT

    @property
    def entering(self) -> Floats:
        """Weight of each cell for targets that appear, (num_cells,). Births are in proportion to it."""
        return np.ones(self.grid.num_cells) if self.birth_density == "uniform" else self.grid.border

    @property
    def first_rate(self) -> float:
        """Birth rate before any measurement, 1/s."""
        return self.prior_rate if isinstance(self.birth_rate, str) else self.birth_rate

    def births(self, dt: float, rate: float | None = None) -> Floats:
        """Mean number of births in each cell in `dt` seconds, (num_cells,). rate: 1/s. None: `first_rate`."""
        number, shares = (self.first_rate if rate is None else rate) * non_negative("dt", dt), self.entering
        return np.asarray(number * shares / shares.sum())

    def predict(self, expected: Floats, dt: float, survival: Floats | float, rate: float | None = None) -> Floats:
        """Return the mean number of undetected targets in each cell `dt` seconds later, (num_cells,).

        out_j = births_j + sum over cells i of P(j | i) survival_i expected_i, with P(j | i) the probability that a
        uniform point in cell i is in cell j after a Gaussian step of standard deviation speed * dt.

        Args:
            expected: (num_cells,) mean number in each cell.
            dt: time step in s, at least 0.
            survival: probability of surviving `dt`: one number, or (num_cells,).
            rate: birth rate, 1/s. None: `first_rate`.
        """
        living = (expected * survival).reshape(self.grid.rows, self.grid.columns)
        return moved_in_cells(living, *self.shares(dt)).ravel() + self.births(dt, rate)

    def shares(self, dt: float) -> tuple[Floats, Floats]:
        """Return the shares of a cell's targets that move 0, 1, 2, ... columns, and rows, to one side in `dt` s."""
        step, grid = self.speed * non_negative("dt", dt), self.grid
        width, height = grid.cell_size
        return cell_shares(step, width, grid.columns), cell_shares(step, height, grid.rows)


@lru_cache(maxsize=1000)
def cell_shares(step: float, size: float, num: int) -> Floats:
    """Probability that a uniform point in a cell moves 0, 1, 2, ... cells to one side, (num or less,).

    The step is Gaussian with standard deviation `step`, and cells are `size` long. With a = size / step and G the
    integral of the standard normal distribution function Phi, G(x) = x Phi(x) + phi(x), the probability is the second
    difference

        (G((k - 1) a) - 2 G(k a) + G((k + 1) a)) / a = (G(-(k - 1) a) - 2 G(-k a) + G(-(k + 1) a)) / a,   k > 0.

    Cells with a probability below rounding are left out.
    """
    if step == 0.0:
        return np.ones(1)
    ratio, last = size / step, min(num - 1.0, math.ceil(_REACH * step / size) + 1.0)
    below = _integral_below(ratio * np.arange(last + 2.0))
    shares = np.empty(int(last) + 1)
    shares[0] = 1.0 - 2.0 * (below[0] - below[1]) / ratio
    shares[1:] = (below[:-2] - 2.0 * below[1:-1] + below[2:]) / ratio
    return np.maximum(shares, 0.0)  # rounding, where a step goes over millions of cells


def _integral_below(x: NDArray[np.floating]) -> Floats:
    """Return G(-x) = phi(x) - x Phi(-x) for x >= 0. Its two terms are nearly equal for large x."""
    from scipy.special import erfcx

    density = np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)
    return np.asarray(density * (1.0 - x * math.sqrt(0.5 * math.pi) * erfcx(x * math.sqrt(0.5))))
