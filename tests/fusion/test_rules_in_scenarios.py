"""Scenarios under each rule: what a fusion keeps of targets that only one sensor sees, or that have two labels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.densities import LMB, FactoredGLMB
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, load_scenario, parse_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.scenarios.sections import ScenarioModel
from vedette.simulation import simulate

SCENE = """\
name: two-ends
time: {num_steps: 12, step_period: 1.0}
region: {x_min: -500.0, x_max: 500.0, y_min: -100.0, y_max: 100.0}
motion: {kind: constant_velocity, sigma_v: 0.5}
survival: {kind: constant, probability: 0.99}
birth:
  steps: STEPS
  sites:
    - {existence: 0.05, mean: [-300.0, 0.0, 0.0, 0.0], std: [10.0, 10.0, 2.0, 2.0]}
    - {existence: 0.05, mean: [300.0, 0.0, 0.0, 0.0], std: [10.0, 10.0, 2.0, 2.0]}
targets:
  kind: scripted
  tracks:
    - {state: [-303.0, 2.0, 1.0, 0.5], start_step: 1, end_step: 12}
    - {state: [296.0, -4.0, -1.0, 0.5], start_step: 1, end_step: 12}
sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [3.0, 3.0]}
  detection: {kind: limited_range, probability: 0.999, max_range: REACH}
  clutter: {kind: region, rate: 1.0}
sensors:
  - {position: [-300.0, -50.0]}
  - {position: [300.0, -50.0]}
