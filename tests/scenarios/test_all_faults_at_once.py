"""A file with many mistakes gets all of them back, in file order, whatever part they are in."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenarios.minimal import MINIMAL, changed
from vedette.errors import InputError, ScenarioError
from vedette.scenarios import load_scenario, parse_scenario


def faults(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text, "f")
    return error.value.faults


def test_faults_of_schema_and_of_sense_come_together_in_file_order() -> None:
    text = changed(
        ("num_steps: 20", "num_stps: 20, num_steps: 20"),
        ("existence: 0.1", "existence: 2"),
        ("end_step: 18", "end_step: 1"),
        ("std: [0.02, 3.0]", "std: [0.02]"),
        ("heading_deg: 4.0", "heading_deg: fast"),
        ("weights: [0.5, 0.5]", "weights: [0.5, 0.6], mixture_power: cubic"),
        ("decision_steps: [4, 8]", "decision_steps: [4, 50], num_samples: 0"),
    )
    lines = faults(text)
    assert [line.split(" expected ")[0] for line in lines] == [
        "f:2:8: time.num_stps:",
        "f:9:19: birth.sites[0].existence:",
        "f:13:63: targets.tracks[0].end_step:",
        "f:15:32: sensor_defaults.noise.std:",
        "f:17:55: sensors[0].heading_deg:",
        "f:20:40: fusion.weights:",
        "f:20:67: fusion.mixture_power:",
        "f:22:31: control.decision_steps[1]:",
        "f:22:49: control.num_samples:",
    ]


def test_a_fault_in_the_defaults_is_named_once_and_where_it_stands() -> None:
    assert faults(changed(("kind: constant, std", "kind: constant, sdt"))) == [
        "f:15:3: sensor_defaults.noise.std: expected a value, as it is required, got nothing",
        "f:15:27: sensor_defaults.noise.sdt: expected one of kind, std, got an unknown key (did you mean std?)",
    ]


def test_a_sensor_with_its_own_value_has_its_own_faults() -> None:
    text = changed(("heading_deg: 4.0", "noise: {kind: constant, std: [1.0]}"))
    assert faults(text) == [
        "f:17:71: sensors[0].noise.std: expected 2 numbers, as a bearing_range measurement has, got a list of 1"
    ]


@pytest.mark.parametrize("text", ["", "# nothing\n"])
def test_an_empty_file_is_no_scenario(text: str) -> None:
    assert faults(text) == ["f:1:1: expected a mapping of the sections of a scenario, got nothing"]


def test_a_list_is_no_scenario() -> None:
    assert faults("- a\n- b\n") == ["f:1:1: expected a mapping of the sections of a scenario, got a list of 2"]


def test_a_key_twice_and_a_wrong_value_are_both_told() -> None:
    text = changed(("name: small", "name: small\nname: large"), ("cutoff: 50.0", "cutoff: wide"))
    assert faults(text) == [
        "f:2:1: name: expected each key once, got it again, after line 1",
        'f:24:16: ospa.cutoff: expected a number, got "wide"',
    ]


def test_merge_keys_get_a_hint() -> None:
    (fault,) = faults(changed(("heading_deg: 4.0", "<<: {heading_deg: 4.0}")))
    assert fault.endswith("(YAML 1.2 has no merge keys; sensor_defaults holds what sensors share)")


def test_numbers_as_people_write_them() -> None:
    text = changed(
        ("num_steps: 20,", "num_steps: 2e1,"), ("name: small", "name: no"), ("heading_deg: 4.0", "heading_deg: 4")
    )
    model = parse_scenario(text)
    assert (model.time.num_steps, model.name, model.sensors[0].heading_deg) == (20, "no", 4.0)


def test_anchors_and_aliases_can_repeat_a_section() -> None:
    text = changed(
        ("heading_deg: 4.0", "detection: &limited {kind: limited_range, probability: 0.9, max_range: 80.0}"),
        ("position: [0.0, -40.0]", "position: [0.0, -40.0], detection: *limited"),
    )
    first, second = parse_scenario(text).sensors
    assert first.detection == second.detection


def test_a_fault_behind_an_alias_is_told_where_it_is_written() -> None:
    text = changed(
        ("heading_deg: 4.0", "detection: &limited {kind: limited_range, probability: 2, max_range: 80.0}"),
        ("position: [0.0, -40.0]", "position: [0.0, -40.0], detection: *limited"),
    )
    assert [fault.split(":")[1:3] for fault in faults(text)] == [["17", "97"], ["17", "97"]]


def test_loading_names_the_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(MINIMAL.replace("name: small", "nmae: small"), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"mine\.yaml:1:1: nmae: .*\(did you mean name"):
        load_scenario(file)


def test_what_is_no_utf8_is_told(tmp_path: Path) -> None:
    file = tmp_path / "latin.yaml"
    file.write_bytes("name: Zürich\n".encode("latin-1"))
    with pytest.raises(InputError, match="expected UTF-8 text; byte 7 is not"):
        load_scenario(file)


def test_an_unknown_name_gets_the_nearest_one() -> None:
    with pytest.raises(InputError, match=r"^papre-a: no such file; expected .* \(did you mean paper-a\?\)"):
        load_scenario("papre-a")
