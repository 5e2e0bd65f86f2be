"""A grid over a box, and multi-target densities evaluated on products of it.

For Gaussians that vanish at the border of the box the midpoint rule converges faster than any power of the spacing: a
spacing of half the smallest standard deviation gives more than twelve digits.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from reference import Floats, Glmb, Label, Mixture


class Grid:
    """Midpoints of equal cells of a box in state space."""

    def __init__(self, low: Sequence[float], high: Sequence[float], num: int) -> None:
        widths = [(b - a) / num for a, b in zip(low, high, strict=True)]
        axes = [a + width * (np.arange(num) + 0.5) for a, width in zip(low, widths, strict=True)]
        self.points: Floats = np.array(list(itertools.product(*axes)))
        self.cell = float(np.prod(widths))

    def values(self, mixture: Mixture) -> Floats:
        """The mixture's density at every point."""
        total = np.zeros(len(self.points))
        for weight, mean, cov in mixture:
            deviations = self.points - mean
            exponents = -0.5 * np.sum(deviations @ np.linalg.inv(cov) * deviations, axis=1)
            total += weight * np.exp(exponents) / np.sqrt(np.linalg.det(2.0 * np.pi * cov))
        return total

    def moments(self, values: Floats) -> tuple[Floats, Floats]:
        """Mean and covariance of the density proportional to `values`."""
        shares = values / values.sum()
        mean = shares @ self.points
        deviations = self.points - mean
        return mean, (deviations * shares[:, None]).T @ deviations


def label_sets(*densities: Glmb) -> list[tuple[Label, ...]]:
    """Every label set of any of the densities, the smaller first."""
    found = {tuple(sorted(tracks)) for density in densities for _, tracks in density}
    return sorted(found, key=lambda labels: (len(labels), labels))


def joint_values(density: Glmb, labels: tuple[Label, ...], grid: Grid) -> Floats:
    """pi({(x_1, l_1), ..., (x_n, l_n)}) with each x_i at every grid point: an array of n axes."""
    total = np.zeros((len(grid.points),) * len(labels))
    for weight, tracks in density:
        if tuple(sorted(tracks)) != labels:
            continue
        product = np.array(weight)
        for label in labels:
            product = np.multiply.outer(product, grid.values(tracks[label]))
        total += product
    return total
