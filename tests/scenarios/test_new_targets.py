"""Detections that a new target needs: compared with a simulated Kalman filter, and warnings of `vedette check`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vedette.evaluation.diagnostics import Diagnostic, new_target_diagnostics, record_diagnostics
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.new_targets import NewTargets, new_targets
from vedette.scenarios.overrides import replace_fields
from vedette.scenarios.warnings import scenario_warnings
from vedette.simulation.health import Health

SIDE, NOISE, SPEED, SIGMA = 1000.0, 10.0, 10.0, 0.3


def scene(births: float, clutter: float, detection: float, at_site: bool = False, **fields: Any) -> Scenario:
    """One radar that measures positions, and one target."""
    site = {"existence": births, "mean": [600.0, 500.0, 0.0, 0.0], "std": [40.0, 40.0, SPEED, SPEED]}
    anywhere = {"expected": births, "std": [2.0 * NOISE, 2.0 * NOISE, SPEED, SPEED]}
    sensor = {
        "position": [0.0, 0.0],
        "measurement": {"kind": "position"},
        "noise": {"kind": "constant", "std": [NOISE, NOISE]},
        "detection": {"kind": "constant", "probability": detection},
        "clutter": {"kind": "region", "rate": clutter},
    }
    return replace_fields(
        load_scenario("linear-10"),
        {
            "time": {"num_steps": 60},
            "region": {"x_min": 0.0, "x_max": SIDE, "y_min": 0.0, "y_max": SIDE},
            "motion": {"kind": "constant_velocity", "sigma_v": SIGMA},
            "survival": {"kind": "constant", "probability": 0.99},
            "birth": {"steps": [1], "sites": [site]} if at_site else {"sites": [], "from_measurements": anywhere},
            "targets": {"kind": "scripted", "tracks": [{"state": [600.0, 500.0, 0.0, 0.0]}]},
            "sensors": [sensor],
            "filter": {"kind": "factored_glmb"},
            "fusion": {"kind": "none"},
            **fields,
        },
    )


def simulated(births: float, clutter: float, detection: float, at_site: bool) -> float:
    """Median number of detections until the odds of existence exceed 1, for one target without clutter near it."""
    rng, kappa, numbers = np.random.default_rng(0), clutter / SIDE**2, []
    for _ in range(200):
        start = np.diag([40.0**2, SPEED**2]) if at_site else np.diag([1e8, SPEED**2])
        state, mean, cov, log_odds, number = rng.normal(size=(2, 2)), np.zeros((2, 2)), start, 0.0, 0
        state *= np.sqrt(np.diag(start))[:, np.newaxis] if at_site else [[0.0], [SPEED]]
        log_odds = math.log(births) if at_site else math.log(births / (detection + 0.01) / SIDE**2)
        while log_odds <= 0.0 and number < 100:
            if number:
                step = np.array([[1.0, 1.0], [0.0, 1.0]])
                state, mean = step @ state, step @ mean
                cov = step @ cov @ step.T + SIGMA**2 * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]])
            if rng.random() > detection:
                log_odds += math.log(1.0 - detection) if number else 0.0
                continue
            measured = state[0] + rng.normal(0.0, NOISE, 2)
            variance, residual = cov[0, 0] + NOISE**2, measured - mean[0]
            if at_site or number:
                squared = float(residual @ residual) / variance
                log_odds += -math.log(2.0 * math.pi * variance) - 0.5 * squared
            log_odds += math.log(detection / kappa)
            gain = cov[:, 0] / variance
            mean, cov, number = mean + np.outer(gain, residual), cov - np.outer(gain, cov[0]), number + 1
        numbers.append(number)
    return float(np.median(numbers))


@pytest.mark.parametrize("at_site", [False, True])
@pytest.mark.parametrize("detection", [0.7, 0.9, 0.98])
@pytest.mark.parametrize("clutter", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("births", [1e-6, 1e-3, 0.3])
def test_detections_agree_with_those_of_a_simulated_filter(
    births: float, clutter: float, detection: float, at_site: bool
) -> None:
    found = new_targets(scene(births, clutter, detection, at_site))
    assert found is not None
    assert np.median(found.needed) == pytest.approx(simulated(births, clutter, detection, at_site), abs=1.0)


def test_more_detections_are_needed_with_rare_births_and_much_clutter() -> None:
    needed = [
        [np.median(found.needed) for births in (0.5, 1e-2, 1e-4, 1e-6) if (found := new_targets(scene(births, c, 0.9)))]
        for c in (0.1, 3.0, 30.0, 3000.0)
    ]
    assert (np.diff(needed[:3], axis=0) >= 0.0).all()
    assert (np.diff(needed[:3], axis=1) >= 0.0).all()
    assert needed[0] == [1.0, 2.0, 2.0, 3.0]
    assert needed[2] == [4.0, 6.0, 8.0, 11.0]
    assert np.isinf(needed[3]).all()


def test_check_warns_if_targets_give_fewer_detections_than_they_need() -> None:
    (line,) = scenario_warnings(scene(1e-6, 30.0, 0.5, time={"num_steps": 15}))
    assert "a new target needs about 18 detections (36 s) to be reported, and gives about 7.5" in line
    (line,) = scenario_warnings(scene(0.1, 300.0, 0.5))
    assert "no number of detections suffices to report a new target" in line


def test_check_does_not_warn_of_ordinary_scenes() -> None:
    rng = np.random.default_rng(0)
    for _ in range(40):
        births, clutter, detection = 10.0 ** rng.uniform(-3.0, 0.0), 10.0 ** rng.uniform(-1.0, 1.3), rng.uniform(0.6, 1)
        assert scenario_warnings(scene(float(births), float(clutter), float(detection))) == ()


@pytest.mark.parametrize("kind", ["phd", "cphd", "cb_member"])
def test_filters_without_existence_probabilities_have_none(kind: str) -> None:
    assert new_targets(scene(0.1, 1.0, 0.9, at_site=True, filter={"kind": kind})) is None


def test_scenarios_with_custom_code_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    ordinary = scene(0.1, 1.0, 0.9)
    assert new_targets(ordinary) is not None
    monkeypatch.setattr("vedette.scenarios.new_targets.custom_code", lambda model: ("own.py:motion",))
    assert new_targets(ordinary) is None


def found_of(needed: float, births: float = 10.0) -> tuple[NewTargets, Health]:
    parts = (np.array([number]) for number in (needed, 10.0, needed, births, 0.8 * births))
    return NewTargets(*parts), Health.unreported(20, 1)


def levels(results: tuple[Diagnostic, ...]) -> list[str]:
    return [each.level for each in results]


def test_diagnostics_of_new_targets() -> None:
    targets, health = found_of(3.0)
    assert levels(tuple(new_target_diagnostics(targets, health, 7))) == ["ok", "ok", "ok"]
    late = tuple(new_target_diagnostics(found_of(15.0)[0], health, 7))
    assert levels(late) == ["check", "ok", "ok"]
    text = "a new target needs about 15 detections (15 s) to be reported, and gives about 10"
    assert late[0].text == f"{text} in the run, its life and the view"
    missing = tuple(new_target_diagnostics(targets, health, 0))
    assert levels(missing) == ["ok", "ok", "check"]
    assert missing[2].text == "none, 8 expected (probability 0.0003)"
    assert levels(tuple(new_target_diagnostics(targets, health, 1))) == ["ok", "ok", "note"]
    assert levels(tuple(new_target_diagnostics(found_of(3.0, 2.0)[0], health, 0))) == ["ok", "ok", "ok"]
    assert levels(tuple(new_target_diagnostics(None, health, 0))) == ["ok", "ok", "ok"]


@pytest.mark.parametrize(("dropped", "level"), [(0.05, "ok"), (0.3, "note"), (0.6, "check")])
def test_dropped_births_are_a_share_of_the_expected_ones(dropped: float, level: str) -> None:
    targets, health = found_of(3.0)
    health.dropped_existence[:] = dropped * 10.0 / 20.0
    result = tuple(new_target_diagnostics(targets, health, 7))[1]
    assert (result.level, result.text) == (level, f"{100 * dropped:.0f} % of 10 expected, by filter.limits")


def test_a_run_of_an_ordinary_scene_has_no_finding() -> None:
    ordinary = scene(0.05, 1.0, 0.9)
    results = record_diagnostics(run_scenario(ordinary, "stationary", seed=0), ordinary)
    assert {each.name for each in results} >= {"New targets", "Births dropped", "Targets reported"}
    assert "check" not in levels(results)
    assert len(results) == len(record_diagnostics(run_scenario(ordinary, "stationary", seed=0), None)) + 3
