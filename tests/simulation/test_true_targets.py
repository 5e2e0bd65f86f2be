"""Decisions on the true targets: the beliefs that they are made on, by hand, and that they lose to no other planner."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import mobile_sensor
from vedette.control import ConstantPlanner, Plan
from vedette.densities import GLMB, LMB, FactoredGLMB, LabelledDensity, Poisson, UndetectedIntensity, as_glmb
from vedette.errors import InputError
from vedette.evaluation import run_scenario
from vedette.models import BirthModel, CellGrid, MeasurementBirth, Region
from vedette.platforms import Actions, HeadingPlatform
from vedette.scenarios import load_scenario, replace_fields
from vedette.scenarios.build import build_planner
from vedette.simulation import TrueTargetsPlanner, Truth
from vedette.tracking import State

POSES = np.array([[-500.0, 300.0, 0.2], [-450.0, -350.0, -0.4]])
STARTS = np.array([[-60.0, 250.0, 8.0, -3.0], [180.0, -120.0, -4.0, 9.0], [-220.0, -300.0, 0.0, 5.0]])
COV = np.diag([400.0, 900.0, 25.0, 9.0])
LOST = np.diag([1e4, 1e4, 100.0, 100.0])  # of the size of the cutoff, a tenth of it beyond the position
CELLS = CellGrid(Region(-900.0, 900.0, -900.0, 900.0), 2, 2)
ELSEWHERE = np.array([700.0, 700.0, 0.0, 0.0])


class Keeps:
    """A planner that keeps the state that it is asked with."""

    name = "keeps"

    def __init__(self) -> None:
        self.state: Any = None

    def plan(self, state: State, poses: Any, *, rng: np.random.Generator) -> Plan:
        self.state = state
        return ConstantPlanner((Actions.of(heading_deg=0.0),) * 2).plan(state, poses, rng=rng)


def truth() -> Truth:
    """Three targets at two scans."""
    return Truth.from_arrays(np.array([1.0, 2.0]), np.ones((3, 2), bool), np.repeat(STARTS[:, np.newaxis], 2, axis=1))


def sensors(kind: str, births: bool) -> Any:
    measured = MeasurementBirth(0.5, 0.03, np.array([20.0, 20.0, 5.0, 5.0])) if births else None
    found: list[Any] = [mobile_sensor(kind, HeadingPlatform(speed, (0.0, 90.0))) for speed in (30.0, 45.0)]
    birth = replace(BirthModel.none(4), from_measurements=measured)
    targets = replace(found[0].filter.targets, birth=birth)
    return tuple(replace(own, filter=replace(own.filter, targets=targets)) for own in found)


def beliefs() -> tuple[LMB, LMB]:
    """The first target and, improbably, the second are held, each off its place; so is one that is not there."""
    labels, means = [(1, 0), (1, 1), (1, 2)], np.array([STARTS[0] + 9.0, STARTS[1] - 20.0, ELSEWHERE])
    fused = LMB.from_bernoullis(labels, [0.99, 0.05, 0.95], means, [COV, 2.0 * COV, 3.0 * COV])
    local = LMB.from_bernoullis(labels[:1], [0.9], means[:1], [4.0 * COV])
    return fused, local


def told_of(kind: str, births: bool) -> State:
    form = {
        "lmb": lambda own: own,
        "marginal": lambda own: as_glmb(own, max_hypotheses=10)[0],
        "factored": FactoredGLMB.of,
    }
    fused, local = map(form[kind], beliefs())
    unfound = UndetectedIntensity(CELLS, np.ones(4))
    state = State((fused, local), fused, step=1, time=1.0, undetected=unfound)
    inner = Keeps()
    planner = TrueTargetsPlanner(inner, sensors(kind, births)).with_truth(truth())
    plan = planner.plan(state, POSES, rng=np.random.default_rng(0))
    assert plan.planner == "true_targets"
    found: State = inner.state
    return found


def table(belief: LabelledDensity) -> Any:
    """Labels, existences, means and covariances of a belief, one Gaussian each."""
    rows = list(belief.targets())
    return [own.label for own in rows], *(
        np.array([getattr(own, name) for own in rows]) for name in ("existence", "mean", "cov")
    )


@pytest.mark.parametrize("kind", ["lmb", "marginal", "factored"])
@pytest.mark.parametrize("births", [False, True])
def test_beliefs_are_of_true_targets_and_false_estimates(kind: str, births: bool) -> None:
    state = told_of(kind, births)
    num = 3 if births else 2  # the third target has no label, and starts a track only where targets are born
    wanted = {"lmb": LMB, "marginal": GLMB, "factored": FactoredGLMB}[kind]
    assert state.undetected is None
    assert [type(own) for own in (state.fused, *state.local)] == [wanted] * 3
    first, second = [COV, 2.0 * COV, LOST], [4.0 * COV, LOST, LOST]  # of the targets, and then of the false estimate
    wanted_covs = [(state.fused, first, 3.0 * COV), (state.local[0], first, 3.0 * COV), (state.local[1], second, LOST)]
    for belief, covs, of_false in wanted_covs:
        labels, existence, means, found = table(belief)
        assert labels == [*((0, target) for target in range(num)), (1, 0)]
        np.testing.assert_allclose(existence, 1.0)
        np.testing.assert_allclose(means, [*STARTS[:num], ELSEWHERE])
        np.testing.assert_allclose(found, [*covs[:num], of_false])


def test_it_needs_its_truth_and_labels() -> None:
    planner, (fused, local) = TrueTargetsPlanner(Keeps(), sensors("lmb", True)), beliefs()
    state, rng = State((fused, local), fused, step=1, time=1.0), np.random.default_rng(0)
    with pytest.raises(InputError, match="truth: expected the targets of the run"):
        planner.plan(state, POSES, rng=rng)
    with pytest.raises(InputError, match=r"state\.fused: expected a LabelledDensity"):
        planner.with_truth(truth()).plan(replace(state, fused=Poisson.empty(4)), POSES, rng=rng)
    with pytest.raises(InputError, match="truth: expected states of at most 4 components"):
        planner.with_truth(replace(truth(), states=np.ones((6, 5))))


def test_where_nothing_is_in_sight_it_goes_to_the_targets() -> None:
    """The oracle of one decision stays before the gap; `jdm` does not know in time where the targets are."""
    short = {"time.num_steps": 20, "control.decision_steps": list(range(1, 20))}
    gap, errors = replace_fields(load_scenario("beyond-the-gap"), short), {}
    for name in ("true_targets", "jdm", "oracle"):
        errors[name] = run_scenario(gap, name, seed=0, run=3).ospa[5:, 0].mean()
    assert errors["true_targets"] < min(errors["jdm"], errors["oracle"]) - 1.0


def test_a_named_planner_takes_its_own_reward_and_does_not_search() -> None:
    named = {
        "planners": {"floor": {"kind": "true_targets", "reward": {"kind": "peecs"}}},
        "control.association": "known",
    }
    scenario = replace_fields(load_scenario("paper-a"), named)
    built: Any = build_planner(scenario, "floor")
    assert built.name == "floor"
    assert type(built.planner.planner.reward).__name__ == "PeecsReward"
    assert built.planner.planner.settings.undetected_target_value == 0.0
    assert isinstance(build_planner(scenario, "true_targets"), TrueTargetsPlanner)
