"""Validation of the inputs of planners, and the options of their sensors."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from vedette.control.constraints.mask import Mask
from vedette.control.constraints.masks import feasible_action_mask
from vedette.control.constraints.protocol import Constraint, ConstraintContext
from vedette.control.prediction import predicted
from vedette.control.rewards.base import LabelReward, PowerReward
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import LabelledDensity
from vedette.errors import InputError
from vedette.filters import common_target_model
from vedette.fusion import Fusion
from vedette.kernels.base.types import BUDGET, HEADING, POINTING, Floats
from vedette.kernels.labelled.validity import is_valid_glmb, is_valid_lmb
from vedette.kernels.planning.ascent import Allowed
from vedette.models import TargetModel
from vedette.models.arguments import float_array, instance, reject, sequence, warn_if_degrees
from vedette.platforms import Options, options_at
from vedette.platforms.camera import is_camera
from vedette.tracking import State


def check_sensors(sensors: Sequence[MobileSensor]) -> TargetModel:
    """Return the sensors' target model. Raises `InputError` unless there is a sensor and all have the same model."""
    if len(sensors) == 0 or not all(isinstance(sensor, MobileSensor) for sensor in sensors):
        raise reject("sensors", "at least one MobileSensor", sensors)
    return common_target_model([sensor.filter for sensor in sensors])


def check_control_inputs(planner: Any) -> None:
    """Store sensors and constraints of a planner as tuples. Raises `InputError` if they or the settings are invalid."""
    for name, expected in (("sensors", "at least one MobileSensor"), ("constraints", "constraints in a tuple")):
        object.__setattr__(planner, name, sequence(name, getattr(planner, name), expected))
    check_sensors(planner.sensors)
    instance("settings", planner.settings, PlanningSettings)
    for i, constraint in enumerate(planner.constraints):
        instance(f"constraints[{i}]", constraint, Constraint)


def check_reward_inputs(fusion: Any, reward: Any, notes: Any = ()) -> None:
    """Raise `InputError` for an invalid fusion, reward or notes of a planner."""
    if not all(isinstance(note, str) for note in sequence("notes", notes, "texts in a tuple")):
        raise reject("notes", "texts in a tuple", notes)
    instance("fusion", fusion, Fusion)
    if not callable(reward) and not isinstance(reward, PowerReward | LabelReward | ExpectedLossReward):
        raise reject("reward", "a function of two densities, a PowerReward or a LabelReward", type(reward).__name__)


def check_poses(poses: Any, num_sensors: int) -> Floats:
    """Return the poses, (num_sensors, 3 or more). Raises `InputError` for other shapes or non-finite values."""
    checked = float_array("poses", poses, (num_sensors, None))
    if checked.shape[1] < 3:
        raise reject("poses", f"an array of shape ({num_sensors}, 3 or more)", f"shape {checked.shape}")
    for s in np.flatnonzero(np.abs(checked[:, HEADING]) >= 10.0).tolist():
        warn_if_degrees(f"poses[{s}]", float(checked[s, HEADING]))
    return checked


def options_of(sensors: Sequence[MobileSensor], poses: Any, settings: PlanningSettings) -> tuple[Options, ...]:
    """Return each sensor's options over the planner's horizon. Raises `InputError` for invalid poses or platforms."""
    at, times, options = check_poses(poses, len(sensors)), settings.horizon_times(), []
    for s, sensor in enumerate(sensors):
        options.append(options_at(f"sensors[{s}].platform", sensor.platform, at[s], times, sensor.abilities))
    return tuple(options)


def check_state(sensors: Sequence[MobileSensor], state: State) -> None:
    """Raise `InputError` unless each sensor's filter has a valid belief of its type, and the fused belief is valid."""
    if not isinstance(state, State):
        raise InputError(f"state: expected a State; got {type(state).__name__}")
    if len(state.local) != len(sensors):
        raise InputError(f"state.local: expected {len(sensors)} beliefs, one a sensor; got {len(state.local)}")
    state_dim = sensors[0].filter.targets.state_dim
    checked: set[int] = set()
    for i, (belief, sensor) in enumerate(zip(state.local, sensors, strict=True)):
        if sensor.belief is None:
            raise reject(f"sensors[{i}].filter", "one that labels its targets", type(sensor.filter).__name__)
        _check_density(f"state.local[{i}]", belief, sensor.belief, state_dim, checked)
    _check_density("state.fused", state.fused, LabelledDensity, state_dim, checked)


def _check_density(name: str, density: Any, kind: type[Any], state_dim: int, checked: set[int]) -> None:
    """Validate a density. checked: identities of valid densities, as sensors of one tracker may share one."""
    if not isinstance(density, kind):
        expected = "GLMB, LMB or FactoredGLMB" if kind is LabelledDensity else kind.__name__
        raise InputError(f"{name}: expected {expected}; got {type(density).__name__}")
    if density.state_dim != state_dim:
        raise InputError(f"{name}: expected states of dimension {state_dim}, as its filter; got {density.state_dim}")
    if id(density) in checked:
        return
    checked.add(id(density))
    # A fast check; if it fails, the density's own checks report the fault.
    if not density.is_product and (is_valid_lmb if density.is_lmb else is_valid_glmb)(density.to_kernel()):
        return
    try:
        density.validate(error=InputError)
    except InputError as fault:
        raise InputError(f"{name}: {fault}") from None


