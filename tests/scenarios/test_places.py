"""Places in longitude and latitude: both ways, everywhere in a scenario, and what is told where they cannot be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError, ScenarioError
from vedette.recorded import Origin
from vedette.scenarios import load_scenario
from vedette.scenarios.build import build_experiment, build_targets
from vedette.scenarios.sections import ScenarioModel

ORIGIN = Origin(-1.1171, 50.7865)
# Of WGS 84.
AXIS, FLATTENING = 6378137.0, 1.0 / 298.257223563


def plain_plane(longitude: Any, latitude: Any, origin: Origin) -> Any:
    """By Earth-centred coordinates, written out."""
    square = FLATTENING * (2.0 - FLATTENING)

    def centred(lon: Any, lat: Any) -> Any:
        normal = AXIS / np.sqrt(1.0 - square * np.sin(lat) ** 2)
        flat = normal * (1.0 - square) * np.sin(lat)
        return np.stack([normal * np.cos(lat) * np.cos(lon), normal * np.cos(lat) * np.sin(lon), flat], axis=-1)

    lon, lat = np.radians(origin.longitude_deg), np.radians(origin.latitude_deg)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    offsets = centred(np.radians(longitude), np.radians(latitude)) - centred(lon, lat)
    return np.stack([offsets @ east, offsets @ np.cross(up, east)], axis=-1)


def test_planes_are_those_of_the_formulas_and_lead_back() -> None:
    rng = np.random.default_rng(0)
    for spread in (1e-5, 1e-2, 1.0, 20.0):
        for _ in range(20):
            origin = Origin(rng.uniform(-180.0, 180.0), rng.uniform(-60.0, 60.0))
            places = np.array([origin.longitude_deg, origin.latitude_deg]) + spread * rng.uniform(-1.0, 1.0, (50, 2))
            plane = origin.to_plane(places[:, 0], places[:, 1])
            np.testing.assert_allclose(plane, plain_plane(places[:, 0], places[:, 1], origin), atol=1e-8)
            back = origin.to_degrees(plane)
            apart = np.abs(back - places) % 360.0
            assert np.minimum(apart, 360.0 - apart).max() < 1e-11


def test_the_other_side_of_the_globe_is_refused_in_both_directions() -> None:
    with pytest.raises(InputError, match=r"expected points on the origin's side of the globe; got \(170, 10\) degrees"):
        Origin(-10.0, 0.0).to_plane([5.0, 170.0], [3.0, 10.0])
    with pytest.raises(InputError, match="positions: expected points above the origin's side"):
        ORIGIN.to_degrees([[0.0, 0.0], [7e6, 0.0]])
    with pytest.raises(InputError, match=r"origin.latitude_deg: expected degrees from -90 to 90; got 91"):
        Origin(0.0, 91.0)


SCENE = """
format: 1
name: bay
time: {num_steps: 6, step_period: 5.0}
origin: {lon: -1.1171, lat: 50.7865}
region: {lon_min: -1.16, lon_max: -1.07, lat_min: 50.76, lat_max: 50.81}
birth:
  sites: [{existence: 0.02, mean: [{lon: -1.113, lat: 50.795}, 0.5, 0.0], std: [300.0, 450.0, 4.0, 4.0]}]
targets:
  kind: scripted
  tracks: [{state: [{lon: -1.12, lat: 50.79}, 3.0, 1.0]}]
sensor_defaults: {measurement: {kind: position}, noise: {kind: constant, std: [5.0, 5.0]}}
sensors:
  - position: {lon: -1.13, lat: 50.77}
    platform: {kind: waypoints, speed: 5.0, points: [{lon: -1.13, lat: 50.77}, {lon: -1.10, lat: 50.78}]}
  - {position: [10.0, 20.0], platform: {kind: heading, speed: 5.0, headings_deg: [0, 90]}}
control:
  decision_steps: [3]
  constraints:
    - {kind: keep_out, polygon: [{lon: -1.11, lat: 50.79}, {lon: -1.10, lat: 50.79}, {lon: -1.10, lat: 50.80}]}
