"""Trackers that others are put beside: one that knows the targets, and one that only looks at the last scan."""

from __future__ import annotations

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
from vedette.tracking.program import UNKNOWN_VARIANCE, untold

_SURE = 0.999
_LOST = 1000.0  # m and m/s: of a target before its first scan


@dataclass(slots=True, eq=False)
class _Reference:
    """What both share: a `vedette.tracking.CentralFilter` whose belief is an LMB.

    Attributes:
        targets: as the filters know them.
        sensors: all of them.
    """

    targets: TargetModel
    sensors: tuple[SensorModel, ...]

    def initial(self) -> LMB:
        """No target."""
        return LMB.empty(self.targets.state_dim)

    def _believed(self, labels: Any, means: Floats, covs: Floats) -> tuple[LMB, FilterInfo]:
        info = untold(len(means))
        if len(means) == 0:
            return self.initial(), info
        return LMB.from_bernoullis(labels, np.full(len(means), _SURE), means, covs), info


@dataclass(slots=True, eq=False)
class OracleFilter(_Reference):
    """Knows which targets there are; where each is, as well as the Cramer-Rao bound allows.

    Its estimates are the true states plus Gaussian errors whose covariances follow the posterior Cramer-Rao recursion
    at the truth, with every scan detecting by its probability (`vedette.simulation.cramer_rao`). Where targets move
    with less noise than the models allow for, filters may do better.

    Attributes:
        targets, sensors: as of all.
        truth: the targets of the run; None: `with_truth` sets them.
    """

    truth: Truth | None = None
    _covs: dict[int, Floats] = field(init=False, default_factory=dict, repr=False)

    def with_truth(self, truth: Truth) -> OracleFilter:
        """The same for the targets of a run."""
        return replace(self, truth=truth)

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
        """The targets at that step. Raises `InputError` where it was not told of them."""
        if self.truth is None:
            raise InputError("truth: expected the targets of the run, as of with_truth(); got None")
        ids, states = self.truth.at(step - 1)
        motion, dim = self.targets.motion, self.targets.state_dim
        if states.shape[1] != dim:
            raise InputError(f"truth: expected states of {dim} numbers, as of the filters; got {states.shape[1]}")
        wide = _LOST**2 * np.eye(dim)
        covs = np.array([self._covs.get(own, wide) for own in ids.tolist()]).reshape(-1, dim, dim)
        moved = transition_jacobians(motion, states, dt).reshape(-1, dim, dim)
        informations = np.linalg.inv(moved @ covs @ moved.swapaxes(1, 2) + motion.noise_covs(states, dt))
        for sensor, scan, pose in zip(self.sensors, scans, poses, strict=True):
            if scan is not None:
                informations = informations + scan_information(sensor, states, np.asarray(pose, np.float64))
        covs = np.linalg.inv(informations)
        covs = 0.5 * (covs + covs.swapaxes(1, 2))
        self._covs = dict(zip(ids.tolist(), covs, strict=True))
        errors = np.linalg.cholesky(covs) @ rng.standard_normal((len(ids), dim, 1))
        return self._believed([(1, own) for own in ids.tolist()], states + errors[:, :, 0], covs)


@dataclass(slots=True, eq=False)
class LastScanFilter(_Reference):
    """Takes every measurement of the scan that has most of them for a target: what no memory and no model gives."""

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
        """Where that scan says that something is."""
        there = [(scan, s) for s, scan in enumerate(scans) if scan is not None]
        scan, s = max(there, key=lambda each: len(each[0]), default=(np.empty((0, 2)), 0))
        means = np.zeros((len(scan), self.targets.state_dim))
        if len(scan):
            means[:, :2] = self.sensors[s].measurement.positions(np.asarray(scan), np.asarray(poses[s], np.float64))
        covs = np.tile(UNKNOWN_VARIANCE * np.eye(self.targets.state_dim), (len(scan), 1, 1))
        return self._believed([(1, i) for i in range(len(scan))], means, covs)
