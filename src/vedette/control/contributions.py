"""Contributions of targets and sensors to the reward of a joint action, for rewards that are sums over labels."""

from typing import NamedTuple

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.joint_values import existence_logits, label_values


class Contributions(NamedTuple):
    """Contributions to a reward, in its own unit, as means over the samples.

    `baseline` plus the sum of `sensors` equals the reward, and so does `baseline` plus `existence`, `localisation` and
    `found` less the price of the sensors' courses.
    """

    baseline: float  # the reward without any scan of these sensors
    existence: Floats | None  # (num_labels,) gain from the existence of each target ...
    localisation: Floats | None  # (num_labels,) ... and from its position; None if the reward is not linear in its sums
    found: float  # gain from undetected targets
    sensors: Floats  # (num_sensors,) mean of the gains when added to those before it, and to those after it
    last: Floats  # (num_sensors,) gain of each when added to all others
    samples: Floats  # (num_samples,) rewards of the choice


def contributions_of(additive: AdditiveRewards, chosen: Ints, sensors: Ints) -> Contributions:
    """Return the contributions of some sensors to the reward of courses (num_sensors,). The others always scan.

    A sensor's contribution is its Shapley value on two orders, the printed and the reverse one: rewards of the first
    sensors, of the last ones, and of all but one, while the rest of them do not scan. sensors: (num,) indices of
    these sensors.
    """
    num_sensors = len(sensors)
    first_scan = np.arange(num_sensors) < np.arange(num_sensors + 1)[:, np.newaxis]
    scanning = np.concatenate([first_scan, ~first_scan, ~np.eye(num_sensors, dtype=bool)])
    actions = np.tile(chosen, (len(scanning), 1))
    actions[:, sensors] = np.where(scanning, chosen[sensors], -1)
    rewards = additive(actions)
    means = rewards.mean(axis=1)
    ahead, behind, without = np.split(means, [num_sensors + 1, 2 * num_sensors + 2])
    existence, localisation = _of_labels(additive, chosen, actions[0])
    total_gain = additive.found(chosen) - additive.found(actions[0])
    shares = 0.5 * (np.diff(ahead) - np.diff(behind))
    return Contributions(
        float(means[0]), existence, localisation, total_gain, shares, ahead[num_sensors] - without, rewards[num_sensors]
    )


def _of_labels(additive: AdditiveRewards, chosen: Ints, rest: Ints) -> tuple[Floats, Floats] | tuple[None, None]:
    """Return (num_labels,) gains by existence, and by localisation, or None if the reward is not linear in its sums.

    The gain by existence is that of the existence after all scans with the density after the scans of `rest`, in which
    -1 is a sensor that does not scan. The remainder is localisation.
    """
    valuation, coefficients, without_scans = additive.valuation, additive.coefficients, additive.with_scans(rest)
    if coefficients is None:
        return None, None
    with_scans, dim = additive.with_scans(chosen), valuation.references.shape[1]
    with_existence = without_scans.copy()
    with_existence[:, -2] += existence_logits(with_scans, dim) - existence_logits(without_scans, dim)
    before, partly, whole = (
        (label_values(rows, valuation).mean(axis=2) @ coefficients).reshape(additive.num_horizons, -1).sum(axis=0)
        for rows in (without_scans, with_existence, with_scans)
    )
    return partly - before, whole - partly
