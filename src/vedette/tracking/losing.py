"""Labels that a sensor has lost sight of, and where targets without a label are, on a grid."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from vedette.densities import LMB, LabelledDensity, UndetectedIntensity, as_lmb, existence_probabilities, track_moments
from vedette.densities.containers import for_kernel
from vedette.densities.label_sets import without_labels
from vedette.filters.inputs import model_errors
from vedette.fusion import FieldsOfView
from vedette.kernels.base.types import Floats
from vedette.kernels.gaussian.position_integrals import spread_nodes
from vedette.kernels.planning.reach import predict_paths
from vedette.models import BirthModel, CellGrid, MeasurementBirth, SensorModel, TargetModel, kernel_motion

_Labelled = TypeVar("_Labelled", bound=LabelledDensity)
_NODES = spread_nodes()
_LEAST = 1e-300  # of a probability that is divided by


def lost_labels(before: Any, after: Sequence[Any]) -> LMB | None:
    """The labels of a belief that none of the beliefs after the next scan holds; None where beliefs have no labels."""
    if not all(isinstance(belief, LabelledDensity) for belief in (before, *after)):
        return None
    held = [existence_probabilities(belief)[0] for belief in {id(belief): belief for belief in after}.values()]
    return as_lmb(without_labels(before, np.concatenate(held))[0])


def expected_of_lost(
    lost: LMB, targets: TargetModel, looks: Sequence[tuple[SensorModel, Floats]], dt: float, grid: CellGrid
) -> Floats:
    """(num_cells,) mean number of lost targets in each cell, `dt` seconds after they were believed, none detected.

    A label that exists with r, lives on with p, is predicted as f(x) and missed at x by all scans with q(x) exists with

        r p int q f / (1 - r p + r p int q f)

    and has the density q f. f is taken at nodes, whose shares go to the cells that they lie in; those outside of the
    grid are lost.

    looks: the sensors that scanned, and where.
    """
    tracks = lost.tracks
    of_component = np.repeat(np.arange(tracks.num_tracks), np.diff(tracks.offsets))
    with model_errors():
        motion = kernel_motion(targets.motion, targets.survival)
        paths = predict_paths(motion, dt, 1, for_kernel(tracks.means), for_kernel(tracks.covs))
    nodes = _nodes_of(paths.means[:, 0], paths.covs[:, 0])
    living = lost.existence[of_component] * np.exp(tracks.log_weights) * targets.survival.prob(tracks.means, dt)
    shares = living[:, None] * _NODES[:, 0]
    for sensor, pose in looks:
        shares = shares * (1.0 - sensor.detection.prob(nodes, pose)).reshape(shares.shape)
    alive, missed = (np.bincount(of_component, each, tracks.num_tracks) for each in (living, shares.sum(axis=1)))
    shares /= np.maximum(1.0 - alive + missed, _LEAST)[of_component, None]
    return expected_in_cells(nodes, shares.ravel(), grid)


def undetected_of(belief: Any, birth: BirthModel) -> UndetectedIntensity | None:
    """The undetected targets of a belief on the cells of `birth.anywhere`, wherever they come from.

    None where there are no such cells, or the belief has no undetected targets.
    """
    held = getattr(belief, "undetected", None)
    if birth.anywhere is None or held is None:
        return None
    grid, intensity = birth.anywhere.grid, held.intensity
    expected = birth.anywhere.initial() if held.cells is None else held.cells.expected
    shares = np.exp(intensity.log_weights)[:, None] * _NODES[:, 0]
    elsewhere = expected_in_cells(_nodes_of(intensity.means, intensity.covs), shares.ravel(), grid)
    return UndetectedIntensity(grid, expected + elsewhere)


def _nodes_of(means: Floats, covs: Floats) -> Floats:
    """(num_components * num_nodes, state_dim) states that share each Gaussian's position evenly, one by one."""
    states = np.repeat(means[:, None], len(_NODES), axis=1)
    states[..., :2] += np.einsum("cij,nj->cni", np.linalg.cholesky(covs[:, :2, :2]), _NODES[:, 1:])
    return states.reshape(-1, states.shape[2])


def expected_in_cells(states: Floats, shares: Floats, grid: CellGrid) -> Floats:
    """(num_cells,) sums of the shares (n,) of states (n, 2 or more) in each cell; nobody counts those outside."""
    cells = grid.cells_at(states)
    return np.bincount(cells[cells >= 0], shares[cells >= 0], grid.num_cells).astype(np.float64)


def without_forgotten(
    belief: _Labelled, birth: MeasurementBirth, views: FieldsOfView, sensor: int, min_detection: float
) -> tuple[_Labelled, float]:
    """A sensor's own belief without the labels that it cannot see and knows too little of, and their summed existence.

    Not seen is a label that the sensor detects with a probability below `min_detection`, on average over its density.
    Known too little is one of which no place is likelier to hold a target than that of a birth at its most: r / sqrt
    det of the covariance of its position is less than `max_existence` / (std_x std_y). Where such a target comes back
    into view, the birth from its first measurement says more of it than the label.

    views: of all sensors; who has just scanned is not asked.
    """
    lmb = as_lmb(belief)
    covs = track_moments(lmb.tracks)[1][:, :2, :2]
    spread = np.sqrt(np.maximum(covs[:, 0, 0] * covs[:, 1, 1] - covs[:, 0, 1] * covs[:, 1, 0], 0.0))
    vague = lmb.existence * birth.std[0] * birth.std[1] < birth.max_existence * spread
    if not vague.any():
        return belief, 0.0
    unseen = views.if_all_scanned().detection_by(sensor, lmb.tracks) < min_detection
    return without_labels(belief, np.ascontiguousarray(lmb.tracks.labels[vague & unseen]))
