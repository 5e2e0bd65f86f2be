"""A world that is stepped from outside: the runs of a campaign, scan for scan."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation import ospa_of_run, run_scenario
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.simulation import SimulationRun
from vedette.simulation.loop import PLANNER, run_stream
from vedette.simulation.replay import scans_of


def of(scenario: Scenario) -> dict[str, Any]:
    ospa = scenario.model.ospa
    return {"cutoff": ospa.cutoff, "order": ospa.order, "components": ospa.components}


@pytest.mark.parametrize("name", ["paper-a", "six-cameras"])
def test_who_steps_it_as_the_loop_does_has_its_run(name: str) -> None:
    """Truth, poses, scans and estimates, bit for bit."""
    scenario = replace_fields(load_scenario(name), {"control.reward": {"kind": "expected_loss"}})
    scenario = replace_fields(scenario, {"control.explain": False, "control.search": {"kind": "coordinate_ascent"}})
    record = run_scenario(scenario, "jdm", seed=3, run=2, num_threads=1)
    experiment, planner = build_experiment(scenario), build_planner(scenario, "jdm", num_threads=1)
    assert planner is not None
    world, rng, actions, estimates = SimulationRun(experiment, seed=3, run=2), run_stream(3, 2, PLANNER), None, []
    kept = scans_of(record, experiment)
    while not world.is_over:
        moment = world.step(actions)
        actions = None
        if moment.step in experiment.decision_steps:
            actions = planner.plan(moment.state, moment.poses, rng=rng).chosen_actions
        estimates.append(moment.estimate)
        assert moment.time == record.times[moment.step - 1]
        np.testing.assert_array_equal(moment.poses, record.poses[moment.step - 1])
        for scan, own, measured in zip(moment.scans, kept[moment.step - 1], moment.measurements, strict=True):
            assert (scan is None) == (own is None) == (measured is None)
            if scan is not None and own is not None:
                np.testing.assert_array_equal(scan.origins, own.origins)
                np.testing.assert_array_equal(measured, own.measurements)
        np.testing.assert_array_equal(moment.estimate.means, record.estimates[moment.step - 1].means)
    np.testing.assert_array_equal(world.truth.states, record.truth.states)
    np.testing.assert_array_equal(ospa_of_run(world.truth, estimates, **of(scenario)), record.ospa)


def test_another_world_is_the_run_once_more() -> None:
    experiment = build_experiment(load_scenario("linear-10"))
    first, again, other = (SimulationRun(experiment, seed=1, run=run) for run in (0, 0, 1))
    for _ in range(3):
        one, two, three = first.step(), again.step(), other.step()
        mine, same, others = (np.asarray(moment.measurements[0]) for moment in (one, two, three))
        np.testing.assert_array_equal(mine, same)
        assert not np.array_equal(mine, others)


def test_it_ends_and_reports_where_nothing_can_be_sent() -> None:
    whole = build_experiment(load_scenario("linear-10"))
    experiment = replace(whole, times=whole.times[:1])
    world = SimulationRun(experiment, seed=1)
    with pytest.raises(InputError, match="world: expected a scan before the sensors are sent anywhere; got none yet"):
        world.step([None])
    world.step()
    assert world.is_over
    with pytest.raises(InputError, match="world: expected one of 1 scans to come; all are done"):
        world.step()
