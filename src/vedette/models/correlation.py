"""Errors that last: sensors whose scans are counted for as much as they tell."""

import math
from dataclasses import replace

from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.models import noise
from vedette.models.arguments import non_negative, positive, reject
from vedette.models.measurement import NoiseModel
from vedette.models.sensor import SensorModel


def independent_share(interval_s: float, correlation_s: float) -> float:
    """Return how many independent scans a scan is worth, (1 - q) / (1 + q) with q = exp(-interval / correlation time).

    The mean of n errors of variance R, with a correlation of q^k over k scans, has the variance R / (n share) for large
    n, as the mean of n share independent ones. The share is at most 1, that of a correlation time of 0.
    """
    return math.tanh(0.5 * interval_s / correlation_s) if correlation_s > 0.0 else 1.0


def discounted(sensor: SensorModel, interval_s: float, noise_s: float) -> SensorModel:
    """Return the sensor for filters, which take errors as independent, where those of a target last for several scans.

    With the share w of `independent_share` the covariance of the noise becomes R / w. Many scans then give the
    confidence in a position that they should, and a single one less than it could.

    Args:
        sensor: its noise is a built-in model.
        interval_s: time between two scans, s.
        noise_s: correlation time of the errors of the measurements of a target, s. 0: independent.

    Raises:
        InputError: a number out of range, or a noise model that is not built in.
    """
    share = independent_share(positive("interval_s", interval_s), non_negative("noise_s", noise_s))
    if share == 1.0:
        return sensor
    with suppress_unit_warnings():
        return replace(sensor, noise=_widened(sensor.noise, share**-0.5))


def _widened(model: NoiseModel, factor: float) -> NoiseModel:
    """Return the noise with standard deviations that are this many times as large."""
    if model.function not in noise.BUILT_IN or model.least_stds is None:
        raise reject("noise", "a built-in model, where its errors last", model.function)
    return replace(model, params=factor * model.params, least_stds=factor * model.least_stds)
