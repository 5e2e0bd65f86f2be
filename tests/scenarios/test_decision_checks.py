"""What only some decisions can be made with is refused before a run, in the file and in Python."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from scenarios.minimal import changed
from vedette.control import (
    CauchySchwarzReward,
    HorizonPlanner,
    JointPlanner,
    PlanningSettings,
    RandomPlanner,
    SequentialGreedy,
    VoidProbability,
)
from vedette.errors import InputError
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_planner, build_sensors
from vedette.scenarios.code_checks import code_faults

LMB = (("{kind: m_delta_glmb}", "{kind: lmb}"), ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{kind: clmb}"))
PHD = (
    ("{kind: m_delta_glmb}", "{kind: phd}"),
    ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{kind: none}"),
    ("  - {name: south, position: [0.0, -40.0]}\n", ""),
    ("estimator: {kind: marginal, threshold: 0.6}\n", ""),
)


def scenario(text: str, *changes: tuple[str, str]) -> Scenario:
    given = changed(("{decision_steps: [4, 8]}", f"{{decision_steps: [4, 8], {text}}}"), *changes)
    return Scenario(parse_scenario(given), Path("scenario.yaml"))


GREEDY = "search: {kind: sequential_greedy}"
SAMPLED = "reward: {kind: cauchy_schwarz}"


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        (f"{GREEDY}, {SAMPLED}", LMB),
        (f"{GREEDY}, {SAMPLED}, limits: {{max_glmb_targets: 0}}", ()),
        (f"{GREEDY}, {SAMPLED}, limits: {{max_glmb_sensors: 1}}", ()),
        (GREEDY, ()),
        (f"{GREEDY}, reward: {{kind: expected_loss}}", ()),
        (f"{GREEDY}, association: full", LMB),
        (f"{GREEDY}, {SAMPLED}, association: full", LMB),
        (f"{GREEDY}, {SAMPLED}", ()),
        (GREEDY, PHD),
    ],
)
def test_greedy_searches_go_with_every_reward(text: str, changes: tuple[tuple[str, str], ...]) -> None:
    given = scenario(text, *changes)
    name = "random" if changes == PHD else "jdm"
    assert build_planner(given, name) is not None


@pytest.mark.parametrize(
    ("settings", "reward", "wanted"),
    [
        (PlanningSettings(association="full"), CauchySchwarzReward(), "settings.association: expected known, for"),
        (PlanningSettings(), lambda predicted, updated: 0.0, "reward, fusion: expected a reward and a fusion of LMBs"),
    ],
)
def test_sequences_of_decisions_are_sums_over_labels(settings: PlanningSettings, reward: Any, wanted: str) -> None:
    given = scenario("num_samples: 2")
    sensors, fusion = build_sensors(given), given.model.fusion.build(2, given.folder)
    assert fusion is not None
    with pytest.raises(InputError, match=wanted):
        HorizonPlanner(sensors, fusion, settings, reward)
    JointPlanner(sensors, fusion, settings, reward, SequentialGreedy())


def test_a_strategy_without_its_parts_is_reported_before_the_run() -> None:
    with pytest.raises(
        InputError, match=r"planner lookahead: expected joint or another, as with control.association full"
    ):
        build_planner(scenario(f"association: full, {SAMPLED}"), "lookahead")


def test_constraints_that_look_at_beliefs_need_labels() -> None:
    sensors = build_sensors(scenario("num_samples: 2", *PHD))
    with pytest.raises(InputError, match="constraints: expected none that asks where targets will be"):
        RandomPlanner(sensors, constraints=(VoidProbability(5.0, 0.9),))


def own(name: str) -> str:
    return f"{{kind: custom, function: 'own_parts.py:{name}'}}"


BORN = (
    "  steps: [1, 5]\n",
    "  from_measurements: {expected: 0.5, max_existence: 0.03, std: [5.0, 5.0, 2.0, 2.0]}\n  steps: [1, 5]\n",
)
LABELS = ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", "{kind: clmb, matching: assignment}")


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        (
            (
                ("heading_deg: 4.0", "heading_deg: 4.0, scans: {every: 2}"),
                ("{kind: m_delta_glmb}", own("Filter")),
                LMB[1],
            ),
            "19:34: filter.function: expected own_parts.py:Filter to give a PredictUpdateFilter, with predict() and "
            "update(), as it must predict without a scan, got a Filter",
        ),
        (
            (BORN, LABELS, ("{kind: m_delta_glmb}", own("Filter"))),
            "as targets are born of measurements, got a Filter",
        ),
        (
            (("{kind: m_delta_glmb}", own("Filter")),),
            "expected parts that fit together, got in the fusion at step 1: beliefs[0]: expected GLMB or FactoredGLMB; "
            "got LMB",
        ),
        (
            (("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", own("fusion").replace("}", ", feedback: true}")),),
            "got in the filter of sensor 1 at step 2: belief: expected a GLMB; got LMB",
        ),
        (  # sensors that hardly ever hear each other fuse nothing in the first scans
            (
                (
                    "{kind: cm_delta_glmb, weights: [0.5, 0.5]}",
                    own("fusion").replace("}", ", feedback: true}\nnetwork: {link_loss_probability: 0.999}"),
                ),
            ),
            "got in the filter at step 2: belief: expected a GLMB; got LMB",
        ),
        (
            (*PHD[:3], ("{kind: marginal, threshold: 0.6}", own("sure"))),
            "which have labels; got Poisson",
        ),
        (
            (("{decision_steps: [4, 8]}", f"{{decision_steps: [4], lookahead: {{}}, reward: {own('reward')}}}"), *LMB),
            "planner lookahead: reward, fusion: expected a reward and a fusion of LMBs that are sums over labels",
        ),
    ],
)
def test_custom_code_is_tried_with_the_parts_around_it(
    changes: tuple[tuple[str, str], ...], wanted: str, tmp_path: Path
) -> None:
    from vedette.scenarios import load_scenario

    (tmp_path / "own_parts.py").write_bytes(Path(__file__).with_name("own_parts.py").read_bytes())
    file = tmp_path / "scenario.yaml"
    file.write_text(changed(*changes))
    faults = code_faults(load_scenario(file))
    assert faults
    assert wanted in faults[0]
