"""Targets beyond the cutoff of the expected loss: what plans say of them, against errors worked out one by one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from control.examples import KNOWN, Situation, decided, situation
from vedette.control import ExpectedLossReward, HorizonPlanner, IndependentPlanner, JointPlanner, KullbackLeiblerReward
from vedette.densities import LMB
from vedette.internal.probabilities import expit

PLANNERS = (JointPlanner, IndependentPlanner, HorizonPlanner)


def given() -> Situation:
    return situation("lmb", settings=KNOWN)


def alone(of: Situation, label: int) -> Situation:
    """With one of the labels."""
    logits = np.where(np.arange(of.fused.tracks.num_tracks) == label, of.fused.existence_logit, -30.0)
    one = LMB(of.fused.tracks, logits)
    return replace(of, beliefs=(one,) * len(of.sensors), fused=one)


def errors(of: Situation, chosen: tuple[int, ...]) -> Any:
    """(num_labels,) existence and error at the end if detected, out of rewards under a cutoff that cuts nothing off."""
    existence = expit(of.fused.existence_logit)
    found = []
    for label, own in enumerate(existence):
        tiny = -decided(alone(of, label), JointPlanner, ExpectedLossReward(1e-3)).tables[0].mean[chosen] / own
        assert tiny == pytest.approx(1e-3, rel=1e-6)
        # These cutoffs are above all errors. A label that is not detected is not reported, and costs the cutoff.
        near, far = (
            -decided(alone(of, label), JointPlanner, ExpectedLossReward(cutoff, 2.0)).tables[0].mean[chosen] / own
            for cutoff in (100.0, 110.0)
        )
        missed = (far - near) / (110.0**2 - 100.0**2)
        found.append(np.sqrt((near - missed * 100.0**2) / (1.0 - missed)))
    return existence, np.array(found)


@pytest.mark.parametrize("kind", PLANNERS)
def test_a_plan_tells_of_targets_that_do_not_count(kind: Any) -> None:
    of = given()
    for cutoff in (5.0, 12.0, 15.0, 20.0, 25.0, 30.0, 60.0):
        made = decided(of, kind, ExpectedLossReward(cutoff))
        existence, error = errors(of, made.chosen)
        lost = existence[error > cutoff].sum() > 0.1 * existence.sum()
        told = [note for note in made.notes if note.startswith("cutoff of the expected loss")]
        assert len(told) == lost
        if lost:
            assert f"{cutoff:.4g} m: {existence[error > cutoff].sum():.2g} of {existence.sum():.2g} targets" in told[0]
            assert f"errors up to {error.max():.3g} m" in told[0]


@pytest.mark.parametrize("kind", PLANNERS)
def test_nothing_is_told_of_others(kind: Any) -> None:
    of = given()
    for reward in (ExpectedLossReward(), KullbackLeiblerReward()):
        assert not [note for note in decided(of, kind, reward).notes if "cutoff" in note]


def test_targets_out_of_view_are_none_of_the_cutoff_s_doing() -> None:
    """Their errors are beyond any cutoff that there is, and nobody could help it."""
    of = situation("lmb", settings=KNOWN)
    far = LMB(of.fused.tracks, of.fused.existence_logit)
    away = replace(of, fused=far, poses=of.poses + np.array([1e5, 0.0, 0.0]))
    assert not [note for note in decided(away, JointPlanner, ExpectedLossReward(5.0)).notes if "cutoff" in note]
