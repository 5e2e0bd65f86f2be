"""A scenario written with every default reads back as itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fuzz.combinations import combination, lay_beside
from fuzz.mutations import pick
from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.scenarios import list_builtin, load_scenario, parse_scenario
from vedette.scenarios.dumping import dump_scenario

# Among them words that YAML could take for something else.
WORDS = ["no", "yes", "1e3", "~", "null", "true", "0x1F", "- a", "a: b", "#c", "2016-01-12", ":0", "1_0", " é", "'q'"]
ODD: dict[str, Any] = {"~": None, "no": [1, 2], "1e3": "0x1F", "a: b": True, " é": -1e-9, "#c": "- a"}
# Fields that random combinations leave as they are.
MORE: dict[str, Any] = {
    "control.detection_threshold": 0.35,
    "control.reward": {"kind": "cauchy_schwarz", "unit_volume": 1e-7},
    "control.search": {"kind": "cross_entropy", "num_samples": 10**6, "elite_fraction": 0.1, "smoothing": 0.3},
    "estimator": {"kind": "marginal", "threshold": 1e-6},
    "filter.limits": {"max_existence": 1.0 - 1e-6, "gate_probability": 0.5, "max_hypotheses": 10**6},
    "fusion.missing_weight": 1e-6,
    "fusion.missing_existence": 0.1 + 0.2,
    "fusion.limits": {"max_hypotheses": 77, "max_components": 3, "merge_distance": 1e9},
    "motion": {"kind": "constant_velocity", "sigma_v": 1e-9, "state_order": "interleaved"},
    "ospa": {"cutoff": 123456789.125, "order": 99.5, "window": 12},
    "sensors.0.noise": {"kind": "range_dependent", "sigma_range": 1e9, "eta_range": 1e-9, "sigma_bearing_deg": 0.3},
    "survival": {"kind": "custom", "function": "json:loads", "arguments": ODD},
}
FIXED = ("weights", "decision_times")  # which must fit others


def put(data: Any, path: str, value: Any) -> None:
    *within, last = path.split(".")
    for name in within:
        data = data[int(name)] if name.isdigit() else data[name]
    data[last] = value


def uneven(data: Any, rng: np.random.Generator) -> Any:
    """With all digits of every number that is none of a few."""
    if isinstance(data, dict):
        return {key: value if key in FIXED else uneven(value, rng) for key, value in data.items()}
    if isinstance(data, list):
        return [uneven(value, rng) for value in data]
    return data * (1.0 - 1e-3 * rng.random()) if isinstance(data, float) else data


def test_valid_scenarios_round_trip(tmp_path: Path) -> None:
    """Of any kinds of sections beside each other."""
    lay_beside(tmp_path)
    valid, kept = 0, set[str]()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        data = combination(rng)
        data = (uneven(data, rng) if seed % 2 else data) | {"name": pick(rng, WORDS), "description": pick(rng, WORDS)}
        path = [*MORE, "name"][seed % (len(MORE) + 1)]
        put(data, path, MORE.get(path, data["name"]))
        try:
            model = parse_scenario(json.dumps(data), folder=tmp_path)
        except ScenarioError:
            continue
        valid += 1
        kept.add(path)
        text = dump_scenario(model)
        again = parse_scenario(text, "dumped.yaml", folder=tmp_path)
        assert again == model
        assert dump_scenario(again) == text
    assert valid > 40
    assert kept >= MORE.keys()


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
