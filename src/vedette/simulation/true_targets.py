"""Beliefs about the true targets: which labels the filters hold of them, and planners that decide on such beliefs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from vedette.control import MobileSensor, Plan, Planner
from vedette.control.inputs import check_sensors
from vedette.densities import LMB, Estimator, FactoredGLMB, LabelledDensity, as_glmb, best_estimate
from vedette.errors import InputError
from vedette.kernels.base.types import Bools, Floats
from vedette.models import BirthModel
from vedette.models.arguments import instance, positive, reject
from vedette.simulation.truth import Truth
from vedette.tracking import State

# Of a target without a label, the standard deviation of components beyond the position, relative to the cutoff.
_LOST = 0.1


class TrackedTargets(NamedTuple):
    """What a belief holds of given targets."""

    covs: Floats  # (num, dim, dim) of the label of each; of the size of the cutoff where it has none
    found: Bools  # (num,) whether it has one
    false_means: Floats  # (num_false, dim) of estimates that are none of these targets


@dataclass(frozen=True, slots=True, eq=False)
class TrueTargetsPlanner:
    """The decisions of another planner with beliefs about the true targets in place of those of the filters.

    Each true target that a label of a belief is assigned to, within the cutoff, is a label at its true state, with the
    covariance that the belief has of it. A target without a label is one too where it may still start a track, with an
    error of the size of the cutoff. Estimates that are no target stay as labels: they count as errors until a scan
    shows that nothing is there. Other labels and the intensity of undetected targets are left out. Targets that appear
    later are not foreseen. Components of the motion's states that recorded targets lack, such as a turn rate, are taken
    as 0.

    Attributes:
        planner: decides.
        sensors: that it steers.
        cutoff: the error that counts as a lost target, m.
        estimate: reads the tracks off a belief.
        truth: the targets; None: `with_truth` sets them.

    Raises:
        InputError: parts of another kind, or targets with more components than the motion's states.
    """

    planner: Planner
    sensors: tuple[MobileSensor, ...]
    cutoff: float = 100.0
    estimate: Estimator = best_estimate
    truth: Truth | None = None
    name: ClassVar[str] = "told"

    def __post_init__(self) -> None:
        check_sensors(self.sensors)
        positive("cutoff", self.cutoff)
        if self.truth is not None:
            truth = with_components(self.truth, check_sensors(self.sensors).state_dim)
            object.__setattr__(self, "truth", truth)

    def with_truth(self, truth: Truth) -> TrueTargetsPlanner:
        """The same for the targets of a run."""
        return replace(self, truth=truth)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """What the planner decides on the true targets; raises what it raises, and `InputError` without a truth."""
        instance("state", state, State)
        if self.truth is None:
            raise InputError("truth: expected the targets of the run, as of with_truth(); got None")
        plan = self.planner.plan(self._on_truth(state, self.truth), poses, rng=rng)
        return replace(plan, planner=self.name)

    def _on_truth(self, state: State, truth: Truth) -> State:
        """The state with beliefs about targets that have a label or may start a track, and about false estimates."""
        instance("state.fused", state.fused, LabelledDensity)
        birth, step = check_sensors(self.sensors).birth, state.step
        ids, states = truth.at(max(step, 1) - 1)
        held = match_tracks(self.estimate, state.fused, step, states, self.cutoff)
        kept = held.found | _may_be_born(birth, step)
        places = np.concatenate([states[kept], held.false_means])
        # Labels (0, id) of targets, and then (1, number) of false estimates.
        labels = [(0, own) for own in ids[kept].tolist()] + [(1, k) for k in range(len(held.false_means))]
        made: dict[int, Any] = {}
        for belief in (state.fused, *state.local):
            if id(belief) not in made:
                covs = match_tracks(self.estimate, belief, step, places, self.cutoff).covs
                made[id(belief)] = _certain(belief, labels, places, covs)
        local = tuple(made[id(belief)] for belief in state.local)
        return replace(state, local=local, fused=made[id(state.fused)], undetected=None)


def match_tracks(estimate: Estimator, belief: Any, step: int, states: Floats, cutoff: float) -> TrackedTargets:
    """What a belief holds of targets at (num, dim) states.

    Estimates are assigned first; targets that are left go by the labels that the belief holds besides, however
    improbable: the next scans may confirm them. cutoff: m, of the distance of a target and its label.
    """
    estimated = estimate(belief, step)
    stds = np.full(states.shape[1], _LOST * cutoff)
    stds[:2] = cutoff
    covs, found = np.tile(np.diag(stds**2), (len(states), 1, 1)), np.zeros(len(states), bool)
    false = np.ones(len(estimated.means), bool)
    false[_assign(estimated.means, estimated.covs, states, cutoff, covs, found)] = False
    if isinstance(belief, LabelledDensity) and not found.all():
        named = {(step, index) for step, index in estimated.labels.tolist()}
        others = [own for own in belief.targets() if own.label not in named]
        if others:
            means, of_means = (np.array([getattr(own, name) for own in others]) for name in ("mean", "cov"))
            _assign(means, of_means, states, cutoff, covs, found)
    return TrackedTargets(covs, found, estimated.means[false])


def with_components(truth: Truth, dim: int) -> Truth:
    """The same targets with states of `dim` components, of which those that are missing are 0."""
    missing = dim - truth.states.shape[1]
    if missing < 0:
        raise reject("truth", f"states of at most {dim} components, as the motion's", truth.states.shape[1])
    return replace(truth, states=np.pad(truth.states, ((0, 0), (0, missing)))) if missing else truth


def _assign(means: Floats, covs: Floats, states: Floats, cutoff: float, out: Floats, found: Bools) -> list[int]:
    """Give targets that have none yet the covariance of a track within the cutoff; the tracks that were assigned."""
    from scipy.optimize import linear_sum_assignment  # here, as it takes a third of a second to load

    open_, assigned = np.flatnonzero(~found), []
    offsets = states[open_, np.newaxis, :2] - means[:, :2]
    gaps = np.minimum(np.hypot(offsets[..., 0], offsets[..., 1]), cutoff)
    for target, track in zip(*linear_sum_assignment(gaps), strict=True):
        if gaps[target, track] < cutoff:
            out[open_[target]], found[open_[target]] = covs[track], True
            assigned.append(int(track))
    return assigned


def _may_be_born(birth: BirthModel, step: int) -> bool:
    """Whether targets without a label may still start a track after a scan."""
    return birth.from_measurements is not None or (birth.num_sites > 0 and max(birth.steps or {step + 1}) > step)


def _certain(of_kind: LabelledDensity, labels: list[tuple[int, int]], means: Floats, covs: Floats) -> LabelledDensity:
    """The belief, of the kind of another, that is certain of these targets."""
    lmb = LMB.from_bernoullis(labels, np.ones(len(labels)), means, covs) if labels else LMB.empty(means.shape[1])
    if of_kind.is_product:
        return FactoredGLMB.of(lmb)
    return lmb if of_kind.is_lmb else as_glmb(lmb, max_hypotheses=1)[0]
