"""Cameras that must turn to see their targets, one after the other."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette import models
from vedette.control.extrapolation import seconds_to_search, seconds_to_turn, turn_rate, turned_on
from vedette.densities import UndetectedIntensity
from vedette.evaluation.runs import run_scenario
from vedette.platforms import HeadingPlatform, Pointing
from vedette.platforms.base import options_at
from vedette.scenarios import Scenario, parse_scenario

HORIZON, RATE, HALF = np.array([1.0, 2.0]), 15.0, 20.0
POSE = np.array([30.0, -20.0, 0.4, math.radians(10.0), math.radians(HALF)])
CAMERA = Pointing(np.arange(-180.0, 180.0, 10.0).tolist(), turn_rate_deg=RATE)
OWN = options_at("platform", CAMERA, POSE, HORIZON)
OTHER = options_at("platform", HeadingPlatform(5.0, (0.0, 90.0)), np.array([0.0, 0.0, 0.4]), HORIZON)


def test_how_fast_it_turns() -> None:
    rate = turn_rate(OWN, 2.0)
    assert math.degrees(rate) == pytest.approx(RATE)
    assert turn_rate(OTHER, 2.0) == 0.0


def test_how_long_it_takes_to_turn_to_places() -> None:
    """Turned step by step from -20 or 40 degrees, where the horizon ends, until the place is in view; or it stays."""
    places = np.random.default_rng(0).uniform(-200.0, 200.0, (50, 2))
    found = seconds_to_turn(OWN, math.radians(RATE), places)
    for place, turn in zip(places, found, strict=True):
        bearing = math.degrees(math.atan2(*(place - POSE[:2])[::-1]))
        steps = np.arange(0.0, 12.0, 1e-3)
        turns = np.concatenate([40.0 + RATE * steps, -20.0 - RATE * steps, 10.0 + 0.0 * steps]) - bearing
        seen = np.abs((turns + 180.0) % 360.0 - 180.0) <= HALF
        assert turn == pytest.approx(np.tile(steps, 3)[seen].min(), abs=2e-3)
    np.testing.assert_array_equal(seconds_to_turn(OTHER, 0.0, places), 0.0)


def test_how_long_it_takes_to_look_where_undetected_targets_are() -> None:
    """Until less than .1 of them are elsewhere, of those in reach; another sensor that sees them takes them over."""
    grid = models.CellGrid(models.Region(-300.0, 300.0, -300.0, 300.0), 6, 6)
    expected = np.zeros(36)
    west, far = grid.cells_at(np.array([[-150.0, -20.0], [290.0, 290.0]]))
    expected[[west, far]] = 0.3, 5.0
    undetected, rates, reaches = UndetectedIntensity(grid, expected), [math.radians(RATE), 0.0], np.array([250.0, 10.0])
    search = seconds_to_search((OWN, OTHER), rates, reaches, undetected, 0.1)
    [alone] = seconds_to_turn(OWN, math.radians(RATE), grid.centres[[west]])
    assert search == alone > 0.0
    assert seconds_to_search((OWN, OTHER), rates, reaches, undetected, 0.31) == 0.0
    assert seconds_to_search((OWN, OTHER), rates, np.array([250.0, 300.0]), undetected, 0.1) == 0.0


def test_it_turns_on_unless_it_has_arrived() -> None:
    still = options_at("platform", CAMERA, POSE, np.array([20.0, 30.0]))
    pointings, scans = turned_on(OWN, HORIZON, np.array([3.0, 12.0, 15.0]))
    found = np.degrees(pointings)
    assert scans.all()
    by_course = {round(math.degrees(end)): own for end, own in zip(OWN.courses[:, -1, 3], found, strict=True)}
    np.testing.assert_allclose(by_course[40], [55.0, -170.0, -125.0])
    np.testing.assert_allclose(by_course[-20], [-35.0, -170.0, 145.0])
    at_rest = turned_on(still, np.array([20.0, 30.0]), np.array([40.0]))[0][:, 0]
    np.testing.assert_allclose(at_rest, still.courses[:, -1, 3])


def test_a_blind_camera_goes_to_its_pointing_and_from_there_on_slowly() -> None:
    """From 10 degrees at 15 a second; then 40 degrees, its view, in 40 / 15 s of turning and a step of 1 s."""
    blind = Pointing(np.arange(-180.0, 180.0, 10.0).tolist(), turn_rate_deg=RATE, blind_while_turning=True)
    own = options_at("platform", blind, POSE, HORIZON)
    pointings, scans = turned_on(own, HORIZON, np.array([3.0, 6.0, 9.0]))
    slow = 40.0 / (1.0 + 40.0 / RATE)
    for course in range(len(own.courses)):
        turn = (own.actions.values[own.first_action(course), 0] - 10.0 + 180.0) % 360.0 - 180.0
        arrived = abs(turn) / RATE
        for k, time in enumerate((3.0, 6.0, 9.0)):
            turned = RATE * time if time < arrived else abs(turn) + slow * (time - arrived) * (turn != 0.0)
            off = math.degrees(pointings[course, k]) - 10.0 - math.copysign(turned, turn)
            assert (off + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-9)
            assert scans[course, k] == (time >= arrived)


def scene(**control: Any) -> Scenario:
    """Three targets 120 degrees apart, which are expected there, around a camera that sees 30 degrees."""
    places = 200.0 * np.column_stack([f(np.radians([0.0, 120.0, -120.0])) for f in (np.cos, np.sin)])
    sites = [{"existence": 0.9, "mean": [*p, 0.0, 0.0], "std": [20.0, 20.0, 1.0, 1.0]} for p in places.tolist()]
    camera = {
        "kind": "camera",
        "half_width_deg": 15.0,
        "pointings_deg": list(range(-180, 180, 15)),
        "turn_rate_deg": 15.0,
    }
    data = {
        "format": 1,
        "name": "turning",
        "time": {"num_steps": 60, "step_period": 1.0},
        "region": {"x_min": -400.0, "x_max": 400.0, "y_min": -400.0, "y_max": 400.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 0.3},
        "survival": {"kind": "constant", "probability": 0.99},
        "birth": {"sites": sites, "steps": [1]},
        "targets": {"kind": "scripted", "tracks": [{"state": [*p, 0.3, 0.3]} for p in places.tolist()]},
        "sensors": [
            {
                "name": "camera",
                "position": [0.0, 0.0],
                "platform": camera,
                "measurement": {"kind": "position"},
                "noise": {"kind": "constant", "std": [4.0, 4.0]},
                "detection": {"kind": "camera", "probability": 0.98, "max_range": 350.0},
                "clutter": {"kind": "region", "rate": 1.0},
            }
        ],
        "control": {"decision_every": 2, "horizon_steps": 4, "horizon_period": 1.0, **control},
        "ospa": {"cutoff": 100.0, "order": 1.0},
    }
    return Scenario(parse_scenario(json.dumps(data)), Path("turning.yaml"))


def test_a_camera_looks_at_all_its_targets_in_turn() -> None:
    """Each within every 40 s; one that stares at its first target has an error of 36 m."""
    record = run_scenario(scene(), "jdm", seed=1)
    pointings = np.degrees(record.poses[:, 0, 3])
    for bearing in (0.0, 120.0, -120.0):
        seen = np.flatnonzero(np.abs((pointings - bearing + 180.0) % 360.0 - 180.0) <= 15.0)
        assert np.diff(np.concatenate([[0], seen, [len(pointings)]])).max() <= 40
    assert record.ospa[:, 0].mean() < 25.0


def test_a_camera_that_is_blind_while_it_turns_scans_where_it_stops() -> None:
    scenario = scene()
    camera = scenario.model.sensors[0].platform.model_copy(update={"blind_while_turning": True})
    sensor = scenario.model.sensors[0].model_copy(update={"platform": camera})
    blind = Scenario(scenario.model.model_copy(update={"sensors": (sensor,)}), scenario.path)
    record = run_scenario(blind, "jdm", seed=1)
    turned = np.abs(np.diff(np.unwrap(record.poses[:, 0, 3]))) > math.radians(14.9)
    blind_at = record.off[1:, 0]
    assert turned[blind_at].all()  # those that it ends where it is to point have a scan
    assert 0.5 < blind_at[turned].mean() < 1.0
    assert not blind_at[~turned].any()
