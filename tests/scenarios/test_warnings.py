"""Warnings of scenarios that are valid and lose targets: what they say, and where they stay silent."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from scenarios.minimal import MINIMAL, changed
from vedette.cli import app
from vedette.errors import ScenarioError
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, list_builtin, load_scenario, replace_fields
from vedette.scenarios.build import build_targets
from vedette.scenarios.sections import ScenarioModel
from vedette.scenarios.sections.sensors import Sensor
from vedette.scenarios.warnings import prob_detection, scenario_warnings

SOFT: dict[str, object] = {"kind": "soft_sector", "probability": 0.9, "max_range": 150.0, "range_slope": 0.05}

COURSES = "{kind: heading, speed: 5.0, headings_deg: [0.0, 90.0]}"
STEPS = ("steps: [1, 5]", "steps: [1]")
SECTOR = "detection: {kind: limited_sector, probability: 0.9, max_range: 60.0, half_width_deg: 40.0}"


def of(folder: Path, *changes: tuple[str, str]) -> tuple[str, ...]:
    file = folder / "scene.yaml"
    file.write_text(changed(*changes))
    return scenario_warnings(load_scenario(file))


@pytest.mark.parametrize(
    ("platform", "constraint", "told"),
    [
        (COURSES, "{kind: keep_out, polygon: [[-9, 30], [9, 30], [9, 50], [-9, 50]]}", "keep it out of"),
        (COURSES, "{kind: stay_inside, region: {x_min: 5, x_max: 9, y_min: 0, y_max: 50}}", "keep it inside"),
        (COURSES, "{kind: keep_out, polygon: [[9, 30], [19, 30], [19, 50], [9, 50]]}", ""),
        ("{kind: stationary}", "{kind: keep_out, polygon: [[-9, 30], [9, 30], [9, 50], [-9, 50]]}", ""),
        (COURSES, "{kind: keep_out, polygon: [[0, 30], [9, 30], [9, 50], [0, 50]]}", "on the edge of an area that"),
        (COURSES, "{kind: keep_out, polygon: [[-9, 30], [0, 30], [0, 50], [-9, 50]]}", "on the edge of an area that"),
        (COURSES, "{kind: keep_out, polygon: [[0, 40], [9, 40], [9, 50], [0, 50]]}", "on the edge of an area that"),
        (COURSES, "{kind: stay_inside, region: {x_min: -5, x_max: 0, y_min: 0, y_max: 40}}", ""),
        (COURSES, "{kind: stay_inside, region: {x_min: 0, x_max: 5, y_min: 40, y_max: 50}}", ""),
    ],
)
def test_a_sensor_that_starts_on_land_warns(platform: str, constraint: str, told: str, tmp_path: Path) -> None:
    place = "position: [0.0, 40.0]"
    change = (place, f"{place}, platform: {platform}")
    found = [
        line
        for line in of(tmp_path, change, ("control: {", f"control: {{constraints: [{constraint}], "))
        if "position:" in line
    ]
    assert len(found) == (told != "")
    assert all(
        told in line and "sensors[0].position: expected a place where the sensor may be" in line for line in found
    )


@pytest.mark.parametrize("name", list_builtin())
def test_no_built_in_scenario_warns(name: str) -> None:
    assert scenario_warnings(load_scenario(name)) == ()


def with_stay(stay: float) -> dict[str, Any]:
    """A motion with two modes, one of which targets leave after some seconds."""
    cruise, turn = ({"motion": {"kind": "constant_velocity"}, "stay_s": own} for own in (40.0, stay))
    return {"motion": {"kind": "modes", "modes": {"cruise": cruise, "turn": turn}}}


@pytest.mark.parametrize(("stay", "period", "steps"), [(0.5, 10.0, 80), (0.3, 1.0, 14), (0.4, 1.0, 0), (8.0, 1.0, 0)])
def test_a_stay_far_shorter_than_the_time_between_scans_warns_with_the_steps(stay, period, steps) -> None:
    fields = {**with_stay(stay), "time.step_period": period}
    found = [line for line in scenario_warnings(replace_fields(load_scenario("paper-a"), fields)) if "stay_s" in line]
    assert len(found) == (steps > 0)
    if steps:
        assert f"motion.modes.turn.stay_s: {stay:g} s is short for scans {period:g} s apart" in found[0]
        assert f"into {steps} steps" in found[0]


def test_births_at_every_step_warn_under_covariance_intersection_alone() -> None:
    (line,) = scenario_warnings(replace_fields(load_scenario("solent"), {"fusion": {"kind": "cm_delta_glmb"}}))
    assert "warning: births at every step without feedback" in line


def test_births_after_the_first_step_warn_with_their_line(tmp_path: Path) -> None:
    (line,) = of(tmp_path)
    number = MINIMAL.splitlines().index("  steps: [1, 5]") + 1
    assert line.startswith(f"{tmp_path / 'scene.yaml'}:{number}:10: warning: births up to step 5 without feedback")
    assert "take fusion.matching: assignment, or fusion.feedback: true, or fusion: {kind: sequential} where" in line


def test_probabilities_of_a_step_warn_where_a_sensor_scans_at_times_of_its_own() -> None:
    own = load_scenario("three-radars")
    steps = replace_fields(own, {"survival.period": None, "birth.period": None})
    birth, survival = scenario_warnings(steps)
    assert "count 3 times from one scan of south-west to the next; say with birth.period" in birth
    assert "those of a step of 1 s, and count 3 times" in survival
    assert (
        scenario_warnings(own)
        == scenario_warnings(replace_fields(steps, {"survival.period": 1.0, "birth.period": 1.0}))
        == ()
    )
    assert (
        len(scenario_warnings(replace_fields(steps, {"survival.probability": 1.0}))) == 1
    )  # nobody dies, however often asked
    assert scenario_warnings(replace_fields(steps, {"sensors.*.scans": {"every": 1, "first": 1}})) == ()


@pytest.mark.parametrize("kind", ["clmb", "arithmetic_average"])
@pytest.mark.parametrize("filters", ["factored_glmb", "lmb", "m_delta_glmb"])
def test_fields_of_view_warning_suggests_alternatives(tmp_path: Path, kind: str, filters: str) -> None:
    south, rule = "{name: south, position: [0.0, -40.0]", "{kind: cm_delta_glmb, weights: [0.5, 0.5]}"
    blind = (south, f"{south}, heading_deg: 90.0, {SECTOR}")
    own = "kind: m_delta_glmb", f"kind: {filters}"
    (line,) = of(tmp_path, STEPS, blind, own, (rule, f"{{kind: {kind}}}"))
    parallel = "" if filters == "m_delta_glmb" else "fusion: {kind: parallel} where only densities can; "
    loses = {"clmb": "GCI", "arithmetic_average": "the arithmetic average"}[kind]
    assert (
        f"{loses} loses what one sensor sees and another does not; take fusion: {{kind: sequential}} where scans can "
        f"be sent; {parallel}fusion: {{kind: {kind}, field_of_view_weighting: true}} where sensors do not share a "
        "prediction"
    ) in line
    assert of(tmp_path, STEPS, blind, (rule, f"{{kind: {kind}, field_of_view_weighting: true}}")) == ()


CURE = re.compile(r"(fusion): (\{[^}]*\})|((?:fusion|filter)\.[a-z]+): ([a-z_]+)")


def cures(lines: Iterable[str]) -> list[dict[str, Any]]:
    """What warnings say is to be taken instead, as fields of a scenario."""
    found = [match for line in lines for match in CURE.findall(line.partition("; take ")[2])]
    return [{section or field: YAML(typ="safe").load(whole or value)} for section, whole, field, value in found]


def scene_of(filters: str, fusion: dict[str, Any], number: int, births: str, network: Any) -> Scenario:
    """Three scans of a part of the sixteen views."""
    scene = load_scenario("sixteen-views")
    model = scene.model.model_dump(mode="json")
    sites = [{"existence": 0.1, "mean": [0.0, 0.0, 0.0, 0.0], "std": [300.0, 300.0, 10.0, 10.0]}]
    fields = {
        "time.num_steps": 3,
        "targets": {"kind": "scripted", "tracks": [{"state": [-118.0, 64.5, 7.3, -13.8]}]},
        "sensors": model["sensors"][:number],
        "birth": model["birth"] | ({} if births == "measured" else {"sites": sites, "from_measurements": None}),
    }
    return replace_fields(scene, fields | {"filter": {"kind": filters}, "fusion": fusion, "network": network})


@pytest.mark.parametrize(("number", "births"), [(3, "sites"), (5, "measured")])
@pytest.mark.parametrize("filters", ["factored_glmb", "lmb", "delta_glmb", "m_delta_glmb"])
def test_every_suggestion_is_accepted_and_runs(filters: str, number: int, births: str) -> None:
    assert filters != "factored_glmb" or ScenarioModel.model_fields["filter"].default.kind == filters
    ways: list[tuple[dict[str, Any], Any]] = [
        ({"kind": "clmb", "matching": "assignment"}, None),
        ({"kind": "cm_delta_glmb"}, None),
        ({"kind": "clmb", "feedback": True}, None),
        ({"kind": "cm_delta_glmb", "feedback": True}, None),
        ({"kind": "arithmetic_average", "field_of_view_weighting": True, "feedback": True}, None),
        ({"kind": "parallel"}, None),
        ({"kind": "clmb", "feedback": True, "matching": "assignment"}, {"delay": 1}),
        ({"kind": "cm_delta_glmb", "feedback": True, "matching": "assignment"}, {"consensus_rounds": 2}),
    ]
    named = 0
    for fusion, network in ways:
        try:
            scene = scene_of(filters, fusion, number, births, network)
        except ScenarioError:
            continue
        for fields in cures(scenario_warnings(scene)):
            named += 1
            run_scenario(replace_fields(scene, fields), "stationary", seed=1, num_threads=1)
    assert named >= 4


def test_fusing_many_densities_warns_with_the_cost() -> None:
    (line,) = scenario_warnings(
        scene_of("factored_glmb", {"kind": "clmb", "field_of_view_weighting": True, "feedback": True}, 5, "sites", None)
    )
    assert "5 sensors fuse densities by GCI, which makes no use of what they have in common" in line
    assert "take fusion: {kind: sequential} where scans can be sent; fusion: {kind: parallel} where only" in line
    own = {"kind": "arithmetic_average", "field_of_view_weighting": True, "matching": "assignment"}
    (line,) = scenario_warnings(scene_of("factored_glmb", own, 5, "measured", None))
    assert "each finds every target by itself, and anew where one comes into its view" in line
    (line,) = scenario_warnings(scene_of("lmb", {"kind": "parallel"}, 5, "measured", None))
    assert "take filter.kind: factored_glmb" in line
    for filters, fusion, number in (
        ("factored_glmb", {"kind": "parallel"}, 5),
        ("lmb", {"kind": "parallel"}, 4),
        ("factored_glmb", {"kind": "clmb", "field_of_view_weighting": True, "feedback": True}, 4),
    ):
        assert scenario_warnings(scene_of(filters, fusion, number, "measured", None)) == ()


@pytest.mark.parametrize("kind", ["sequential", "parallel"])
def test_fusions_that_divide_by_the_prediction_do_not_warn(tmp_path: Path, kind: str) -> None:
    south = "{name: south, position: [0.0, -40.0]"
    changes = (south, f"{south}, heading_deg: 90.0, {SECTOR}"), ("kind: m_delta_glmb", "kind: lmb")
    assert of(tmp_path, *changes, ("{kind: cm_delta_glmb, weights: [0.5, 0.5]}", f"{{kind: {kind}}}")) == ()


@pytest.mark.parametrize(
    "changes",
    [
        (STEPS,),
        (("weights: [0.5, 0.5]}", "weights: [0.5, 0.5], feedback: true}"),),
        (("weights: [0.5, 0.5]}", "weights: [0.5, 0.5], matching: assignment}"),),
        (
            ("  - {name: south, position: [0.0, -40.0]}\n", ""),
            ("fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}", "fusion: {kind: none}"),
        ),
    ],
)
def test_births_at_once_with_feedback_matched_or_of_one_sensor_do_not_warn(
    tmp_path: Path, changes: tuple[tuple[str, str], ...]
) -> None:
    assert of(tmp_path, *changes) == ()


def test_different_fields_of_view_warn_at_the_sensor_that_does_not_see(tmp_path: Path) -> None:
    south = "{name: south, position: [0.0, -40.0]"
    (line,) = of(tmp_path, STEPS, (south, f"{south}, heading_deg: 90.0, {SECTOR}"))
    assert "warning: sensors differ in what they see: in " in line
    assert "north " in line
    assert "south 0 at x " in line
    number = MINIMAL.splitlines().index("  - {name: south, position: [0.0, -40.0]}") + 1
    assert f"scene.yaml:{number}:" in line


@pytest.mark.parametrize(("decisions", "number"), [("[4, 8]", 1), ("[]", 0)])
def test_limited_fields_of_view_warn_if_sensors_move(tmp_path: Path, decisions: str, number: int) -> None:
    same = "noise: {kind: constant, std: [0.02, 3.0]}"
    found = of(
        tmp_path,
        STEPS,
        ("decision_steps: [4, 8]", f"decision_steps: {decisions}"),
        (same, f"{same}\n  detection: {{kind: limited_range, probability: 0.9, max_range: 160.0}}"),
        ("heading_deg: 4.0", "platform: {kind: heading, speed: 4.0}"),
    )
    assert len(found) == number
    assert all("sensors that move or turn and see only so far" in line for line in found)


@pytest.mark.parametrize(
    "detection",
    [
        {"kind": "constant", "probability": 0.7},
        {"kind": "gaussian", "sigma": 120.0},
        {"kind": "limited_range", "probability": 0.9, "max_range": 150.0},
        {"kind": "limited_sector", "probability": 0.9, "max_range": 150.0, "half_width_deg": 70.0},
        {"kind": "limited_range", "probability": 0.9, "max_range": 150.0, "outside": 0.2},
        {"kind": "limited_sector", "probability": 0.9, "max_range": 150.0, "half_width_deg": 70.0, "outside": 0.2},
        {**SOFT, "angle_slope": 20.0, "hard_limit": True},
        {**SOFT, "angle_slope": 5.0, "half_width_deg": 70.0},
        {**SOFT, "half_width_deg": 70.0},
        {**SOFT, "half_width_deg": 70.0, "hard_limit": True},
        SOFT,
    ],
)
def test_field_of_view_is_that_of_the_detection_model(detection: dict[str, object], tmp_path: Path) -> None:
    sensor = Sensor.model_validate(
        {"position": [10.0, -20.0], "heading_deg": 130.0, "noise": {"kind": "constant", "std": [1.0, 1.0]}}
        | {"detection": detection}
    )
    points = np.random.default_rng(1).uniform(-200.0, 200.0, (500, 2))
    pose = np.array([10.0, -20.0, np.radians(130.0)])
    expected = sensor.detection.build(tmp_path).prob(np.c_[points, np.zeros((500, 2))], pose)
    found = prob_detection(sensor, points)
    assert found is not None
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_check_run_and_dry_run_warn_without_failing(tmp_path: Path) -> None:
    file, spec = tmp_path / "scene.yaml", tmp_path / "spec.toml"
    file.write_text(changed(("num_steps: 20", "num_steps: 8"), ("last_scan: 20", "last_scan: 8"), ("18", "8")))
    spec.write_text('name = "small"\nscenarios = ["scene.yaml"]\nplanners = ["stationary", "random"]\nruns = 1\n')
    for words in (
        ["check", str(file)],
        ["run", str(file), "--planner", "stationary"],
        ["campaign", str(spec), "--dry-run"],
    ):
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 0, result.output
        assert result.stderr.count("warning: births up to step 5 without feedback") == 1, words
        assert "warning" not in result.stdout


CAPPED = "at most 3 labels are kept, and {} targets are there at once: the others are never tracked"


@pytest.mark.parametrize("kind", ["lmb", "factored_glmb", "m_delta_glmb"])
@pytest.mark.parametrize(
    ("targets", "number"),
    [
        ("{kind: uniform, number: 3, std: [1.0, 1.0]}", None),
        ("{kind: uniform, number: 4, std: [1.0, 1.0]}", 4),
        ("{kind: poisson, expected: 0.5, mean: [0, 0, 0, 0], std: [1, 1, 1, 1], death_probability: 0.1}", 4),
        ("{kind: poisson, expected: 0.5, mean: [0, 0, 0, 0], std: [1, 1, 1, 1]}", None),
    ],
)
def test_a_label_cap_below_the_number_of_targets_warns(
    tmp_path: Path, kind: str, targets: str, number: int | None
) -> None:
    scene = replace_fields(
        load_scenario("three-positions"),
        {
            "filter": {"kind": kind, "limits": {"max_labels": 3}},
            "fusion": {"kind": "sequential"},
            "time.num_steps": 15,
            "targets": YAML(typ="safe").load(targets),
        },
    )
    found = [line for line in scenario_warnings(scene) if "labels are kept" in line]
    assert len(found) == (number is not None and kind != "m_delta_glmb")
    assert all(CAPPED.format(number) in line for line in found)


def test_scripted_targets_count_while_they_are_there() -> None:
    scene = load_scenario("three-positions")
    most = scene.model.targets.expected_number(scene.model.time.num_steps)
    truth = build_targets(scene).truth(scene.model.time.build(), rng=np.random.default_rng(0))
    assert most == max(len(truth.at(scan)[0]) for scan in range(scene.model.time.num_steps))


def test_near_births_warn_under_fusion_by_label_and_not_far_ones(tmp_path: Path) -> None:
    own = load_scenario("paper-a")
    second = own.model.birth.sites[1].mean
    for apart, warns in ((200.0, True), (290.0, False)):  # m, of standard deviations of 50 m each
        place = (second[0], second[1] + apart, 0.0, 0.0)
        near = replace_fields(own, {"birth.sites.0.mean": place, "targets.tracks.0.state": place})
        found = scenario_warnings(near)
        assert len(found) == warns
        assert all("sites 0 and 1 are 2.8 standard deviations apart" in line for line in found)
        assert all(
            "take fusion.matching: assignment, or fusion.feedback: true, or fusion: {k" in line for line in found
        )
        for cure in ({"fusion.matching": "assignment"}, {"fusion.feedback": True}, {"fusion": {"kind": "sequential"}}):
            assert scenario_warnings(replace_fields(near, cure)) == ()
