# ruff: noqa: E501
"""The words and places of the faults of the sensors."""

from __future__ import annotations

import pytest

from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario

CASES = [
    (
        "  kind: scripted\n  tracks:\n    - {state: [1.0, 2.0, 0.5, -0.5], start_step: 2, end_step: 18}",
        "  {kind: recorded, path: ships.txt, columns: {longitude: lon}}",
        [
            'f.yaml:11:26: targets.path: expected a .csv or .parquet file, got "ships.txt"',
            "f.yaml:11:46: targets.columns: expected longitude and latitude together, got only longitude",
        ],
    ),
    (
        "std: [0.02, 3.0]",
        "std: [0.02]",
        [
            "f.yaml:15:32: sensor_defaults.noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1"
        ],
    ),
    (
        "std: [0.02, 3.0]",
        "std: [0.02, -3.0]",
        ["f.yaml:15:39: sensor_defaults.noise.std[1]: expected a number above 0, got -3.0"],
    ),
    (
        "kind: constant, std: [0.02, 3.0]",
        "kind: range_dependent, sigma_bearing: 1",
        [
            "f.yaml:15:34: sensor_defaults.noise.sigma_bearing: expected one of eta_bearing, eta_range, kind, sigma_bearing_deg, sigma_range, got an unknown key (did you mean sigma_bearing_deg?)"
        ],
    ),
    (
        "  noise: {",
        "  nose: {",
        [
            "f.yaml:15:3: sensor_defaults.nose: expected one of clutter, detection, heading_deg, measurement, moves_from, noise, platform, scans, truth, got an unknown key (did you mean noise?)"
        ],
    ),
    (
        "position: [0.0, 40.0]",
        "position: [0.0, 40.0, 1.0]",
        ["f.yaml:17:29: sensors[0].position: expected a list of 2, got a list of 3"],
    ),
    (
        "heading_deg: 4.0",
        "platform: {kind: waypoints, speed: 1.0, points: [[0.0, 1.0], [2.0]]}",
        ["f.yaml:17:103: sensors[0].platform.points[1]: expected a list of 2, got a list of 1"],
    ),
    (
        "position: [0.0, 40.0], ",
        "",
        ["f.yaml:17:5: sensors[0].position: expected a value, as it is required, got nothing"],
    ),
    ("name: south", "name: north", ['f.yaml:18:12: sensors[1].name: expected each name once, got "north" again']),
    (
        "heading_deg: 4.0",
        "platform: {kind: courses, speed: -4.0}",
        ["f.yaml:17:75: sensors[0].platform.speed: expected a number of at least 0, got -4.0"],
    ),
    (
        "heading_deg: 4.0",
        "platform: {kind: courses, speed: 4.0, headings_deg: []}",
        ["f.yaml:17:94: sensors[0].platform.headings_deg: expected a list of at least 1, got an empty list"],
    ),
    (
        "heading_deg: 4.0",
        "platform: {kind: courses}",
        ["f.yaml:17:52: sensors[0].platform: expected either speed or speeds, got neither"],
    ),
    (
        "heading_deg: 4.0",
        "platform: {kind: curses, speed: 4.0}",
        [
            'f.yaml:17:59: sensors[0].platform.kind: expected one of camera, courses, steps, still, waypoints, custom, got "curses" (did you mean courses?)'
        ],
    ),
    (
        "heading_deg: 4.0",
        "speed: 4.0",
        [
            "f.yaml:17:42: sensors[0].speed: expected one of clutter, detection, heading_deg, measurement, moves_from, name, noise, platform, position, scans, truth, got an unknown key (the platform of a sensor has it: `platform: {kind: courses, speed: 50.0, headings_deg: [0, 90]}`)"
        ],
    ),
    (
        "heading_deg: 4.0",
        "platform: {kind: camera, half_width_deg: 200.0, pointings_deg: [0.0], carrier: {kind: camera}}",
        [
            "f.yaml:17:83: sensors[0].platform.half_width_deg: expected a number of at most 180, got 200.0",
            'f.yaml:17:128: sensors[0].platform.carrier.kind: expected one of still, courses, steps, waypoints, custom, got "camera"',
        ],
    ),
    (
        "heading_deg: 4.0",
        "detection: {kind: camera, probability: 0.9, max_range: 50.0}",
        ["f.yaml:17:5: sensors[0].platform: expected a camera, as its detection is a camera's, got still"],
    ),
    (
        "heading_deg: 4.0",
        "measurement: {kind: position}, noise: {kind: range_dependent}",
        [
            "f.yaml:17:80: sensors[0].noise: expected constant, by_axis or custom noise for a position measurement, got range_dependent noise"
        ],
    ),
    (
        "heading_deg: 4.0",
        "measurement: {kind: range_only}",
        [
            "f.yaml:15:32: sensor_defaults.noise.std: expected 1 number, as a range_only measurement has, got a list of 2"
        ],
    ),
    (
        "heading_deg: 4.0",
        "detection: {kind: limited_sector, probability: 0.9, max_range: 50.0, half_width_deg: 0}",
        ["f.yaml:17:127: sensors[0].detection.half_width_deg: expected a number above 0, got 0"],
    ),
    (
        "heading_deg: 4.0",
        "detection: {kind: limited_range, probability: 1.1, max_range: -1}",
        [
            "f.yaml:17:88: sensors[0].detection.probability: expected a number of at most 1, got 1.1",
            "f.yaml:17:104: sensors[0].detection.max_range: expected a number above 0, got -1",
        ],
    ),
    (
        "heading_deg: 4.0",
        "clutter: {kind: measurement_space, rate: 5, low: [-3.0, 0.0], high: [3.0, -1.0]}",
        ["f.yaml:17:116: sensors[0].clutter.high[1]: expected a number above low, 0, got -1.0"],
    ),
    (
        "heading_deg: 4.0",
        "clutter: {kind: region, rate: lots}",
        ['f.yaml:17:72: sensors[0].clutter.rate: expected a number, got "lots"'],
    ),
    (
        "heading_deg: 4.0",
        "noise: {kind: by_axis, std: [1.0, 1.0], growth: [0.0, 1e-5]}",
        [
            "f.yaml:17:49: sensors[0].noise: expected range_dependent, constant or custom noise for a bearing_range measurement, got by_axis noise"
        ],
    ),
    (
        "heading_deg: 4.0",
        "detection: {kind: soft_sector, probability: 0.9, max_range: 50.0, half_width_deg: 200, range_slope: 0}",
        [
            "f.yaml:17:124: sensors[0].detection.half_width_deg: expected a number of at most 180, got 200",
            "f.yaml:17:142: sensors[0].detection.range_slope: expected a number above 0, got 0",
        ],
    ),
    (
        "heading_deg: 4.0",
        "clutter: {kind: around_sensor, radius: 10, half_side: 10}",
        ["f.yaml:17:51: sensors[0].clutter: expected either radius or half_side, got both"],
    ),
    (
        "heading_deg: 4.0",
        "measurement: {kind: bearing_only}, noise: {kind: constant, std: [0.1]}, clutter: {kind: around_sensor, radius: 10}",
        [
            "f.yaml:17:123: sensors[0].clutter: expected region, measurement_space or custom clutter for a bearing_only measurement, got around_sensor clutter"
        ],
    ),
    (
        "heading_deg: 4.0",
        "truth: {measurement: {kind: position}}",
        [
            'f.yaml:17:70: sensors[0].truth.measurement.kind: expected bearing_range or custom, as the filter takes it for that, got "position"'
        ],
    ),
    (
        "heading_deg: 4.0",
        "truth: {noise: {kind: constant, std: [1.0]}, clutter: {kind: measurement_space, low: [0.0, 9.0], high: [1.0, 8.0]}}",
        [
            "f.yaml:17:79: sensors[0].truth.noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1",
            "f.yaml:17:151: sensors[0].truth.clutter.high[1]: expected a number above low, 9, got 8.0",
        ],
    ),
    (
        "heading_deg: 4.0",
        "truth: {first_detection: {kind: camera, probability: 0.9, max_range: 9.0}}",
        ["f.yaml:17:5: sensors[0].platform: expected a camera, as its detection is a camera's, got still"],
    ),
    (
        "heading_deg: 4.0",
        "measurement: {kind: range_only}, noise: {kind: constant, std: [1.0]}, truth: {detection_of: measurement}",
        [
            'f.yaml:17:134: sensors[0].truth.detection_of: expected state, as a range_only measurement does not say where the target is, got "measurement"'
        ],
    ),
    (
        "heading_deg: 4.0",
        "scans: {every: 3, first: 4}",
        ["f.yaml:17:67: sensors[0].scans.first: expected a step up to every, 3, got 4"],
    ),
    (
        "heading_deg: 4.0",
        "scans: {every: 30, first: 21}",
        ["f.yaml:17:68: sensors[0].scans.first: expected a step up to the last, 20, got 21"],
    ),
]


@pytest.mark.parametrize(("old", "new", "faults"), CASES, ids=[f"{old[:20]} -> {new[:40]}" for old, new, _ in CASES])
def test_faults_are_named_with_their_places(old: str, new: str, faults: list[str]) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed((old, new)), "f.yaml")
    assert error.value.faults == faults
