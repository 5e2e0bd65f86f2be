"""Scans taken in turn touch what they may say anything of: the same beliefs as if they touched all, for less."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.densities import LMB, as_lmb
from vedette.filters import Limits, SequentialFactoredFilter, SequentialLmbFilter, factored, lmb
from vedette.kernels.base.types import ScanInput
from vedette.kernels.steps.field_of_view import in_view
from vedette.kernels.steps.multi_sensor_combinations import standing_combinations
from vedette.kernels.steps.multi_sensor_lmb import update_lmb
from vedette.models.scan_rows import to_measurements

# Every label alone: lists of hypotheses are cut anew by each scan, also by one that says nothing of them.
KINDS = [
    (SequentialLmbFilter, lmb),
    (partial(SequentialFactoredFilter, max_split_error=2.0), factored),
]
SPACING, NUM = 150.0, 12  # m, sensors in a row, of which each sees up to its neighbours
REGION = models.Region(-500.0, NUM * SPACING + 500.0, -500.0, 500.0)
POSES = np.column_stack([SPACING * np.arange(NUM), np.zeros(NUM), np.zeros(NUM)])
STARTS = np.column_stack([np.arange(0.0, NUM * SPACING, 60.0), np.zeros((30, 3))])
STARTS[:, 1] = 40.0 * np.sin(np.arange(30))
STARTS[:, 2:] = 3.0 * np.cos(np.outer(np.arange(30), [1.0, 2.0]))
BIRTH = models.BirthModel(
    np.full(30, 0.3), STARTS, np.tile(np.diag([20.0, 20.0, 3.0, 3.0]) ** 2, (30, 1, 1)), steps=frozenset({1, 4})
)
TARGETS = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.99), BIRTH)


def sensor(detection: models.DetectionModel, clutter: Any = None) -> models.SensorModel:
    clutter = models.region_clutter(3.0, REGION, "position") if clutter is None else clutter
    return models.SensorModel(models.position(), models.constant_noise([5.0, 5.0]), detection, clutter)


SHARP = sensor(models.limited_range(0.9, 160.0))
SOFT = sensor(models.soft_sector(0.9, 140.0, range_slope=0.3))
SENSORS = (SHARP, SOFT) * (NUM // 2)


def scans_at(step: int, rng: np.random.Generator) -> list[Any]:
    places = STARTS[:, :2] + step * STARTS[:, 2:]
    scans = []
    for sensor, pose in zip(SENSORS, POSES, strict=True):
        seen = places[rng.random(len(places)) < sensor.detection.prob(np.hstack([places, STARTS[:, 2:]]), pose)]
        clutter = rng.uniform([REGION.x_min, REGION.y_min], [REGION.x_max, REGION.y_max], (rng.poisson(3.0), 2))
        scans.append(np.vstack([seen + rng.normal(0.0, 5.0, seen.shape), clutter]))
    return scans


def beliefs(filter_of_all: Any, num_steps: int = 8) -> list[LMB]:
    rng, belief, found = np.random.default_rng(3), filter_of_all.initial(), []
    for step in range(1, num_steps + 1):
        belief, _ = filter_of_all.step(belief, scans_at(step, rng), POSES, 1.0, step, rng=rng)
        found.append(as_lmb(belief))
    return found


@pytest.mark.parametrize(("kind", "module"), KINDS)
def test_what_is_out_of_view_costs_nothing_and_changes_nothing(kind: Any, module: Any, monkeypatch: Any) -> None:
    touched: list[tuple[int, int]] = []

    def counting(tracks: Any, *rest: Any) -> Any:
        marks = in_view(tracks, *rest)
        touched.append((int(marks.sum()), len(marks)))
        return marks

    monkeypatch.setattr(module, "in_view", counting)
    found = beliefs(kind(TARGETS, SENSORS))
    assert len(touched) == 8 * (NUM - 2)
    assert sum(own for own, _ in touched) < 0.4 * sum(of for _, of in touched)
    monkeypatch.setattr(module, "in_view", lambda tracks, *_: np.ones(len(tracks.labels), np.bool_))
    for own, whole in zip(found, beliefs(kind(TARGETS, SENSORS)), strict=True):
        assert len(whole.tracks.labels) > 20
        np.testing.assert_array_equal(own.tracks.labels, whole.tracks.labels)
        np.testing.assert_array_equal(own.tracks.offsets, whole.tracks.offsets)
        np.testing.assert_allclose(own.existence, whole.existence, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(own.tracks.means, whole.tracks.means, rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("off", [0.0, 300.0, 600.0, 900.0, 1500.0])
def test_a_track_out_of_view_is_one_that_the_scan_leaves_as_it_was(off: float, measured: bool) -> None:
    """Where clutter is taken for impossible, a measurement may speak for what is all but never detected."""
    nowhere = models.region_clutter(1.0, models.Region(-10.0, 10.0, -10.0, 10.0), "position")
    soft = sensor(models.soft_sector(0.95, 100.0, range_slope=0.1), nowhere)
    prior = LMB.from_bernoullis([(1, 0)], [0.5], [[off, 0.0, 0.0, 0.0]], [np.diag([9.0, 9.0, 1.0, 1.0])]).to_kernel()
    nobody = LMB.empty(4).to_kernel()
    measurements = to_measurements(np.array([[off, 0.0]] if measured else np.empty((0, 2))))
    scan = ScanInput(nobody, measurements, np.zeros(3), 0.0)
    limits = Limits()
    rest = scan, soft.to_kernel(), limits.truncation(2)
    after, _ = update_lmb(standing_combinations(prior, 1), *rest, limits.keeping_labels().reduction())
    changed = abs(after.existence_logit[0] - prior.existence_logit[0])
    if in_view(prior.tracks, *rest)[0]:
        assert changed > 1e-16
    else:
        assert changed < 1e-15
        np.testing.assert_allclose(after.tracks.components.means, prior.tracks.components.means, rtol=1e-15)
    assert in_view(prior.tracks, *rest)[0] == (off <= 300.0 or (measured and off <= 900.0))
