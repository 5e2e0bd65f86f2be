"""Generated crowds: valid, the same from the same settings, of equal density whatever their number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.errors import ScenarioError
from vedette.evaluation import run_scenario
from vedette.scenarios import GeneratedCrowd, Scenario, crowd_text, list_builtin, parse_scenario, replace_fields
from vedette.scenarios.build import build_targets
from vedette.scenarios.generated_crowd import MEASURED
from vedette.scenarios.sections.tracking import Filter
from vedette.scenarios.warnings import scenario_warnings


def scenario(**settings: Any) -> Scenario:
    return Scenario(parse_scenario(crowd_text(GeneratedCrowd(**settings))))


@pytest.mark.parametrize("num_targets", [1, 10, 1000, 100_000])
@pytest.mark.parametrize("measured", MEASURED)
def test_crowds_of_any_size_are_valid_and_short(num_targets: int, measured: str) -> None:
    text = crowd_text(GeneratedCrowd(num_targets=num_targets, measured=measured))
    found = Scenario(parse_scenario(text))
    assert scenario_warnings(found) == ()
    assert len(text) < 3000
    model = found.model
    region = model.region.build()
    assert region.area == pytest.approx(num_targets / 25.0 * 1e6, rel=1e-4)
    assert model.sensors[0].clutter.kind == "region"
    assert model.sensors[0].clutter.rate == pytest.approx(0.3 * num_targets)
    assert isinstance(model.filter, Filter)
    assert model.filter.limits.max_labels >= 4 * num_targets


def test_equal_settings_give_equal_files_and_seeds_equal_targets() -> None:
    assert crowd_text(GeneratedCrowd(num_targets=30)) == crowd_text(GeneratedCrowd(num_targets=30))
    found = scenario(num_targets=30)
    first, second, other = (
        build_targets(found).truth(found.model.time.build(), rng=np.random.default_rng(seed)) for seed in (0, 0, 1)
    )
    np.testing.assert_array_equal(first.states, second.states)
    assert not np.array_equal(first.at(0)[1], other.at(0)[1])
    assert len(first.at(0)[0]) == 30


def test_a_crowd_says_the_settings_that_differ_from_the_usual() -> None:
    crowd = GeneratedCrowd(num_targets=7, density=3.5, clutter=0.0, measured="bearing_range", num_steps=9)
    assert crowd.name == "crowd-7-density-3.5-clutter-0-bearing-range-steps-9"
    command = "#   vedette crowd --targets 7 --density 3.5 --clutter 0 --measurement bearing_range --steps 9\n"
    assert command in crowd_text(crowd)
    assert GeneratedCrowd().name == "crowd-100"


def test_the_built_in_crowd_is_the_usual_one() -> None:
    text = list_builtin()["crowd"].read_text(encoding="utf-8")
    assert text == crowd_text(GeneratedCrowd()).replace("name: crowd-100", "name: crowd")


def test_components_that_do_not_fit_the_motion() -> None:
    text = crowd_text(GeneratedCrowd())
    with pytest.raises(ScenarioError, match=r"targets.std: expected 2 numbers, as a state under motion has but the"):
        parse_scenario(text.replace("std: [3.0, 3.0],", "std: [3.0],"))
    with pytest.raises(ScenarioError, match=r"targets.std.1.: expected a number of at least 0, got -3"):
        parse_scenario(text.replace("std: [3.0, 3.0],", "std: [3.0, -3.0],"))


@pytest.mark.parametrize("measured", MEASURED)
@pytest.mark.parametrize("num_targets", [10, 1000])
def test_crowds_are_tracked_from_a_few_scans_on(num_targets: int, measured: str) -> None:
    short = replace_fields(scenario(num_targets=num_targets, measured=measured), {"time.num_steps": 8})
    record = run_scenario(short, "stationary", seed=0, run=0)
    assert record.ospa[-1, 0] < 0.4 * 25.0
    numbers = np.array([estimate.num_targets for estimate in record.estimates])
    assert abs(numbers[-1] - len(record.truth.at(7)[0])) <= 1 + 0.05 * num_targets
