"""How a decision is evaluated: by sums over labels if beliefs, fusion and reward allow it, otherwise case by case."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from vedette.control.constraints.mask import Mask
from vedette.control.constraints.paths import VisibilityGraph, visibility_graph
from vedette.control.constraints.protocol import Constraint
from vedette.control.evaluator import Evaluator
from vedette.control.inputs import check_state, mask_of_decision, options_of
from vedette.control.plan import SamplingOutcome
from vedette.control.rewards.base import LabelReward, PowerReward, Reward, may_replace
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import (
    LMB,
    LabelledDensity,
    as_lmb,
    at_dominant_components,
    existence_probabilities,
    resolve_labels,
)
from vedette.fusion import (
    Clmb,
    CmDeltaGlmb,
    Fusion,
    LogLinearFusion,
    LogLinearPool,
    ParallelUpdate,
    requires_common_prior,
)
from vedette.models.arguments import provides, reject
from vedette.platforms import Options
from vedette.tracking import State

AnyReward: TypeAlias = Reward | PowerReward | LabelReward | ExpectedLossReward


_PARALLEL = ParallelUpdate()  # fusion assumed by the expected loss
_PLANNED_ON_LMBS = "planned on the LMBs of the GLMB beliefs: {}"


class PlanningBeliefs(NamedTuple):
    """The beliefs and the fusion that a decision is planned on."""

    state: State
    fusion: Fusion
    rule: LogLinearPool | None  # how densities are summed; None if the decision is not a sum
    notes: tuple[str, ...]  # notes on their form


@dataclass(frozen=True, slots=True, eq=False)
class Preparation:
    """The prepared inputs of one decision, which makes evaluators on fresh samples."""

    sensors: tuple[MobileSensor, ...]  # as in the planners
    settings: PlanningSettings  # as in the planners
    reward: AnyReward  # as in the planners
    planned: PlanningBeliefs  # beliefs and fusion in the form that they are planned on
    options: tuple[Options, ...]  # for each sensor
    mask: Mask | None  # feasible joint actions. None: all
    graph: VisibilityGraph  # of the zones that constraints forbid

    @classmethod
    def of(
        cls,
        sensors: Sequence[MobileSensor],
        fusion: Fusion,
        settings: PlanningSettings,
        reward: AnyReward,
        state: State,
        poses: Any,
        constraints: Sequence[Constraint] = (),
    ) -> "Preparation":
        """Return the preparation. Raises `InputError` for invalid inputs."""
        options = options_of(sensors, poses, settings)
        planned = planning_beliefs(sensors, fusion, settings, reward, state)
        mask = None
        if constraints:
            mask = mask_of_decision(constraints, sensors, options, state, np.asarray(poses), settings)
        return cls(tuple(sensors), settings, reward, planned, options, mask, visibility_graph(constraints))

    @property
    def races(self) -> bool:
        """Whether samples are added until the decision is certain. The expected loss needs no samples."""
        return self.settings.confidence is not None and not isinstance(self.reward, ExpectedLossReward)

    @property
    def certainty(self) -> SamplingOutcome | None:
        """The sampling outcome of a decision that does not race."""
        return None if self.settings.confidence is None else SamplingOutcome("no samples", 1.0, 0, (), ())

    def evaluator(
        self, num_samples: int, options: tuple[Options, ...] | None = None, *, rng: np.random.Generator
    ) -> Evaluator:
        """Return the evaluator on newly drawn samples. options: a subset of them. Raises as `JointPlanner.plan`."""
        own, settings = options or self.options, self.settings
        if num_samples != settings.num_samples:
            settings = replace(settings, num_samples=num_samples)
        sensors, reward, (state, fusion, rule, notes) = self.sensors, self.reward, self.planned
        if rule is None:
            assert not isinstance(reward, ExpectedLossReward)
            evaluator = Evaluator.of_cases(sensors, own, fusion, settings, reward, state, rng=rng)
        else:
            evaluator = Evaluator.of_sums(
                sensors, own, rule, settings, reward, state, horizons=None, graph=self.graph, rng=rng
            )
        all_notes = (
            *state_notes(sensors, settings, state, sums=rule is not None),
            *(self.mask.notes if self.mask is not None else ()),
            *notes,
        )
        evaluator.notes.update(dict.fromkeys(all_notes))
        return evaluator


def state_notes(
    sensors: Sequence[MobileSensor], settings: PlanningSettings, state: State, *, sums: bool
) -> tuple[str, ...]:
    """Return why undetected targets are not included, though requested, and which sensors do not scan.

    All courses of a sensor that does not scan within the horizon are equivalent. sums: whether rewards are sums over
    labels.
    """
    notes = []
    if settings.undetected_target_value and not (sums and state.undetected is not None):
        reason = "the state has no intensity of them" if state.undetected is None else "rewards are no sums over labels"
        notes.append(f"targets not found yet are not looked for: {reason}")
    for s, sensor in enumerate(sensors):
        if sensor.scan_times is not None and not sensor.scans(state.time, settings).any():
            notes.append(f"sensor {s + 1}: no scan within the horizon; all of its courses are worth the same")
    return tuple(notes)


def check_sums(
    purpose: str, num_sensors: int, fusion: Fusion, settings: PlanningSettings, reward: AnyReward
) -> LogLinearPool:
    """Return how densities are summed if beliefs are LMBs, or are planned on as LMBs.

    Raises `InputError`, with the `purpose`, for settings, a reward or a fusion with which a decision is not a sum over
    labels.
    """
    rule = _rule_of_lmbs(num_sensors, _of_lmbs(fusion), settings, reward)
    if rule is None:
        if settings.association != "known":
            raise reject("settings.association", f"known, for {purpose}", settings.association)
        expected = f"a reward and a fusion of LMBs that are sums over labels, for {purpose}"
        raise reject("reward, fusion", expected, f"{type(reward).__name__}, {type(fusion).__name__}")
    return rule


def planning_beliefs(
    sensors: Sequence[MobileSensor],
    fusion: Fusion,
    settings: PlanningSettings,
    reward: AnyReward,
    state: State,
    reason: str = "",
) -> PlanningBeliefs:
    """Return the beliefs in the form that they are planned on.

    reason: reason to convert GLMBs to LMBs in any case. Raises `InputError` for an invalid state.
    """
    check_state(sensors, state)
    if isinstance(reward, ExpectedLossReward):
        return _planned_on_loss(fusion, state, reason or "the expected loss asks for no more")
    num_sensors, beliefs, notes = len(sensors), (*state.local, state.fused), tuple[str, ...]()
    # A fusion that divides by the common prediction needs beliefs that have one.
    from_one = requires_common_prior(fusion)
    if _has_glmb(beliefs) and (reason := reason or _why_lmbs(num_sensors, fusion, settings, beliefs)):
        # Ambiguous labels are resolved only in a single belief; several beliefs would resolve them differently.
        as_planned = resolve_labels if from_one or len(set(map(id, beliefs))) == 1 else as_lmb
        converted: dict[int, LMB] = {}
        for belief in (state.fused,) if from_one else beliefs:
            if id(belief) not in converted:
                converted[id(belief)] = as_planned(belief)
        local = state.local if from_one else tuple([converted[id(belief)] for belief in state.local])
        state = replace(state, local=local, fused=converted[id(state.fused)])
        notes = (_PLANNED_ON_LMBS.format(reason),)
        fusion = _of_lmbs(fusion)
    if from_one:
        state = replace(state, local=(state.fused,) * num_sensors)
    summed = not _has_glmb((*state.local, state.fused))
    return PlanningBeliefs(
        state, fusion, _rule_of_lmbs(num_sensors, fusion, settings, reward) if summed else None, notes
    )


def _planned_on_loss(fusion: Fusion, state: State, reason: str) -> PlanningBeliefs:
    """Return the fused belief for all sensors: an LMB with the heaviest Gaussian of each label.

    reason: text of the note.
    """
    fused, num_sensors, notes = state.fused, len(state.local), tuple[str, ...]()
    if _has_glmb((*state.local, fused)):
        fused, fusion, notes = resolve_labels(fused), _of_lmbs(fusion), (_PLANNED_ON_LMBS.format(reason),)
    fused = at_dominant_components(fused)
    state = replace(state, local=(fused,) * num_sensors, fused=fused)
    return PlanningBeliefs(state, fusion, _PARALLEL.log_linear_pool(num_sensors), notes)


def _of_lmbs(fusion: Fusion) -> Fusion:
    return _clmb(tuple(fusion.weights)) if isinstance(fusion, CmDeltaGlmb) else fusion


@lru_cache(maxsize=100)
def _clmb(weights: tuple[float, ...]) -> Clmb:
    """Return the fusion with these weights (cached, because the weights are checked)."""
    return Clmb(weights)


def _has_glmb(beliefs: Sequence[LabelledDensity]) -> bool:
    return not all([belief.is_lmb for belief in beliefs])


def _why_lmbs(num_sensors: int, fusion: Fusion, settings: PlanningSettings, beliefs: Sequence[LabelledDensity]) -> str:
    """Return why GLMBs are planned on as their LMBs, empty if they are not. beliefs: the fused one last."""
    if requires_common_prior(fusion):
        return f"{type(fusion).__name__} fuses LMBs"
    if any(belief.is_product for belief in beliefs):
        return "products of GLMBs always are"
    expected = float(existence_probabilities(beliefs[-1])[1].sum())
    if num_sensors > settings.max_glmb_sensors:
        return f"{num_sensors} sensors, of at most {settings.max_glmb_sensors}"
    if expected > settings.max_glmb_targets or settings.max_glmb_targets == 0:
        return f"{expected:.1f} targets expected, of at most {settings.max_glmb_targets}"
    return ""


def _rule_of_lmbs(
    num_sensors: int, fusion: Fusion, settings: PlanningSettings, reward: AnyReward
) -> LogLinearPool | None:
    """Return how densities are summed if they are LMBs, or None if the decision is not a sum."""
    if isinstance(reward, ExpectedLossReward):
        return _PARALLEL.log_linear_pool(num_sensors)
    if settings.association != "known":
        return None
    if not (provides(reward, PowerReward) or provides(reward, LabelReward)):
        return None
    if not may_replace(reward, "combine", "__call__"):
        return None
    if not provides(fusion, LogLinearFusion) or not may_replace(fusion, "log_linear_pool", "fuse"):
        return None
    rule: LogLinearPool = fusion.log_linear_pool(num_sensors)
    return rule
