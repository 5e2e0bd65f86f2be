"""Generated scenes: valid, the same from the same settings, of equal density whatever their size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.evaluation import custom_metrics, measure_run, run_scenario
from vedette.scenarios import Scenario, parse_scenario, replace_fields
from vedette.scenarios.build import build_targets
from vedette.scenarios.generated import PATTERNS, VIEWS, GeneratedScene, scene_text
from vedette.scenarios.sections.tracking import Filter
from vedette.scenarios.warnings import scenario_warnings


def scenario(**settings: Any) -> Scenario:
    return Scenario(parse_scenario(scene_text(GeneratedScene(**settings))))


@pytest.mark.parametrize("num_sensors", [1, 2, 3, 20])
@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("view", VIEWS)
def test_scenes_of_any_size_are_valid(num_sensors: int, pattern: str, view: str) -> None:
    found = scenario(num_sensors=num_sensors, pattern=pattern, view=view)
    model = found.model
    assert model.name == f"{pattern}-{view}-{num_sensors}"
    assert (len(model.sensors), len(model.birth.sites)) == (num_sensors, 2 * num_sensors)
    assert model.decision_steps == tuple(range(1, 60))
    assert scenario_warnings(found) == ()
    truth = build_targets(found).truth(model.time.build(), rng=np.random.default_rng(0))
    assert np.abs(truth.states[:, :2]).max() <= model.region.x_max + 100.0


@pytest.mark.parametrize(
    ("settings", "most"), [((50, None), 1000), ((251, None), 1004), ((150, 300), 1000), ((2, 1000), 1004)]
)
def test_a_scene_has_labels_for_all_its_targets(settings: tuple[int, int | None], most: int) -> None:
    found = scenario(num_sensors=settings[0], num_targets=settings[1])
    assert isinstance(found.model.filter, Filter)
    assert found.model.filter.limits.max_labels == most
    assert scenario_warnings(found) == ()
    short = replace_fields(found, {"filter.limits.max_labels": len(found.model.birth.sites) - 1})
    assert "labels are kept" in scenario_warnings(short)[0]


def test_more_targets_than_a_filter_keeps_by_default_are_all_tracked() -> None:
    """Four targets a sensor."""
    short = {"time.num_steps": 4, "control.decision_steps": []}
    found = replace_fields(scenario(num_sensors=60, num_targets=240), short)
    record = run_scenario(found, "stationary", seed=0)
    assert len(record.estimates[-1].labels) > 225


def test_a_scene_says_the_settings_that_differ_from_the_usual() -> None:
    scene = GeneratedScene(num_sensors=3, pattern="crowd", num_targets=7, decide_every=5, seed=4)
    text = scene_text(scene)
    assert scene.name == "crowd-limited-3-targets-7-every-5-seed-4"
    assert (
        "#   vedette generate --sensors 3 --pattern crowd --field-of-view limited --targets 7 --decide-every 5 "
        "--seed 4\n" in text
    )
    model = parse_scenario(text)
    assert len(model.birth.sites) == 7
    assert model.decision_steps == (5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55)
    assert (model.horizon[0], model.sensors[0].platform.top_speed) == (5, 20.0)


def test_equal_settings_give_equal_files_and_other_seeds_other_ones() -> None:
    texts = [scene_text(GeneratedScene(num_sensors=4, seed=seed)) for seed in (0, 0, 1)]
    assert texts[0] == texts[1]
    assert texts[0] != texts[2]


@pytest.mark.parametrize("num_sensors", [2, 20])
def test_groups_part_or_meet_at_one_place(num_sensors: int) -> None:
    for pattern in PATTERNS:
        _, states = GeneratedScene(num_sensors=num_sensors, pattern=pattern).places()
        first, last = states[:, :2], states[:, :2] + 59.0 * states[:, 2:]
        together, apart = (first, last) if pattern == "spread" else (last, first)
        for begin in range(0, len(states), 4):
            group = slice(begin, begin + 4)
            np.testing.assert_allclose(together[group] - together[begin], 0.0, atol=1e-9)
            gaps = np.linalg.norm(apart[group, None] - apart[None, group], axis=2)
            assert gaps[np.triu_indices(len(gaps), 1)].min() > 59.0 * 3.0 * 0.7
        speeds = np.linalg.norm(states[:, 2:], axis=1)
        assert ((speeds >= 3.0) & (speeds <= 8.0)).all()


@pytest.mark.parametrize("num_sensors", [5, 20, 100])
def test_sensors_are_spread_evenly_over_an_area_that_grows_with_their_number(num_sensors: int) -> None:
    scene = GeneratedScene(num_sensors=num_sensors)
    sensors, _ = scene.places()
    assert scene.side**2 == pytest.approx(500.0**2 * num_sensors)
    assert np.abs(sensors).max() <= 0.5 * scene.side
    gaps = np.linalg.norm(sensors[:, None] - sensors[None], axis=2) + 1e9 * np.eye(num_sensors)
    assert gaps.min() > 200.0


@pytest.mark.parametrize("view", VIEWS)
def test_a_scene_runs_and_its_truth_is_drawn_anew_in_each_run(view: str) -> None:
    whole = scenario(num_sensors=2, view=view)
    short = replace_fields(whole, {"time.num_steps": 6, "control.decision_steps": [2, 4], "control.num_samples": 2})
    runs = {(name, run): run_scenario(short, name, seed=0, run=run) for name in ("jdm", "random") for run in (0, 1)}
    for run in (0, 1):
        np.testing.assert_array_equal(runs["jdm", run].truth.states, runs["random", run].truth.states)
    assert not np.allclose(runs["jdm", 0].truth.states, runs["jdm", 1].truth.states)
    share = measure_run(runs["jdm", 0], short, custom_metrics(short)).columns()["tracked_of_all"]
    assert ((share >= 0.0) & (share <= 1.0)).all()
