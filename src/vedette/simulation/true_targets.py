"""Densities of the true targets: the filters' labels of them, and a planner that decides on such densities."""

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

# Standard deviation of the components after the position for a target without a label, relative to the cutoff.
_LOST = 0.1


class TrackedTargets(NamedTuple):
    """Labels of given targets in a density."""

    covs: Floats  # (num, dim, dim) covariance of each target's label; of the size of the cutoff without one
    found: Bools  # (num,) whether a target has a label
    false_means: Floats  # (num_false, dim) means of false estimates


@dataclass(frozen=True, slots=True, eq=False)
class TrueTargetsPlanner:
    """Planner that lets another planner decide on densities of the true targets instead of those of the filters.

    Each true target that a label is assigned to, within the cutoff, becomes a label at its true state, with the
    covariance of that label. So does a target without a label if it may still start a track, with an error of the size
    of the cutoff. False estimates stay as labels: they count as errors until a scan shows that nothing is there. Other
    labels and the intensity of undetected targets are left out. Targets that appear later are not foreseen. State
    components of the motion model that recorded targets lack, such as a turn rate, are taken as 0.

    Attributes:
        planner: the planner that decides.
        sensors: the sensors that it controls.
        cutoff: error that counts as a lost target, m.
        estimate: extracts the tracks from a density.
        truth: the targets. None: set by `with_truth`.

    Raises:
        InputError: parts of another type, or targets with more components than the motion's states.
    """

    planner: Planner
    sensors: tuple[MobileSensor, ...]
    cutoff: float = 100.0
    estimate: Estimator = best_estimate
    truth: Truth | None = None
    name: ClassVar[str] = "true_targets"

    def __post_init__(self) -> None:
        check_sensors(self.sensors)
        positive("cutoff", self.cutoff)
        if self.truth is not None:
            truth = with_components(self.truth, check_sensors(self.sensors).state_dim)
            object.__setattr__(self, "truth", truth)

    def with_truth(self, truth: Truth) -> "TrueTargetsPlanner":
        """Return the planner for the targets of a run."""
        return replace(self, truth=truth)

    def plan(self, state: State, poses: Floats, *, rng: np.random.Generator) -> Plan:
        """Return the decision on the true targets. Raises as the planner, and `InputError` without a truth."""
        instance("state", state, State)
        if self.truth is None:
            raise InputError("truth: expected the targets of the run, as of with_truth(); got None")
        plan = self.planner.plan(self._on_truth(state, self.truth), poses, rng=rng)
        return replace(plan, planner=self.name)

    def _on_truth(self, state: State, truth: Truth) -> State:
        """Return the state with densities of the trackable true targets and of the false estimates.

        Trackable targets have a label or may start a track.
        """
        instance("state.fused", state.fused, LabelledDensity)
        birth, step = check_sensors(self.sensors).birth, state.step
        ids, states = truth.at(max(step, 1) - 1)
        held = match_tracks(self.estimate, state.fused, step, states, self.cutoff)
        retained = held.found | _may_be_born(birth, step)
        places = np.concatenate([states[retained], held.false_means])
        # Labels (0, id) of targets, and then (1, number) of false estimates.
        labels = [(0, target) for target in ids[retained].tolist()] + [(1, k) for k in range(len(held.false_means))]
        densities: dict[int, Any] = {}
        for belief in (state.fused, *state.local):
            if id(belief) not in densities:
                covs = match_tracks(self.estimate, belief, step, places, self.cutoff).covs
                densities[id(belief)] = _certain(belief, labels, places, covs)
        local = tuple(densities[id(belief)] for belief in state.local)
        return replace(state, local=local, fused=densities[id(state.fused)], undetected=None)


def match_tracks(estimate: Estimator, belief: Any, step: int, states: Floats, cutoff: float) -> TrackedTargets:
    """Match a density with targets at (num, dim) states.

    Estimates are assigned first. The remaining targets are matched with the other labels of the density, however
    improbable, as the next scans may confirm them. cutoff: largest distance of a target and its label, m.
    """
    estimated = estimate(belief, step)
    stds = np.full(states.shape[1], _LOST * cutoff)
    stds[:2] = cutoff
    covs, matched = np.tile(np.diag(stds**2), (len(states), 1, 1)), np.zeros(len(states), bool)
    false = np.ones(len(estimated.means), bool)
    false[_assign(estimated.means, estimated.covs, states, cutoff, covs, matched)] = False
    if isinstance(belief, LabelledDensity) and not matched.all():
        named = {(step, index) for step, index in estimated.labels.tolist()}
        others = [target for target in belief.targets() if target.label not in named]
        if others:
            means, of_means = (np.array([getattr(target, name) for target in others]) for name in ("mean", "cov"))
            _assign(means, of_means, states, cutoff, covs, matched)
    return TrackedTargets(covs, matched, estimated.means[false])


def with_components(truth: Truth, dim: int) -> Truth:
    """Return the targets with states of `dim` components. Missing ones are 0."""
    missing = dim - truth.states.shape[1]
    if missing < 0:
        raise reject("truth", f"states of at most {dim} components, as the motion's", truth.states.shape[1])
    return replace(truth, states=np.pad(truth.states, ((0, 0), (0, missing)))) if missing else truth


def _assign(means: Floats, covs: Floats, states: Floats, cutoff: float, out: Floats, matched: Bools) -> list[int]:
    """Assign tracks within the cutoff to targets without one, set their covariances, and return the assigned tracks."""
    from scipy.optimize import linear_sum_assignment  # imported here, as it takes a third of a second

    open_, assigned = np.flatnonzero(~matched), []
    offsets = states[open_, np.newaxis, :2] - means[:, :2]
    gaps = np.minimum(np.hypot(offsets[..., 0], offsets[..., 1]), cutoff)
    for target, track in zip(*linear_sum_assignment(gaps), strict=True):
        if gaps[target, track] < cutoff:
            out[open_[target]], matched[open_[target]] = covs[track], True
            assigned.append(int(track))
    return assigned


def _may_be_born(birth: BirthModel, step: int) -> bool:
    """Return True if targets without a label may still start a track after a scan."""
    return birth.from_measurements is not None or (birth.num_sites > 0 and max(birth.steps or {step + 1}) > step)


def _certain(of_kind: LabelledDensity, labels: list[tuple[int, int]], means: Floats, covs: Floats) -> LabelledDensity:
    """Return a density, of the type of another, that is certain of these targets."""
    lmb = LMB.from_bernoullis(labels, np.ones(len(labels)), means, covs) if labels else LMB.empty(means.shape[1])
    if of_kind.is_product:
        return FactoredGLMB.of(lmb)
    return lmb if of_kind.is_lmb else as_glmb(lmb, max_hypotheses=1)[0]
