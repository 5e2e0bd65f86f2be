"""Searches and constraints as a scenario says them: what is built, what is refused, and a run with them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.minimal import MINIMAL, changed
from vedette import models
from vedette.control import (
    AutomaticSearch,
    CoordinateAscent,
    CrossEntropy,
    ExhaustiveSearch,
    KeepOut,
    Separation,
    SequentialGreedy,
    StayInside,
    VoidProbability,
)
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, load_scenario, parse_scenario, replace_fields
from vedette.scenarios.build import build_planner
from vedette.scenarios.dumping import dump_scenario


def written(folder: Path, control: str) -> Scenario:
    """The minimal scenario with something more under `control`, as read."""
    file = folder / "f.yaml"
    file.write_text(changed(("{decision_steps: [4, 8]}", f"{{decision_steps: [4], {control}}}")))
    return load_scenario(file)


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("num_samples: 3", AutomaticSearch()),
        ("search: {kind: automatic, max_joint_actions: 50}", AutomaticSearch(50)),
        ("search: {kind: exhaustive, max_joint_actions: 1e3}", ExhaustiveSearch(1000)),
        ("search: {kind: coordinate_ascent}", CoordinateAscent(2)),
        ("search: {kind: coordinate_ascent, num_restarts: 0}", CoordinateAscent(0)),
        (
            "search: {kind: sequential_greedy, order: best_first}, limits: {max_glmb_targets: 0}",
            SequentialGreedy("best_first"),
        ),
        ("search: {kind: cross_entropy, num_samples: 50, elite_fraction: 0.2}", CrossEntropy(50, 0.2)),
    ],
)
def test_searches(tmp_path: Path, text: str, made: Any) -> None:
    scenario = written(tmp_path, text)
    assert scenario.model.control.search.build(scenario.folder) == made


def test_constraints_in_their_order(tmp_path: Path) -> None:
    box = "region: {x_min: -90.0, x_max: 90.0, y_min: -40.0, y_max: 45.0}"
    scenario = written(
        tmp_path,
        f"constraints: [{{kind: stay_inside, {box}}}, {{kind: keep_out, polygon: [[0, 0], [9, 0], [0, 9]]}}, "
        f"{{kind: separation, distance: 20}}, {{kind: void_probability, radius: 8, probability: 0.9}}, "
        f"{{kind: keep_out, {box}}}]",
    )
    region = models.Region(-90.0, 90.0, -40.0, 45.0)
    inside, triangle, apart, void, rectangle = scenario.model.control.build_constraints(scenario.folder)
    assert (inside, apart, void) == (StayInside(region), Separation(20.0), VoidProbability(8.0, 0.9))
    assert isinstance(triangle, KeepOut)
    assert isinstance(rectangle, KeepOut)
    np.testing.assert_array_equal(triangle.area, [[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]])
    assert rectangle.area == region
    again = tmp_path / "again.yaml"
    again.write_text(dump_scenario(scenario.model))
    assert load_scenario(again).model == scenario.model


def test_no_constraints_by_default(tmp_path: Path) -> None:
    assert written(tmp_path, "num_samples: 3").model.control.build_constraints(tmp_path) == ()


def test_a_custom_constraint(tmp_path: Path) -> None:
    shutil.copy(Path(__file__).with_name("own_parts.py"), tmp_path)
    scenario = written(
        tmp_path, "constraints: [{kind: custom, function: 'own_parts.py:OddOnes', arguments: {spared: 0}}]"
    )
    (own,) = scenario.model.control.build_constraints(scenario.folder)
    assert (own.name, own.needs_beliefs) == ("odd_ones", False)


@pytest.mark.parametrize("kind", ["automatic", "exhaustive", "coordinate_ascent", "cross_entropy"])
def test_a_run_with_a_search(tmp_path: Path, kind: str) -> None:
    """Of two sensors all find what is best."""
    control = f"horizon_steps: 1, num_samples: 2, search: {{kind: {kind}}}"
    plans = [
        run_scenario(written(tmp_path, text), "jdm", seed=1).decisions[0].plan
        for text in (control, control.split(", search")[0])
    ]
    assert plans[0].chosen == plans[1].chosen


@pytest.mark.parametrize(
    ("fields", "horizon"),
    [
        ({}, (10, 0.5)),  # decisions after 10 and 20 of 27 scans
        ({"control.decision_steps": [20]}, (7, 0.5)),  # up to the last scan
        ({"control.decision_steps": [4, 8, 12, 16, 26]}, (4, 0.5)),  # what is most often so
        ({"control.decision_steps": [7, 20]}, (13, 0.5)),  # of as many the longer
        ({"control.decision_steps": None, "control.decision_times": [3.0, 5.0, 7.0]}, (4, 0.5)),
        ({"control.decision_steps": list(range(1, 28))}, (1, 0.5)),
        ({"control.decision_steps": []}, (1, 0.5)),
        ({"time.num_steps": 1000}, (100, 0.5)),
        ({"control.horizon_period": 2.0}, (2, 2.0)),
        ({"control.horizon_period": 1e-30}, (100, 1e-30)),
        ({"control.horizon_period": 1e9}, (1, 1e9)),
        ({"control.horizon_steps": 5}, (5, 0.5)),
        ({"control.horizon_steps": 5, "control.horizon_period": 2.0}, (5, 2.0)),
    ],
)
def test_default_horizon_reaches_the_next_decision(fields: dict[str, Any], horizon: tuple[int, float]) -> None:
    given = {"time.num_steps": 27, "time.step_period": 0.5, "control.decision_steps": [10, 20], "ospa.last_scan": None}
    scenario = replace_fields(Scenario(parse_scenario(MINIMAL)), given | fields)
    assert scenario.model.horizon == horizon
    planner: Any = build_planner(scenario, "jdm")
    assert (planner.settings.horizon_steps, planner.settings.horizon_period) == horizon


@pytest.mark.parametrize(("every", "steps"), [(1, tuple(range(1, 20))), (6, (6, 12, 18)), (10, (10,)), (20, ())])
def test_decisions_every_so_many_scans(every: int, steps: tuple[int, ...]) -> None:
    model = parse_scenario(changed(("decision_steps: [4, 8]", f"decision_every: {every}")))
    assert model.decision_steps == steps
    assert model.horizon[0] == (every if steps else 1)
