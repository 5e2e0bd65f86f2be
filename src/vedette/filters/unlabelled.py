"""The filters without labels: PHD, CPHD and CB-MeMBer."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from vedette.densities import IidCluster, MultiBernoulli, Poisson
from vedette.errors import NumericalError
from vedette.filters.base import SingleSensorFilter, StepInputs, step_limits
from vedette.filters.inputs import check_belief, check_scan, model_errors
from vedette.filters.protocols import FilterInfo
from vedette.kernels.steps.cbmember import step_cb_member
from vedette.kernels.steps.cphd import step_cphd
from vedette.kernels.steps.phd import step_phd
from vedette.models.arguments import generator

_Density = TypeVar("_Density", Poisson, IidCluster, MultiBernoulli)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class UnlabelledFilter(SingleSensorFilter, ABC, Generic[_Density]):
    """Base of the filters of one sensor without labels.

    Attributes and errors: as `SingleSensorFilter`.
    """

    kind: ClassVar[type[Any]]  # of the belief

    def initial(self) -> _Density:
        """Return the belief before the first scan: no target."""
        empty: _Density = self.kind.empty(self.targets.birth)
        return empty

    def step(
        self, belief: _Density, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator
    ) -> tuple[_Density, FilterInfo]:
        """Predict over `dt` seconds and update with a scan, arguments, results and errors as `DeltaGlmbFilter.step`.

        `rng` is not used. It is accepted so that filters are interchangeable.
        """
        generator(rng)
        measurements, repeats = check_scan(scan, self.sensor, self.targets.num_classes)
        prior = check_belief(belief, self.kind, self.targets)
        inputs = self._inputs_after(dt, measurements, pose, step)
        with model_errors():
            posterior, info = self._updated(prior, inputs, f"step {step}: ")
        return posterior, replace(info, num_duplicates=len(repeats))

    @abstractmethod
    def _updated(self, prior: _Density, inputs: StepInputs, place: str) -> tuple[_Density, FilterInfo]:
        """Return the posterior and a report without `num_duplicates`. place: prefix of errors."""

    def _info(self, report: Any, num_tracks: int, most: int, log_likelihood: float, discarded: float) -> FilterInfo:
        """Return the part of the report that all filters share. most: largest allowed size of the posterior."""
        return FilterInfo(
            log_likelihood=log_likelihood,
            num_hypotheses=1,
            num_tracks=num_tracks,
            truncation_error_bound=discarded,
            num_clutter_floored=int(report.num_raised),
            limit_reached=num_tracks >= most,
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PhdFilter(UnlabelledFilter[Poisson]):
    """Gaussian-mixture PHD filter of one sensor (Vo and Ma 2006).

    The belief is a Poisson density. Its intensity after a scan is that of the exact posterior of such a prior. Births
    enter with their intensity, the existence of each site times its density, which is exact as well.

    Attributes and errors: as `LmbFilter`.
    """

    kind: ClassVar[type[Poisson]] = Poisson

    def _updated(self, prior: Poisson, inputs: StepInputs, place: str) -> tuple[Poisson, FilterInfo]:
        posterior, report = step_phd(prior.to_kernel(), *inputs, step_limits(self, self.sensor).intensity_caps())
        log_likelihood = report.log_total + report.log_clutter - self.sensor.clutter.rate
        num, most = len(posterior.log_weights), self.limits.max_intensity_components
        return Poisson.from_kernel(posterior), self._info(report, num, most, log_likelihood, 0.0)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CphdFilter(UnlabelledFilter[IidCluster]):
    """Gaussian-mixture CPHD filter of one sensor (Vo, Vo and Cantoni 2007).

    The belief is an iid cluster. Its cardinality distribution and intensity after a scan are those of the exact
    posterior of such a prior. The cardinality distribution of the births is that of the multi-Bernoulli birth (not a
    Poisson one of the same mean), so that the predicted cardinality distribution is exact too.

    Attributes and errors: as `LmbFilter`.
    """

    kind: ClassVar[type[IidCluster]] = IidCluster

    def _updated(self, prior: IidCluster, inputs: StepInputs, place: str) -> tuple[IidCluster, FilterInfo]:
        log_cardinality, mixture = prior.to_kernel()
        caps = step_limits(self, self.sensor).intensity_caps()
        cardinality, posterior, report = step_cphd(log_cardinality, mixture, *inputs, caps)
        if report.log_total == -math.inf:
            raise NumericalError(f"{place}no number of targets can have given this scan; do the models forbid it?")
        log_likelihood = report.log_total + report.log_clutter - self.sensor.clutter.rate
        num, most = len(posterior.log_weights), self.limits.max_intensity_components
        info = self._info(report, num, most, log_likelihood, -math.expm1(report.log_kept))
        return IidCluster.from_kernel(cardinality, posterior), info


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CbMemberFilter(UnlabelledFilter[MultiBernoulli]):
    """Gaussian-mixture cardinality-balanced multi-target multi-Bernoulli filter (Vo, Vo and Cantoni 2009).

    The belief is a multi-Bernoulli density, to which the births are added unchanged. Prediction is exact. The update
    approximates the posterior by a Bernoulli for each missed one and for each measurement. It assumes that detection is
    probable and clutter not too dense. Then the expected number of targets is unbiased, unlike in Mahler's original
    multi-Bernoulli update.

    Attributes and errors: as `LmbFilter`.
    """

    kind: ClassVar[type[MultiBernoulli]] = MultiBernoulli

    def _updated(self, prior: MultiBernoulli, inputs: StepInputs, place: str) -> tuple[MultiBernoulli, FilterInfo]:
        limits = step_limits(self, self.sensor)
        posterior, report = step_cb_member(prior.to_kernel(), *inputs, limits.reduction(), limits.max_existence_logit)
        info = self._info(report, len(posterior.existence_logit), limits.max_labels, math.nan, math.nan)
        return MultiBernoulli.from_kernel(posterior), replace(info, dropped_existence=float(report.dropped_existence))
