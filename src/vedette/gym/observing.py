"""Observations of a policy before a decision: beliefs, sensors and their actions as arrays of fixed size."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vedette.control import Constraint, MobileSensor, PlanningSettings
from vedette.control.constraints.mask import Mask, nearest_feasible
from vedette.control.inputs import mask_of_decision, options_of, single_mask
from vedette.densities import LabelledDensity, best_estimate
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array, reject
from vedette.models.fields import Checked, Count
from vedette.platforms import Options
from vedette.simulation import Schedule
from vedette.tracking import State

Observation: TypeAlias = dict[str, NDArray[Any]]


class DecisionContext(NamedTuple):
    """A pending decision."""

    state: State  # the belief, and (num_sensors, 3 or more) poses of the sensors
    poses: Floats
    options: tuple[Options, ...]  # possible actions of each sensor
    mask: Mask | None  # actions that constraints allow, or None without constraints
    observation: Observation  # what the policy receives


@dataclass(frozen=True, slots=True, eq=False)
class ObservationEncoder(Checked):
    """Converts decisions into observations and answers of a policy into actions, for environments and planners alike.

    Attributes:
        sensors: all sensors. Those with more than one action are decided about.
        settings: the horizon, over which courses are distinguished.
        constraints: constraints on the sensors.
        schedule: times of scans and decisions.
        num_labels: number of targets in an observation, the most probable ones.
    """

    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings
    constraints: tuple[Constraint, ...]
    schedule: Schedule
    num_labels: Count = 10

    @property
    def num_modes(self) -> int:
        """Number of modes of motion, or 0 without modes."""
        return len(getattr(self.sensors[0].filter.targets.motion, "names", ()))

    @classmethod
    def of(cls, parts: Mapping[str, Any], num_labels: int = 10) -> "ObservationEncoder":
        """Return the encoder for the parts of a scenario's planner (`vedette.scenarios.build.build_parts`)."""
        schedule = parts["oracle"]["schedule"]
        return cls(parts["sensors"], parts["settings"], parts["constraints"], schedule, num_labels)

    def decision_context(self, state: State, poses: Floats) -> DecisionContext:
        """Return the pending decision.

        Raises `InputError` for poses that do not fit, or if no sensor has a choice.
        """
        options = options_of(self.sensors, poses, self.settings)
        mask = mask_of_decision(self.constraints, self.sensors, options, state, poses, self.settings)
        return DecisionContext(state, poses, options, mask, self._observation(state, poses, options, mask))

    def resolve_actions(self, context: DecisionContext, actions: ArrayLike) -> tuple[tuple[int, ...], int]:
        """Return the index of each sensor's action, as chosen by the policy, and the number that constraints changed.

        A joint action that violates constraints is replaced by one near it, as in `vedette.control.RandomPlanner`.
        actions: (num_deciding,) indices. Raises `InputError` for invalid indices.
        """
        deciding = deciding_sensors(context.options)
        given = np.atleast_1d(as_array("actions", actions, "iu", "indices of actions"))
        sizes = np.array([len(context.options[s].actions) for s in deciding])
        if given.shape != sizes.shape or (given < 0).any() or (given >= sizes).any():
            raise reject("actions", f"{len(sizes)} indices below {sizes.tolist()}", given)
        indices = dict(zip(deciding, given.tolist(), strict=True))
        every = [indices.get(s, 0) for s in range(len(context.options))]
        if context.mask is None:
            return tuple(every), 0
        wanted = [int(own.which[index]) for own, index in zip(context.options, every, strict=True)]
        courses = nearest_feasible(context.mask, wanted)
        kept = [
            index if course == before else own.first_action(course)
            for own, index, course, before in zip(context.options, every, courses, wanted, strict=True)
        ]
        return tuple(kept), sum(course != before for course, before in zip(courses, wanted, strict=True))

    def _observation(self, state: State, poses: Floats, options: tuple[Options, ...], mask: Mask | None) -> Observation:
        deciding = deciding_sensors(options)
        most = max(len(options[s].actions) for s in deciding)
        masks = np.zeros((len(deciding), most), np.int8)
        ends = np.zeros((len(deciding), most, poses.shape[1]), np.float32)
        for row, s in enumerate(deciding):
            own, num = options[s], len(options[s].actions)
            masks[row, :num] = single_mask(mask, s, len(own.courses))[own.which]
            ends[row, :num] = own.courses[own.which, -1]
        found = belief_arrays(state.fused, state.step, self.num_labels, self.num_modes)
        found |= {"poses": poses.astype(np.float32), "time": self._times(state.step)}
        found |= {"ends": ends, "action_mask": masks}
        if state.undetected is not None:
            found["undetected"] = state.undetected.expected.astype(np.float32)
        return found

    def _times(self, step: int) -> NDArray[np.float32]:
        """Time in s to the next decision (to the end if there is none), and to the end, shape (2,)."""
        times, last = self.schedule.times, len(self.schedule.times)
        due = next((own for own in self.schedule.decision_steps if own > step), last)
        return np.asarray(times[[due - 1, -1]] - times[step - 1], np.float32)


def deciding_sensors(options: tuple[Options, ...]) -> tuple[int, ...]:
    """Return the sensors that have more than one action. Raises `InputError` if there are none."""
    found = tuple(s for s, own in enumerate(options) if len(own.actions) > 1)
    if not found:
        raise InputError("sensors: expected one with a choice of actions at least; got none")
    return found


def belief_arrays(belief: Any, step: int, num_labels: int, num_modes: int = 0) -> Observation:
    """Return the most probable targets, in descending order, as arrays of `num_labels` rows. Unused rows are 0.

    Mean and covariance are those of a label's marginal density. For a belief without labels, the targets are the
    estimated ones. With modes of motion, also the probability of each mode of each target, or 0 for a belief without
    labels.
    """
    rows = list((belief if isinstance(belief, LabelledDensity) else best_estimate(belief, step)).targets())
    rows = [rows[i] for i in np.argsort([-row.existence for row in rows], kind="stable")[:num_labels]]
    dim = belief.state_dim
    existence, mask = np.zeros(num_labels, np.float32), np.zeros(num_labels, np.int8)
    means, roots = np.zeros((num_labels, dim), np.float32), np.zeros((num_labels, dim, dim), np.float32)
    if rows:
        num = len(rows)
        existence[:num], mask[:num] = [row.existence for row in rows], 1
        means[:num] = [row.mean for row in rows]
        roots[:num] = np.linalg.cholesky(np.array([row.cov for row in rows]))
    found: Observation = {"existence": existence, "means": means, "sqrt_covs": roots, "mask": mask}
    if num_modes:
        found["mode_probs"] = np.zeros((num_labels, num_modes), np.float32)
        for i, row in enumerate(rows):
            found["mode_probs"][i, : len(row.mode_probs)] = row.mode_probs
    return found
