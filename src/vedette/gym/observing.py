"""What a policy is shown before a decision: beliefs, sensors and their actions as arrays of fixed size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vedette.control import Constraint, MobileSensor, PlanningSettings
from vedette.control.constraints import Mask, nearest_feasible
from vedette.control.inputs import mask_of_decision, options_of, single_mask
from vedette.densities import LabelledDensity, best_estimate
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import as_array, dimension, reject
from vedette.platforms import Options
from vedette.simulation import Timetable
from vedette.tracking import State

Observation: TypeAlias = dict[str, NDArray[Any]]


class DecisionContext(NamedTuple):
    """A decision that is to be made.

    state, poses: what is believed, and (num_sensors, 3 or more) where the sensors are. options: of each sensor what it
    may do. mask: what constraints allow; None where there are none. observation: what a policy is shown of all that.
    """

    state: State
    poses: Floats
    options: tuple[Options, ...]
    mask: Mask | None
    observation: Observation


@dataclass(frozen=True, slots=True, eq=False)
class ObservationEncoder:
    """What shows decisions to a policy, and takes its answers; environments and planners have the same.

    Attributes:
        sensors: all of them; those that have more than one action are decided about.
        settings: the horizon, over which courses are told apart.
        constraints: what the sensors must not do.
        timetable: when they scan and decide.
        num_labels: targets that are shown, those that most probably exist.

    Raises:
        InputError: `num_labels` that is no number of at least 1.
    """

    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings
    constraints: tuple[Constraint, ...]
    timetable: Timetable
    num_labels: int = 10

    def __post_init__(self) -> None:
        dimension("num_labels", self.num_labels)

    @classmethod
    def of(cls, parts: Mapping[str, Any], num_labels: int = 10) -> ObservationEncoder:
        """Of what a planner of a scenario is made of (`vedette.scenarios.build.build_parts`)."""
        timetable = parts["oracle"]["timetable"]
        return cls(parts["sensors"], parts["settings"], parts["constraints"], timetable, num_labels)

    def decision_context(self, state: State, poses: Floats) -> DecisionContext:
        """The decision at hand.

        Raises `InputError` for poses that do not fit, or no sensor with a choice.
        """
        options = options_of(self.sensors, poses, self.settings)
        mask = mask_of_decision(self.constraints, self.sensors, options, state.fused, poses, self.settings)
        return DecisionContext(state, poses, options, mask, self._observation(state, poses, options, mask))

    def resolve_actions(self, context: DecisionContext, actions: ArrayLike) -> tuple[tuple[int, ...], int]:
        """The index of each sensor's action, of those that decide as a policy says, and how many were moved.

        A joint action that constraints forbid is moved to one near it, as that of `vedette.control.RandomPlanner` is.
        actions: (num_deciding,) indices. Raises `InputError` for what are none.
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
        found = belief_arrays(state.fused, state.step, self.num_labels)
        found |= {"poses": poses.astype(np.float32), "time": self._times(state.step)}
        found |= {"ends": ends, "action_mask": masks}
        if state.undetected is not None:
            found["undetected"] = state.undetected.expected.astype(np.float32)
        return found

    def _times(self, step: int) -> NDArray[np.float32]:
        """(2,) s to the next decision, or where there is none to the end, and to the end."""
        times, last = self.timetable.times, len(self.timetable.times)
        due = next((own for own in self.timetable.decision_steps if own > step), last)
        return np.asarray(times[[due - 1, -1]] - times[step - 1], np.float32)


def deciding_sensors(options: tuple[Options, ...]) -> tuple[int, ...]:
    """The sensors that have more than one action; `InputError` where none has."""
    found = tuple(s for s, own in enumerate(options) if len(own.actions) > 1)
    if not found:
        raise InputError("sensors: expected one with a choice of actions at least; got none")
    return found


def belief_arrays(belief: Any, step: int, num_labels: int) -> Observation:
    """The targets that most probably exist, those first, as arrays of `num_labels` rows; rows beyond them are 0.

    Mean and covariance are those of a label's marginal density; where a belief has no labels, targets are those that
    are estimated.
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
    return {"existence": existence, "means": means, "sqrt_covs": roots, "mask": mask}
