"""Targets that no sensor has found yet: how many there are at first, and where they come, go and end."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vedette.kernels.base.types import Floats
from vedette.kernels.steps.undetected import moved_in_cells
from vedette.models.arguments import float_array, non_negative, positive, probability, reject
from vedette.models.fields import NonNegative, Positive, Probability
from vedette.models.grid import CellGrid

# Standard deviations beyond which a Gaussian is taken as 0: what lies there is below the rounding of a sum.
_REACH = 8.5
LEARNT: Literal["learnt"] = "learnt"  # in place of a birth rate that nobody knows


@dataclass(frozen=True, slots=True, eq=False)
class UndetectedModel:
    """How the expected number of undetected targets in each cell of a grid changes with time.

    Within a cell they are anywhere alike, and each moves with a velocity of its own, drawn anew at every prediction
    from a Gaussian with mean 0. Those that leave the region are lost.

    Attributes:
        grid: the cells.
        expected: mean number of undetected targets in the region at the first scan, before it, spread evenly; or
            (num_cells,) that in each cell.
        birth_rate: mean number of targets that appear in the region in a second; learnt: estimated from the first
            detections, in beliefs that have an intensity of undetected targets [1/s].
        enters: where they appear: anywhere alike, or along the border of the region, in the cells there.
        speed: standard deviation of each of the two components of the velocity [m/s].
        survival: probability of living through a second; none: as survival says of a scan, at the middle of a cell and
            at rest.
        prior_rate: where the birth rate is learnt, the mean of its prior density, a gamma of shape 1/2 [1/s].

    Raises:
        InputError: names the field, what was expected and what came.
    """

    grid: CellGrid
    expected: float | Floats
    birth_rate: NonNegative | Literal["learnt"] = 0.0
    enters: Literal["anywhere", "border"] = "anywhere"
    speed: float = 0.0
    survival: Probability | None = None
    prior_rate: Positive = 0.1

    def __post_init__(self) -> None:
        if not isinstance(self.grid, CellGrid):
            raise reject("UndetectedModel.grid", "a CellGrid", self.grid)
        if not self.is_learnt:
            object.__setattr__(self, "birth_rate", non_negative("UndetectedModel.birth_rate", self.birth_rate))
        object.__setattr__(self, "prior_rate", positive("UndetectedModel.prior_rate", self.prior_rate))
        object.__setattr__(self, "speed", non_negative("UndetectedModel.speed", self.speed))
        if self.enters not in ("anywhere", "border"):
            raise reject("UndetectedModel.enters", "anywhere or border", self.enters)
        if self.survival is not None:
            object.__setattr__(self, "survival", probability("UndetectedModel.survival", self.survival))
        field = "UndetectedModel.expected"
        if np.ndim(self.expected) == 0:
            object.__setattr__(self, "expected", non_negative(field, self.expected))
            return
        values = float_array(field, self.expected, (self.grid.num_cells,))
        if (values < 0.0).any():
            raise reject(field, "numbers of at least 0", values[values < 0.0])
        object.__setattr__(self, "expected", values)

    def initial(self) -> Floats:
        """(num_cells,) mean number of undetected targets in each cell at the first scan, before it."""
        num = self.grid.num_cells
        return np.full(num, self.expected / num) if np.ndim(self.expected) == 0 else np.array(self.expected)

    @property
    def is_learnt(self) -> bool:
        """Whether the birth rate is learnt."""
        return isinstance(self.birth_rate, str) and self.birth_rate == LEARNT

    @property
    def entering(self) -> Floats:
        """(num_cells,) in what proportion targets that appear are shared out among the cells."""
        return np.ones(self.grid.num_cells) if self.enters == "anywhere" else self.grid.border

    @property
    def first_rate(self) -> float:
        """Birth rate before anything was measured, 1/s."""
        return self.prior_rate if isinstance(self.birth_rate, str) else self.birth_rate

    def births(self, dt: float, rate: float | None = None) -> Floats:
        """(num_cells,) mean number of targets that appear within `dt` seconds. rate: 1/s; None: `first_rate`."""
        number, shares = (self.first_rate if rate is None else rate) * non_negative("dt", dt), self.entering
        return np.asarray(number * shares / shares.sum())

    def predict(self, expected: Floats, dt: float, survival: Floats | float, rate: float | None = None) -> Floats:
        """(num_cells,) mean number of undetected targets `dt` seconds after `expected`: who lives moves, others appear.

        out_j = births_j + sum over cells i of P(j | i) survival_i expected_i, with P(j | i) the probability that a
        point anywhere in cell i alike is in cell j after a Gaussian step of standard deviation speed * dt.

        Args:
            expected: (num_cells,) mean number in each cell.
            dt: s, from 0.
            survival: probability of living through `dt`: one number, or (num_cells,).
            rate: of births, 1/s; None: `first_rate`.
        """
        living = (expected * survival).reshape(self.grid.rows, self.grid.columns)
        return moved_in_cells(living, *self.shares(dt)).ravel() + self.births(dt, rate)

    def shares(self, dt: float) -> tuple[Floats, Floats]:
        """Shares of a cell's targets that go 0, 1, 2, ... columns, and rows, to one side within `dt` seconds."""
        step, grid = self.speed * non_negative("dt", dt), self.grid
        width, height = grid.cell_size
        return cell_shares(step, width, grid.columns), cell_shares(step, height, grid.rows)


@lru_cache(maxsize=1000)
def cell_shares(step: float, size: float, num: int) -> Floats:
    """(num or less,) probability that a point anywhere in a cell alike lands 0, 1, 2, ... cells to one side.

    The step is Gaussian with standard deviation `step`, cells are `size` long. With a = size / step and G the integral
    of the standard normal distribution function Phi, G(x) = x Phi(x) + phi(x), it is the second difference

        (G((k - 1) a) - 2 G(k a) + G((k + 1) a)) / a = (G(-(k - 1) a) - 2 G(-k a) + G(-(k + 1) a)) / a,   k > 0.

    Nothing is said of cells that a step reaches with a probability below rounding.
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
    """G(-x) = phi(x) - x Phi(-x) for x >= 0, whose two terms are nearly equal where x is large."""
    from scipy.special import erfcx

    density = np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)
    return np.asarray(density * (1.0 - x * math.sqrt(0.5 * math.pi) * erfcx(x * math.sqrt(0.5))))
