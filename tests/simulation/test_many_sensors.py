"""Records of many sensors: as large as what they hold, and back without loss in either form."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, parse_scenario, replace_fields
from vedette.scenarios.generated import GeneratedScene, scene_text
from vedette.simulation import decision_tables
from vedette.simulation.arrow import read_table, write_table
from vedette.simulation.decision_tables import OWN_REWARDS
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import decode_run, encode_run
from vedette.simulation.tables import run_facts


@cache
def record(num_sensors: int, planner: str = "jdm") -> RunRecord:
    scene = Scenario(parse_scenario(scene_text(GeneratedScene(num_sensors=num_sensors))))
    short = {"time.num_steps": 3, "control.decision_steps": [1, 2]}
    return run_scenario(replace_fields(scene, short), planner, seed=0, num_threads=1)


def read(files: dict[str, bytes], of: RunRecord) -> RunRecord:
    return decode_run(run_facts(of), files, "here")


def assert_same_plans(found: RunRecord, wanted: RunRecord) -> None:
    assert len(found.decisions) == len(wanted.decisions) == 2
    for own, other in zip(found.decisions, wanted.decisions, strict=True):
        assert [table.sensors for table in own.plan.tables] == [table.sensors for table in other.plan.tables]
        for table, given in zip(own.plan.tables, other.plan.tables, strict=True):
            np.testing.assert_array_equal(table.mean, given.mean)
            np.testing.assert_array_equal(table.standard_error, given.standard_error)
        assert own.plan.chosen == other.plan.chosen


@pytest.mark.parametrize("planner", ["jdm", "idm"])
def test_rewards_of_many_sensors_take_room_in_proportion_to_their_number(planner: str) -> None:
    sizes = {}
    for num in (18, 72):
        files = encode_run(record(num, planner))
        sizes[num] = sum(len(content) for name, content in files.items() if "rewards" in name)
    assert sizes[72] < 4.4 * sizes[18]  # squared, it would be 16 times


def test_rewards_that_stand_apart_come_back(monkeypatch: pytest.MonkeyPatch) -> None:
    run = record(18)
    files = encode_run(run)
    assert "own_rewards.arrow" in files
    assert_same_plans(read(files, run), run)
    assert encode_run(read(files, run)) == files
    monkeypatch.setattr(decision_tables, "_FEW_SENSORS", 1000)  # as they all stood before, and do for few sensors
    together = encode_run(run)
    assert "own_rewards.arrow" not in together
    assert len(together["rewards.arrow"]) > 5 * len(files["own_rewards.arrow"]) / 2
    assert_same_plans(read(together, run), run)


@pytest.mark.parametrize(
    ("column", "change", "told"),
    [
        ("sensor", lambda values: values + 18, "column sensor: expected one of 18"),
        ("sensor", lambda values: np.arange(len(values)) % 18, "column sensor: expected one of 18"),
        ("action", lambda values: values + 100, "expected each of 9 actions at most once"),
        ("action", lambda values: values * 0, "expected each of 9 actions at most once"),
        ("reward_table", lambda values: values[::-1].copy(), "expected rows in order"),
        ("reward_table", lambda values: values + 1, "expected rows of every number from 0"),
    ],
)
def test_rewards_that_fit_no_run_are_refused(column: str, change: Any, told: str) -> None:
    run = record(18)
    files, layout = encode_run(run), OWN_REWARDS["own_rewards"]
    rows = read_table(files["own_rewards.arrow"], layout, "own_rewards")
    changed = write_table({**rows, column: change(rows[column])}, layout)
    with pytest.raises(InputError, match=told):
        read({**files, "own_rewards.arrow": changed}, run)


def test_few_sensors_have_their_rewards_in_one_table() -> None:
    assert "own_rewards.arrow" not in encode_run(record(3))
