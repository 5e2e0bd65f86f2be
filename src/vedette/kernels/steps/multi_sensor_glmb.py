"""A further sensor's scan of the same time for a delta-GLMB density: an update without births, deaths or motion."""

from __future__ import annotations

import math

from vedette.kernels.association.predicted import Rows, expect_rows, make_rows
from vedette.kernels.association.truncation import Truncation
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Glmb, ScanInput, Sensor, Tracks
from vedette.kernels.gaussian.mixtures import copy_component
from vedette.kernels.gaussian.scratch import make_scratch
from vedette.kernels.steps.glmb import StepReport, finish_ranked


@kernel
def _certain_rows(tracks: Tracks, meas_dim: int) -> Rows:
    """The tracks as they are; in a hypothesis that holds one it is surely there."""
    rows = make_rows(len(tracks.labels), len(tracks.log_weights), tracks.means.shape[1], meas_dim)
    for i in range(len(tracks.labels)):
        rows.labels[i, 0], rows.labels[i, 1] = tracks.labels[i, 0], tracks.labels[i, 1]
        rows.log_absent[i], rows.offsets[i + 1] = -math.inf, tracks.offsets[i + 1]
    for c in range(len(tracks.log_weights)):
        rows.log_weights[c] = tracks.log_weights[c]
        copy_component(tracks.means, tracks.covs, c, rows.means, rows.covs, c)
    return rows


@kernel
def update_ranked(prior: Glmb, scan: ScanInput, sensor: Sensor, truncation: Truncation) -> tuple[Glmb, StepReport]:
    """The exactly ranked hypotheses after one more sensor's scan of the same time."""
    rows = _certain_rows(prior.tracks, len(sensor.angular))
    expect_rows(sensor, scan.pose, rows, make_scratch(prior.tracks.means.shape[1], len(sensor.angular)))
    return finish_ranked(prior, rows, scan, sensor, truncation)
