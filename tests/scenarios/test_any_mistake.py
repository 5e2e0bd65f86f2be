"""Whatever is wrong with a scenario, it is told as faults with places, and nothing else is raised."""

from __future__ import annotations

import copy
import json
import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.strategies import scenarios
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario

JUNK: st.SearchStrategy[Any] = st.sampled_from(
    [
        None,
        True,
        0,
        -1,
        1e300,
        10**30,
        "",
        "every",
        "none",
        [],
        [[]],
        [1, "a"],
        {},
        {"kind": "custom"},
        {"kind": []},
        {"": {}},
    ]
).map(copy.deepcopy)


def places(data: Any) -> list[tuple[Any, Any]]:
    """Every collection in the data with each of its keys."""
    if not isinstance(data, dict | list):
        return []
    keys = list(data) if isinstance(data, dict) else list(range(len(data)))
    return [(data, key) for key in keys] + [place for key in keys for place in places(data[key])]


@st.composite
def mistaken(draw: st.DrawFn) -> Any:
    """A valid scenario with a few of its values replaced, left out, renamed or added to."""
    data = copy.deepcopy(draw(scenarios()))
    for _ in range(draw(st.integers(1, 4))):
        found = places(data)
        collection, key = found[draw(st.integers(0, len(found) - 1))]
        what = draw(st.sampled_from(["replace", "remove", "add"]))
        if what == "replace":
            collection[key] = draw(JUNK)
        elif what == "remove":
            del collection[key]
        elif isinstance(collection, dict):
            collection[str(key) + "x"] = draw(JUNK)
        else:
            collection.append(draw(JUNK))
    return data


@settings(max_examples=100)
@given(mistaken())
def test_any_mistake_is_told_with_its_place(data: Any) -> None:
    text = json.dumps(data, indent=1)
    lines = [line_of(fault) for fault in faults(text)]
    assert lines == sorted(lines)
    assert all(1 <= line <= text.count("\n") + 1 for line in lines)


def faults(text: str) -> list[str]:
    try:
        parse_scenario(text, "f.yaml")
    except ScenarioError as error:
        return error.faults
    return []


def line_of(fault: str) -> int:
    match = re.fullmatch(r"f\.yaml:(\d+):\d+:( \S.*?:)? expected .+, got .+", fault, re.DOTALL)
    assert match, fault
    return int(match[1])
