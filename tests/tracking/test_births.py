"""Births from measurements: what no track explains, pooled over the sensors; and labels that a sensor makes itself."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tracking.scenes import filters, lmb, rngs, scans_of, sensor, targets
from vedette import models
from vedette.densities import marginal_estimate
from vedette.errors import InputError, ModelError
from vedette.filters import (
    LmbFilter,
    MultiSensorGlmbFilter,
    MultiSensorLmbFilter,
    PhdFilter,
    SequentialFactoredFilter,
    SequentialLmbFilter,
)
from vedette.fusion import Clmb, LabelMatchedFusion
from vedette.fusion.matching import OWN_LABELS
from vedette.models import BirthModel, MeasurementBirth
from vedette.tracking import Central, Distributed, State
from vedette.tracking.births import UnexplainedMeasurements, _pool, birth_candidates, births_from_scans

STD = np.array([10.0, 10.0, 5.0, 5.0])
MEASURED = MeasurementBirth(expected=0.4, max_existence=0.3, std=STD)
BIRTH = replace(BirthModel.none(4), from_measurements=MEASURED)
SENSORS = (sensor(3.0, 0.9, 4.0), sensor(4.0, 0.8, 4.0))
POSES = np.zeros((2, 3))
NOBODY = lmb(np.empty((0, 2), np.int64), [], np.empty((0, 4)), np.empty((0, 4, 4)))


def born(belief: Any, scans: Any, **options: Any) -> Any:
    return births_from_scans(BIRTH, belief, SENSORS, scans, POSES, 7, **options)


def test_existence_is_divided_by_the_unexplained_probability() -> None:
    """Against the formulas, by hand: one track, one measurement of it, and others far away."""
    cov = np.diag([9.0, 9.0, 4.0, 4.0])
    belief = lmb([[1, 0]], [0.6], [[0.0, 0.0, 1.0, 1.0]], [cov])
    scan = np.array([[2.0, -1.0], [300.0, 0.0], [-300.0, 50.0]])
    made = born(belief, [scan, None])
    spread = cov[:2, :2] + 9.0 * np.eye(2)
    likelihood = math.exp(-0.5 * scan[0] @ np.linalg.solve(spread, scan[0])) / (
        2.0 * math.pi * math.sqrt(np.linalg.det(spread))
    )
    odds = 0.6 * 0.9 * likelihood / (4.0 / 2000.0**2)
    free = np.array([1.0 / (1.0 + odds), 1.0, 1.0])
    free = free[free > 0.01]
    wanted = np.sort(np.minimum(0.3, 0.4 * free / free.sum()))
    np.testing.assert_allclose(np.sort(made.existence), wanted, rtol=1e-12)
    assert len(made.existence) == 2
    np.testing.assert_array_equal(made.tracks.labels, [[7, 0], [7, 1]])
    np.testing.assert_array_equal(made.tracks.means, [[300.0, 0.0, 0.0, 0.0], [-300.0, 50.0, 0.0, 0.0]])
    np.testing.assert_array_equal(made.tracks.covs[0], np.diag(STD**2))
    assert born(NOBODY, [scan[:1], None]).existence[0] == pytest.approx(0.3)  # no more than that


def test_measurements_of_one_target_by_two_sensors_are_one_birth() -> None:
    here, there = np.array([[10.0, 0.0], [200.0, 0.0]]), np.array([[16.0, 4.0]])
    made = born(NOBODY, [here, there])
    np.testing.assert_allclose(made.tracks.means[:, :2], [[13.0, 2.0], [200.0, 0.0]])
    # Two of one sensor are two targets, however near.
    assert len(born(NOBODY, [np.array([[10.0, 0.0], [11.0, 0.0]]), None]).existence) == 2
    # The order in which they were measured does not matter but for the labels.
    again = born(NOBODY, [here[::-1], there])
    np.testing.assert_allclose(np.sort(again.tracks.means[:, 0]), np.sort(made.tracks.means[:, 0]))


def pooled_one_by_one(found: UnexplainedMeasurements) -> tuple[list[np.ndarray], list[float]]:
    """Every measurement meets every group: the definition."""
    places: list[np.ndarray] = []
    probabilities: list[float] = []
    members: list[list[int]] = []
    for i in np.argsort(-found.probabilities, kind="stable"):
        free = [g for g in range(len(places)) if found.sensors[i] not in members[g]]
        apart = [(((places[g] - found.states[i]) / STD[:2]) ** 2).sum() for g in free]
        if apart and min(apart) <= 9.21:
            group = free[int(np.argmin(apart))]
            members[group].append(int(found.sensors[i]))
            places[group] = places[group] + (found.states[i] - places[group]) / len(members[group])
        else:
            places.append(found.states[i])
            probabilities.append(float(found.probabilities[i]))
            members.append([int(found.sensors[i])])
    return places, probabilities


@pytest.mark.parametrize("num_sensors", [1, 2, 5])
@pytest.mark.parametrize("side", [30.0, 300.0, 3000.0])
def test_pooling_with_cells_equals_pooling_without_cells_to_the_bit(num_sensors: int, side: float) -> None:
    rng = np.random.default_rng(round(side) + num_sensors)
    for num in (0, 1, 200):
        positions = rng.uniform(-side, side, (num, 2)).round(0)  # whole metres: distances that are equal
        probabilities = rng.choice([0.2, 0.5, 0.9, 1.0], num)
        found = UnexplainedMeasurements(positions, probabilities, rng.integers(0, num_sensors, num))
        made = _pool(found, MEASURED)
        places, least = pooled_one_by_one(found)
        np.testing.assert_array_equal(made.states, np.reshape(places, (-1, 2)))
        np.testing.assert_array_equal(made.probabilities, least)


def test_labels_follow_the_sites_or_are_a_sensors_own() -> None:
    sites = replace(targets().birth, from_measurements=MEASURED)
    scan = np.array([[500.0, 500.0]])
    made = births_from_scans(sites, NOBODY, SENSORS[:1], [scan], POSES[:1], 1)
    assert made is not None
    np.testing.assert_array_equal(made.tracks.labels, [[1, 2]])
    due = birth_candidates(sites, 1, 1.0, made)
    assert due is not None
    np.testing.assert_array_equal(due.tracks.labels, [[1, 0], [1, 1], [1, 2]])
    np.testing.assert_allclose(due.existence, [0.5, 0.3, 0.3])
    due.validate()
    assert birth_candidates(sites, 2, 1.0, None).tracks.num_tracks == 0  # type: ignore[union-attr]  # sites at step 1 alone
    assert birth_candidates(targets().birth, 1, 1.0, None) is None
    own = born(NOBODY, [None, scan], owner=1)
    np.testing.assert_array_equal(own.tracks.labels, [[7, 2 * OWN_LABELS]])
    assert born(NOBODY, [None, None]).tracks.num_tracks == 0


def test_a_bearing_and_range_give_a_position() -> None:
    polar = models.SensorModel(
        models.bearing_range(),
        models.constant_noise([0.01, 3.0]),
        models.constant_detection(0.9),
        models.measurement_space_clutter(1.0, [-math.pi, 0.0], [math.pi, 1e4], angular=[True, False]),
    )
    pose = np.array([10.0, -20.0, 0.3])
    made = births_from_scans(BIRTH, NOBODY, [polar], [np.array([[math.pi / 2, 50.0]])], [pose], 2)
    assert made is not None
    np.testing.assert_allclose(made.tracks.means[0, :2], [10.0, 30.0], atol=1e-12)
    bearing = replace(
        polar,
        measurement=models.bearing_only(),
        noise=models.constant_noise([0.01]),
        clutter=models.measurement_space_clutter(1.0, [-3.0], [3.0], angular=[True]),
    )
    scans = [np.array([[1.0]]), np.array([[math.pi / 2, 50.0]])]
    alone = births_from_scans(BIRTH, NOBODY, [bearing], scans[:1], [pose], 2)
    assert alone is not None
    assert len(alone.existence) == 0
    both = births_from_scans(BIRTH, NOBODY, [bearing, polar], scans, [pose, pose], 2)
    assert both is not None
    np.testing.assert_array_equal(both.tracks.means, made.tracks.means)
    wrong = replace(polar, measurement=replace(polar.measurement, places=lambda z, pose: z[0]))
    with pytest.raises(ModelError, match="places of measurements"):
        births_from_scans(BIRTH, NOBODY, [wrong], [np.array([[1.0, 2.0]])], [pose], 2)


WORLD = targets(existence=(), measured=MeasurementBirth(0.5, 0.1, STD))
TRUTH = np.array([[3.0, -4.0, 2.0, 1.0], [95.0, 5.0, -1.0, 2.0], [0.0, 200.0, 3.0, 3.0]])


@pytest.mark.parametrize(
    "kind", [SequentialLmbFilter, MultiSensorLmbFilter, MultiSensorGlmbFilter, "feedback", "matched"]
)
def test_targets_are_tracked_without_birth_sites(kind: Any) -> None:
    if kind == "feedback":
        tracker: Any = Distributed(filters(WORLD, SENSORS), Clmb((0.5, 0.5)), feedback=True)
    elif kind == "matched":
        tracker = Distributed(filters(WORLD, SENSORS), LabelMatchedFusion(Clmb((0.5, 0.5))))
    else:
        tracker = Central(kind(WORLD, SENSORS))
    state, rng = tracker.initial(), np.random.default_rng(0)
    for step in range(1, 9):
        truth = TRUTH.copy()
        truth[:, :2] += step * truth[:, 2:]
        state, _ = tracker.step(state, scans_of(truth, SENSORS, POSES, rng), POSES, float(step), rngs=rngs(2))
    found = marginal_estimate(state.fused, 0.7).means
    assert len(found) == 3
    assert np.linalg.norm(found[:, None, :2] - truth[None, :, :2], axis=2).min(axis=0).max() < 10.0


def test_a_birth_needs_labels_and_a_fusion_that_matches_them() -> None:
    with pytest.raises(InputError, match="expected one that matches labels"):
        Distributed(filters(WORLD, SENSORS), Clmb((0.5, 0.5)))
    with pytest.raises(InputError, match=r"expected a PredictUpdateFilter.*as targets are born of measurements"):
        Distributed((PhdFilter(WORLD, SENSORS[0]),))
    placeless = replace(SENSORS[0], measurement=replace(SENSORS[0].measurement, places=None))
    wanted = r"sensors\[1\]\.measurement: expected a measurement with `places`, as targets are born of measurements"
    with pytest.raises(InputError, match=wanted):
        Distributed(filters(WORLD, (SENSORS[0], placeless)), LabelMatchedFusion(Clmb((0.5, 0.5))))
    with pytest.raises(InputError, match=wanted.replace("1", "0")):
        Central(MultiSensorLmbFilter(WORLD, (placeless, placeless)))


@pytest.mark.parametrize("kind", [SequentialLmbFilter, MultiSensorLmbFilter, SequentialFactoredFilter])
def test_a_camera_sharpens_tracks_that_a_radar_starts(kind: Any) -> None:
    radar = replace(SENSORS[0], noise=models.constant_noise([20.0, 3.0]))
    camera = models.SensorModel(
        models.bearing_only(),
        models.constant_noise([0.01]),
        models.constant_detection(0.9),
        models.measurement_space_clutter(1.0, [-math.pi], [math.pi], angular=[True]),
    )
    poses = np.array([[0.0, 0.0, 0.0], [-300.0, 0.0, 0.0]])
    errors = []
    for sensors in ((radar,), (radar, camera)):
        tracker, rng = Central(kind(WORLD, sensors)), np.random.default_rng(0)
        state = tracker.initial()
        for step in range(1, 30):
            truth = TRUTH.copy()
            truth[:, :2] += step * truth[:, 2:]
            at = poses[: len(sensors)]
            state, _ = tracker.step(state, scans_of(truth, sensors, at, rng), at, float(step), rngs=rngs(len(sensors)))
        found = marginal_estimate(state.fused, 0.5).means
        assert len(found) == 3
        errors.append(np.linalg.norm(found[:, None, :2] - truth[None, :, :2], axis=2).min(axis=0).mean())
    assert errors[1] < 0.7 * errors[0]

    for fields, name in (
        ({"expected": 0.0}, "expected"),
        ({"max_existence": 1.0}, "max_existence"),
        ({"std": [1.0, -1.0, 1.0, 1.0]}, "std"),
    ):
        with pytest.raises(InputError, match=rf"MeasurementBirth\.{name}"):
            MeasurementBirth(**{"expected": 1.0, "max_existence": 0.1, "std": STD, **fields})  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"from_measurements.std: expected 5 numbers"):
        replace(BirthModel.none(5), from_measurements=MEASURED)


class Plain:
    """A filter of one's own that has a step and no more."""

    def __init__(self, inner: LmbFilter) -> None:
        self.inner, self.targets, self.sensor = inner, inner.targets, inner.sensor

    def initial(self) -> Any:
        return self.inner.initial()

    def step(self, belief: Any, scan: Any, pose: Any, dt: float, step: int, *, rng: np.random.Generator) -> Any:
        return self.inner.step(belief, scan, pose, dt, step, rng=rng)


