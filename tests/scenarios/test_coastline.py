"""The coastline: out of any GeoJSON, cut to the picture, drawn by everything that draws, and obeyed by nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from typer.testing import CliRunner

from recordings import write_recording
from reports.test_single import data_of
from scenarios.test_geojson import ORIGIN
from vedette.cli import app
from vedette.cli.picture import scenario_figure
from vedette.cli.show import sample_truth
from vedette.errors import ScenarioError
from vedette.evaluation.figures import build_scene, tracks_figure
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.warnings import scenario_warnings
from vedette.scenarios.zones import COAST, zones

EDGE = [[-900.0, -3000.0], [-800.0, 0.0], [-900.0, 3000.0]]
ISLAND = [[100.0, 100.0], [200.0, 100.0], [200.0, 200.0], [100.0, 100.0]]


def degrees(line: Any) -> Any:
    return ORIGIN.to_degrees(line).tolist()


def feature(kind: str, coordinates: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": {}, "geometry": {"type": kind, "coordinates": coordinates}}


def world(*features: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}


def scene(folder: Path, coast: Any, *, origin: bool = True) -> Path:
    """paper-e, 2 km by 2 km, with a coast."""
    (folder / "coast.geojson").write_text(coast if isinstance(coast, str) else json.dumps(coast), "utf-8")
    text = dump_scenario(load_scenario("paper-e").model).replace("coastline:\n", "coastline: coast.geojson\n")
    if origin:
        text = text.replace("origin:\n", "origin: {lon: -1.1171, lat: 50.7865}\n")
    (folder / "scene.yaml").write_text(text, "utf-8")
    return folder / "scene.yaml"


def coast_of(scenario: Scenario) -> list[Any]:
    return [np.array(zone.corners) for zone in zones(scenario) if zone.kind == COAST]


@pytest.mark.parametrize(
    "coast",
    [
        world(feature("LineString", degrees(EDGE)), feature("Polygon", [degrees(ISLAND)])),
        world(feature("MultiLineString", [degrees(EDGE)]), feature("MultiPolygon", [[degrees(ISLAND)]])),
        {"type": "GeometryCollection", "geometries": [
            {"type": "MultiLineString", "coordinates": [degrees(EDGE), degrees(ISLAND)]},
            {"type": "Point", "coordinates": [0.0, 0.0]},
        ]},
    ],
)  # fmt: skip
def test_lines_and_polygons_are_lines_in_metres(tmp_path: Path, coast: Any) -> None:
    edge, island = coast_of(load_scenario(scene(tmp_path, coast)))
    np.testing.assert_allclose(edge, EDGE, atol=1e-6)
    np.testing.assert_allclose(island, ISLAND, atol=1e-6)


def test_distant_coastline_is_clipped(tmp_path: Path) -> None:
    """A coast round the world; what crosses the picture stays, even where no point of it lies in it."""
    meridian = [[-1.1171, 50.7865 + 0.01 * k] for k in range(-2000, 2000)]
    across = degrees([[-50_000.0, 40.0], [50_000.0, 40.0]])
    away = [[170.0, -50.0], [175.0, -45.0], [-60.0, 10.0]]
    coast = world(*(feature("LineString", line) for line in (meridian, across, away)))
    lines = coast_of(load_scenario(scene(tmp_path, coast)))
    assert len(lines) == 2
    assert 2 <= len(lines[0]) <= 12
    np.testing.assert_allclose(lines[0][:, 0], 0.0, atol=1e-3)
    np.testing.assert_allclose(lines[1], [[-50_000.0, 40.0], [50_000.0, 40.0]], atol=0.2)


def test_a_fine_coastline_is_simplified(tmp_path: Path) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 40_001)
    circle = 700.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    islets = [(np.array(ISLAND) / 20.0 + [30.0 * k, -500.0]).tolist() for k in range(-20, 20)]
    coast = world(feature("LineString", degrees(circle)), *(feature("Polygon", [degrees(each)]) for each in islets))
    first, *others = coast_of(load_scenario(scene(tmp_path, coast)))
    assert 1000 < len(first) <= 10_000
    np.testing.assert_allclose(np.hypot(*first.T), 700.0, atol=1e-3)
    np.testing.assert_allclose(first[[0, -1]], circle[[0, -1]], atol=1e-6)
    assert len(others) == 40


@pytest.mark.parametrize(
    ("coast", "message"),
    [
        ("{", "coast.geojson"),
        ({"type": "Topology"}, "no GeoJSON: type"),
        (world(feature("Point", [0.0, 0.0])), "no line and no polygon in it"),
        (world(feature("LineString", [[0.0], [1.0]])), "a line whose places are not several [longitude, latitude]"),
        (world(feature("LineString", 5)), "a line whose places are not"),
        (world(feature("MultiPolygon", [5])), "no line and no polygon in it"),
        (world(feature("LineString", [[0.0, 0.0], [500.0, 0.0]])), "places that are no degrees"),
        ('{"type": "LineString", "coordinates": [[0.0, 0.0], [NaN, 0.0]]}', "coast.geojson"),
    ],
)
def test_invalid_coastlines_are_reported_at_the_field(tmp_path: Path, coast: Any, message: str) -> None:
    with pytest.raises(ScenarioError) as error:
        load_scenario(scene(tmp_path, coast))
    (fault,) = error.value.faults
    assert "coastline: expected a GeoJSON file of lines or polygons, got" in fault
    assert message in fault


def test_a_coastline_outside_the_region_warns(tmp_path: Path) -> None:
    def told(places: Any) -> list[str]:
        scenario = load_scenario(scene(tmp_path, world(feature("LineString", places))))
        return [text for text in scenario_warnings(scenario) if "coastline" in text]

    assert told(degrees(EDGE)) == []
    (text,) = told([[lat, lon] for lon, lat in degrees(EDGE)])
    assert "coastline: nothing of it is near region and sensors, and none is drawn (are longitudes" in text


def test_a_file_and_an_origin_must_be_there(tmp_path: Path) -> None:
    file = scene(tmp_path, world(feature("LineString", degrees(EDGE))), origin=False)
    with pytest.raises(ScenarioError, match="longitudes and latitudes, of which the scenario has no `origin`"):
        load_scenario(file)
    file = scene(tmp_path, world(feature("LineString", degrees(EDGE))))
    (tmp_path / "coast.geojson").unlink()
    with pytest.raises(ScenarioError, match=r'coastline: .*"coast.geojson": no such file'):
        load_scenario(file)


def drawn(figure: Any) -> list[Any]:
    """The segments of the collection that has them."""
    found = [each for axes in figure.axes for each in axes.collections if isinstance(each, LineCollection)]
    return [segment for each in found for segment in each.get_segments()]


def test_pictures_and_replays_have_it_and_limits_are_as_without(tmp_path: Path) -> None:
    scenario = load_scenario(scene(tmp_path, world(feature("LineString", degrees(EDGE)))))
    truth = sample_truth(scenario)
    figure, without = scenario_figure(scenario, truth), scenario_figure(load_scenario("paper-e"), truth)
    np.testing.assert_allclose(drawn(figure)[0], EDGE, atol=1e-6)
    assert figure.axes[0].get_xlim() == without.axes[0].get_xlim()
    assert "coastline" in [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    record = run_scenario(scenario, "stationary", seed=0)
    figure = tracks_figure(record, scene=build_scene(scenario, "stationary"))
    np.testing.assert_allclose(drawn(figure)[0], EDGE, atol=1e-6)
    (line,) = [corners for kind, corners in data_of(record, scenario)["zones"] if kind == COAST]
    np.testing.assert_allclose(line, EDGE, atol=0.5)


def test_tracked_scans_keep_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_recording(tmp_path, seconds=40.0)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "coast.geojson").write_text(json.dumps(world(feature("LineString", degrees(EDGE)))), "utf-8")
    text = (tmp_path / "radars.yaml").read_text("utf-8")
    (tmp_path / "radars.yaml").write_text(f"coastline: coast.geojson\n{text}", "utf-8")
    for words in (
        ["track", "scans.csv", "--sensors", "radars.yaml", "--out", "deep/run"],
        ["report", "deep/run"],
        ["video", "deep/run", "--out", "a.gif", "--duration", "0.2"],
    ):
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
    assert "coastline" in (tmp_path / "deep/run/report.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("place", "constraints", "told"),
    [
        ([180.0, 120.0], [], "inside a closed line of the coastline, which is only drawn"),
        ([120.0, 180.0], [], ""),
        ([180.0, 120.0], [{"kind": "keep_out", "geojson": "coast.geojson"}], "inside an area that control.constraints"),
    ],
)
def test_a_sensor_that_starts_on_drawn_land_warns(
    place: list[float], constraints: list[Any], told: str, tmp_path: Path
) -> None:
    """Also where no constraint keeps boats off it."""
    file = scene(tmp_path, world(feature("Polygon", [degrees(ISLAND)])))
    given = replace_fields(load_scenario(file), {"sensors.0.position": place, "control.constraints": constraints})
    found = [line for line in scenario_warnings(given) if "position: expected a place where the sensor may be" in line]
    assert len(found) == (told != "")
    assert all(told in line for line in found)
