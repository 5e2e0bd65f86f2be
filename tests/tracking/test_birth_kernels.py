"""The kernels of births against plain formulas."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.densities import LMB, TrackTable
from vedette.filters.inputs import births_within
from vedette.kernels.gaussian.marks import unmarked
from vedette.kernels.labelled.births import BirthsOfMeasurements, births_of_measurements


def lmb(step: int, existence: list[float]) -> LMB:
    num = len(existence)
    labels = np.column_stack([np.full(num, step), np.arange(num)])
    tracks = TrackTable.from_gaussians(labels, np.arange(4.0 * num).reshape(num, 4), np.tile(np.eye(4), (num, 1, 1)))
    r = np.array(existence)
    return LMB(tracks, np.log(r) - np.log1p(-r))


def test_births_of_measurements_share_the_expected_number() -> None:
    states, unexplained = np.zeros((3, 4)), np.array([0.9, 0.2, 0.2])
    states[:, :2] = [[3.0, 4.0], [1.0, 2.0], [5.0, 6.0]]
    std = np.array([10.0, 20.0, 3.0, 4.0])
    born = births_of_measurements(states, unexplained, BirthsOfMeasurements(std, unmarked(1), 0.65, 0.4, 7, 2))
    assert born.tracks.labels.tolist() == [[7, 2], [7, 3], [7, 4]]
    assert born.tracks.components.means.tolist() == [[3.0, 4.0, 0.0, 0.0], [1.0, 2.0, 0.0, 0.0], [5.0, 6.0, 0.0, 0.0]]
    np.testing.assert_array_equal(born.tracks.components.covs, np.tile(np.diag(std**2), (3, 1, 1)))
    existence = 1.0 / (1.0 + np.exp(-born.existence_logit))
    np.testing.assert_allclose(existence, [0.4, 0.1, 0.1], rtol=1e-12)
    LMB(TrackTable.from_kernel(born.tracks), born.existence_logit)  # it is a valid one


@pytest.mark.parametrize("others", [None, [0.25, 1e-9]])
@pytest.mark.parametrize(("period", "dt"), [(None, 3.0), (2.0, 0.5), (2.0, 2.0), (1.0, 7.0)])
def test_births_within_a_time(others: list[float] | None, period: float | None, dt: float) -> None:
    sites = lmb(3, [0.5, 0.01])
    more = None if others is None else lmb(4, others)
    due = births_within(sites, period, dt, more)
    given = np.array([0.5, 0.01, *(others or [])])
    share = 1.0 if period is None else dt / period
    np.testing.assert_allclose(due.existence, -np.expm1(share * np.log1p(-given)), rtol=1e-12)
    assert due.tracks.num_tracks == len(given)
    np.testing.assert_array_equal(due.tracks.means[:2], sites.tracks.means)
    LMB(due.tracks, due.existence_logit)
