"""Whatever is wrong with a scenario, it is told as faults with places, and nothing else is raised."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fuzz.combinations import combination, lay_beside
from fuzz.mutations import spoil_data
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario


@pytest.mark.parametrize("seed", range(4))
def test_any_error_is_reported_with_its_location(seed: int, tmp_path: Path) -> None:
    """Scenarios with a few of their values replaced, changed, left out, renamed or added to."""
    lay_beside(tmp_path)
    told = 0
    for number in range(50):
        rng = np.random.default_rng([seed, number])
        text = json.dumps(spoil_data(rng, combination(rng), 4), indent=1)
        for word, other in (("-Infinity", "-.inf"), ("Infinity", ".inf"), ("NaN", ".nan")):
            text = text.replace(word, other)
        try:
            parse_scenario(text, "f.yaml", folder=tmp_path)
        except ScenarioError as error:
            lines = [line_of(fault) for fault in error.faults]
            assert lines == sorted(lines)
            assert all(1 <= line <= text.count("\n") + 1 for line in lines)
            told += 1
    assert told > 25


def line_of(fault: str) -> int:
    match = re.fullmatch(
        r"f\.yaml:(\d+):\d+:( \S.*?:)? (required key is missing|expected .+, got .+)", fault, re.DOTALL
    )
    assert match, fault
    return int(match[1])
