"""An lmb with births: poisson is a PMB: which scenarios take it, what is built, and how it counts missed targets."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.minimal import changed
from vedette import filters, models
from vedette.densities import FactoredGLMB, cardinality_distribution
from vedette.errors import ScenarioError
from vedette.evaluation import run_scenario
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.dumping import dump_scenario
from vedette.scenarios.warnings import MAX_MISSED, scenario_warnings
from vedette.tracking import BeliefNetwork, Central, Distributed, ScanNetwork

PMB = "{kind: lmb, births: poisson}"
SHORT = (
    ("num_steps: 20", "num_steps: 5"),
    ("last_scan: 20", "last_scan: 5"),
    ("[4, 8]", "[2]"),
    ("end_step: 18", "end_step: 5"),
    ("estimator: {kind: marginal, threshold: 0.6}\n", ""),
)


def scenario(fusion: str, local: str = PMB, *changes: tuple[str, str]) -> Scenario:
    of_filter = "filter: {kind: m_delta_glmb}", f"filter: {local}"
    of_fusion = "fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}", f"fusion: {fusion}"
    return Scenario(parse_scenario(changed(of_filter, of_fusion, *changes)), Path("f.yaml"))


def test_the_default_of_each_kind() -> None:
    """An lmb has labelled births, a factored_glmb Poisson ones; what is built has the split error of a PMB."""
    local: Any = build_experiment(scenario("{kind: sequential}", "{kind: lmb}")).tracker
    assert isinstance(local.filter, filters.SequentialLmbFilter)
    local = build_experiment(scenario("{kind: sequential}")).tracker
    assert isinstance(local.filter, filters.SequentialFactoredFilter)
    assert (local.filter.births, local.filter.max_split_error) == ("poisson", 2.0)
    local = build_experiment(scenario("{kind: sequential}", "{kind: factored_glmb}")).tracker
    assert (local.filter.births, local.filter.max_split_error) == ("poisson", 0.01)
    labelled = scenario("{kind: sequential}", "{kind: factored_glmb, births: labelled}")
    local = build_experiment(labelled).tracker
    assert local.filter.births == "labelled"
    for each in (labelled, scenario("{kind: sequential}")):
        assert parse_scenario(dump_scenario(each.model), "g.yaml") == each.model


@pytest.mark.parametrize(
    ("fusion", "tracker"),
    [
        ("{kind: sequential}", Central),
        ("{kind: central}", Central),
        ("{kind: parallel}", Distributed),
        ("{kind: clmb}", Distributed),
        ("{kind: clmb, feedback: true}", Distributed),
        ("{kind: cm_delta_glmb}", Distributed),
        ("{kind: arithmetic_average}", Distributed),
        ("{kind: sequential}\nnetwork: {radio_range: 500.0}", ScanNetwork),
        ("{kind: cm_delta_glmb, feedback: true}\nnetwork: {radio_range: 500.0}", BeliefNetwork),
    ],
)
def test_every_fusion_runs(fusion: str, tracker: type) -> None:
    """With joint decisions; where beliefs are fused by label, births are labelled as with factored_glmb."""
    given = scenario(fusion, PMB, *SHORT)
    assert isinstance(build_experiment(given).tracker, tracker)
    record = run_scenario(given, "jdm", seed=1)
    assert len(record.estimates) == 5


@pytest.mark.parametrize(
    ("fusion", "local", "message"),
    [
        ("{kind: parallel}\nnetwork: {radio_range: 500.0}", PMB, r"filter\.kind: expected lmb with births: labelled"),
        (
            "{kind: sequential}",
            "{kind: lmb, births: poisson, assignment: {kind: belief_propagation}}",
            "expected ranked, as the filter is lmb with births: poisson",
        ),
    ],
)
def test_what_a_pmb_cannot_do_is_refused(fusion: str, local: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        scenario(fusion, local)


CONSTANT = "noise: {kind: constant, std: [0.02, 3.0]}", "noise: {kind: constant, std: [0.02, 3.0]}\n  detection: {}"
EVERY = "steps: [1, 5]", "steps: every"


@pytest.mark.parametrize(
    ("local", "chance", "is_warned"),
    [("{kind: lmb}", 0.3, True), ("{kind: lmb}", 0.9, False), (PMB, 0.3, False), ("{kind: factored_glmb}", 0.3, False)],
)
def test_check_warns_of_undetected_targets_at_one_site(local: str, chance: float, is_warned: bool) -> None:
    """Two sensors, .1 births per scan: .1 (1 / (1 - .7^2) - 1) = .096 undetected targets, or .001."""
    seen = CONSTANT[1].replace("{}", f"{{kind: constant, probability: {chance}}}")
    given = scenario("{kind: sequential}", local, EVERY, (CONSTANT[0], seen))
    found = [line for line in scenario_warnings(given) if "undetected targets are expected" in line]
    assert len(found) == is_warned
    assert 0.1 * (1.0 / (1.0 - 0.1**2) - 1.0) < MAX_MISSED < 0.096
    for line in found:
        assert "0.096 undetected targets are expected at birth.sites[0]" in line
        assert "take filter.births: poisson" in line


def test_two_missed_targets_of_one_site_are_both_counted() -> None:
    """Three scans miss everything, then two measurements far apart twice: the number of targets against a delta-GLMB.

    The exact mean is .79. A PMB has .85, and labels that contend for both targets .21.
    """
    birth = models.BirthModel(np.array([0.05]), np.zeros((1, 4)), np.diag([1e4, 1e4, 25.0, 25.0])[np.newaxis])
    targets = models.TargetModel(models.constant_velocity(1.0), models.constant_survival(0.98), birth)
    clutter = models.region_clutter(5.0, models.Region(-300.0, 300.0, -300.0, 300.0), "position")
    noise, detection = models.constant_noise([10.0, 10.0]), models.constant_detection(0.4)
    sensor = models.SensorModel(models.position(), noise, detection, clutter)

    def number(local: Any) -> Any:
        belief, both = local.initial(), np.array([[-80.0, -60.0], [80.0, 60.0]])
        for step, scan in enumerate([both[:0]] * 3 + [both] * 2, start=1):
            belief, _ = local.step(belief, scan, np.zeros(3), 1.0, step, rng=np.random.default_rng(0))
        assert isinstance(belief, FactoredGLMB) == isinstance(local, filters.FactoredGlmbFilter)
        chances = cardinality_distribution(belief)
        return chances @ np.arange(len(chances)), chances[2]

    many = filters.Limits(max_hypotheses=100_000, min_relative_weight=1e-12)
    exact = number(filters.DeltaGlmbFilter(targets, sensor, many))
    pmb = number(filters.FactoredGlmbFilter(targets, sensor, max_split_error=2.0))
    labelled = number(filters.LmbFilter(targets, sensor))
    assert exact == pytest.approx((0.79, 0.137), abs=0.005)
    assert pmb == pytest.approx(exact, abs=0.06)
    assert labelled[0] < 0.3
    assert labelled[1] < 0.02
