"""Decisions on products of GLMBs: those on their LMBs, and what constraints say of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import POSES, SETTINGS, A, B, C, Situation, glmb, situation
from vedette.control import (
    CauchySchwarzReward,
    ExpectedLossReward,
    JointPlanner,
    RandomPlanner,
    VoidProbability,
    void_probability,
)
from vedette.control.prediction import predicted
from vedette.densities import FactoredGLMB, as_glmb, as_lmb
from vedette.errors import InputError
from vedette.filters import DeltaGlmbFilter
from vedette.fusion import Clmb, CmDeltaGlmb


class Factored(DeltaGlmbFilter):
    """A filter that believes in products of GLMBs."""

    def initial(self) -> Any:
        """Of no factor."""
        return FactoredGLMB.empty(4)


def _product(seed: int) -> FactoredGLMB:
    rng = np.random.default_rng(seed)
    return FactoredGLMB.from_factors([glmb(((A, B), (A,), (A, B), ()), rng, 2), glmb(((), (C,)), rng)], 4)


def factored() -> Situation:
    """Two sensors whose filters believe in products."""
    example = situation("delta")
    sensors = tuple(replace(own, filter=Factored(own.filter.targets, own.filter.sensor)) for own in example.sensors)
    beliefs, fusion = (_product(1), _product(2)), CmDeltaGlmb((0.5, 0.5))
    return replace(example, sensors=sensors, beliefs=beliefs, fusion=fusion, fused=fusion.fuse(beliefs)[0])


@pytest.mark.parametrize(
    ("association", "reward"),
    [("full", CauchySchwarzReward()), ("known", CauchySchwarzReward()), ("known", ExpectedLossReward())],
)
def test_decisions_are_those_on_the_lmbs(association: Any, reward: Any) -> None:
    example, settings = factored(), replace(SETTINGS, association=association)
    planner = JointPlanner(example.sensors, example.fusion, settings, reward)
    plan = planner.plan(*example.arguments, rng=np.random.default_rng(1))
    assert any(note.startswith("planned on the LMBs of the GLMB beliefs") for note in plan.notes)
    plain = situation("lmb")
    lmbs = tuple(as_lmb(belief) for belief in (*example.beliefs, example.fused))
    own = JointPlanner(plain.sensors, Clmb((0.5, 0.5)), settings, reward)
    expected = own.plan(replace(plain, beliefs=lmbs[:2], fused=lmbs[2]).state, POSES[:2], rng=np.random.default_rng(1))
    assert plan.chosen == expected.chosen
    assert plan.expected_rewards == expected.expected_rewards


def test_beliefs_of_another_kind_are_refused() -> None:
    example = factored()
    planner = JointPlanner(example.sensors, example.fusion, SETTINGS)
    mixed = replace(example, beliefs=(example.beliefs[0], as_lmb(example.beliefs[1])))
    with pytest.raises(InputError, match=r"state.local\[1\]: expected FactoredGLMB; got LMB"):
        planner.plan(*mixed.arguments, rng=np.random.default_rng(1))


def test_constraints_look_at_the_product() -> None:
    """Void probabilities ahead are those of the GLMB of all combinations."""
    example, motion = factored(), situation("delta").sensors[0].filter.targets.motion
    ahead = predicted(example.fused, motion, 2, 4.0)
    ahead.validate()
    whole = predicted(as_glmb(example.fused, max_hypotheses=10**6)[0], motion, 2, 4.0)
    centres = POSES[:, :2]
    np.testing.assert_allclose(
        void_probability(ahead, centres, 300.0), void_probability(whole, centres, 300.0), rtol=1e-10
    )
    planner = RandomPlanner(example.sensors, SETTINGS, (VoidProbability(100.0, 0.9),))
    planner.plan(*example.arguments, rng=np.random.default_rng(1))
