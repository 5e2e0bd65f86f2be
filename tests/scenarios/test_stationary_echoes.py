"""Places that are measured all through a recording: found, named by the fit, and left out where that is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette.evaluation.fit import fit_of_run
from vedette.evaluation.runs import run_scenario
from vedette.kernels.base.types import Floats
from vedette.recorded import RecordedScans, RecordedSensor
from vedette.recorded.returns import ReturnsModel
from vedette.recorded.stationary import stationary_places, without_stationary
from vedette.scenarios.from_recording import scenario_from_recording
from vedette.scenarios.warnings import scenario_warnings

LAND = np.array([[-2000.0, 500.0 * k - 1800.0] for k in range(8)])
SITE = RecordedSensor("R", "bearing_range", (0.0, 0.0, 0.0))
MODEL = ReturnsModel(0.0, (0.01, 15.0), 0.9)


def scans_of(rng: np.random.Generator, land: Floats, clutter: float, poses: Floats) -> RecordedScans:
    """Two ships, one of which anchors at half-time, and echoes of land, each seen in 3 of 10 scans."""
    scans = []
    for k, pose in enumerate(poses):
        ships = np.array([[1500.0 - 8.0 * k, 900.0], [400.0, min(15.0 * k, 1500.0) - 800.0]])
        places = np.concatenate([ships[rng.random(2) < 0.9], land[rng.random(len(land)) < 0.3]])
        false = rng.uniform(-3000.0, 3000.0, (rng.poisson(clutter), 2))
        away = np.concatenate([places, false]) - pose[:2]
        polar = np.column_stack([np.arctan2(away[:, 1], away[:, 0]), np.hypot(*away.T)])
        polar[:, 1] += rng.normal(0.0, 15.0, len(polar))
        polar[:, 0] += rng.normal(0.0, 0.005, len(polar))
        scans.append((polar,))
    times = np.asarray(2.5 * np.arange(len(poses)), np.float64)
    return RecordedScans(times, 0.0, False, tuple(scans), poses[:, np.newaxis], (), ("east",))


@pytest.mark.parametrize("speed", [0.0, 4.0])
def test_places_on_the_ground_are_found_and_left_out(speed: float) -> None:
    poses = np.column_stack([np.full(200, 100.0), speed * np.arange(200.0), np.zeros(200)])
    recording = scans_of(np.random.default_rng(1), LAND, 2.0, poses)
    places, masks = stationary_places(recording, 0, SITE, MODEL)
    assert len(places) == len(LAND)
    assert np.linalg.norm(places[:, np.newaxis] - LAND, axis=2).min(axis=1).max() < 10.0
    share = sum(int(mask.sum()) for mask in masks) / (0.3 * 200 * len(LAND))
    assert share == pytest.approx(1.0, abs=0.1)  # neither ship is left out, the anchored one included
    found = without_stationary(recording, [SITE], [MODEL])
    assert found.num_measurements == recording.num_measurements - sum(int(mask.sum()) for mask in masks)
    assert found.notes[0].endswith("measurements at 8 places that are measured all through are left out")


@pytest.mark.parametrize("clutter", [0.2, 5.0, 100.0])
@pytest.mark.parametrize("seed", range(3))
def test_moving_targets_and_clutter_are_no_places(clutter: float, seed: int) -> None:
    recording = scans_of(np.random.default_rng(seed), LAND[:0], clutter, np.zeros((150, 3)))
    assert len(stationary_places(recording, 0, SITE, MODEL)[0]) == 0


def test_the_fit_names_them_and_a_setting_leaves_them_out(tmp_path: Path) -> None:
    rng, rows, truth = np.random.default_rng(2), ["time,sensor,x,y"], ["time,id,x,y"]
    for k in range(100):
        ship = np.array([1500.0 - 20.0 * k, 900.0])
        truth.append(f"{2.5 * k},0,{ship[0]},{ship[1]}")
        seen = np.concatenate([ship[np.newaxis][: int(rng.random() < 0.9)], LAND[rng.random(len(LAND)) < 0.3]])
        rows += [f"{2.5 * k},C,{x},{y}" for x, y in seen + rng.normal(0.0, 15.0, seen.shape)] or [f"{2.5 * k},C,,"]
    (tmp_path / "scans.csv").write_text("\n".join([*rows, ""]), "utf-8")
    (tmp_path / "truth.csv").write_text("\n".join([*truth, ""]), "utf-8")
    text = (
        "sensor_defaults:\n  measurement: {kind: position}\n  noise: {kind: constant, std: [15.0, 15.0]}\n"
        "  detection: {kind: constant, probability: 0.9}\nsensors: [{name: C, position: [0.0, 0.0]}]\n"
    )
    numbers = []
    for more in ("", "recording: {ignore: stationary}\n"):
        (tmp_path / "sensors.yaml").write_text(more + text, "utf-8")
        scenario = scenario_from_recording(
            tmp_path / "sensors.yaml", tmp_path / "scans.csv", tmp_path / "truth.csv"
        ).scenario
        record = run_scenario(scenario, "stationary", seed=0)
        numbers.append(np.mean([len(each.labels) for each in record.estimates[10:]]))
        tests = [each.test for each in fit_of_run(record, scenario).findings]
        assert ("stationary echoes" in tests) is (not more)
        assert any("are left out" in line for line in scenario_warnings(scenario)) is bool(more)
    assert numbers[0] > 2.0
    assert numbers[1] == pytest.approx(1.0, abs=0.1)


CAMERA, POSITION_MODEL = RecordedSensor("C", "position", (0.0, 0.0, 0.0)), ReturnsModel(0.0, (15.0, 15.0), 0.9)
BUOY = np.array([500.0, -700.0])


def recorded(rng: np.random.Generator, places: Sequence[Floats], clutter: float = 2.0) -> RecordedScans:
    """Return noisy measurements of places that each scan sees, and of clutter in a square of 6 km."""
    scans = []
    for seen in places:
        false = rng.uniform(-3000.0, 3000.0, (rng.poisson(clutter), 2))
        scans.append((np.concatenate([seen, false]) + rng.normal(0.0, 15.0, (len(seen) + len(false), 2)),))
    num = len(scans)
    return RecordedScans(np.arange(float(num)), 0.0, False, tuple(scans), np.zeros((num, 1, 3)), (), (None,))


def buoy_at(scans: Sequence[int], num_scans: int) -> list[Floats]:
    """Return the places of a buoy that only some of the scans see."""
    return [BUOY[np.newaxis] if k in scans else np.empty((0, 2)) for k in range(num_scans)]


def found_in(recording: RecordedScans) -> Floats:
    return stationary_places(recording, 0, CAMERA, POSITION_MODEL)[0]


@pytest.mark.parametrize(
    ("seen", "num_places"),
    [
        (range(200), 1),
        (range(25, 180), 1),
        (range(40, 200), 0),  # a ship that arrives and anchors
        (range(160), 0),  # one that leaves
        ([*range(40), *range(140, 200)], 0),  # two ships, one after the other
    ],
)
def test_a_place_is_measured_from_beginning_to_end(seen: Sequence[int], num_places: int) -> None:
    places = found_in(recorded(np.random.default_rng(4), buoy_at(seen, 200)))
    assert len(places) == num_places
    assert np.linalg.norm(places - BUOY, axis=1).max(initial=0.0) < 10.0


@pytest.mark.parametrize(("num_scans", "num_places"), [(79, 0), (80, 1)])
def test_a_short_recording_shows_no_place(num_scans: int, num_places: int) -> None:
    places = found_in(recorded(np.random.default_rng(5), buoy_at(range(num_scans), num_scans)))
    assert len(places) == num_places


def test_a_lone_target_that_stands_still_is_no_place() -> None:
    """Nothing else is measured, so that the place is not denser than the rest."""
    assert len(found_in(recorded(np.random.default_rng(6), buoy_at(range(200), 200), clutter=0.0))) == 0


def test_a_sensor_that_measures_nothing_has_no_place() -> None:
    assert len(found_in(recorded(np.random.default_rng(9), buoy_at((), 200), clutter=0.0))) == 0


def test_a_region_of_more_clutter_is_no_place() -> None:
    rng = np.random.default_rng(7)
    rain = [rng.uniform(1000.0, 1600.0, (rng.poisson(10.0), 2)) for _ in range(200)]
    assert len(found_in(recorded(rng, rain))) == 0


def test_a_ship_at_anchor_next_to_a_buoy_is_kept() -> None:
    """With the columns of accuracy of its measurements, and between scans of another sensor."""
    both = BUOY + np.array([[0.0, 0.0], [100.0, 0.0]])
    recording = recorded(np.random.default_rng(8), [both[: 1 + (k >= 100)] for k in range(200)], clutter=1.0)
    pairs, accuracy = list[Any](), list[Any]()
    for (scan,) in recording.scans:
        pairs += [(scan, np.empty((0, 2))), (None, np.empty((0, 2)))]
        accuracy += [(2.0 * np.asarray(scan), np.empty((0, 2))), (None, np.empty((0, 2)))]
    recording = replace(
        recording,
        times=np.arange(400.0),
        poses=np.zeros((400, 2, 3)),
        scans=tuple(pairs),
        bearings=(None, None),
        accuracy=tuple(accuracy),
    )
    left = without_stationary(recording, [CAMERA, CAMERA], [POSITION_MODEL, POSITION_MODEL])
    num = recording.num_measurements - left.num_measurements
    assert 195 <= num <= 205  # of the buoy, and hardly any of the ship or of clutter
    assert left.notes == (f"C: {num} measurements at 1 place that is measured all through are left out",)
    for pair, rows in zip(left.scans, left.accuracy, strict=True):
        for scan, own in zip(pair, rows, strict=True):
            assert (scan is None) is (own is None)
            if scan is not None:
                np.testing.assert_array_equal(own, 2.0 * np.asarray(scan))


def test_a_lane_of_traffic_in_a_long_recording_is_no_place() -> None:
    """Ships that turn at the same places again and again: all over the recording, but not all through it."""
    rng, places = np.random.default_rng(3), []
    for k in range(3000):
        swing = 1200.0 * np.sin(k / 120.0 + np.arange(4.0))
        places.append(np.column_stack([swing, 800.0 * np.arange(4.0) - 1200.0])[rng.random(4) < 0.9])
    assert len(found_in(recorded(rng, places))) == 0
