"""Texts that no person writes: each ends soon, in a fault of the file's own words."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scenarios.minimal import MINIMAL, changed
from vedette.campaigns.spec import load_spec, parse_spec
from vedette.errors import InputError, ScenarioError
from vedette.models.arguments import reject
from vedette.scenarios import load_scenario, parse_scenario
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.yaml_reader import MAX_BYTES, read_yaml


def faults(text: str) -> list[str]:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(text, "f")
    return error.value.faults


@pytest.mark.parametrize("escape", ["\\UFFFFFFFF", "\\U00110000"])
def test_an_escape_of_no_letter_is_a_syntax_error_where_it_stands(escape: str) -> None:
    (fault,) = faults(f'format: 1\nname: "{escape}"\n')[-1:]
    assert fault.startswith("f:2:")
    assert "a syntax error: an escape of what is no letter" in fault


def test_half_a_letter_is_a_fault_as_a_value_and_as_a_key() -> None:
    value, key = read_yaml('a: "\\ud800"\n"\\udfff": 1\n', "f").faults
    assert value.message("f").startswith("f:1:4: a: expected whole letters, got half of one")
    assert key.message("f").startswith("f:2:1: expected whole letters, got half of one")


def test_the_halves_that_json_writes_are_one_letter() -> None:
    assert read_yaml(json.dumps({"a": "\U0001f6a2"}), "f").data == {"a": "\U0001f6a2"}


def test_messages_have_printable_characters_alone() -> None:
    text = (
        MINIMAL
        + '"\\e[31m\\u202e": 1\n'
        + changed(("kind: constant_velocity", 'kind: "\\0\\x9b"')).split("\n")[3]
        + "\n"
    )
    assert all(fault.isprintable() for fault in faults(text))


def test_many_faults_are_counted_and_all_are_kept() -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(MINIMAL + "".join(f"unknown{number}: 1\n" for number in range(3000)))
    assert len(error.value.faults) == 3000
    lines = str(error.value).splitlines()
    assert len(lines) == 51
    assert lines[-1] == "and 2950 more"


def test_work_grows_with_the_length_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted in places written, as times depend on the machine: an alias copies its own node and nothing else."""
    from vedette.scenarios import yaml_reader

    counts = []
    record = yaml_reader._Reader.record

    def counted(self: yaml_reader._Reader, *args: object, **others: object) -> None:
        counts.append(1)
        record(self, *args, **others)  # type: ignore[arg-type]

    monkeypatch.setattr(yaml_reader._Reader, "record", counted)
    for number in (1000, 2000):
        counts.clear()
        read_yaml("x: &a [1]\ny: [" + ",".join(["*a"] * number) + "]\n", "f")
        assert len(counts) == 2 * number + 6


def test_a_file_too_long_is_not_read() -> None:
    assert faults("#" * (MAX_BYTES + 1)) == [
        f"f:1:1: expected a file of at most {MAX_BYTES} letters, got {MAX_BYTES + 1}"
    ]


def test_numbers_of_thousands_of_digits_are_words() -> None:
    assert faults(changed(("num_steps: 20", "num_steps: 0x" + "F" * 5000)))[0].startswith(
        'f:2:19: time.num_steps: expected a whole number, got "0xFFFF'
    )


@pytest.mark.parametrize("name", ["x" * 10_000, "a\x00b", "\udcff"])
def test_an_impossible_file_name_is_a_missing_file(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected a YAML file or one of") as error:
        load_scenario(name)
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 1000
    section = {"kind": "recorded", "path": f"{name}.csv"}
    with pytest.raises(ScenarioError, match=r"targets.*(no such file|string)"):
        replace_fields(parse(tmp_path), {"targets": section})


def parse(folder: Path):
    file = folder / "s.yaml"
    file.write_text(MINIMAL)
    return load_scenario(file)


@pytest.mark.parametrize("index", ["\u00b2", "\u0663", "9" * 5000, "-1"])
def test_an_index_is_a_plain_number(index: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"expected \* or a number below 2 after sensors"):
        replace_fields(parse(tmp_path), {f"sensors.{index}.speed": 1.0})


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, "a = " + "{b=" * 5000])
def test_deep_brackets_of_toml_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="expected TOML"):
        parse_spec(text)


def test_a_campaign_of_endless_combinations_is_refused() -> None:
    grid = "".join(f'"sensors.{number}.speed" = [1, 2, 3, 4, 5, 6, 7, 8, 9]\n' for number in range(8))
    with pytest.raises(InputError, match=r"expected at most 10000 combinations of settings, got 43046721"):
        parse_spec(f'name = "a"\nscenarios = ["paper-a"]\nplanners = ["constant"]\nruns = 1\n[grid]\n{grid}')


def test_a_date_is_named_as_one() -> None:
    with pytest.raises(InputError, match="got the date or time 2024-01-01"):
        parse_spec('name = "a"\nscenarios = ["paper-a"]\nruns = 1\n[grid]\n"time.start" = [2024-01-01]\n')


def test_a_campaign_file_too_long_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "c.toml"
    file.write_bytes(b"#" * 2_000_001)
    with pytest.raises(InputError, match="at most 2000000 bytes; it has more than 2000000"):
        load_spec(file)


@pytest.mark.parametrize(
    ("got", "text"),
    [
        (np.float64(0.9), "0.9"),
        ([np.float64(0.9), np.int64(2)], "[0.9, 2]"),
        (np.array([1.5]), "[1.5]"),
        (10**5000, "a number of thousands of digits"),
    ],
    ids=["number", "numbers", "array", "digits"],
)
def test_numbers_of_any_kind_are_written_as_numbers(got: object, text: str) -> None:
    assert str(reject("a", "b", got)) == f"a: expected b; got {text}"


def test_a_number_of_numpy_in_a_field_set_by_path_is_written_as_a_number(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"got -0\.9$"):
        replace_fields(parse(tmp_path), {"ospa.cutoff": np.float64(-0.9)})
