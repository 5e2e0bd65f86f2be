"""Zones out of GeoJSON: every polygon is one, holes may be entered, and what cannot be read is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette.control import KeepOut
from vedette.control.constraints.protocol import ConstraintContext
from vedette.errors import InputError, ScenarioError
from vedette.evaluation.runs import run_scenario
from vedette.recorded import Origin
from vedette.scenarios import load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.overrides import replace_fields

ORIGIN = Origin(-1.1171, 50.7865)


def ring(west: float, south: float, east: float, north: float) -> Any:
    """A closed ring, by metres from the origin."""
    corners = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return ORIGIN.to_degrees(corners).tolist()


ISLAND = {"type": "Polygon", "coordinates": [ring(-60.0, -60.0, 60.0, 60.0), ring(-20.0, -20.0, 20.0, 20.0)]}
ISLETS = {"type": "MultiPolygon", "coordinates": [[ring(200.0, 0.0, 220.0, 20.0)], [ring(300.0, 0.0, 320.0, 20.0)]]}
COAST: dict[str, Any] = {
    "type": "FeatureCollection",
    "features": [
        {"type": "Feature", "properties": {}, "geometry": ISLAND},
        {"type": "Feature", "properties": None, "geometry": {"type": "GeometryCollection", "geometries": [ISLETS]}},
        {"type": "Feature", "geometry": {"type": "Point", "coordinates": [0.0, 0.0]}},
        {"type": "Feature", "geometry": None},
    ],
}


def scene(tmp_path: Path, coast: Any = COAST, *, origin: bool = True, zone: str = "geojson: coast.geojson") -> Path:
    (tmp_path / "coast.geojson").write_text(coast if isinstance(coast, str) else json.dumps(coast), "utf-8")
    text = dump_scenario(load_scenario("paper-e").model)
    head, _, rest = text.partition("  constraints: []")
    assert rest
    wall = "{kind: keep_out, region: {x_min: 500.0, x_max: 600.0, y_min: 0.0, y_max: 10.0}}"
    text = f"{head}  constraints:\n    - {{kind: keep_out, {zone}}}\n    - {wall}{rest}"
    if origin:
        text = text.replace("origin:\n", "origin: {lon: -1.1171, lat: 50.7865}\n")
    (tmp_path / "scene.yaml").write_text(text, "utf-8")
    return tmp_path / "scene.yaml"


def test_every_polygon_is_a_zone_and_the_others_keep_their_places(tmp_path: Path) -> None:
    constraints: Any = load_scenario(scene(tmp_path)).model.control.constraints
    assert [constraint.kind for constraint in constraints] == ["keep_out"] * 4
    island, wall, *islets = constraints
    np.testing.assert_allclose(island.polygon, [[-60, -60], [60, -60], [60, 60], [-60, 60]], atol=1e-6)
    np.testing.assert_allclose(island.holes, [[[-20, -20], [20, -20], [20, 20], [-20, 20]]], atol=1e-6)
    assert wall.region.x_min == 500.0
    assert [round(islet.polygon[0][0]) for islet in islets] == [200, 300]


def test_a_scenario_that_was_read_needs_the_file_no_more(tmp_path: Path) -> None:
    loaded = load_scenario(scene(tmp_path))
    (tmp_path / "coast.geojson").unlink()
    (tmp_path / "again.yaml").write_text(dump_scenario(loaded.model), "utf-8")
    assert load_scenario(tmp_path / "again.yaml").model == loaded.model
    changed = replace_fields(loaded, {"time.num_steps": 12, "ospa.first_scan": None, "ospa.last_scan": None,
                                   "control.decision_steps": [4]})  # fmt: skip
    record = run_scenario(changed, "jdm", seed=1, num_threads=1)
    ways = record.poses[:, :, :2]
    assert not ((np.abs(ways) < 60.0).all(axis=-1) & ~(np.abs(ways) < 20.0).all(axis=-1)).any()


def test_a_hole_may_be_entered_and_its_edge_not_crossed() -> None:
    outer = np.array([[-60.0, -60.0], [60.0, -60.0], [60.0, 60.0], [-60.0, 60.0]])
    zone = KeepOut(outer, (outer / 3.0,))
    ways = [
        [[0.0, 0.0, 0.0], [10.0, 10.0, 0.0]],  # within the hole
        [[0.0, 0.0, 0.0], [30.0, 0.0, 0.0]],  # out of it
        [[30.0, 0.0, 0.0], [40.0, 0.0, 0.0]],  # between
        [[70.0, 0.0, 0.0], [80.0, 0.0, 0.0]],  # outside of all
        [[-70.0, 0.0, 0.0], [70.0, 0.0, 0.0]],  # across all
    ]
    (allowed,) = zone.courses(ConstraintContext((np.array(ways),), np.arange(2.0)))
    assert allowed.tolist() == [True, False, False, True, False]
    with pytest.raises(InputError, match=r"holes\[0\]: expected a Region, or a polygon of at least 3 corners"):
        KeepOut(outer, (outer[:2],))


@pytest.mark.parametrize(
    ("coast", "message"),
    [
        ("{", "a GeoJSON file of polygons, got .*coast.geojson"),
        ({"type": "Topology"}, 'no GeoJSON: type "Topology"'),
        ([1, 2], "no GeoJSON: type nothing"),
        ({"type": "Point", "coordinates": [0, 0]}, "no polygon in it"),
        ({"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, "a ring of 2 corners, or not closed"),
        (
            {"type": "Polygon", "coordinates": [[["a", 0]]]},
            r"a ring whose places are not several \[longitude, latitude\]",
        ),
        ({"type": "Polygon", "coordinates": [[[0, 0], [500, 0], [0, 1], [0, 0]]]}, "places that are no degrees"),
        ({"type": "Polygon", "coordinates": [[[170, 0], [171, 0], [170, 1], [170, 0]]]}, "side of the globe"),
    ],
)
def test_invalid_zone_files_are_reported_at_the_field(tmp_path: Path, coast: Any, message: str) -> None:
    with pytest.raises(ScenarioError, match=message) as error:
        load_scenario(scene(tmp_path, coast))
    assert "control.constraints[0].geojson: expected a GeoJSON file of polygons" in str(error.value)


def test_a_zone_has_one_area_and_a_file_needs_an_origin(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="of which the scenario has no valid `origin`"):
        load_scenario(scene(tmp_path, origin=False))
    both = "geojson: coast.geojson, polygon: [[0, 0], [9, 0], [0, 9]]"
    with pytest.raises(ScenarioError, match="expected either region, polygon or geojson, got polygon and geojson"):
        load_scenario(scene(tmp_path, zone=both))
    with pytest.raises(ScenarioError, match=r'got "sea\.geojson": no such file'):
        load_scenario(scene(tmp_path, zone="geojson: sea.geojson"))
