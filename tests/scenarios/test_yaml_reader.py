# ruff: noqa: E501
"""YAML 1.2 as the core schema has it, with places; nothing in a text makes the reader raise."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vedette.scenarios.yaml_reader import plain_scalar, read_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e3", 1000.0),
        ("+1.5E-2", 0.015),
        (".5", 0.5),
        ("1.", 1.0),
        ("-12", -12),
        ("012", 12),
        ("0x1F", 31),
        ("0o17", 15),
        ("-.inf", -math.inf),
        ("no", "no"),
        ("yes", "yes"),
        ("on", "on"),
        ("1_000", "1_000"),
        ("12:30:00", "12:30:00"),
        ("2016-01-12", "2016-01-12"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        ("NULL", None),
        ("1e", "1e"),
        ("9" * 400, "9" * 400),
    ],
)
def test_plain_scalars(text: str, value: Any) -> None:
    got = plain_scalar(text)
    assert got == value
    assert type(got) is type(value)


def test_not_a_number_is_a_number() -> None:
    assert math.isnan(plain_scalar(".nan"))


def test_quotes_and_the_string_tag_make_words() -> None:
    document = read_yaml("a: '1'\nb: \"true\"\nc: !!str 3\nd: |\n  4\ne: ! 5\n", "f")
    assert document.data == {"a": "1", "b": "true", "c": "3", "d": "4\n", "e": "5"}
    assert document.faults == []


def test_every_node_keeps_its_place() -> None:
    document = read_yaml("a:\n  - {b: 1, c: [2, 3]}\n  - d\n", "f")
    assert document.place(("a",)) == (1, 1)
    assert document.value_place(("a", 0)) == (2, 5)
    assert document.place(("a", 0, "c")) == (2, 12)
    assert document.value_place(("a", 0, "c", 1)) == (2, 19)
    assert document.value_place(("a", 1)) == (3, 5)
    assert document.place(("a", 0, "absent", "deeper")) == (2, 5)


def test_aliases_repeat_data_and_take_its_places_inside() -> None:
    document = read_yaml("a: &x {b: [1, 2]}\nc: *x\n", "f")
    assert document.data == {"a": {"b": [1, 2]}, "c": {"b": [1, 2]}}
    assert document.value_place(("c",)) == (2, 4)
    assert document.value_place(("c", "b", 1)) == (1, 15)


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        (
            "a: [1,\nb: 2",
            ["f:2:5: expected valid YAML 1.2, got a syntax error: expected ',' or ']', but got '<stream end>'"],
        ),
        (
            "a:\n\t- 1",
            [
                "f:2:1: expected valid YAML 1.2, got a syntax error: found character '\\t' that cannot start any token "
                "(indent with spaces, not tabs)"
            ],
        ),
        ("a: b: c", ["f:1:5: expected valid YAML 1.2, got a syntax error: mapping values are not allowed here"]),
        ("a: 1\nb: 2\na: 3\n", ["f:3:1: a: expected each key once, got it again, after line 1"]),
        ("a: 1\n---\nb: 2\n", ["f:2:1: expected one document, got another after it"]),
        ("%YAML 1.1\n---\na: no\n", ["f:2:1: expected YAML 1.2, got a %YAML 1.1 directive"]),
        ("a: *b\n", ["f:1:4: a: expected an alias of a node that stands, complete, before it, got *b"]),
        ("a: &a [*a]\n", ["f:1:8: a[0]: expected an alias of a node that stands, complete, before it, got *a"]),
        (
            "1: a\n? [b]\n: c\n",
            ["f:1:1: expected a word as key, got 1", "f:2:3: expected a word as key, got a list of 1"],
        ),
        (
            "a: !!python/object/apply:os.system ['x']\n",
            [
                "f:1:4: a: expected plain data without a tag, got the tag tag:yaml.org,2002:python/object/apply:os.system"
            ],
        ),
        ("[" * 60, ["f:1:52: expected at most 50 levels of nesting, got more"]),
        (
            "a: 1\x00",
            [
                "f:1:1: expected valid YAML 1.2, got a syntax error: unacceptable character #x0000: special characters are not allowed"
            ],
        ),
    ],
)
def test_syntax_errors(text: str, messages: list[str]) -> None:
    assert [fault.message("f") for fault in read_yaml(text, "f").faults] == messages


def test_aliases_of_aliases_are_bounded() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    faults = read_yaml("\n".join(lines), "f").faults
    assert "got more, aliases and keys counted" in faults[-1].message("f")


@given(st.text(alphabet=" \n\tab:-?[]{},&*!|>'\"%@#01.e~<"))
@example("? a\n? b\n")
@example("--- !<tag:x> a")
@example("&a : *a")
def test_no_text_makes_it_raise(text: str) -> None:
    read_yaml(text, "f")
