"""Improbable labels: compared with the undetected targets at their place, and returned to them.

A label is worth keeping for what later detections can make of it. Its next detection z has the odds
P_D r g(z) / kappa, and a first detection at the same place P_D D(z) / kappa, with r the existence of the label, g and D
the densities of its measurement and of those of undetected targets. Where r g is below D, the label has no effect on
later odds, however small both are.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Mixture
from vedette.kernels.gaussian.components import (
    copy_component,
    merge_components,
    own_components,
    stacked_mixtures,
)
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.steps.undetected import Undetected, cell_at

# Far from all births, the density of undetected targets counts as this share of its largest value: a lost target is
# kept down to a millionth of the odds of a new one.
_FAR = 1e-6
_FAR_SQUARED = -2.0 * math.log(_FAR)  # squared Mahalanobis distance at which a Gaussian has this share of its peak


class Background(NamedTuple):
    """Positions of the undetected targets before a scan, in few arrays, as kernels are called for each label."""

    sites: Floats  # (num_sites, 6) of each component: expected number; mean x, y; covariance xx, yy, xy
    table: Floats  # (num_cells,) targets per square metre in each cell
    grid: Floats  # (6,) corner x, y; cell width, height; number of columns; mean of the table


@kernel
def background_of(undetected: Undetected) -> Background:
    """Return the positions of the undetected targets."""
    intensity, cells = undetected.intensity, undetected.cells
    sites, grid = np.empty((len(intensity.log_weights), 6)), np.zeros(6)
    for c in range(len(sites)):
        mean, cov = intensity.means[c], intensity.covs[c]
        sites[c, 0], sites[c, 1], sites[c, 2] = math.exp(intensity.log_weights[c]), mean[0], mean[1]
        sites[c, 3], sites[c, 4], sites[c, 5] = cov[0, 0], cov[1, 1], cov[0, 1]
    if len(undetected.tables) == 0:
        return Background(sites, np.empty(0), grid)
    table = undetected.tables[0] / (cells.size[0] * cells.size[1])
    grid[0], grid[1], grid[2], grid[3] = cells.corner[0], cells.corner[1], cells.size[0], cells.size[1]
    grid[4], grid[5] = cells.num_columns, table.mean()
    return Background(sites, table, grid)


@borrowing
def _site_density(sites: Floats, c: int, x: float, y: float, cov: Floats) -> tuple[float, float]:
    """Return the density of a component at a Gaussian, 0 where it is below _FAR of the peak, and its peak."""
    xx, yy, xy = sites[c, 3] + cov[0, 0], sites[c, 4] + cov[1, 1], sites[c, 5] + cov[0, 1]
    dx, dy, det = x - sites[c, 1], y - sites[c, 2], xx * yy - xy * xy
    squared = (dx * dx * yy - 2.0 * dx * dy * xy + dy * dy * xx) / det
    peak = sites[c, 0] / (2.0 * math.pi * math.sqrt(det))
    return (peak * math.exp(-0.5 * squared) if squared < _FAR_SQUARED else 0.0), peak


@borrowing
def _cell_of(background: Background, place: Floats) -> int:
    """Return the index of the cell of a place, or -1 outside of the region, or without one."""
    grid = background.grid
    return cell_at(place[0], place[1], grid[0], grid[1], grid[2], grid[3], int(grid[4]), len(background.table))


@borrowing
def outweighs_undetected(existence: float, mean: Floats, cov: Floats, background: Background) -> bool:
    """Return True if a detection at a label's place is more probably of this label than of an undetected target.

    Compared are the densities of the position, each averaged over that of the label. Without undetected targets, False.

    mean, cov: of the label.
    """
    cell = _cell_of(background, mean)
    density, largest = background.table[cell] if cell >= 0 else 0.0, background.grid[5]
    for c in range(len(background.sites)):
        own, peak = _site_density(background.sites, c, mean[0], mean[1], cov)
        density += own
        largest += peak
    density = max(density, _FAR * largest)
    det = cov[0, 0] * cov[1, 1] - cov[0, 1] * cov[0, 1]
    return 0.0 < density < existence / (4.0 * math.pi * math.sqrt(det))


@borrowing
def _nearest_site(background: Background, mean: Floats, cov: Floats) -> tuple[int, float]:
    """Return which component has the largest density at a Gaussian, and that density, or -1 if all are far."""
    best, largest = -1, 0.0
    for c in range(len(background.sites)):
        density, _ = _site_density(background.sites, c, mean[0], mean[1], cov)
        if density > largest:
            best, largest = c, density
    return best, largest


@kernel
def with_returned(intensity: Mixture, tables: Floats, background: Background, returned: Mixture) -> Mixture:
    """Return the intensity with further Gaussians. In a region, their expected numbers are added to its cells.

    A Gaussian near a component is merged with it, with the moments of both. Far ones become components. The total
    expected number grows by theirs.

    Args:
        intensity: undetected targets after the scan, by the components of the background.
        tables: (num_tables, num_cells) as in `Undetected`, after the scan. The first is written.
        background: undetected targets before the scan.
        returned: the Gaussians, weighted by their expected numbers.
    """
    num = len(intensity.log_weights)
    if len(returned.log_weights) == 0:
        return intensity
    out, filled = stacked_mixtures(intensity, returned), num
    one, pair, weights = own_components(returned, 1), np.empty(2, np.int64), np.empty(2)
    for k in range(len(returned.log_weights)):
        mean, weight = returned.means[k], math.exp(returned.log_weights[k])
        site, density = _nearest_site(background, mean, returned.covs[k])
        cell = _cell_of(background, mean)
        if cell >= 0 and background.table[cell] > density:
            tables[0, cell] += weight
        elif site >= 0:
            total = log_add(out.log_weights[site], returned.log_weights[k])
            pair[0], pair[1] = site, num + k
            # Shares of the sum, which may be too small for a number of its own after a thousand empty scans.
            weights[0], weights[1] = math.exp(out.log_weights[site] - total), math.exp(returned.log_weights[k] - total)
            merge_components(out, pair, weights, 2, one, 0)
            one.log_weights[0] = total
            copy_component(one, 0, out, site)
        else:
            copy_component(returned, k, out, filled)
            filled += 1
    return own_components(out, filled)


@kernel
def add_to_cells(tables: Floats, background: Background, places: Floats, numbers: Floats) -> None:
    """Add expected numbers (num,) to the cells of places (num, state_dim) in the first table, if there is one."""
    for k in range(len(places)):
        cell = _cell_of(background, places[k])
        if cell >= 0:
            tables[0, cell] += numbers[k]