"""


def loaded(tmp_path: Path, text: str) -> ScenarioModel:
    (tmp_path / "bay.yaml").write_text(text, "utf-8")
    return load_scenario(tmp_path / "bay.yaml").model


def test_positions_in_degrees_are_accepted_wherever_metres_are(tmp_path: Path) -> None:
    model: Any = loaded(tmp_path, SCENE)

    def at(lon: float, lat: float) -> tuple[float, float]:
        x, y = ORIGIN.to_plane([lon], [lat])[0].tolist()
        return x, y

    assert model.sensors[0].position == at(-1.13, 50.77)
    assert model.sensors[0].platform.points == (at(-1.13, 50.77), at(-1.10, 50.78))
    assert model.sensors[1].position == (10.0, 20.0)
    assert model.birth.sites[0].mean == (*at(-1.113, 50.795), 0.5, 0.0)
    assert model.targets.tracks[0].state == (*at(-1.12, 50.79), 3.0, 1.0)
    assert model.control.constraints[0].polygon == (at(-1.11, 50.79), at(-1.10, 50.79), at(-1.10, 50.80))
    corners = [at(lon, lat) for lon in (-1.16, -1.07) for lat in (50.76, 50.81)]
    region = model.region
    assert all(region.x_min <= x <= region.x_max and region.y_min <= y <= region.y_max for x, y in corners)
    assert region.x_max - region.x_min < max(x for x, _ in corners) - min(x for x, _ in corners) + 1.0
    assert ScenarioModel.model_validate(model.model_dump(mode="json")) == model
    assert build_experiment(load_scenario(tmp_path / "bay.yaml")).poses[0, :2].tolist() == list(at(-1.13, 50.77))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "position: {lon: -1.13, lat: 50.77}",
            "position: [-1.13, 50.77]",
            r"sensors\[0\].position: expected metres from the origin, or a place .* in degrees, got -1.13, 50",
        ),
        (
            "[{lon: -1.11, lat: 50.79}, {lon: -1.10, lat: 50.79}, {lon: -1.10, lat: 50.80}]",
            "[[-1.11, 50.79], [-1.1, 50.79], [-1.1, 50.8]]",
            r"control.constraints\[0\].polygon: expected metres from the origin, or a place",
        ),
        (
            "region: {lon_min: -1.16, lon_max: -1.07, lat_min: 50.76, lat_max: 50.81}",
            "region: {x_min: -1.16, x_max: -1.07, y_min: 50.76, y_max: 50.81}",
            r"region: expected metres from the origin",
        ),
        ("mean: [{lon: -1.113, lat: 50.795}, 0.5", "mean: [-1.113, 50.795, 0.5", r"sites\[0\].mean: expected metres"),
        ("state: [{lon: -1.12, lat: 50.79}, 3.0", "state: [-1.12, 50.79, 3.0", r"tracks\[0\].state: expected metres"),
        (
            "origin: {lon: -1.1171, lat: 50.7865}",
            "",
            r"sensors\[0\].position: expected a list, got {lon: -1.13, lat: 50.77} \(.* need such an `origin",
        ),
        ("lat_min: 50.76", "lat_min: 50.9", "a box of degrees needs an `origin.*and its four ends in order"),
        (
            "{lon: -1.12, lat: 50.79}",
            "{lon: -1.12, lat: 99}",
            r"state\[0\]: expected a number, got {lon: -1.12, lat: 99} \(places",
        ),
        (
            "position: {lon: -1.13, lat: 50.77}",
            "position: {lon: 50.77, lat: -1.13}",
            r"sensors\[0\].position: expected places within 1000 km of the origin, got x 5\d+ km, .*exchanged",
        ),
        (
            "origin: {lon: -1.1171, lat: 50.7865}",
            "origin: {lon: 50.7865, lat: -1.1171}",
            r"region: expected places within 1000 km of the origin, .*here or in `origin`",
        ),
        ("{lon: -1.1171, lat: 50.7865}", "{lon: -1.1171, lat: 95}", "origin.lat: expected a number of at most 90"),
    ],
)
def test_invalid_positions_are_reported_by_field(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SCENE
    with pytest.raises(ScenarioError, match=message):
        loaded(tmp_path, SCENE.replace(old, new))


def test_recorded_targets_take_the_origin_of_the_scenario(tmp_path: Path) -> None:
    rows = "".join(f"{t},a,{-1.12 + 1e-5 * t},{50.79}\n" for t in range(0, 60, 5))
    (tmp_path / "ships.csv").write_text("time,id,longitude,latitude\n" + rows, "utf-8")
    rows = "".join(f"{t},a,{10.0 * t},{5.0 * t}\n" for t in range(0, 60, 5))
    (tmp_path / "plane.csv").write_text("time,id,x,y\n" + rows, "utf-8")
    scripted = SCENE[SCENE.index("targets:") : SCENE.index("sensor_defaults")]
    text = SCENE.replace(scripted, "targets: {kind: recorded, path: ships.csv}\n")
    (tmp_path / "bay.yaml").write_text(text, "utf-8")
    truth = build_targets(load_scenario(tmp_path / "bay.yaml")).truth([0.0], rng=np.random.default_rng(0))
    np.testing.assert_allclose(truth.states[0, :2], ORIGIN.to_plane([-1.12], [50.79])[0], atol=1e-6)
    (tmp_path / "bay.yaml").write_text(text.replace("ships.csv", "plane.csv"), "utf-8")
    truth = build_targets(load_scenario(tmp_path / "bay.yaml")).truth([0.0, 5.0], rng=np.random.default_rng(0))
    np.testing.assert_allclose(truth.states[1, :2], [50.0, 25.0], atol=1e-6)
