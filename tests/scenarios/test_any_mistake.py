"""Whatever is wrong with a scenario, it is told as faults with places, and nothing else is raised."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fuzz.mutations import spoil_data
from scenarios.strategies import scenarios
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario


@settings(max_examples=100)
@given(scenarios(), st.integers(0, 2**32 - 1))
def test_any_mistake_is_told_with_its_place(data: Any, seed: int) -> None:
    """A valid scenario with a few of its values replaced, changed, left out, renamed or added to."""
    text = json.dumps(spoil_data(np.random.default_rng(seed), data, 4), indent=1)
    for word, number in (("-Infinity", "-.inf"), ("Infinity", ".inf"), ("NaN", ".nan")):
        text = text.replace(word, number)
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
