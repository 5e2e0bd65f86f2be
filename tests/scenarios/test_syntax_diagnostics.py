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


@pytest.mark.parametrize("text", ["", "# nothing\n"])
def test_an_empty_file_is_no_scenario(text: str) -> None:
    assert faults(text) == ["f:1:1: expected a mapping of the sections of a scenario, got nothing"]


def test_a_list_is_no_scenario() -> None:
    assert faults("- a\n- b\n") == ["f:1:1: expected a mapping of the sections of a scenario, got a list of 2"]


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


def test_an_error_behind_an_alias_is_located_where_it_is_written() -> None:
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


def test_invalid_utf8_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "latin.yaml"
    file.write_bytes("name: Zürich\n".encode("latin-1"))
    with pytest.raises(InputError, match="expected UTF-8 text; byte 7 is not"):
        load_scenario(file)


def test_an_unknown_name_gets_the_nearest_suggestion() -> None:
    with pytest.raises(InputError, match=r"^papre-a: no such file; expected .* \(did you mean paper-a\?\)"):
        load_scenario("papre-a")
