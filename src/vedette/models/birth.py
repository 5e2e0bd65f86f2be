"""Labelled multi-Bernoulli birth: at fixed sites, and from unexplained measurements."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from vedette.kernels.base.types import VX, VY, Floats, Marks
from vedette.kernels.gaussian.marks import marks_of, unmarked
from vedette.models.arguments import float_array, instance, no_gaussians, positive, positive_definite, reject
from vedette.models.fields import Chance, check_fields
from vedette.models.grid import CellGrid
from vedette.models.region import Region
from vedette.models.undetected import LEARNT, UndetectedModel

# Cells along each side of a region in which targets appear anywhere.
_CELLS = 16


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementBirth:
    """Birth from measurements: targets may appear anywhere, and start a track where they are measured.

    With a `region`, filters with a Poisson intensity of undetected targets use a uniform intensity over the region. A
    measurement is then the first detection of a target with the odds of that intensity, the probability of detection
    there and the clutter. Otherwise a measurement that is unexplained by tracks with probability u starts a label at
    the next scan, with existence min(max_existence, expected u / sum of all u), at rest at the measured position
    (Reuter, Vo, Vo, Dietmayer 2014, section IV-C).

    Attributes:
        expected: expected number of targets that appear between two scans, or within the `period` of the births.
            learnt: estimated from the first detections, in filters with an intensity of undetected targets.
        max_existence: largest existence of a label that starts at the next scan, in (0, 1).
        std: (state_dim,) standard deviation of the state of a new label, for the position about twice that of the
            noise.
        region: region in which targets appear. None: anywhere.
    """

    expected: float | Literal["learnt"]
    max_existence: Chance
    std: Floats
    region: Region | None = None

    def __post_init__(self) -> None:
        check_fields(self, "MeasurementBirth.")
        if not self.is_learnt:
            object.__setattr__(self, "expected", positive("MeasurementBirth.expected", self.expected))
        std = float_array("MeasurementBirth.std", self.std, (None,))
        if len(std) < 2 or (std <= 0.0).any():
            raise reject("MeasurementBirth.std", "a standard deviation above 0 of each state component", std.tolist())
        object.__setattr__(self, "std", std)
        positive_definite("MeasurementBirth.cov", self.cov)

    @property
    def cov(self) -> Floats:
        """Covariance of a birth, (state_dim, state_dim)."""
        return np.diag(self.std**2)

    @property
    def is_learnt(self) -> bool:
        """True if the expected number of births is learnt."""
        return isinstance(self.expected, str) and self.expected == LEARNT

    def uniform(self, cells_a_side: int = _CELLS) -> UndetectedModel | None:
        """Return the model of undetected targets that is uniform over the region, on cells, or None without a region.

        With a known rate, births are not included, as they may be a number per scan. With a learnt rate, one target is
        expected before the first scan.
        """
        if self.region is None:
            return None
        grid = CellGrid(self.region, cells_a_side, cells_a_side)
        speed = float(self.std[VX]) if len(self.std) > VY else 0.0
        if self.is_learnt:
            return UndetectedModel(grid, 1.0, birth_rate=LEARNT, speed=speed)
        return UndetectedModel(grid, 0.0, speed=speed)


@dataclass(frozen=True, slots=True, eq=False)
class BirthModel:
    """Labelled multi-Bernoulli birth: each site may give birth to one target per step.

    The label of a birth is (step, site index) (paper-notes 6). With a `period`, a site of birth probability r per
    period gives birth within dt seconds with probability 1 - (1 - r)^(dt / period), so the number of births in a time
    span does not depend on the number of steps. The first scan counts as one period after a time without targets.

    Attributes:
        existence: (num_sites,) birth probability of each site, in (0, 1).
        means: (num_sites, state_dim) mean state of a birth.
        covs: (num_sites, state_dim, state_dim) covariance of a birth, symmetric positive definite.
        steps: the filter steps at which births at the sites may happen. None: every step.
        from_measurements: further births, from measurements that no track explains. None: no such births.
        anywhere: model of undetected targets with more detail than `from_measurements`: initial number, birth rate and
            places of entry. Filters with an intensity of undetected targets use it. None: they use that of
            `from_measurements`.
        period: time in s for which birth probabilities are given, also those from measurements. None: each step,
            whatever its length (the paper).
        class_probs: (num_classes,) probability of each class of target, which sum to 1. None: targets have no classes.
            The classes of a sensor's measurements are in the same order (`vedette.models.ScanRows`).
        num_sites: number of birth sites.
        state_dim: length of a target's state.
    """

    existence: Floats
    means: Floats
    covs: Floats
    steps: frozenset[int] | None = None
    from_measurements: MeasurementBirth | None = None
    period: float | None = None
    anywhere: UndetectedModel | None = None
    class_probs: Floats | None = None
    num_sites: int = field(init=False)
    state_dim: int = field(init=False)

    def __post_init__(self) -> None:
        means = float_array("BirthModel.means", self.means, (None, None))
        num_sites, state_dim = means.shape
        existence = float_array("BirthModel.existence", self.existence, (num_sites,))
        covs = float_array("BirthModel.covs", self.covs, (num_sites, state_dim, state_dim))
        if state_dim < 2:
            raise reject("BirthModel.means", "states of at least 2 components, px and py first", f"{state_dim}")
        if ((existence <= 0.0) | (existence >= 1.0)).any():
            raise reject("BirthModel.existence", "probabilities above 0 and below 1", existence.tolist())
        for site, cov in enumerate(covs):
            positive_definite(f"BirthModel.covs[{site}]", cov)
        measured = self.from_measurements
        if measured is not None and not isinstance(measured, MeasurementBirth):
            raise reject("BirthModel.from_measurements", "a MeasurementBirth or None", measured)
        if measured is not None and len(measured.std) != state_dim:
            raise reject("BirthModel.from_measurements.std", f"{state_dim} numbers", measured.std.tolist())
        if self.anywhere is not None:
            instance("BirthModel.anywhere", self.anywhere, UndetectedModel)
        if self.period is not None:
            object.__setattr__(self, "period", positive("BirthModel.period", self.period))
        if self.class_probs is not None:
            object.__setattr__(self, "class_probs", _class_probs(self.class_probs))
        for name, value in (("existence", existence), ("means", means), ("covs", covs), ("steps", _steps(self.steps))):
            object.__setattr__(self, name, value)
        for name, size in (("num_sites", num_sites), ("state_dim", state_dim)):
            object.__setattr__(self, name, size)

    @property
    def num_classes(self) -> int:
        """Number of classes of targets, or 0 if they have none."""
        return 0 if self.class_probs is None else len(self.class_probs)

    @property
    def marks(self) -> Marks:
        """Marks of the component of a birth."""
        return unmarked(1) if self.class_probs is None else marks_of(np.log([self.class_probs]))

    def is_active(self, step: int) -> bool:
        """Return True if targets may be born at the sites at this filter step."""
        return self.num_sites > 0 and (self.steps is None or step in self.steps)

    def least_existence(self, clutter_rate: float) -> float:
        """Return the least existence of a label of a filter with labelled births, or 1 without births.

        clutter_rate: mean number of false measurements of a scan. Births from measurements are divided among them.
        """
        least, measured = float(self.existence.min(initial=1.0)), self.from_measurements
        if measured is None or measured.is_learnt:
            return least
        return min(least, measured.max_existence, float(measured.expected) / (1.0 + clutter_rate))

    @classmethod
    def none(cls, state_dim: int) -> "BirthModel":
        """Return the model without any births."""
        return cls(np.empty(0), *no_gaussians(state_dim))


def _class_probs(given: object) -> Floats:
    probs = float_array("BirthModel.class_probs", given, (None,))
    if len(probs) < 2 or (probs <= 0.0).any() or abs(probs.sum() - 1.0) > 1e-6:
        raise reject("BirthModel.class_probs", "at least 2 probabilities above 0 that sum to 1", probs.tolist())
    return np.asarray(probs / probs.sum())


def _steps(steps: Iterable[int] | None) -> frozenset[int] | None:
    if steps is None:
        return None
    try:
        values = list(steps)
        if any(isinstance(value, bool) or int(value) != value for value in values):
            raise ValueError
        return frozenset(int(value) for value in values)
    except (TypeError, ValueError):
        raise reject("BirthModel.steps", "None or whole numbers", steps) from None
