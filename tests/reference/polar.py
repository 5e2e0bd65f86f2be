"""The posterior of a position given one bearing and range, integrated on a grid of bearings and ranges."""

from __future__ import annotations

import numpy as np

from reference import Floats

_REACH = 8.0  # standard deviations of the noise that the grid covers


def posterior(
    mean: Floats, cov: Floats, sensor: Floats, measurement: Floats, noise: Floats, num: int = 400
) -> tuple[Floats, Floats, float]:
    """Mean (2,), covariance (2, 2) and log marginal likelihood of the measurement.

    mean, cov: of the prior of the position, m. sensor: its position, m. measurement: bearing in rad and range in m.
    noise: their standard deviations. num: grid points along each axis. The noise of a bearing is not wrapped, which
    matters from about 60 degrees on.
    """
    width = min(_REACH * noise[0], np.pi)
    bearings = measurement[0] + np.linspace(-width, width, num)
    ranges = np.linspace(max(measurement[1] - _REACH * noise[1], 1e-6), measurement[1] + _REACH * noise[1], num)
    bearing, reach = np.meshgrid(bearings, ranges, indexing="ij")
    places = np.stack([sensor[0] + reach * np.cos(bearing), sensor[1] + reach * np.sin(bearing)], axis=-1)
    off = places - mean
    exponent = -0.5 * np.einsum("xyi,ij,xyj->xy", off, np.linalg.inv(cov), off)
    exponent -= 0.5 * (((bearing - measurement[0]) / noise[0]) ** 2 + ((reach - measurement[1]) / noise[1]) ** 2)
    # An area of the plane is range times the area of the grid's cell.
    exponent += np.log(reach) - np.log(4.0 * np.pi**2 * noise[0] * noise[1]) - 0.5 * np.linalg.slogdet(cov)[1]
    peak = exponent.max()
    density = np.exp(exponent - peak)
    total, cell = density.sum(), (bearings[1] - bearings[0]) * (ranges[1] - ranges[0])
    centre = np.einsum("xy,xyi->i", density, places) / total
    spread = np.einsum("xy,xyi,xyj->ij", density, places - centre, places - centre) / total
    return centre, spread, float(peak + np.log(total * cell))
