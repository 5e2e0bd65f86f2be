"""Why decisions were taken, kept with a run."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.synthetic import make_record
from simulation.test_storage import assert_same
from vedette.control import Bound, Explanation, Plan, RunnerUp, TargetGains
from vedette.errors import InputError
from vedette.evaluation import run_scenario
from vedette.scenarios import load_scenario, replace_fields
from vedette.simulation.arrow import read_table, write_table
from vedette.simulation.explanation_tables import EXPLANATION_TABLES
from vedette.simulation.records import RunRecord
from vedette.simulation.serialization import decode_run, encode_run
from vedette.simulation.storage import load_run, save_run
from vedette.simulation.tables import run_facts

FILES = tuple(f"{name}.arrow" for name in EXPLANATION_TABLES)


def explanation_of(plan: Plan, **fields: Any) -> Explanation:
    """One with everything in it, but for the fields that are given."""
    other = tuple((index + 1) % len(own) for own, index in zip(plan.actions, plan.chosen, strict=True))
    whole = Explanation(
        planner=plan.planner,
        chosen=tuple(own.text(index) for own, index in zip(plan.actions, plan.chosen, strict=True)),
        reward=4.0,
        standard_error=0.1,
        evaluations=169,
        baseline=-0.0,
        of_targets=TargetGains(np.array([[1, 0], [3, 2]]), np.array([0.5, -0.25]), np.array([2.0, 1.0])),
        of_undetected=0.75,
        of_sensors=np.array([3.0, 1.0]),
        reward_without_sensor=np.array([1.5, math.inf]),
        runner_up=RunnerUp(other, "sensor 1 with heading_deg 30", 0.125, 0.0625),
        bound=Bound(math.inf, 4.0, "by target", 3),
        missing={},
        price=0.25,
    )
    return replace(whole, **fields)


def explained(record: RunRecord) -> RunRecord:
    """Its decisions explained: all there is, what a decision case by case has, and not at all."""
    first, second, *rest = record.decisions
    whole = explanation_of(first.plan)
    names = ("baseline", "of_targets", "of_undetected", "of_sensors", "reward_without_sensor", "runner_up")
    little = explanation_of(
        second.plan,
        **dict.fromkeys(names),
        standard_error=None,
        bound=None,
        missing=dict.fromkeys(names, "case by case: nothing: at all"),
    )
    plans = replace(first.plan, explanation=whole, bound=whole.bound), replace(second.plan, explanation=little)
    return replace(record, decisions=(replace(first, plan=plans[0]), replace(second, plan=plans[1]), *rest))


def test_explanations_read_back_bit_for_bit(tmp_path: Path) -> None:
    record = explained(make_record())
    again = load_run(save_run(record, tmp_path / "run"))
    assert_same(again, record)
    assert str(again.decisions[0].plan.explain()) == str(record.decisions[0].plan.explain())
    assert encode_run(again) == encode_run(record)


def test_runs_without_explanations_are_as_they_were() -> None:
    """The same files as before there were any; and a run reads without them."""
    record = make_record()
    files = encode_run(record)
    assert not set(FILES) & set(files)
    with_why = encode_run(explained(record))
    assert set(with_why) - set(files) == set(FILES)
    assert {name: with_why[name] for name in files} == files
    assert_same(decode_run(run_facts(record), files, "run"), replace(record, timings={}))


def test_damaged_explanations_are_named() -> None:
    record = explained(make_record())
    files = encode_run(record)
    with pytest.raises(InputError, match="do not fit together"):
        decode_run(run_facts(record), {name: files[name] for name in files if name != FILES[1]}, "run")

    def with_column(table: str, column: str, values: Any) -> dict[str, bytes]:
        content = read_table(files[f"{table}.arrow"], EXPLANATION_TABLES[table], table)
        return {**files, f"{table}.arrow": write_table({**content, column: values}, EXPLANATION_TABLES[table])}

    for table, column, values, message in (
        ("explanations", "decision", np.array([0, 7]), "expected numbers below 3; got 7"),
        ("explanations", "decision", np.array([1, 1]), "expected each once"),
        ("explanations", "action_1", np.array([40, -1]), "column action_1: expected an index of 13 actions; got 40"),
        ("sensor_gains", "decision", np.array([0, 2]), "sensor_gains: expected rows of 2 sensors; got 1"),
        ("explanations", "missing", ["", "nonsense"], "do not fit together"),
    ):
        with pytest.raises(InputError, match=message):
            decode_run(run_facts(record), with_column(table, column, values), "run")
    plan = record.decisions[0].plan
    wrong = replace(plan, explanation=explanation_of(plan, reward_without_sensor=np.zeros(3)))
    decisions = (replace(record.decisions[0], plan=wrong),)
    with pytest.raises(InputError, match=r"plan\.explanation\.reward_without_sensor: expected 2 numbers; got \(3,\)"):
        encode_run(replace(record, decisions=decisions))


def test_a_scenario_says_whether_decisions_are_explained() -> None:
    fields = {
        "time.num_steps": 4,
        "ospa.first_scan": 1,
        "ospa.last_scan": 4,
        "control.decision_steps": [2, 3],
        "control.num_samples": 4,
    }
    local = {"filter.kind": "lmb", "fusion.kind": "clmb"}
    few = replace_fields(load_scenario("paper-a"), {**fields, **local})
    record = run_scenario(few, "jdm", seed=1)
    for decision in record.decisions:
        plan, why = decision.plan, decision.plan.explain()
        assert plan.analysis is None
        assert why.of_sensors is not None
        assert why.baseline is not None
        assert why.reward == plan.expected_rewards[0][0]
        np.testing.assert_allclose(why.baseline + why.of_sensors.sum(), why.reward, rtol=1e-9)
    again = decode_run(run_facts(record), encode_run(record), "run")
    assert str(again.decisions[1].plan.explain()) == str(record.decisions[1].plan.explain())
    plain = run_scenario(replace_fields(few, {"control.explain": False}), "jdm", seed=1)
    assert [decision.plan.explanation for decision in plain.decisions] == [None, None]
    files = encode_run(record)
    assert encode_run(plain) == {name: files[name] for name in files if name not in FILES}
