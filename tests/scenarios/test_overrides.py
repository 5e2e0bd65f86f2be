"""Fields of a scenario set by path, and checked as if the file had said so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from vedette.errors import ScenarioError
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.overrides import replace_fields


@pytest.fixture(scope="module")
def paper() -> Scenario:
    return load_scenario("paper-a")


def test_nothing_set_is_the_same_scenario(paper: Scenario) -> None:
    assert replace_fields(paper, {}) is paper


def test_a_field_of_a_section_of_every_sensor_and_of_one(paper: Scenario) -> None:
    changed = replace_fields(
        paper,
        {"control.num_samples": 7, "sensors.*.platform.speed": 30.0, "sensors.1.platform.speed": 20.0, "ospa.order": 2},
    )
    assert changed.model.control.num_samples == 7
    assert [sensor.platform.model_dump()["speed"] for sensor in changed.model.sensors] == [30.0, 20.0]
    assert changed.model.ospa.order == 2.0
    assert changed.path == paper.path
    assert paper.model.control.num_samples != 7


def test_a_whole_section(paper: Scenario) -> None:
    changed = replace_fields(paper, {"estimator": {"kind": "marginal", "threshold": 0.4}})
    assert changed.model.estimates_by.model_dump() == {"kind": "marginal", "threshold": 0.4}


def test_a_section_may_leave_out_what_is_at_its_default(paper: Scenario) -> None:
    changed = replace_fields(paper, {"time": {"num_steps": 40, "step_period": 2.0}, "control.decision_times": None})
    assert (changed.model.time.num_steps, changed.model.time.start) == (40, paper.model.time.start)
    with pytest.raises(ScenarioError, match="expected the whole section, with step_period too"):
        replace_fields(replace_fields(paper, {"time.step_period": 2.0}), {"time": {"num_steps": 30}})


def test_a_field_set_to_what_it_is_changes_nothing(paper: Scenario) -> None:
    same = replace_fields(paper, {"control.num_samples": paper.model.control.num_samples})
    assert same.model == paper.model
    assert dump_scenario(same.model) == dump_scenario(paper.model)


def test_files_next_to_the_scenario_stay_next_to_it(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("def motion():\n    raise RuntimeError\n")
    text = dump_scenario(load_scenario("paper-a").model)
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    loaded = load_scenario(path)
    custom = {"kind": "custom", "function": "own.py:motion", "components": ["px", "py", "vx", "vy"]}
    assert replace_fields(loaded, {"motion": custom}).folder == tmp_path
    with pytest.raises(ScenarioError, match=r"motion\.function: expected a file.*other\.py"):
        replace_fields(loaded, {"motion": {**custom, "function": "other.py:motion"}})


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"control.num_sample": 3}, r"control\.num_sample: expected one of .* in control, got 'num_sample' \(did you"),
        ({"contrl.num_samples": 3}, r"in the scenario, got 'contrl' \(did you mean control\?\)"),
        ({"sensors.9.speed": 3.0}, r"sensors\.9\.speed: expected \* or a number below 2 after sensors, got '9'"),
        ({"sensors.speed": 3.0}, r"expected \* or a number below 2 after sensors, got 'speed'"),
        ({"ospa.cutoff.metres": 3.0}, r"expected a section at ospa\.cutoff for 'metres' to be in, got a single value"),
        ({"sensor_defaults.speed": 3.0}, r"what sensors share is set by sensors\.\*"),
        ({"": 3}, r"expected one of .*, got ''"),
        ({"control.num_samples": -3}, r"control\.num_samples: expected a number of at least 1, got -3"),
        ({"control.num_samples": "many"}, r"control\.num_samples: expected a whole number, got \"many\""),
        ({"filter.kind": "glmb"}, r"filter\.kind: expected one of .*, got \"glmb\""),
        (
            {"filter.kind": "lmb"},
            r"fusion\.kind: expected sequential, .*, clmb, .*, central or none, as the filters are lmb",
        ),
        ({"time.num_steps": 5}, r"expected a (step|time)"),
        ({"control.num_samples": -3, "ospa.cutoff": 0}, r"(?s)control\.num_samples.*ospa\.cutoff"),
    ],
)
def test_invalid_overrides_are_reported(paper: Scenario, fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        replace_fields(paper, fields)


def test_a_file_next_to_a_built_in_scenario_needs_a_copy() -> None:
    reward = {"kind": "custom", "function": "mine.py:Reward"}
    with pytest.raises(
        ScenarioError, match=r"relative to the scenario file \(a built-in one: copy it with `vedette init`\)"
    ):
        replace_fields(load_scenario("paper-a"), {"control.reward": reward})
