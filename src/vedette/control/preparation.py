"""How a decision is evaluated: by sums over labels where beliefs, fusion and reward allow it, else case by case."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vedette.control.additive.evaluator import AdditiveEvaluator
from vedette.control.evaluator import Evaluator
from vedette.control.inputs import Belief, check_state, options_of
from vedette.control.rewards.base import LabelReward, PowerReward, Reward, speaks_for
from vedette.control.rewards.loss import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import GLMB, LMB, existence_probabilities, glmb_to_lmb
from vedette.fusion import Clmb, CmDeltaGlmb, Fusion, Linear, LinearRule, ParallelUpdate
from vedette.models.arguments import reject
from vedette.tracking import State

AnyEvaluator: TypeAlias = Evaluator | AdditiveEvaluator
AnyReward: TypeAlias = Reward | PowerReward | LabelReward | ExpectedLossReward


class _Planned(NamedTuple):
    """What is planned on, and what a reader must know of it."""

    state: State
    fusion: Fusion
    notes: tuple[str, ...]


def prepare(
    sensors: Sequence[MobileSensor],
    fusion: Fusion,
    settings: PlanningSettings,
    reward: AnyReward,
    state: State,
    poses: Any,
    *,
    rng: np.random.Generator,
) -> AnyEvaluator:
    """The evaluator of one decision.

    Raises:
        InputError: inputs that do not fit.
        ModelError, NumericalError: as the filters.
    """
    options = options_of(sensors, poses, settings)
    check_state(sensors, state)
    planned = _planned(len(sensors), fusion, settings, reward, state)
    rule = _rule(len(sensors), planned.fusion, settings, reward, planned.state)
    if rule is None:
        assert not isinstance(reward, ExpectedLossReward)
        evaluator: AnyEvaluator = Evaluator.prepare(
            sensors, options, planned.fusion, settings, reward, planned.state, rng=rng
        )
    else:
        fused, local = planned.state.fused, planned.state.local
        evaluator = AdditiveEvaluator.prepare(sensors, options, rule, settings, reward, fused, local, rng=rng)
    evaluator.notes.update(dict.fromkeys(planned.notes))
    return evaluator


class Sums(NamedTuple):
    """What decisions that are sums over labels are made on."""

    rule: LinearRule
    fused: LMB
    local: tuple[LMB, ...]
    notes: tuple[str, ...]


def prepare_sums(
    sensors: Sequence[MobileSensor], fusion: Fusion, settings: PlanningSettings, reward: AnyReward, state: State
) -> Sums:
    """For decisions that can be nothing else; GLMB beliefs are planned on as LMBs.

    Raises:
        InputError: inputs that do not fit, or settings, reward or fusion that make a decision no sum over labels.
    """
    check_state(sensors, state)
    notes: tuple[str, ...] = ()
    if _has_glmb((*state.local, state.fused)):
        notes = ("planned on the LMBs of the GLMB beliefs: so are all sequences of decisions",)
        state = replace(state, local=tuple(map(_as_lmb, state.local)), fused=_as_lmb(state.fused))
        if isinstance(fusion, CmDeltaGlmb):
            fusion = Clmb(fusion.weights)
    planned = _planned(len(sensors), fusion, settings, reward, state)
    rule = _rule(len(sensors), planned.fusion, settings, reward, planned.state)
    if rule is None:
        if settings.association != "known":
            raise reject("settings.association", "known, for sequences of decisions", settings.association)
        expected = "a reward and a fusion of LMBs that are sums over labels, for sequences of decisions"
        raise reject("reward, fusion", expected, f"{type(reward).__name__}, {type(planned.fusion).__name__}")
    fused, local = planned.state.fused, planned.state.local
    assert isinstance(fused, LMB)
    return Sums(rule, fused, tuple(map(_as_lmb, local)), (*notes, *planned.notes))


def _planned(num_sensors: int, fusion: Fusion, settings: PlanningSettings, reward: AnyReward, state: State) -> _Planned:
    """The beliefs in the form in which they are planned on."""
    beliefs = (*state.local, state.fused)
    why = _why_lmbs(num_sensors, fusion, settings, reward, state.fused) if _has_glmb(beliefs) else ""
    notes: tuple[str, ...] = ()
    if why:
        converted: dict[int, LMB] = {id(belief): _as_lmb(belief) for belief in beliefs}
        local = tuple(converted[id(belief)] for belief in state.local)
        state = replace(state, local=local, fused=converted[id(state.fused)])
        notes = (f"planned on the LMBs of the GLMB beliefs: {why}",)
        if isinstance(fusion, CmDeltaGlmb):
            fusion = Clmb(fusion.weights)
    # What divides by the common prediction needs beliefs that have one.
    if getattr(fusion, "shares_prediction", False) or isinstance(reward, ExpectedLossReward):
        state = replace(state, local=(state.fused,) * num_sensors)
    return _Planned(state, fusion, notes)


def _has_glmb(beliefs: Sequence[Belief]) -> bool:
    return any(isinstance(belief, GLMB) for belief in beliefs)


def _as_lmb(belief: Belief) -> LMB:
    return belief if isinstance(belief, LMB) else glmb_to_lmb(belief)


def _why_lmbs(num_sensors: int, fusion: Fusion, settings: PlanningSettings, reward: AnyReward, fused: Belief) -> str:
    """Why GLMBs are planned on their LMBs; empty where they are not."""
    if isinstance(reward, ExpectedLossReward):
        return "the expected loss asks for no more"
    if getattr(fusion, "shares_prediction", False):
        return f"{type(fusion).__name__} fuses LMBs"
    expected = float(existence_probabilities(fused)[1].sum())
    if num_sensors > settings.max_glmb_sensors:
        return f"{num_sensors} sensors, of at most {settings.max_glmb_sensors}"
    if expected > settings.max_glmb_targets:
        return f"{expected:.1f} targets expected, of at most {settings.max_glmb_targets}"
    return ""


def _rule(
    num_sensors: int, fusion: Fusion, settings: PlanningSettings, reward: AnyReward, state: State
) -> LinearRule | None:
    """How densities are summed, None where the decision is no sum."""
    if isinstance(reward, ExpectedLossReward):
        return ParallelUpdate().linear_rule(num_sensors)
    if settings.association != "known" or _has_glmb((*state.local, state.fused)):
        return None
    if not isinstance(reward, PowerReward | LabelReward) or not speaks_for(reward, "combine", "__call__"):
        return None
    if not isinstance(fusion, Linear) or not speaks_for(fusion, "linear_rule", "fuse"):
        return None
    return fusion.linear_rule(num_sensors)
