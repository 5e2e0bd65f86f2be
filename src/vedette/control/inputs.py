"""Checks of what a planner is given."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from vedette.control.constraints.protocol import Constraint
from vedette.control.rewards.base import LabelReward, PowerReward
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import GLMB, LMB, Labelled
from vedette.errors import InputError
from vedette.filters import shared_targets
from vedette.fusion import Fusion
from vedette.kernels.base.types import Floats
from vedette.models import TargetModel
from vedette.models.arguments import float_array, instance, reject, sequence, tell_degrees
from vedette.platforms import Options, options_at
from vedette.tracking import State

Belief: TypeAlias = GLMB | LMB  # that is planned on


def check_sensors(sensors: Sequence[MobileSensor]) -> TargetModel:
    """The targets that the sensors track; `InputError` unless there is a sensor, and all track the same."""
    if len(sensors) == 0 or not all(isinstance(sensor, MobileSensor) for sensor in sensors):
        raise reject("sensors", "at least one MobileSensor", sensors)
    return shared_targets([sensor.filter for sensor in sensors])


def check_steering(planner: Any) -> None:
    """Keep sensors and constraints of a planner as tuples; `InputError` where they or the settings are no such."""
    for name, expected in (("sensors", "at least one MobileSensor"), ("constraints", "constraints in a tuple")):
        object.__setattr__(planner, name, sequence(name, getattr(planner, name), expected))
    check_sensors(planner.sensors)
    instance("settings", planner.settings, PlanningSettings)
    for i, constraint in enumerate(planner.constraints):
        instance(f"constraints[{i}]", constraint, Constraint)


def check_valuing(fusion: Any, reward: Any, notes: Any = ()) -> None:
    """`InputError` for a fusion, reward or notes of a planner that are no such."""
    if not all(isinstance(note, str) for note in sequence("notes", notes, "texts in a tuple")):
        raise reject("notes", "texts in a tuple", notes)
    instance("fusion", fusion, Fusion)
    if not callable(reward) and not isinstance(reward, PowerReward | LabelReward | ExpectedLossReward):
        raise reject("reward", "a function of two densities, a PowerReward or a LabelReward", type(reward).__name__)


def check_poses(poses: Any, num_sensors: int) -> Floats:
    """The poses as a (num_sensors, 3 or more) array; `InputError` if they are not that or not finite."""
    checked = float_array("poses", poses, (num_sensors, None))
    if checked.shape[1] < 3:
        raise reject("poses", f"an array of shape ({num_sensors}, 3 or more)", f"shape {checked.shape}")
    for s, heading in enumerate(checked[:, 2].tolist()):
        tell_degrees(f"poses[{s}]", heading)
    return checked


def options_of(sensors: Sequence[MobileSensor], poses: Any, settings: PlanningSettings) -> tuple[Options, ...]:
    """For each sensor what it may do over the horizon; `InputError` for sensors, poses or platforms that do not fit."""
    check_sensors(sensors)
    at, times = check_poses(poses, len(sensors)), settings.horizon_times()
    return tuple(
        options_at(f"sensors[{s}].platform", sensor.platform, pose, times)
        for s, (sensor, pose) in enumerate(zip(sensors, at, strict=True))
    )


def check_state(sensors: Sequence[MobileSensor], state: State) -> None:
    """`InputError` unless there is a valid belief of the right kind for each sensor's filter, and a valid fused one."""
    if not isinstance(state, State):
        raise InputError(f"state: expected a State; got {type(state).__name__}")
    if len(state.local) != len(sensors):
        raise InputError(f"state.local: expected {len(sensors)} beliefs, one a sensor; got {len(state.local)}")
    state_dim = shared_targets([sensor.filter for sensor in sensors]).state_dim
    checked: set[int] = set()
    for i, (belief, sensor) in enumerate(zip(state.local, sensors, strict=True)):
        initial = sensor.filter.initial()
        if not isinstance(initial, Labelled):
            raise reject(f"sensors[{i}].filter", "one that labels its targets", type(sensor.filter).__name__)
        _check_density(f"state.local[{i}]", belief, type(initial), state_dim, checked)
    _check_density("state.fused", state.fused, Labelled, state_dim, checked)


def _check_density(name: str, density: Any, kind: type[Any], state_dim: int, checked: set[int]) -> None:
    """checked: identities of densities that are known to be valid, of which one tracker's sensors may share one."""
    if not isinstance(density, kind):
        expected = "GLMB, LMB or FactoredGLMB" if kind is Labelled else kind.__name__
        raise InputError(f"{name}: expected {expected}; got {type(density).__name__}")
    if density.state_dim != state_dim:
        raise InputError(f"{name}: expected states of dimension {state_dim}, as its filter; got {density.state_dim}")
    if id(density) in checked:
        return
    try:
        density.validate(error=InputError)
    except InputError as fault:
        raise InputError(f"{name}: {fault}") from None
    checked.add(id(density))


def check_choice(name: str, choice: Any, shape: tuple[int, ...]) -> tuple[int, ...]:
    """A joint action as plain numbers; `InputError` unless it has one action a sensor, each within `shape`."""
    array = np.asarray(choice)
    fits = array.shape == (len(shape),) and array.dtype.kind in "iu" and bool(((array >= 0) & (array < shape)).all())
    if not fits:
        raise InputError(f"{name}: expected one action of each sensor, numbers below {shape}; got {choice!r}")
    return tuple(int(action) for action in array)
