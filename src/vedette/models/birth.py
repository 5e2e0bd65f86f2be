"""Labelled multi-Bernoulli birth: at fixed sites, and where something unexplained was measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.models.arguments import float_array, instance, no_gaussians, positive, positive_definite, real, reject
from vedette.models.grid import CellGrid
from vedette.models.region import Region
from vedette.models.undetected import LEARNT, UndetectedModel

# Cells along each side of a region in which targets appear anywhere.
_CELLS = 16


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementBirth:
    """Targets that may appear anywhere, and start a track where they are measured.

    With a `region`, filters whose undetected targets are a Poisson intensity hold them as one: targets appear anywhere
    in the region alike, and a measurement is the first detection of one with the odds of that intensity, the
    probability of detection there and the clutter. Elsewhere a measurement that no track explains, with probability u,
    starts a label at the next scan with existence min(max_existence, expected u / sum of all u), at rest where it was
    measured (Reuter, Vo, Vo, Dietmayer 2014, section IV-C).

    Attributes:
        expected: expected number of targets that appear between two scans, or within the `period` of the births;
            learnt: estimated from the first detections, in filters whose undetected targets are an intensity.
        max_existence: largest existence of a label that starts at the next scan, in (0, 1).
        std: (state_dim,) standard deviation of the state of a new label; of the position about twice that of the noise.
        region: where targets appear; None: anywhere that is measured.

    Raises:
        InputError: names the field, what was expected and what came.
    """

    expected: float | Literal["learnt"]
    max_existence: float
    std: Floats
    region: Region | None = None

    def __post_init__(self) -> None:
        if self.region is not None:
            instance("MeasurementBirth.region", self.region, Region)
        if not self.is_learnt:
            object.__setattr__(self, "expected", positive("MeasurementBirth.expected", self.expected))
        if not 0.0 < real("MeasurementBirth.max_existence", self.max_existence) < 1.0:
            raise reject("MeasurementBirth.max_existence", "a probability above 0 and below 1", self.max_existence)
        std = float_array("MeasurementBirth.std", self.std, (None,))
        if len(std) < 2 or (std <= 0.0).any():
            raise reject("MeasurementBirth.std", "a standard deviation above 0 of each state component", std.tolist())
        object.__setattr__(self, "std", std)
        positive_definite("MeasurementBirth.cov", self.cov)

    @property
    def cov(self) -> Floats:
        """(state_dim, state_dim) covariance of a birth."""
        return np.diag(self.std**2)

    @property
    def is_learnt(self) -> bool:
        """Whether the expected number of births is learnt."""
        return isinstance(self.expected, str) and self.expected == LEARNT

    def uniform(self, cells_a_side: int = _CELLS) -> UndetectedModel | None:
        """The targets that appear anywhere in the region alike, on cells; None without a region.

        Births of a known rate are not among them, as they may be so many a scan. Where the rate is learnt, one target
        is expected before the first scan.
        """
        if self.region is None:
            return None
        grid, speed = (
            CellGrid(self.region, cells_a_side, cells_a_side),
            float(self.std[2]) if len(self.std) > 2 else 0.0,
        )
        if self.is_learnt:
            return UndetectedModel(grid, 1.0, birth_rate=LEARNT, speed=speed)
        return UndetectedModel(grid, 0.0, speed=speed)


@dataclass(frozen=True, slots=True, eq=False)
class BirthModel:
    """Each site may give birth to one target a step; its label is (step, site index) (paper-notes 6).

    With a `period` a site that gives birth within it with probability r does so within dt seconds with probability
    1 - (1 - r)^(dt / period), so that a stretch of time brings as many targets in however many steps it is cut. The
    first scan counts as one second after a time without targets.

    Attributes:
        existence: (num_sites,) birth probability of each site, in (0, 1).
        means: (num_sites, state_dim) mean state of a birth.
        covs: (num_sites, state_dim, state_dim) its covariance, symmetric positive definite.
        steps: the filter steps at which births at the sites may happen; None: every step.
        from_measurements: births where a tracker finds measurements that no track explains, beside the sites; None:
            there are none.
        anywhere: the targets that appear anywhere, where more is known of them than `from_measurements` says: how many
            there are at first, their birth rate and where they enter. Filters whose undetected targets are an
            intensity then hold these; None: what `from_measurements` says.
        period: s; the stretch of time within which births have these probabilities, those from measurements too; None:
            each step, whatever its length (the paper).
        num_sites: number of birth sites.
        state_dim: length of a target's state.

    Raises:
        InputError: names the field, what was expected and what came.
    """

    existence: Floats
    means: Floats
    covs: Floats
    steps: frozenset[int] | None = None
    from_measurements: MeasurementBirth | None = None
    period: float | None = None
    anywhere: UndetectedModel | None = None
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
        for name, value in (("existence", existence), ("means", means), ("covs", covs), ("steps", _steps(self.steps))):
            object.__setattr__(self, name, value)
        for name, size in (("num_sites", num_sites), ("state_dim", state_dim)):
            object.__setattr__(self, name, size)

    def is_active(self, step: int) -> bool:
        """Whether targets may be born at the sites at this filter step."""
        return self.num_sites > 0 and (self.steps is None or step in self.steps)

    @classmethod
    def none(cls, state_dim: int) -> BirthModel:
        """No births ever."""
        return cls(np.empty(0), *no_gaussians(state_dim))


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
