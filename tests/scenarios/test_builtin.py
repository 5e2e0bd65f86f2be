"""The scenarios that come with the library: valid, with the numbers of the notes, and with every choice a field."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest

from scenarios.minimal import kinds
from vedette.control import ConstraintContext, KeepOut
from vedette.scenarios import list_builtin, load_scenario
from vedette.scenarios.build import build_experiment, build_targets
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections import ScenarioModel, Section
from vedette.scenarios.sections.platforms import Heading
from vedette.scenarios.sections.sensing import Clutter, Detection, Measurement, RangeDependentNoise
from vedette.scenarios.sections.targets import RecordedTargets, ScriptedTargets
from vedette.scenarios.sections.world import Motion
from vedette.simulation import Truth
from vedette.tracking import DelayedScanTracker

LAYOUTS: dict[str, dict[str, Any]] = {
    "paper-a": {
        "targets": [(-55, 875, 15, -6), (-180, -205, -5.5, -19), (-320, 485, 5.5, -5.5), (340, -5, 10, 6)],
        "sensors": [(-745, 830), (-580, 220)],
        "speed": 50,
    },
    "paper-e": {
        "targets": [(60, -260, 5, -7), (580, -190, 3, 17), (-270, -100, -1, 8), (-180, 280, 3, -8)],
        "sensors": [(-520, 280), (-590, -190)],
        "speed": 40,
    },
}

# Row of the notes on the paper -> field, the default asked for.
NOTE_ROWS = {
    1: ("motion.state_order", "grouped"),
    3: ("sensors.0.noise", RangeDependentNoise()),
    4: ("sensors.0.detection", kinds(Detection)["gaussian"]()),
    5: ("sensors.0.clutter", kinds(Clutter)["region"]()),
    6: ("birth.steps", "every"),
    7: ("fusion.missing_weight", 1e-6),
    8: ("fusion.mixture_power", "auto"),
    9: ("fusion.feedback", False),
    12: ("control.ideal_measurements", "ideal"),
    14: ("sensors.0.platform.relative", False),
    15: ("control.reward.unit_volume", 1.0),
    17: ("ospa.cutoff", 100.0),
}


def truth_of(scenario: Scenario) -> Truth:
    return build_targets(scenario).truth(scenario.model.time.build(), rng=np.random.default_rng(0))


def test_they_are_all_there_and_valid() -> None:
    assert list(list_builtin()) == [
        "beyond-the-gap",
        "crowd",
        "eight-mobile",
        "linear-10",
        "paper-a",
        "paper-e",
        "polar-10",
        "shore-radar",
        "six-cameras",
        "sixteen-views",
        "solent",
        "solent-patrol",
        "three-positions",
        "three-radars",
        "two-searchers",
        "two-views-1",
        "two-views-2",
    ]
    for name in list_builtin():
        assert load_scenario(name).name == name


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_papers_scenario_has_the_numbers_of_the_notes(name: str) -> None:
    model, layout = load_scenario(name).model, LAYOUTS[name]
    assert isinstance(model.targets, ScriptedTargets)
    assert [track.state for track in model.targets.tracks] == layout["targets"]
    assert not any(track.process_noise for track in model.targets.tracks)
    assert [sensor.position for sensor in model.sensors] == layout["sensors"]
    assert {sensor.platform for sensor in model.sensors} == {Heading(speed=layout["speed"])}
    assert {sensor.stationary_until_first_decision for sensor in model.sensors} == {True}
    assert [site.mean for site in model.birth.sites] == [(x, y, 0.0, 0.0) for x, y, *_ in layout["targets"]]
    assert {(site.existence, site.std) for site in model.birth.sites} == {(0.02, (50.0, 50.0, 25.0, 25.0))}
    assert model.birth.steps == (1,)


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_papers_scenario_has_the_papers_numbers(name: str) -> None:
    model = load_scenario(name).model
    assert (model.time.num_steps, model.time.step_period, model.time.start) == (40, 1.0, 1.0)
    assert model.motion == kinds(Motion)["constant_velocity"](sigma_v=5.0)
    assert model.survival.model_dump() == {"kind": "constant", "probability": 0.98, "period": None}
    for sensor in model.sensors:
        assert sensor.measurement == kinds(Measurement)["bearing_range"]()
        noise: Section = RangeDependentNoise(sigma_range=10.0, eta_range=5e-5, sigma_bearing_deg=1.0, eta_bearing=5e-6)
        assert sensor.noise == noise
        assert sensor.detection == kinds(Detection)["gaussian"](sigma=10000.0)
        assert sensor.clutter == kinds(Clutter)["region"](rate=25.0)
    assert model.region.model_dump() == {"x_min": -1000.0, "x_max": 1000.0, "y_min": -1000.0, "y_max": 1000.0}
    assert model.fusion.model_dump()["weights"] == (0.5, 0.5)
    control = model.control
    assert control.decision_steps == (10, 20, 30)
    assert {sensor.platform.model_dump()["headings_deg"] for sensor in model.sensors} == {tuple(range(-180, 181, 30))}
    assert (control.horizon_steps, control.horizon_period, control.num_samples) == (5, 2.0, 40)
    assert (control.limits.max_prior_hypotheses, control.limits.max_hypotheses) == (10, 10)
    assert (model.ospa.cutoff, model.ospa.order, model.ospa.components, model.ospa.window) == (
        100.0,
        1.0,
        "position",
        10,
    )
    assert (model.ospa.first_scan, model.ospa.last_scan) == (11, 40)


def field_at(model: Any, path: str) -> Any:
    for part in path.split("."):
        model = model[int(part)] if part.isdigit() else getattr(model, part)
    return model


@pytest.mark.parametrize("row", NOTE_ROWS)
def test_every_choice_that_the_paper_leaves_open_is_a_field_with_its_default(row: int) -> None:
    path, default = NOTE_ROWS[row]
    least = {
        "name": "least",
        "time": {"num_steps": 3},
        "region": {"x_min": 0.0, "x_max": 1.0, "y_min": 0.0, "y_max": 1.0},
        "birth": {"sites": [{"existence": 0.1, "mean": [0.0] * 4, "std": [1.0] * 4}]},
        "targets": {"kind": "scripted", "tracks": []},
        "sensors": [{"position": [0.0, 0.0], "platform": {"kind": "heading", "speed": 1.0}}],
        "control": {"reward": {"kind": "cauchy_schwarz"}},
    }
    assert field_at(ScenarioModel.model_validate(least), path) == default


@pytest.mark.parametrize(("name", "measures"), [("linear-10", "position"), ("polar-10", "bearing_range")])
def test_ten_targets_inside_the_region_and_as_many_at_once(name: str, measures: str) -> None:
    scenario = load_scenario(name)
    truth, region = truth_of(scenario), scenario.model.region
    assert len(np.unique(truth.ids)) == 10
    assert np.diff(truth.offsets).max() == 10
    assert (truth.states[:, :2] > [region.x_min, region.y_min]).all()
    assert (truth.states[:, :2] < [region.x_max, region.y_max]).all()
    sensor = scenario.model.sensors[0]
    assert (sensor.measurement.kind, sensor.platform.kind) == (measures, "stationary")
    assert len(scenario.model.birth.sites) == 4


@pytest.mark.parametrize("name", ["linear-10", "polar-10"])
def test_the_targets_are_likely_births_of_the_sites(name: str) -> None:
    model = load_scenario(name).model
    assert isinstance(model.targets, ScriptedTargets)
    for track in model.targets.tracks:
        distances = [
            math.sqrt(sum(((x - m) / s) ** 2 for x, m, s in zip(track.state, site.mean, site.std or (), strict=True)))
            for site in model.birth.sites
        ]
        assert min(distances) < 3.0


def test_three_positions_is_the_published_scene() -> None:
    scenario = load_scenario("three-positions")
    truth, model = truth_of(scenario), scenario.model
    assert np.diff(truth.offsets).mean() == pytest.approx(5.28)
    assert np.diff(truth.offsets)[[0, 19, 39, 59, 70, 80, 90, 99]].tolist() == [2, 4, 6, 10, 8, 6, 4, 4]
    assert truth.at(69)[1][0].tolist() == [-80.0 + 69 * 0.75, -20.0 + 69 * 1.5, 0.75, 1.5]
    assert {(site.existence, site.std) for site in model.birth.sites} == {(0.03, (10.0,) * 4)}
    motion = model.motion.build(scenario.folder)
    axis = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
    np.testing.assert_allclose(motion.noise_cov(np.zeros(4), 1.0), np.kron(axis, np.eye(2)), rtol=1e-15)
    sensors = [(s.detection.model_dump()["probability"], s.noise.model_dump()["std"][0]) for s in model.sensors]
    assert sensors == [(0.67, 4.0), (0.7, 3.0), (0.73, 2.0)]
    assert (model.ospa.cutoff, model.ospa.order, model.ospa.unit) == (5.0, 2.0, "")


def test_solent_has_three_to_twelve_real_ships_under_way_at_every_scan() -> None:
    scenario = load_scenario("solent")
    assert isinstance(scenario.model.targets, RecordedTargets)
    truth = truth_of(scenario)
    alive = np.diff(truth.offsets)
    assert (alive.min(), alive.max()) == (3, 10)
    assert np.abs(truth.states[:, :2]).max() <= 3000.0
    assert np.hypot(truth.states[:, 2], truth.states[:, 3]).max() < 20.0


def test_the_land_of_the_patrol_has_no_ship_on_it_and_the_boats_off_it() -> None:
    scenario = load_scenario("solent-patrol")
    constraints = scenario.model.control.build_constraints(scenario.folder)
    zones = [constraint for constraint in constraints if isinstance(constraint, KeepOut)]
    assert len(zones) == 2
    places = truth_of(scenario).states[:, :2]
    starts = np.array([sensor.position for sensor in scenario.model.sensors[1:]])
    for zone in zones:
        way = np.concatenate([places, starts])[:, np.newaxis]
        assert zone.courses(ConstraintContext((way,), np.ones(1)))[0].all()
    assert isinstance(build_experiment(scenario).tracker, DelayedScanTracker)


def test_the_ships_come_with_their_origin_and_licence() -> None:
    data = list_builtin()["solent"].parents[1] / "data"
    assert (data / "solent.csv").stat().st_size < 100_000
    text = (data / "README.md").read_text(encoding="utf-8")
    assert "SolentAIS_20160112_130211.csv" in text
    assert re.search(r"MIT License.*Crown Copyright.*Permission is hereby granted", text, re.DOTALL)
    ids = {line.split(",")[1] for line in (data / "solent.csv").read_text(encoding="utf-8").splitlines()[1:]}
    assert ids == {str(number) for number in range(1, 22)}
