# ruff: noqa: E501
"""Everything that a user may write of their own: in a scenario, in a campaign with workers, and what the check says."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from scenarios.minimal import changed
from vedette.campaigns import open_results, parse_spec, resolve, run_campaign
from vedette.cli import app
from vedette.errors import InputError
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.sections.custom import Custom
from vedette.simulation.journal import RunStopped

OWN = Path(__file__).with_name("own_parts.py")


def own(name: str, arguments: str = "{}") -> str:
    return f"{{kind: custom, function: 'own_parts.py:{name}', arguments: {arguments}}}"


ALL = (
    ("num_steps: 20", "num_steps: 6"),
    ("start_step: 2, end_step: 18", "start_step: 1"),
    (
        "  noise: {kind: constant, std: [0.02, 3.0]}",
        f"  noise: {{kind: constant, std: [0.02, 3.0]}}\n  platform: {own('Hopper', '{step: 7.0}')}",
    ),
    ("{kind: m_delta_glmb}", own("Filter", "{max_hypotheses: 30}")),
    ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", own("fusion", "{first: 0.75}")),
    ("{kind: marginal, threshold: 0.6}", own("sure", "{threshold: 0.4}")),
    (
        "{decision_steps: [4, 8]}",
        f"\n  decision_steps: [2, 4]\n  horizon_steps: 1\n  num_samples: 2\n  reward: {own('reward', '{scale: 2.0}')}\n  search: {own('FirstOfAll')}\n  constraints: [{own('OddOnes', '{spared: 2}')}]\nplanners:\n  last: {own('Last')}\n  third: {own('Last', '{skip: 1}')}\n  breaks: {own('Breaks')}",
    ),
    (
        "first_scan: 5, last_scan: 20}",
        f"first_scan: 1, last_scan: 6}}\nmetrics:\n  found: {own('count', '{factor: 2.0}')}",
    ),
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(OWN, tmp_path)
    (tmp_path / "scene.yaml").write_text(changed(*ALL))
    return tmp_path


@pytest.fixture
def scenario(folder: Path) -> Scenario:
    return load_scenario(folder / "scene.yaml")


def test_all_kinds_in_one_run(scenario: Scenario) -> None:
    record = run_scenario(scenario, "last", seed=1)
    assert record.planner == "last"
    assert [decision.plan.planner for decision in record.decisions] == ["last", "last"]
    first, second = record.decisions[0].plan.chosen_actions
    np.testing.assert_array_equal([first, second], [[0.0, 7.0]] * 2)
    third = run_scenario(scenario, "third", seed=1).decisions[0].plan.chosen_actions
    np.testing.assert_array_equal(third[0], [7.0, 0.0])


@pytest.mark.filterwarnings("ignore::vedette.errors.SlowRewardWarning")
def test_a_joint_decision_with_custom_reward_search_and_fusion(scenario: Scenario) -> None:
    plan = run_scenario(scenario, "jdm", seed=1).decisions[0].plan
    assert plan.chosen == (0, 0)
    assert np.isfinite(plan.expected_rewards[0][0])
    assert plan.notes == ("rewards were computed one by one: reward is a function of two densities",)


def test_a_reward_of_power_integrals(scenario: Scenario) -> None:
    powers = {"kind": "custom", "function": "own_parts.py:Powers", "arguments": {"order": 0.25}}
    twin = {"kind": "renyi", "order": 0.25}
    for reward in (powers, twin):
        plan = run_scenario(replace_fields(scenario, {"control.reward": reward}), "idm", seed=1).decisions[0].plan
        assert np.isfinite(plan.expected_rewards[0][0])


def test_a_campaign_with_workers_gives_the_same_bytes(folder: Path) -> None:
    spec = 'name = "own"\nscenarios = ["scene.yaml"]\nruns = 2\nplanners = ["last", "random"]\n'
    spec += '[grid]\n"planners.last.arguments" = [{skip = 0}, {skip = 1}]\n'
    campaign = resolve(parse_spec(spec), folder)
    kept = []
    for workers in (1, 2):
        outcome = run_campaign(campaign, folder / f"out{workers}", num_workers=workers)
        assert (outcome.num_completed, outcome.failed) == (8, ())
        kept.append({file.name: file.read_bytes() for file in (folder / f"out{workers}").rglob("*.parquet")})
        scans = open_results(folder / f"out{workers}").tables()["scans"]
        assert len(scans.column("found")) == 8 * 6
    assert "scans.parquet" in kept[0]
    assert {name for name in kept[0] if kept[0][name] != kept[1][name]} <= {"timings.parquet"}


def test_custom_code_that_fails_during_a_run_is_named(scenario: Scenario) -> None:
    with pytest.raises(RunStopped, match=r"in the planning: RuntimeError: no fuel \(own_parts\.py, line \d+, plan\)"):
        run_scenario(scenario, "breaks", seed=1)


def test_an_unknown_custom_planner(scenario: Scenario) -> None:
    with pytest.raises(
        InputError,
        match="planner: expected one of jdm, idm, lookahead, nearest, assigned_target, centroid, oracle, true_targets, random, constant, stationary, last, third, breaks; got 'x'",
    ):
        run_scenario(scenario, "x", seed=1)


def check(file: Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["check", str(file)])
    return result.exit_code, result.output


def test_the_check_makes_everything(folder: Path) -> None:
    code, text = check(folder / "scene.yaml")
    assert (code, text.count("warning")) == (0, 1), text
    assert "warning: a run with --planner lookahead is refused: expected a reward and a fusion of LMBs" in text


def test_a_reward_of_power_integrals_is_one_too(folder: Path) -> None:
    file = folder / "scene.yaml"
    file.write_text(file.read_text().replace(own("reward", "{scale: 2.0}"), own("Overlap", "{power: 0.25}")))
    assert check(file)[0] == 0
    reward = load_scenario(file).model.control.reward.build(folder)
    assert (reward.exponents[0], reward.combine(np.array([-1.0]))) == ((0.25, 0.75), 1.0)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("last: {kind: custom, function: 'own_parts.py:Last'", "last: {kind: custom, function: 'own_parts.py:NoPlan'", "planners.last.function: expected own_parts.py:NoPlan to give a Planner, got a NoPlan without plan("),
        ("last: {kind: custom, function: 'own_parts.py:Last'", "last: {kind: custom, function: 'own_parts.py:plans_otherwise'", "planners.last.function: expected own_parts.py:plans_otherwise to give a Planner, got a Otherwise that cannot be called as plan("),
        ("own_parts.py:Hopper", "own_parts.py:FirstOfAll", "sensor_defaults.platform.function: expected own_parts.py:FirstOfAll to give a Platform, got TypeError"),
        ("own_parts.py:FirstOfAll'", "own_parts.py:NoPlan'", "control.search.function: expected own_parts.py:NoPlan to give a JointSearch, got a NoPlan without search(problem, *, rng)"),
        ("own_parts.py:OddOnes", "own_parts.py:FirstOfAll", "control.constraints[0].function: expected own_parts.py:FirstOfAll to give a Constraint, got TypeError"),
        ("own_parts.py:OddOnes', arguments: {spared: 2}", "own_parts.py:NoPlan', arguments: {}", "control.constraints[0].function: expected own_parts.py:NoPlan to give a Constraint, got a NoPlan without name"),
        ("own_parts.py:sure", "own_parts.py:cardinality", "estimator.function: expected own_parts.py:cardinality to give a Estimator, got a partial that cannot be called as (density, step)"),
        ("own_parts.py:Filter", "own_parts.py:NoPlan", "filter.function: expected own_parts.py:NoPlan to give a Filter, got TypeError"),
        ("own_parts.py:fusion", "own_parts.py:Last", "fusion.function: expected own_parts.py:Last to give a Fusion, got TypeError"),
        ("own_parts.py:count", "own_parts.py:FirstOfAll", "metrics.found.function: expected own_parts.py:FirstOfAll to give a Measure, got TypeError"),
        ("own_parts.py:reward", "math:pi", "control.reward.function: expected math:pi to give a Reward, got"),
    ],
)  # fmt: skip
def test_the_check_says_what_is_missing(folder: Path, old: str, new: str, fault: str) -> None:
    file = folder / "scene.yaml"
    file.write_text(file.read_text().replace(old, new))
    code, text = check(file)
    assert code == 1
    assert fault in text, text


def test_untrusted_code_is_reported_and_not_imported(folder: Path) -> None:
    (folder / "own_parts.py").write_text(
        "raise SystemExit('run')\nHopper = Filter = fusion = sure = reward = 1\nFirstOfAll = OddOnes = Last = Breaks = count = 1\n"
    )
    (folder / "own_parts.py").chmod(0o666)
    code, text = check(folder / "scene.yaml")
    assert code == 0
    assert "is not imported, as every user may write to" in text


def test_a_measure_that_is_no_number_a_scan(folder: Path) -> None:
    from vedette.evaluation import custom_metrics, measure_run

    file = folder / "scene.yaml"
    file.write_text(file.read_text().replace("count', arguments: {factor: 2.0}", "short_count', arguments: {}"))
    loaded = load_scenario(file)
    record = run_scenario(loaded, "stationary", seed=1)
    with pytest.raises(InputError, match="metric found: expected"):
        measure_run(record, loaded, custom_metrics(loaded))


def test_files_import_those_beside_them_each_its_own(tmp_path: Path) -> None:
    made = []
    for number in (1, 2):
        place = tmp_path / str(number)
        place.mkdir()
        (place / "helper_beside.py").write_text(f"NUMBER = {number}\n")
        (place / "models.py").write_text("from helper_beside import NUMBER\n\n\nclass Last:\n    number = NUMBER\n")
        made.append(Custom.model_construct(kind="custom", function="models.py:Last", arguments={}).load_object(place))
    assert [found.number for found in made] == [1, 2]
    assert "helper_beside" not in sys.modules
    assert not {str(tmp_path / "1"), str(tmp_path / "2")} & set(sys.path)


def test_custom_actions_take_prices_of_a_column(tmp_path: Path) -> None:
    shutil.copy(OWN, tmp_path)
    noise = "  noise: {kind: constant, std: [0.02, 3.0]}"
    path = tmp_path / "scene.yaml"

    def planned(price: str) -> Any:
        path.write_text(changed((noise, f"{noise}\n  platform: {own('Ferry')}\n  price: {price}")))
        return run_scenario(load_scenario(path), "jdm", seed=1).decisions[0].plan

    # No step is worth a million.
    dear = planned("fare")
    assert [row[0] for row in dear.chosen_actions] == [0.0, 0.0]
    assert dear.explanation.price == 0.0
    assert planned("3.0").explanation.price == 6.0
    path.write_text(changed((noise, f"{noise}\n  platform: {own('Ferry')}\n  price: fee")))
    shown = CliRunner().invoke(app, ["check", str(path)])
    assert shown.exit_code == 1
    assert "own_parts.py:Ferry to have a column fee, as its price, got dx, fare" in " ".join(shown.output.split())


def test_a_price_column_belongs_to_custom_platforms(tmp_path: Path) -> None:
    path, noise = tmp_path / "scene.yaml", "  noise: {kind: constant, std: [0.02, 3.0]}"
    path.write_text(changed((noise, f"{noise}\n  price: speed")))
    shown = CliRunner().invoke(app, ["check", str(path)])
    assert shown.exit_code == 1
    assert "a number, as only a custom platform has a column of prices" in " ".join(shown.output.split())
