"""Posterior Cramer-Rao bound over several scans: recursion of covariances at the true states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Floats, Ints
from vedette.models import MotionModel, SensorModel
from vedette.models.measurement import wrap_periodic

# Step of central differences, in units of the state.
_STEP = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class CovarianceRecursion:
    """Covariance recursion over the scans from one decision to the next, at the true targets.

    Covariances go through P <- F P F' + Q, then P^-1 <- P^-1 + P_D H' R^-1 H of each sensor that scans, where P_D is
    the share of scans that detect the target (posterior Cramer-Rao bound, Tichavsky, Muravchik and Nehorai 1998).
    """

    transitions: Floats  # F and Q, (num_scans, num_targets, dim, dim)
    noises: Floats
    alive: Floats  # (num_scans, num_targets) 1 if the target exists, else 0
    # P_D H' R^-1 H of the scans of each sensor, (num_courses, num_scans, num_targets, dim, dim)
    sensor_information: tuple[Floats, ...]
    powers: tuple[float, ...]  # weight of each sensor's information in the fused density
    one_belief: bool  # whether all scans update one density, which sensors share after every scan
    cutoff: float  # error that counts as a lost target, m

    def follow(self, covs: Sequence[Floats], actions: Ints) -> tuple[Floats, list[Floats]]:
        """(num_joint,) cost of joint actions (num_joint, num_sensors), and the covariances after the last scan.

        covs: (num_targets, dim, dim) of each density before. After: (num_joint, num_targets, dim, dim) of each. The
        cost is the sum over scans and targets of min(sqrt(tr P), cutoff), with P of the position in the fused density.
        """
        costs = np.zeros(len(actions))
        beliefs: list[Floats] = [np.broadcast_to(cov, (len(actions), *cov.shape)) for cov in covs]
        for k, (transition, noise) in enumerate(zip(self.transitions, self.noises, strict=True)):
            information = [of_courses[actions[:, s], k] for s, of_courses in enumerate(self.sensor_information)]
            infos: list[Floats] = [_inverse(transition @ cov @ transition.swapaxes(-1, -2) + noise) for cov in beliefs]
            if self.one_belief:
                beliefs = [_inverse(infos[0] + self._summed(information))]
                fused = beliefs[0]
            else:
                infos = [info + scan for info, scan in zip(infos, information, strict=True)]
                beliefs = [_inverse(info) for info in infos]
                fused = _inverse(self._summed(infos))
            errors = np.sqrt(fused[..., 0, 0] + fused[..., 1, 1])
            costs += np.minimum(errors, self.cutoff) @ self.alive[k]
        return costs, beliefs

    def _summed(self, informations: Sequence[Floats]) -> Floats:
        """Return the sum of the informations, weighted by the sensors' powers."""
        return np.asarray(sum(power * info for power, info in zip(self.powers, informations, strict=True)))


def _inverse(matrices: Floats) -> Floats:
    return np.asarray(np.linalg.inv(matrices), np.float64)


def transition_jacobians(motion: MotionModel, states: Floats, dt: float) -> Floats:
    """(num, dim, dim) derivatives of the motion over `dt` seconds at (num, dim) states, by central differences."""
    propagated = motion.propagate(_shifted(states), dt).reshape(2, motion.state_dim, *states.shape)
    return np.moveaxis((propagated[0] - propagated[1]) / (2.0 * _STEP), 0, -1)


def scan_information(sensor: SensorModel, states: Floats, pose: Floats, factors: Floats | float = 1.0) -> Floats:
    """(num, dim, dim) P_D H' R^-1 H of one scan of targets at (num, dim) states.

    factors: (num,) factors on P_D, see `Truth.detection_factors_at`.
    """
    num, dim = states.shape
    measured = sensor.measurement.measure(_shifted(states), pose).reshape(2, dim, num, sensor.meas_dim)
    change = (measured[0] - measured[1]).reshape(-1, sensor.meas_dim)
    change = wrap_periodic(change, sensor.measurement.periods).reshape(dim, num, sensor.meas_dim)
    jacobians = change.transpose(1, 2, 0) / (2.0 * _STEP)
    weights = np.linalg.inv(sensor.noise.covs(states, pose, sensor.meas_dim))
    detection = (factors * sensor.detection.prob(states, pose))[:, np.newaxis, np.newaxis]
    return np.asarray(detection * (jacobians.swapaxes(1, 2) @ weights @ jacobians))


def _shifted(states: Floats) -> Floats:
    """(2 dim num, dim) states with each component one step further, then one step back."""
    steps = _STEP * np.eye(states.shape[1])[:, np.newaxis]
    return np.ascontiguousarray(np.concatenate([states + steps, states - steps]).reshape(-1, states.shape[1]))
