"""Lost labels, and the expected number of targets without a label on a grid."""

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
_MIN_PROBABILITY = 1e-300  # lower bound of a probability in a denominator


def lost_labels(before: Any, after: Sequence[Any]) -> LMB | None:
    """Return the labels of a belief that no belief after the next scan has, or None if the beliefs have no labels."""
    if not all(isinstance(belief, LabelledDensity) for belief in (before, *after)):
        return None
    labels = [existence_probabilities(belief)[0] for belief in {id(belief): belief for belief in after}.values()]
    return as_lmb(without_labels(before, np.concatenate(labels))[0])


def expected_lost_targets(
    lost: LMB, targets: TargetModel, scanned: Sequence[tuple[SensorModel, Floats]], dt: float, grid: CellGrid
) -> Floats:
    """Mean number of lost, undetected targets in each cell, `dt` seconds after the belief `lost`, (num_cells,).

    For a label of existence r, survival probability p, predicted density f(x) and probability q(x) that all scans miss
    a target at x, the existence is

        r p int q f / (1 - r p + r p int q f)

    and the density is proportional to q f. f is evaluated at nodes, whose shares go to the cells that contain them.
    Nodes outside of the grid do not count.

    scanned: the sensors that scanned, and their poses.
    """
    tracks = lost.tracks
    track_of_component = np.repeat(np.arange(tracks.num_tracks), np.diff(tracks.offsets))
    with model_errors():
        motion = kernel_motion(targets.motion, targets.survival)
        paths = predict_paths(motion, dt, 1, for_kernel(tracks.means), for_kernel(tracks.covs))
    nodes = _position_nodes(paths.means[:, 0], paths.covs[:, 0])
    survival_weights = (
        lost.existence[track_of_component] * np.exp(tracks.log_weights) * targets.survival.prob(tracks.means, dt)
    )
    shares = survival_weights[:, None] * _NODES[:, 0]
    for sensor, pose in scanned:
        shares = shares * (1.0 - sensor.detection.prob(nodes, pose)).reshape(shares.shape)
    existing, missed = (
        np.bincount(track_of_component, values, tracks.num_tracks) for values in (survival_weights, shares.sum(axis=1))
    )
    shares /= np.maximum(1.0 - existing + missed, _MIN_PROBABILITY)[track_of_component, None]
    return expected_in_cells(nodes, shares.ravel(), grid)


def undetected_intensity(belief: Any, birth: BirthModel) -> UndetectedIntensity | None:
    """Return the intensity of all undetected targets of a belief on the cells of `birth.anywhere`.

    None if there are no such cells, or the belief has no undetected targets.
    """
    undetected = getattr(belief, "undetected", None)
    if birth.anywhere is None or undetected is None:
        return None
    grid, intensity = birth.anywhere.grid, undetected.intensity
    expected = birth.anywhere.initial() if undetected.cells is None else undetected.cells.expected
    shares = np.exp(intensity.log_weights)[:, None] * _NODES[:, 0]
    from_components = expected_in_cells(_position_nodes(intensity.means, intensity.covs), shares.ravel(), grid)
    return UndetectedIntensity(grid, expected + from_components)


def _position_nodes(means: Floats, covs: Floats) -> Floats:
    """Nodes over the position of each Gaussian, as states (num_components * num_nodes, state_dim), by component."""
    states = np.repeat(means[:, None], len(_NODES), axis=1)
    states[..., :2] += np.einsum("cij,nj->cni", np.linalg.cholesky(covs[:, :2, :2]), _NODES[:, 1:])
    return states.reshape(-1, states.shape[2])


def expected_in_cells(states: Floats, shares: Floats, grid: CellGrid) -> Floats:
    """Sum of the shares (n,) of states (n, 2 or more) in each cell, (num_cells,). States outside do not count."""
    cells = grid.cells_at(states)
    return np.bincount(cells[cells >= 0], shares[cells >= 0], grid.num_cells).astype(np.float64)


def drop_forgotten_labels(
    belief: _Labelled, birth: MeasurementBirth, views: FieldsOfView, sensor: int, min_detection: float
) -> tuple[_Labelled, float]:
    """Return a sensor's belief without labels that are out of view and vague, and the sum of their existences.

    A label is out of view if the mean probability of its detection by the sensor, over its density, is below
    `min_detection`. It is vague if its peak intensity is below that of the most certain birth: r / sqrt det of the
    covariance of its position is less than `max_existence` / (std_x std_y). When such a target comes back into view,
    the birth from its first measurement has more information than the label.

    views: fields of view of all sensors. Each sensor is taken to have scanned.
    """
    lmb = as_lmb(belief)
    covs = track_moments(lmb.tracks)[1][:, :2, :2]
    area = np.sqrt(np.maximum(covs[:, 0, 0] * covs[:, 1, 1] - covs[:, 0, 1] * covs[:, 1, 0], 0.0))
    vague = lmb.existence * birth.std[0] * birth.std[1] < birth.max_existence * area
    if not vague.any():
        return belief, 0.0
    out_of_view = views.if_all_scanned().detection_by(sensor, lmb.tracks) < min_detection
    return without_labels(belief, np.ascontiguousarray(lmb.tracks.labels[vague & out_of_view]))
