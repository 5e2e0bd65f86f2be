"""A scenario written with every default reads back as itself."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings

from scenarios.minimal import changed
from scenarios.strategies import scenarios
from vedette.scenarios import list_builtin, load_scenario, parse_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.sections import ScenarioModel


@settings(max_examples=60)
@given(scenarios())
def test_valid_scenarios_round_trip(data: dict[str, Any]) -> None:
    model = ScenarioModel.model_validate(data)
    text = dump_scenario(model)
    again = parse_scenario(text, "dumped.yaml")
    assert again == model
    assert dump_scenario(again) == text


@pytest.mark.parametrize("name", list_builtin())
def test_built_in_scenarios_round_trip(name: str) -> None:
    scenario = load_scenario(name)
    assert parse_scenario(dump_scenario(scenario.model), folder=scenario.folder) == scenario.model


def test_what_sensors_share_is_written_out() -> None:
    model = parse_scenario(changed(("heading_deg: 4.0", "noise: {kind: range_dependent}")))
    assert [sensor.noise.kind for sensor in model.sensors] == ["range_dependent", "constant"]
    text = dump_scenario(model)
    assert "sensor_defaults" not in text
    assert parse_scenario(text) == model


def test_a_null_default_is_no_default() -> None:
    text = changed(("  noise: {kind: constant, std: [0.02, 3.0]}", "  noise:"))
    assert parse_scenario(text).sensors[0].noise.kind == "range_dependent"
