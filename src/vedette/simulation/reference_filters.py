"""Reference trackers for comparison: one that knows the true targets, and one that only uses the last scan."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.densities import LMB
from vedette.errors import InputError
from vedette.filters import FilterInfo
from vedette.kernels.base.types import Floats
from vedette.models import SensorModel, TargetModel
from vedette.simulation.cramer_rao import scan_information, transition_jacobians
from vedette.simulation.truth import Truth
from vedette.tracking.program import UNKNOWN_VARIANCE

_SURE = 0.999
_LOST = 1000.0  # m and m/s: standard deviation of a target before its first scan


@dataclass(slots=True, eq=False)
class _Reference:
    """Common part of both: a `vedette.tracking.CentralFilter` whose density is an LMB."""

    targets: TargetModel  # target model of the filters
    sensors: tuple[SensorModel, ...]  # all sensors

    def initial(self) -> LMB:
        """Return a density without targets."""
        return LMB.empty(self.targets.birth)

    def step(
        self,
        belief: Any,
        scans: Any,
        poses: Any,
        dt: float,
        step: int,
        *,
        rng: np.random.Generator,
        births: LMB | None = None,
    ) -> tuple[LMB, FilterInfo]:
        """Return the estimates at that step. Raises `InputError` for an oracle without a truth."""
        ids, means, covs = self._estimated(scans, poses, dt, step, rng)
        info = FilterInfo(math.nan, 1, len(means))
        if len(means) == 0:
            return self.initial(), info
        labels = [(1, target) for target in ids]
        return LMB.from_bernoullis(labels, np.full(len(means), _SURE), means, covs), info

    def _estimated(
        self, scans: Any, poses: Any, dt: float, step: int, rng: np.random.Generator
    ) -> tuple[Sequence[int], Floats, Floats]:
        """Return the number, mean and covariance of each estimated target."""
        raise NotImplementedError


@dataclass(slots=True, eq=False)
class OracleFilter(_Reference):
    """Tracker that knows which targets exist, and estimates their states as well as the Cramer-Rao bound allows.

    Its estimates are the true states plus Gaussian errors. Their covariances follow the posterior Cramer-Rao recursion
    at the truth, with the information of every scan weighted by its detection probability
    (`vedette.simulation.cramer_rao`). If targets move with less noise than the models assume, filters may do better.

    Attributes:
        targets, sensors: as in the other reference filter.
        truth: the targets of the run. None: set by `with_truth`.
    """

    truth: Truth | None = None
    _covs: dict[int, Floats] = field(init=False, default_factory=dict, repr=False)

    def with_truth(self, truth: Truth) -> "OracleFilter":
        """Return the filter for the targets of a run."""
        return replace(self, truth=truth)

    def _estimated(
        self, scans: Any, poses: Any, dt: float, step: int, rng: np.random.Generator
    ) -> tuple[Sequence[int], Floats, Floats]:
        if self.truth is None:
            raise InputError("truth: expected the targets of the run, as of with_truth(); got None")
        (ids, states), factors = self.truth.at(step - 1), self.truth.detection_factors_at(step - 1)
        motion, dim = self.targets.motion, self.targets.state_dim
        if states.shape[1] != dim:
            raise InputError(f"truth: expected states of {dim} numbers, as of the filters; got {states.shape[1]}")
        wide = _LOST**2 * np.eye(dim)
        covs = np.array([self._covs.get(target, wide) for target in ids.tolist()]).reshape(-1, dim, dim)
        moved = transition_jacobians(motion, states, dt).reshape(-1, dim, dim)
        informations = np.linalg.inv(moved @ covs @ moved.swapaxes(1, 2) + motion.noise_covs(states, dt))
        for sensor, scan, pose in zip(self.sensors, scans, poses, strict=True):
            if scan is not None:
                informations = informations + scan_information(sensor, states, np.asarray(pose, float), factors)
        covs = np.linalg.inv(informations)
        covs = 0.5 * (covs + covs.swapaxes(1, 2))
        self._covs = dict(zip(ids.tolist(), covs, strict=True))
        errors = np.linalg.cholesky(covs) @ rng.standard_normal((len(ids), dim, 1))
        return ids.tolist(), states + errors[:, :, 0], covs


@dataclass(slots=True, eq=False)
class LastScanFilter(_Reference):
    """Tracker that takes every measurement of the largest scan for a target: the result without memory and models."""

    def _estimated(
        self, scans: Any, poses: Any, dt: float, step: int, rng: np.random.Generator
    ) -> tuple[Sequence[int], Floats, Floats]:
        taken_scans = [(scan, s) for s, scan in enumerate(scans) if scan is not None]
        scan, s = max(taken_scans, key=lambda entry: len(entry[0]), default=(np.empty((0, 2)), 0))
        dim = self.targets.state_dim
        means = (
            self.sensors[s].measurement.states_at(np.asarray(scan), poses[s], dim) if len(scan) else np.empty((0, dim))
        )
        return range(len(scan)), means, np.tile(UNKNOWN_VARIANCE * np.eye(dim), (len(scan), 1, 1))
