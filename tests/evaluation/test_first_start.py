"""The first start, of scenarios of every kind: whatever cannot be compiled ahead is not spoken of."""

from __future__ import annotations

import pytest

from vedette.evaluation.precompile import precompile
from vedette.scenarios import load_scenario


def test_a_scenario_without_birth_sites_is_compiled_without_a_word(capfd: pytest.CaptureFixture[str]) -> None:
    scenario = load_scenario("shore-radar")  # what `vedette init` writes; its births come from measurements
    assert scenario.model.birth.sites == ()
    precompile(scenario)
    assert capfd.readouterr() == ("", "")
