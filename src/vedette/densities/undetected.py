"""Poisson densities of targets that were never detected: next to the labels of a belief, and on a grid."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vedette.densities import checks
from vedette.densities.unlabelled import Poisson, poisson_numbers
from vedette.errors import InputError
from vedette.internal.representation import SummaryRepr
from vedette.kernels.base.types import Floats, Ints
from vedette.models import CellGrid, Region
from vedette.models.arguments import non_negative, reject
from vedette.models.fields import NonNegative, check_fields


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class UndetectedTargets(SummaryRepr):
    """Poisson density of the targets that were never detected, and the label of the next first detection.

    Attributes:
        intensity: expected number of undetected targets by state, from birth sites and from dropped labels.
        next_label: birth step and index of the label that the next measurement may begin.
        cells: expected number of undetected targets that appeared anywhere in a region, by cell, or None if there are
            none.
        birth_rate: posterior of their birth rate if it is learnt, or None if it is given.

    Raises:
        InputError: a part of another kind, no label, or a birth rate of another number of cells.
    """

    intensity: Poisson
    next_label: tuple[int, int]
    cells: "UndetectedIntensity | None" = None
    birth_rate: "LearntRate | None" = None

    def __post_init__(self) -> None:
        check_fields(self, "UndetectedTargets.")
        label = tuple(self.next_label)
        if len(label) != 2 or not all(isinstance(number, int) for number in label):
            raise reject("UndetectedTargets.next_label", "two whole numbers, birth step and index", self.next_label)
        object.__setattr__(self, "next_label", label)
        if self.birth_rate is not None:
            num = 0 if self.cells is None else self.cells.num_cells
            if len(self.birth_rate.unit) != num:
                raise reject("UndetectedTargets.birth_rate.unit", f"{num} cells", f"{len(self.birth_rate.unit)}")

    def _summary(self) -> str:
        return f"{self.expected_number:.4g} expected"

    @property
    def expected_number(self) -> float:
        """Mean number of undetected targets."""
        return self.intensity.expected_number + (0.0 if self.cells is None else self.cells.total)

    def cardinality(self) -> Floats:
        """Probabilities of 0, 1, ... undetected targets, up to a number beyond which less than 1e-20 remains."""
        return poisson_numbers(self.expected_number)

    @classmethod
    def none(cls, like: Any) -> "UndetectedTargets":
        """Return the density without targets, before the first scan. like: as in `TrackTable.empty`."""
        return cls(Poisson.empty(like), (0, 0))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LearntRate(SummaryRepr):
    """Posterior of the rate of Poisson births, a gamma density, given the first detections of the targets.

    At a birth rate of 1/s, the expected number of targets detected so far is `exposure`. The number of first detections
    is then Poisson with mean rate times exposure.

    Attributes:
        rate: posterior mean of the birth rate, used for prediction [1/s].
        exposure: expected number of first detections per unit of the rate [s].
        unit: (num_cells,) expected number of undetected targets in each cell per unit of the rate [s].
        past: expected number of first detections of targets whose labels have ended.
        labels: (num, 2) labels that may be of targets born after the first scan.
        shares: (num,) probability of this for each label, if its target exists.

    Raises:
        InputError: an array of another shape, or a number that is negative or not finite.
    """

    rate: NonNegative
    exposure: NonNegative
    unit: Floats
    past: NonNegative
    labels: Ints
    shares: Floats

    def __post_init__(self) -> None:
        check_fields(self, "LearntRate.")
        labels = np.array(self.labels, np.int64)
        checks.check_array("LearntRate.labels", labels, np.int64, (None, 2))
        for name, shape in (("unit", (None,)), ("shares", (len(labels),))):
            values = checks.as_floats(f"LearntRate.{name}", getattr(self, name), shape)
            checks.check_finite(f"LearntRate.{name}", values, InputError)
            if (values < 0.0).any():
                raise reject(f"LearntRate.{name}", "numbers of at least 0", values.tolist())
            object.__setattr__(self, name, values)
        object.__setattr__(self, "labels", labels)

    def _summary(self) -> str:
        return f"of {self.rate:.3g} births a second"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class UndetectedIntensity(SummaryRepr):
    """Poisson density of undetected targets that is uniform in each cell, with independent cells.

    Attributes:
        grid: the cells of a region.
        expected: (num_cells,) mean number of undetected targets in each, copied.

    Raises:
        InputError: another number of cells, or a number that is negative or not finite.
    """

    grid: CellGrid
    expected: Floats

    def __post_init__(self) -> None:
        check_fields(self, "UndetectedIntensity.")
        field = "UndetectedIntensity.expected"
        expected = checks.as_floats(field, self.expected, (self.grid.num_cells,))
        checks.check_finite(field, expected, InputError)
        if (expected < 0.0).any():
            place = int(np.flatnonzero(expected < 0.0)[0])
            raise reject(f"{field}[{place}]", "a number of at least 0", expected[place])
        object.__setattr__(self, "expected", expected)

    def _summary(self) -> str:
        return f"of {self.num_cells} cells, {self.total:.4g} targets expected"

    @classmethod
    def uniform(cls, grid: CellGrid, total: float) -> "UndetectedIntensity":
        """Return a uniform density of `total` targets. Raises `InputError` for a negative or infinite number."""
        return cls(grid, np.full(grid.num_cells, non_negative("total", total) / grid.num_cells))

    @property
    def region(self) -> Region:
        """Region of the cells."""
        return self.grid.region

    @property
    def num_cells(self) -> int:
        """Number of cells."""
        return self.grid.num_cells

    @property
    def centres(self) -> Floats:
        """Centre of each cell in m, shape (num_cells, 2)."""
        return self.grid.centres

    @property
    def total(self) -> float:
        """Mean number of undetected targets in the region."""
        return float(self.expected.sum())

    @property
    def table(self) -> Floats:
        """Expected numbers as a map (rows, columns) whose first row is the southern one, for drawing."""
        return self.expected.reshape(self.grid.rows, self.grid.columns).copy()
