"""Places where a sensor's detections or false measurements differ from its model, and none where they do not."""

from __future__ import annotations

import re

import numpy as np
import pytest

from vedette.evaluation.fit_by_place import clutter_by_place, detection_by_place
from vedette.evaluation.innovations import Matches, SensorFit
from vedette.kernels.base.types import Bools, Floats
from vedette.models import (
    Region,
    SensorModel,
    bearing_range,
    constant_detection,
    constant_noise,
    region_clutter,
)

POSE = np.array([500.0, -300.0, 0.0])
SENSOR = SensorModel(
    bearing_range(),
    constant_noise([0.01, 20.0]),
    constant_detection(0.9),
    region_clutter(2.0, Region(-5000.0, 5000.0, -5000.0, 5000.0), "bearing_range"),
)


def is_in_sector(offsets: Floats) -> Bools:
    """Whether bearings lie between 60 and 120 degrees from north."""
    bearings = np.degrees(np.arctan2(offsets[:, 0], offsets[:, 1])) % 360.0
    return (bearings >= 60.0) & (bearings < 120.0)


def blocks_of_detections(seed: int, place: str) -> tuple[Floats, Floats, Floats]:
    """Mean offsets, detections and their probabilities of 60 blocks of ten scans; .4 of .9 are made at the place."""
    rng = np.random.default_rng(seed)
    offsets = rng.uniform(-9000.0, 9000.0, (60, 2))
    is_there = {"far": np.hypot(*offsets.T) > 7000.0, "sector": is_in_sector(offsets), "": np.zeros(60, np.bool_)}[
        place
    ]
    made = rng.binomial(10, np.where(is_there, 0.4, 0.9))
    ten = np.full(60, 10.0)
    return offsets, np.column_stack([made, ten]), np.column_stack([0.9 * ten, ten])


@pytest.mark.parametrize(
    ("place", "words"), [("far", r"beyond [67]\.?\d? km"), ("sector", r"bearings [36]0 to 1[25]0 deg")]
)
def test_detections_that_are_lost_at_a_place_are_named_with_it(place: str, words: str) -> None:
    for seed in range(10):
        text = detection_by_place(*blocks_of_detections(seed, place), compass=True) or ""
        assert re.match(rf"detects its tracks in [345]\d% of scans (within )?{words} ", text), text


def test_detections_as_expected_are_named_at_no_place() -> None:
    assert not any(detection_by_place(*blocks_of_detections(seed, ""), compass=True) for seed in range(200))


def fit_of_clutter(seed: int, in_sector: float) -> SensorFit:
    """Clutter of 100 scans, with so many more false measurements a scan in the sector."""
    rng, scans = np.random.default_rng(seed), list[Floats]()
    for _ in range(100):
        rows = SENSOR.clutter.sample(POSE, SENSOR.measurement, state_dim=4, rng=rng)
        bearings = np.radians(rng.uniform(60.0, 120.0, rng.poisson(in_sector)))
        ranges = rng.uniform(500.0, 4000.0, len(bearings))
        offsets = ranges[:, np.newaxis] * np.column_stack([np.sin(bearings), np.cos(bearings)])
        scans.append(np.concatenate([SENSOR.measurement.positions(rows, POSE) - POSE[:2], offsets]))
    counts = np.array([len(scan) for scan in scans])
    return SensorFit(counts, POSE, np.zeros((100, 2)), Matches.none(2), np.concatenate(scans))


def test_clutter_of_a_sector_is_named_with_it_and_even_clutter_is_not() -> None:
    for seed in range(20):
        text = clutter_by_place(fit_of_clutter(seed, 3.0), SENSOR, 4, compass=True) or ""
        assert "of its unexplained measurements lie within bearings 60 to 120 deg" in text
        assert clutter_by_place(fit_of_clutter(seed, 0.0), SENSOR, 4, compass=True) is None