filter: {kind: lmb}
fusion: FUSION
estimator: {kind: marginal, threshold: 0.7}
control: {decision_steps: []}
ospa: {cutoff: 50.0}
"""


def scene(fusion: str, reach: float = 250.0, steps: str = "[1]", filters: str = "filter: {kind: lmb}") -> Scenario:
    text = SCENE.replace("FUSION", fusion).replace("REACH", str(reach)).replace("STEPS", steps)
    return Scenario(parse_scenario(text.replace("filter: {kind: lmb}", filters)))


def found(scenario: Scenario) -> list[int]:
    """Number of estimated targets at each scan."""
    experiment = build_experiment(scenario)
    record = simulate(experiment, None, seed=1, run=0, score=lambda truth, _: np.zeros((truth.num_scans, 3)))
    return [len(estimate.labels) for estimate in record.estimates]


@pytest.mark.parametrize(
    ("fusion", "keeps"),
    [
        ("{kind: arithmetic_average}", False),
        ("{kind: clmb, field_of_view_weighting: true}", True),
        ("{kind: clmb, field_of_view_weighting: true, feedback: true}", True),
        ("{kind: arithmetic_average, field_of_view_weighting: true}", True),
        ("{kind: parallel}", True),
    ],
)
def test_what_one_sensor_sees_is_kept_by_views_and_by_the_parallel_update(fusion: str, keeps: bool) -> None:
    assert (found(scene(fusion))[3:] == [2] * 9) == keeps


@pytest.mark.parametrize(
    "fusion",
    [
        "{kind: parallel}",
        "{kind: central}",
        "{kind: clmb, field_of_view_weighting: true, feedback: true}",
        "{kind: arithmetic_average, field_of_view_weighting: true, feedback: true}",
        "{kind: clmb, field_of_view_weighting: true}",
    ],
)
def test_the_default_filter_goes_with_every_rule(fusion: str) -> None:
    """No word of a filter."""
    assert found(scene(fusion, filters=""))[3:] == [2] * 9


def test_central_under_the_default_filter_is_what_takes_scans_in_turn() -> None:
    central, in_turn = (build_experiment(scene(f"{{kind: {kind}}}", filters="")) for kind in ("central", "sequential"))
    assert isinstance(central.tracker.initial().fused, FactoredGLMB)
    assert type(central.tracker) is type(in_turn.tracker)


def sixteen(fusion: dict[str, Any], outside: float = 0.0) -> Scenario:
    """The first scans of the sixteen views under the default filter."""
    whole = load_scenario("sixteen-views")
    tracks = [
        track for track in whole.model.targets.model_dump(mode="json")["tracks"] if (track["start_step"] or 1) < 10
    ]
    tracks = [{**track, "end_step": None} for track in tracks]
    fields = {"time.num_steps": 25, "targets": {"kind": "scripted", "tracks": tracks}, "fusion": fusion}
    default: Any = ScenarioModel.model_fields["filter"].default
    chosen = {"filter": default.model_dump(mode="json"), "sensors.*.detection.outside": outside}
    return replace_fields(whole, {**fields, **chosen})


def mean_ospa(scenario: Scenario) -> float:
    """From the sixth scan on, of two runs."""
    runs = [run_scenario(scenario, "stationary", seed=2, run=run, num_threads=1) for run in range(2)]
    return float(np.mean([record.ospa[5:, 0] for record in runs]))


def test_many_sensors_in_parallel_find_what_they_find_in_turn() -> None:
    """Births from measurements make several labels of one target, which all sensors see: not all of these may go."""
    assert mean_ospa(sixteen({"kind": "parallel"})) < 1.15 * mean_ospa(sixteen({"kind": "sequential"}))


@pytest.mark.parametrize("own", [True, False])
def test_sensors_that_hardly_see_do_not_outvote_those_that_do(own: bool) -> None:
    """Filters that allow for a fifth of detections where there are none."""
    fusion = {
        "kind": "clmb",
        "field_of_view_weighting": True,
        **({"matching": "assignment"} if own else {"feedback": True}),
    }
    assert mean_ospa(sixteen(fusion, 0.2)) < 25.0


@pytest.mark.parametrize(("matching", "most"), [("labels", False), ("assignment", True)])
def test_matched_labels_keep_targets_that_are_taken_up_at_other_steps(matching: str, most: bool) -> None:
    experiment = build_experiment(scene(f"{{kind: clmb, matching: {matching}}}", 1000.0, "every"))
    tracker: Any = experiment.tracker
    rng = np.random.default_rng(3)
    state, labels, kept = tracker.initial(), set(), []
    for step in range(1, 13):
        targets = np.array([[-303.0 + step, 2.0], [296.0 - step, -4.0]])
        scans = [targets + rng.normal(size=(2, 2)) for _ in range(2)]
        if step <= 2:
            scans[1] = np.empty((0, 2))  # the second takes both up later
        state, _ = tracker.step(state, scans, experiment.poses, float(step), rngs=[rng, rng])
        assert isinstance(state.fused, LMB)
        sure = state.fused.existence > 0.5
        kept.append(int(sure.sum()))
        if step > 5:
            labels |= {tuple(label) for label in state.fused.tracks.labels[sure].tolist()}
    assert (kept[5:] == [2] * 7) == most
    if most:
        assert len(labels) == 2
        shared = [{tuple(label) for label in own.tracks.labels[own.existence > 0.5].tolist()} for own in state.local]
        assert shared[0] == shared[1] == labels


def test_a_decision_of_matched_beliefs_goes_by_common_labels() -> None:
    loaded = scene("{kind: clmb, matching: assignment}", 1000.0, "every")
    planner: Any = build_planner(loaded, "idm")
    assert type(planner.fusion).__name__ == "Clmb"


@pytest.mark.parametrize(
    ("fusion", "said"),
    [
        ("{kind: parallel}", None),
        ("{kind: sequential}", None),
        (
            "{kind: clmb, field_of_view_weighting: true}",
            "take all scans in full; tracks are fused by another rule (clmb by views)",
        ),
        ("{kind: clmb, matching: assignment}", None),
    ],
)
def test_a_joint_decision_says_where_it_goes_by_another_rule_than_the_tracks(fusion: str, said: str | None) -> None:
    loaded = replace_fields(scene(fusion), {"control.reward": {"kind": "cauchy_schwarz"}})
    experiment, planner = build_experiment(loaded), build_planner(loaded, "jdm", 1)
    assert planner is not None
    plan = planner.plan(experiment.tracker.initial(), experiment.poses, rng=np.random.default_rng(0))
    said_of = f"joint rewards {said}"
    assert plan.notes == (() if said is None else (said_of,))
