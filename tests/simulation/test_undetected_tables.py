"""Where undetected targets were expected at decisions: kept with explanations, in tables and back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import load_scenario, replace_fields
from vedette.simulation import RunRecord
from vedette.simulation.tables import record_of, run_facts, tables_of
from vedette.simulation.undetected_tables import with_undetected

SHORT = {"time.num_steps": 12, "control.decision_steps": [4, 8], "filter": {"kind": "factored_glmb"}}


@pytest.fixture(scope="module")
def record() -> RunRecord:
    return run_scenario(replace_fields(load_scenario("two-searchers"), SHORT), "jdm", seed=0)


def test_tables_give_back_what_was_expected_where(record: RunRecord) -> None:
    assert record.decisions
    assert all(decision.undetected is not None for decision in record.decisions)
    tables = tables_of(record)
    back = record_of(run_facts(record), tables, record.timings)
    for decision, other in zip(record.decisions, back.decisions, strict=True):
        assert decision.undetected is not None
        assert other.undetected is not None
        assert other.undetected.grid == decision.undetected.grid
        np.testing.assert_array_equal(other.undetected.expected, decision.undetected.expected)
        assert other.plan.explanation is not None


def test_runs_without_explanations_or_search_have_no_table() -> None:
    scene = replace_fields(load_scenario("two-searchers"), {**SHORT, "control.explain": False})
    assert "undetected" not in tables_of(run_scenario(scene, "jdm", seed=0))
    assert "undetected" not in tables_of(run_scenario(scene, "nearest", seed=0))


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("decision", 99, "numbers below"),
        ("columns", 1000, "expected columns cell_0 to cell_"),
        ("x_min_m", 1e6, "x_m"),
        ("cell_2", -1.0, "at least 0"),
    ],
)
def test_tables_that_are_no_intensity_are_refused(record: RunRecord, column: str, value: float, message: str) -> None:
    table = {name: np.array(of) for name, of in tables_of(record)["undetected"].items()}
    table[column][1] = value
    plain = tuple(replace(each, undetected=None) for each in record.decisions)
    with pytest.raises(InputError, match=message):
        with_undetected(plain, table)
