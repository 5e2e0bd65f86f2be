"""A scenario without optional settings builds what the constructors in Python build with their defaults."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vedette import filters, fusion, models
from vedette.densities import existence_probabilities
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.tracking import Central, Distributed

TEXT = """\
name: defaults
time: {num_steps: 9, step_period: 1.0}
region: {x_min: -100.0, x_max: 100.0, y_min: -50.0, y_max: 50.0}
motion: {kind: constant_velocity, sigma_v: 1.0}
survival: {kind: constant, probability: 0.95}
birth:
  sites:
    - {existence: 0.1, mean: [9.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}
targets: {kind: scripted, tracks: []}
sensor_defaults:
  measurement: {kind: position}
  noise: {kind: constant, std: [3.0, 4.0]}
  detection: {kind: limited_range, probability: 0.9, max_range: 30.0}
  clutter: {kind: region, rate: 2.0}
"""
SITE = np.array([0.1]), np.array([[9.0, 0.0, 0.0, 0.0]]), np.diag([25.0, 25.0, 4.0, 4.0])[np.newaxis]
REGION = models.Region(-100.0, 100.0, -50.0, 50.0)


def scenario_tracker(num_sensors: int, **sections: str) -> Any:
    """The tracker of a scenario with these sections."""
    sensors = "sensors:\n" + "  - {position: [0.0, 0.0]}\n" * num_sensors
    text = TEXT + sensors + "".join(f"{name}: {text}\n" for name, text in sections.items())
    return build_experiment(Scenario(parse_scenario(text), Path("f.yaml"))).tracker


def python_models() -> tuple[models.TargetModel, models.SensorModel]:
    """The models of the scenario, with the defaults of the constructors."""
    targets = models.TargetModel(
        models.constant_velocity(1.0), models.constant_survival(0.95), models.BirthModel(*SITE)
    )
    noise, clutter = models.constant_noise([3.0, 4.0]), models.region_clutter(2.0, REGION, "position")
    return targets, models.SensorModel(models.position(), noise, models.limited_range(0.9, 30.0), clutter)


def differences(one: Any, other: Any, place: str) -> list[str]:
    """Places at which two objects differ, in any field of any part."""
    if type(one) is not type(other):
        return [f"{place}: {one!r} and {other!r}"]
    if dataclasses.is_dataclass(one):
        fields = [field.name for field in dataclasses.fields(one)]
        found = [differences(getattr(one, name), getattr(other, name), f"{place}.{name}") for name in fields]
    elif isinstance(one, tuple | list) and len(one) == len(other):
        found = [differences(*pair, f"{place}[{i}]") for i, pair in enumerate(zip(one, other, strict=True))]
    elif isinstance(one, np.ndarray):
        return [] if np.array_equal(one, other) else [place]
    else:
        return [] if one is other or one == other else [f"{place}: {one!r} and {other!r}"]
    return [each for part in found for each in part]


SINGLE = {
    "factored_glmb": filters.FactoredGlmbFilter,
    "lmb": filters.LmbFilter,
    "delta_glmb": filters.DeltaGlmbFilter,
    "m_delta_glmb": filters.DeltaGlmbFilter,
    "phd": filters.PhdFilter,
    "cphd": filters.CphdFilter,
    "cb_member": filters.CbMemberFilter,
}
SEQUENTIAL = {
    "factored_glmb": filters.SequentialFactoredFilter,
    "lmb": filters.SequentialLmbFilter,
    "delta_glmb": filters.MultiSensorGlmbFilter,
    "m_delta_glmb": filters.MultiSensorGlmbFilter,
}


def options(kind: str) -> dict[str, Any]:
    """Arguments without which Python builds another kind of filter."""
    return {"marginalised": True} if kind == "m_delta_glmb" else {}


@pytest.mark.parametrize("kind", SINGLE)
def test_filters_of_one_sensor(kind: str) -> None:
    built = scenario_tracker(1, filter=f"{{kind: {kind}}}", fusion="{kind: none}")
    assert differences(built, Distributed((SINGLE[kind](*python_models(), **options(kind)),)), "tracker") == []


@pytest.mark.parametrize("kind", SEQUENTIAL)
def test_filters_of_several_sensors(kind: str) -> None:
    built = scenario_tracker(2, filter=f"{{kind: {kind}}}")
    targets, sensor = python_models()
    expected = Central(SEQUENTIAL[kind](targets, (sensor, sensor), **options(kind)))
    assert differences(built, expected, "tracker") == []


@pytest.mark.parametrize(
    ("kind", "rule", "local"),
    [
        ("clmb", fusion.Clmb, "lmb"),
        ("arithmetic_average", fusion.ArithmeticAverage, "lmb"),
        ("cm_delta_glmb", fusion.CmDeltaGlmb, "delta_glmb"),
        ("parallel", fusion.ParallelUpdate, "factored_glmb"),
    ],
)
def test_fusions(kind: str, rule: Any, local: str) -> None:
    built = scenario_tracker(2, filter=f"{{kind: {local}}}", fusion=f"{{kind: {kind}}}")
    filter_of_sensor = SINGLE[local](*python_models())
    made = rule() if kind == "parallel" else rule((0.5, 0.5))
    expected = Distributed((filter_of_sensor,) * 2, made, feedback=kind == "parallel")
    assert differences(built, expected, "tracker") == []


def test_a_difference_in_any_part_is_found() -> None:
    targets, sensor = python_models()
    plain = filters.FactoredGlmbFilter(targets, sensor)
    for changed, place in (
        (dataclasses.replace(plain, limits=filters.Limits(max_labels=7)), "f.limits.max_labels"),
        (
            dataclasses.replace(plain, sensor=dataclasses.replace(sensor, detection_at="centre")),
            "f.sensor.detection_at",
        ),
        (dataclasses.replace(plain, births="labelled"), "f.births"),
    ):
        (found,) = differences(plain, changed, "f")
        assert found.startswith(place)


def test_a_filter_chooses_where_detection_is_taken() -> None:
    """The default of the filter, also of several sensors; a value that is given stays."""
    targets, sensor = python_models()
    for kind in SINGLE.values():
        expected = "mean" if kind is filters.FactoredGlmbFilter else "centre"
        assert kind(targets, sensor).sensor.detection_at == expected
        given = dataclasses.replace(sensor, detection_at="centre")
        assert kind(targets, given).sensor is given
    assert filters.SequentialFactoredFilter(targets, (sensor,)).sensors[0].detection_at == "mean"
    assert filters.SequentialLmbFilter(targets, (sensor,)).sensors[0].detection_at == "centre"


@pytest.mark.parametrize("measured", [29.0, 31.0])
def test_a_first_detection_inside_an_edge_has_its_exact_existence(measured: float) -> None:
    """A site beyond the edge at 30 m, a measurement near it: the exact existence, on a grid, to .02.

    At the centre of the Gaussian of the site the probability of detection is 0, and no label begins.
    """
    mean, std, noise, existence = np.array([36.0, 0.0]), 5.0, 3.0, 0.1
    birth = models.BirthModel(
        np.array([existence]), np.array([[*mean, 0.0, 0.0]]), np.diag([std**2, std**2, 4.0, 4.0])[np.newaxis]
    )
    targets = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.95), birth)
    clutter = models.region_clutter(2.0, REGION, "position")
    detection, scan = models.limited_range(0.9, 30.0), np.array([[measured, 0.0]])
    sensor = models.SensorModel(models.position(), models.constant_noise([noise, noise]), detection, clutter)
    local = filters.FactoredGlmbFilter(targets, sensor)
    belief, _ = local.step(local.initial(), scan, np.zeros(3), 1.0, 1, rng=np.random.default_rng(0))

    axis = np.arange(-30.0, 30.0, 0.05)
    states = mean + np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    prior = np.exp(-0.5 * ((states - mean) ** 2).sum(axis=1) / std**2) * 0.05**2 / (2.0 * math.pi * std**2)
    likelihood = np.exp(-0.5 * ((scan - states) ** 2).sum(axis=1) / noise**2) / (2.0 * math.pi * noise**2)
    detected = 0.9 * (np.hypot(*states.T) <= 30.0)
    odds = existence * prior @ (detected * likelihood) / (2.0 / 20_000.0)
    missed = existence * prior @ (1.0 - detected)
    # Poisson intensity of undetected targets: a measurement is the target or clutter.
    exact = odds / (odds + 1.0)
    assert 0.3 < exact < 0.95
    found = existence_probabilities(belief)[1]
    assert found.sum() == pytest.approx(exact, abs=0.02)
    assert belief.undetected is not None
    assert belief.undetected.expected_number == pytest.approx(missed, rel=0.05)
    at_centre = dataclasses.replace(local, sensor=dataclasses.replace(sensor, detection_at="centre"))
    belief, _ = at_centre.step(local.initial(), scan, np.zeros(3), 1.0, 1, rng=np.random.default_rng(0))
    assert existence_probabilities(belief)[1].sum() < 0.01
