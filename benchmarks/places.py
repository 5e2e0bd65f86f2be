"""Expected number of targets in the cells of a grid: what any multi-target density says about places."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from vedette.densities import IidCluster, MultiBernoulli, Poisson, UndetectedTargets
from vedette.densities.labelled import LabelledDensity
from vedette.models import CellGrid

Floats = NDArray[np.float64]

# Components with a smaller correlation between x and y than this are taken as uncorrelated.
_UNCORRELATED = 0.05
# Nodes and weights of a mean over a standard normal number. With equal steps it has next to no error where what it is
# the mean of varies over more than a step.
_NODES = np.linspace(-3.9, 3.9, 25)
_NODE_WEIGHTS = np.exp(-0.5 * _NODES**2)
_NODE_WEIGHTS /= _NODE_WEIGHTS.sum()


def expected_in_cells(belief: Any, grid: CellGrid) -> Floats:
    """Return the (num_cells,) mean number of targets in each cell, undetected targets included."""
    numbers = gaussians_in_cells(*weighted_gaussians(belief), grid)
    undetected = getattr(belief, "undetected", None)
    return numbers if undetected is None else numbers + undetected_in_cells(undetected, grid)


def true_in_cells(states: Floats, grid: CellGrid) -> Floats:
    """Return the (num_cells,) number of (num_targets, state_dim) targets in each cell."""
    y_edges, x_edges = edges(grid)
    return np.histogram2d(states[:, 1], states[:, 0], bins=(y_edges, x_edges))[0].ravel()


def weighted_gaussians(density: Any) -> tuple[Floats, Floats, Floats]:
    """Return the expected number, mean and covariance of each Gaussian component of the intensity of a density."""
    if isinstance(density, LabelledDensity):
        tracks = density.tracks
        existence = np.repeat(density.track_existence, np.diff(tracks.offsets))
        return existence * np.exp(tracks.log_weights), tracks.means, tracks.covs
    weights = np.exp(density.log_weights)
    if isinstance(density, MultiBernoulli):
        weights = weights * np.repeat(density.existence, np.diff(density.offsets))
    elif isinstance(density, IidCluster):
        weights = weights * density.expected_number
    else:
        assert isinstance(density, Poisson)
    return weights, density.means, density.covs


def gaussians_in_cells(weights: Floats, means: Floats, covs: Floats, grid: CellGrid) -> Floats:
    """Return the (num_cells,) sum of the weights of (num,) Gaussians, each times its mass in the cell."""
    share, centres, stds = uncorrelated_parts(weights, means[:, :2], covs[:, :2, :2])
    along_y, along_x = (
        np.diff(ndtr((cuts - centres[:, axis, None]) / stds[:, axis, None]), axis=1)
        for axis, cuts in zip((1, 0), edges(grid), strict=True)
    )
    return np.asarray((along_y * share[:, None]).T @ along_x).ravel()


def uncorrelated_parts(weights: Floats, means: Floats, covs: Floats) -> tuple[Floats, Floats, Floats]:
    """Return weights, means and standard deviations of Gaussians without correlation that add up to the given ones.

    With variances p and q and correlation r, (x, y) is the mean, plus a (sqrt(p |r|), sign(r) sqrt(q |r|)) with a
    standard normal number a, plus independent deviations of variances p (1 - |r|) and q (1 - |r|). A sum over nodes
    takes the mean over a.
    """
    variances = np.diagonal(covs, axis1=1, axis2=2)
    correlations = covs[:, 0, 1] / np.sqrt(variances[:, 0] * variances[:, 1])
    plain = np.abs(correlations) < _UNCORRELATED
    r = correlations[~plain]
    common = np.sqrt(variances[~plain] * np.abs(r)[:, None]) * np.column_stack([np.ones(len(r)), np.sign(r)])
    shifted = means[~plain, None] + common[:, None] * _NODES[:, None]
    rest = np.sqrt(variances[~plain] * (1.0 - np.abs(r))[:, None])
    return (
        np.concatenate([weights[plain], (weights[~plain, None] * _NODE_WEIGHTS).ravel()]),
        np.concatenate([means[plain], shifted.reshape(-1, 2)]),
        np.concatenate([np.sqrt(variances[plain]), np.repeat(rest, len(_NODES), axis=0)]),
    )


def undetected_in_cells(intensity: Any, grid: CellGrid) -> Floats:
    """Return the (num_cells,) mean number of undetected targets in each cell.

    intensity: `UndetectedTargets`, or the cells of a grid (`UndetectedIntensity`).
    """
    if isinstance(intensity, UndetectedTargets):
        found = gaussians_in_cells(*weighted_gaussians(intensity.intensity), grid)
        return found if intensity.cells is None else found + undetected_in_cells(intensity.cells, grid)
    along_y, along_x = (_overlaps(own, cut) for own, cut in zip(edges(intensity.grid), edges(grid), strict=True))
    return np.asarray(along_y.T @ intensity.table @ along_x).ravel()


def _overlaps(own: Floats, cuts: Floats) -> Floats:
    """Return the (num_own, num_cells) share of each of one's intervals that lies in each of the others."""
    low, high = np.maximum(own[:-1, None], cuts[:-1]), np.minimum(own[1:, None], cuts[1:])
    return np.maximum(high - low, 0.0) / np.diff(own)[:, None]


def edges(grid: CellGrid) -> tuple[Floats, Floats]:
    """Return the (rows + 1,) edges of the cells along y and the (columns + 1,) edges along x, in m."""
    region = grid.region
    along_y = np.linspace(region.y_min, region.y_max, grid.rows + 1)
    return along_y, np.linspace(region.x_min, region.x_max, grid.columns + 1)
