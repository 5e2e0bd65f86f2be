"""Diagnostics of new targets on the page of a live loop."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vedette.live import build_live_loop
from vedette.scenarios.from_recording import scenario_from_sensors

SENSORS = """
region: {x_min: 0.0, x_max: 1000.0, y_min: 0.0, y_max: 1000.0}
birth: {sites: [], from_measurements: {expected: EXPECTED, std: [20.0, 20.0, 10.0, 10.0]}}
sensors:
  - position: [0.0, 0.0]
    measurement: {kind: position}
    noise: {kind: constant, std: [10.0, 10.0]}
    detection: {kind: constant, probability: 0.9}
    clutter: {kind: region, rate: 1.0}
"""


@pytest.mark.parametrize(("expected", "finding"), [("0.2", "targets reported: none, 19 expected"), ("0.01", "")])
def test_the_page_names_births_that_are_never_reported(tmp_path: Path, expected: str, finding: str) -> None:
    live_page = pytest.importorskip("vedette.reports.live")
    file = tmp_path / "sensors.yaml"
    file.write_text(SENSORS.replace("EXPECTED", expected), encoding="utf-8")
    live_scenario = scenario_from_sensors(file)
    loop = build_live_loop(live_scenario, "stationary")
    state = loop.initial()
    screen = live_page.LiveScreen(live_scenario.scenario, loop, lambda: state)
    for second in range(100):
        state, answers = loop.process(state, json.dumps({"time": second, "sensor": 1, "measurements": []}).encode())
        screen.note(answers)
        assert "reported" not in json.loads(screen.frame())["health"] or second == 99
    health = json.loads(screen.frame())["health"]
    assert finding in health
    assert bool(finding) == ("new targets" in health or "reported" in health)
