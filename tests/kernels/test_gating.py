"""Measurements near a row: all in its gates, in order, against every measurement tried with every row."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.kernels.association.gating import near_measurements
from vedette.kernels.association.predicted import Rows, make_rows
from vedette.kernels.gaussian.components import components_of
from vedette.models.arguments import no_gaussians
from vedette.models.measurement import wrap_angles
from vedette.models.scan_rows import to_measurements

GATE = 9.0


def rows_of(rng: np.random.Generator, num: int, spread: list[float], angular: list[bool], tightness: float) -> Rows:
    """Rows of one to three components that expect measurements spread as these are."""
    sizes = rng.integers(1, 4, num)
    rows = make_rows(num, int(sizes.sum()), components_of(np.empty(0), *no_gaussians(4)), len(spread))
    rows.offsets[:] = np.concatenate([[0], np.cumsum(sizes)])
    places = rng.uniform(-1.0, 1.0, (num, len(spread)))
    for c, row in enumerate(np.repeat(np.arange(num), sizes)):
        predicted = (places[row] + 0.1 * rng.standard_normal(len(spread))) * spread
        rows.innovation.predicted[c] = np.where(angular, wrap_angles(predicted), predicted)
        factor = np.tril(rng.standard_normal((len(spread), len(spread)))) + 2.0 * np.eye(len(spread))
        rows.innovation.factor[c] = tightness * np.array(spread)[:, np.newaxis] * factor
    return rows


def distances(rows: Rows, c: int, scan: np.ndarray, angular: list[bool]) -> np.ndarray:
    off = scan - rows.innovation.predicted[c]
    off = np.where(angular, wrap_angles(off), off)
    white = np.linalg.solve(np.tril(rows.innovation.factor[c]), off.T)
    return np.asarray((white**2).sum(axis=0))


KINDS = {
    "positions": ([500.0, 500.0], [False, False]),
    "bearing and range": ([math.pi, 500.0], [True, False]),
    "bearings": ([math.pi], [True]),
    "position and speed": ([500.0, 500.0, 20.0], [False, False, False]),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tightness", [0.003, 0.05, 1.0])
def test_all_gated_measurements_are_near(kind: str, tightness: float) -> None:
    spread, angular = KINDS[kind]
    rng = np.random.default_rng(3)
    for num_rows, num_measurements in ((40, 70), (1, 3), (5, 0), (0, 7)):
        rows = rows_of(rng, num_rows, spread, angular, tightness)
        scan = rng.uniform(-1.0, 1.0, (num_measurements, len(spread))) * spread
        near = near_measurements(rows, to_measurements(scan), np.where(angular, 2.0 * math.pi, math.inf), GATE)
        assert near.offsets[0] == 0
        for row in range(num_rows):
            found = near.measurements[near.offsets[row] : near.offsets[row + 1]]
            assert (np.diff(found) > 0).all()
            components = range(rows.offsets[row], rows.offsets[row + 1])
            gated = np.any([distances(rows, c, scan, angular) <= GATE for c in components], axis=0)
            assert set(np.flatnonzero(gated)) <= set(found.tolist())


def test_few_others_are() -> None:
    spread, angular = KINDS["positions"]
    rng = np.random.default_rng(5)
    rows, scan = rows_of(rng, 300, spread, angular, 0.002), rng.uniform(-500.0, 500.0, (500, 2))
    near = near_measurements(rows, to_measurements(scan), np.where(angular, 2.0 * math.pi, math.inf), GATE)
    inside = [distances(rows, c, scan, angular) <= GATE for c in range(rows.offsets[-1])]
    assert near.offsets[-1] <= 2 * np.sum(inside) < 0.02 * 300 * 500


def test_without_a_gate_every_measurement_is_near() -> None:
    spread, angular = KINDS["bearing and range"]
    rng = np.random.default_rng(7)
    rows, scan = rows_of(rng, 4, spread, angular, 0.05), rng.uniform(-3.0, 3.0, (6, 2))
    near = near_measurements(rows, to_measurements(scan), np.where(angular, 2.0 * math.pi, math.inf), math.inf)
    assert near.measurements[: near.offsets[-1]].tolist() == 4 * list(range(6))