def test_scans_at_different_times() -> None:
    """Of three sensors that scan in turn each is predicted while it does not, and a filter that cannot says so."""
    world, sensors = targets(), (*SENSORS, SENSORS[0])
    local, poses = filters(world, sensors), np.zeros((3, 3))
    tracker = Distributed(local, Clmb((1 / 3, 1 / 3, 1 / 3)))
    state, rng = tracker.initial(), np.random.default_rng(0)
    beliefs = [own.initial() for own in local]
    for step in range(1, 5):
        scans: Any = scans_of(TRUTH, sensors, poses, rng)
        heard = [scan if s == step % 3 else None for s, scan in enumerate(scans)]
        state, info = tracker.step(state, heard, poses, float(step), rngs=rngs(3))
        for s, own in enumerate(local):
            if heard[s] is None:
                beliefs[s], _ = own.predict(beliefs[s], 1.0, step)
            else:
                beliefs[s], _ = own.step(beliefs[s], heard[s], poses[s], 1.0, step, rng=rng)
            np.testing.assert_array_equal(state.local[s].tracks.means, beliefs[s].tracks.means)
        assert len(info.filters) == 3
    plain = Distributed((Plain(local[0]),))
    with pytest.raises(
        InputError, match=r"a PredictUpdateFilter, with predict\(\) and update\(\), as it must predict without"
    ):
        plain.step(plain.initial(), [None], POSES[:1], 1.0, rngs=rngs(1))


def test_without_feedback_a_sensor_counts_by_its_view_even_without_a_scan() -> None:
    local, thirds, poses = filters(targets(), (*SENSORS, SENSORS[0])), (1 / 3, 1 / 3, 1 / 3), np.zeros((3, 3))
    mean, cov = [[0.0, 0.0, 1.0, 1.0]], [np.diag([9.0, 9.0, 4.0, 4.0])]
    beliefs = tuple(lmb([[1, 0]], [r], mean, cov) for r in (0.9, 0.5, 0.3))
    tracker = Distributed(local, Clmb(thirds, field_of_view_weighting=True))
    state, _ = tracker.step(State(beliefs, beliefs[0], 4, 4.0), [None] * 3, poses, 5.0, rngs=rngs(3))
    predicted = [own.predict(belief, 1.0, 5)[0] for own, belief in zip(local, beliefs, strict=True)]
    detected = np.array([0.9, 0.8, 0.9])
    shares = detected / (1.0 - 0.999 * detected)
    shares /= shares.sum()
    expected, _ = Clmb(tuple(shares)).fuse(predicted)
    np.testing.assert_allclose(state.fused.existence, expected.existence, rtol=1e-12)