def check_choice(name: str, choice: Any, shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return a joint action as integers. Raises `InputError` unless it has one action per sensor within `shape`."""
    array = np.asarray(choice)
    fits = array.shape == (len(shape),) and array.dtype.kind in "iu" and bool(((array >= 0) & (array < shape)).all())
    if not fits:
        raise InputError(f"{name}: expected one action of each sensor, numbers below {shape}; got {choice!r}")
    return tuple(array.tolist())


# Maximum number of courses in a table of compatible courses; with more, searches use the mask itself.
_MOST_COURSES = 20_000


def mask_of_decision(
    constraints: Sequence[Constraint],
    sensors: Sequence[MobileSensor],
    options: Sequence[Options],
    state: State,
    poses: Floats,
    settings: PlanningSettings,
) -> Mask | None:
    """Return the mask of feasible joint actions, or None without constraints. Raises as `feasible_action_mask`.

    state: the present state, from which constraints may predict targets.
    """
    if not constraints:
        return None
    beliefs = predicted_beliefs(constraints, sensors, state, settings, 1, settings.horizon_steps)
    courses, scans = tuple(own.courses for own in options), tuple(own.scans for own in options)
    situation = ConstraintContext(courses, settings.horizon_times(), beliefs, poses, scans, state.unseen)
    return feasible_action_mask(constraints, situation)


def predicted_beliefs(
    constraints: Sequence[Constraint],
    sensors: Sequence[MobileSensor],
    state: Any,
    settings: PlanningSettings,
    first: int,
    last: int,
) -> tuple[LabelledDensity, ...]:
    """Return the fused belief predicted by `first` to `last` steps of the horizon, empty if no constraint needs it.

    Raises `InputError` for a belief without labels.
    """
    needing_beliefs = [constraint.name for constraint in constraints if constraint.needs_beliefs]
    fused = getattr(state, "fused", None)
    if fused is None or not needing_beliefs:
        return ()
    if not isinstance(fused, LabelledDensity):
        expected = f"a density with labels, as the constraint {needing_beliefs[0]} asks where targets will be"
        raise reject("state.fused", expected, type(fused).__name__)
    motion = common_target_model([sensor.filter for sensor in sensors]).motion
    return tuple(predicted(fused, motion, step, settings.horizon_period) for step in range(first, last + 1))


def single_mask(mask: Mask | None, sensor: int, num_courses: int) -> np.ndarray:
    """Return (num_courses,) the courses that one sensor may take, regardless of the other sensors."""
    return np.ones(num_courses, np.bool_) if mask is None else mask.single[sensor]


# Changes of a pose are equal if they differ by less than this, relative to the largest or to 1.
_SAME_CHANGE = 1e-9


def stationary_courses(options: Sequence[Options], mask: Mask | None) -> tuple[int, ...]:
    """Return for each sensor the feasible course that changes its pose least: its assumed course until it decides.

    The course with the least change of heading, of these that with the least change of the camera's pointing, then of
    position, then of all else except the remaining seconds of scanning, as means over the horizon. If only some sensors
    may scan, the sensor is off.
    """
    stationary = []
    for s, own in enumerate(options):
        off = np.abs(own.courses - own.pose)
        angles = [HEADING, POINTING] if is_camera(own.pose) else [HEADING]
        off[:, :, angles] = np.abs(np.remainder(off[:, :, angles] + np.pi, 2.0 * np.pi) - np.pi)
        rest = np.delete(off[:, :, :BUDGET], [0, 1, *angles], axis=2).sum(axis=2)
        candidates = np.flatnonzero(single_mask(mask, s, len(off)))
        candidates = candidates if len(candidates) else np.arange(len(off))
        for change in (*(off[:, :, angle] for angle in angles), np.hypot(off[:, :, 0], off[:, :, 1]), rest):
            means = change.mean(axis=1)[candidates]
            candidates = candidates[means <= means.min() + _SAME_CHANGE * max(1.0, means.max())]
        stationary.append(int(candidates[0]))
    if mask is None or mask.active is None:
        return tuple(stationary)
    return tuple(int(off[course]) for course, off in zip(stationary, mask.active.off, strict=True))


def compiled_mask(mask: Mask | None, shape: Sequence[int]) -> Allowed | None:
    """Return the mask in the form of the compiled ascent, or None if it would be too large."""
    none, num_courses = np.ones((0, 0), np.bool_), sum(shape)
    on, max_active = np.zeros(num_courses, np.bool_), len(shape)
    if mask is None:
        return Allowed(np.ones(num_courses, np.bool_), none, on, max_active)
    single = np.concatenate(mask.single)
    if mask.active is not None:
        on, max_active = np.concatenate(mask.active.on), mask.active.limit
    if not mask.together:
        return Allowed(single, none, on, max_active)
    if num_courses > _MOST_COURSES:
        return None
    together, firsts = np.ones((num_courses, num_courses), np.bool_), np.concatenate([[0], np.cumsum(shape)])
    for (i, j), table in mask.together.items():
        rows, columns = slice(firsts[i], firsts[i + 1]), slice(firsts[j], firsts[j + 1])
        together[rows, columns], together[columns, rows] = table, table.T
    return Allowed(single, together, on, max_active)
