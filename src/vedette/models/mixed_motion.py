"""A mixture of motions as one motion model, of the moments of the mixture.

Its one parameter vector has a block for each motion: [share, length of the block, places of its functions in `_KINDS`
and `_NOISES`, dimension of its states, number of parameters of its transition, place of each of its components in the
states of the mixture, parameters of its transition, those of its noise]. A motion leaves other components as they are.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, common_components, place_of
from vedette.models import kinematics, manoeuvres
from vedette.models.arguments import reject
from vedette.models.functions import ModelFunction, model_function
from vedette.models.motion import MotionModel

_HEAD = 6  # numbers of a block before the places


def _part(function: ModelFunction) -> Any:
    """Return a model function as a kernel, so that it can be compiled into others."""
    return borrowing(getattr(function, "py_func", function))


def _parts(function: str) -> list[Any]:
    return [_part(getattr(module, f"_{name}_{function}")) for module, name in _MODULES]


# Names of the functions of the built-in motions, in the order of their numbers in a block.
_MODULES = (
    (kinematics, "cv"),
    (kinematics, "cv_height"),
    (kinematics, "ct"),
    (manoeuvres, "walk"),
    (manoeuvres, "wander"),
    (manoeuvres, "turn"),
    (manoeuvres, "acceleration"),
)
_KINDS = [getattr(module, f"_{name}_transition") for module, name in _MODULES]
_NOISES = [*(getattr(module, f"_{name}_noise") for module, name in _MODULES), kinematics._cv_continuous_noise]
_cv_f, _height_f, _ct_f, _walk_f, _wander_f, _turn_f, _acceleration_f = _parts("transition")
_cv_j, _height_j, _ct_j, _walk_j, _wander_j, _turn_j, _acceleration_j = _parts("jacobian")
_cv_q, _height_q, _ct_q, _walk_q, _wander_q, _turn_q, _acceleration_q = _parts("noise")
_continuous_q = _part(kinematics._cv_continuous_noise)


@borrowing
def _move(kind: int, state: Floats, dt: float, params: Floats, out: Floats) -> None:
    if kind == 0:
        _cv_f(state, dt, params, out)
    elif kind == 1:
        _height_f(state, dt, params, out)
    elif kind == 2:
        _ct_f(state, dt, params, out)
    elif kind == 3:
        _walk_f(state, dt, params, out)
    elif kind == 4:
        _wander_f(state, dt, params, out)
    elif kind == 5:
        _turn_f(state, dt, params, out)
    else:
        _acceleration_f(state, dt, params, out)


@borrowing
def _slope(kind: int, state: Floats, dt: float, params: Floats, out: Floats) -> None:
    if kind == 0:
        _cv_j(state, dt, params, out)
    elif kind == 1:
        _height_j(state, dt, params, out)
    elif kind == 2:
        _ct_j(state, dt, params, out)
    elif kind == 3:
        _walk_j(state, dt, params, out)
    elif kind == 4:
        _wander_j(state, dt, params, out)
    elif kind == 5:
        _turn_j(state, dt, params, out)
    else:
        _acceleration_j(state, dt, params, out)


@borrowing
def _disturb(kind: int, state: Floats, dt: float, params: Floats, out: Floats) -> None:
    if kind == 0:
        _cv_q(state, dt, params, out)
    elif kind == 1:
        _height_q(state, dt, params, out)
    elif kind == 2:
        _ct_q(state, dt, params, out)
    elif kind == 3:
        _walk_q(state, dt, params, out)
    elif kind == 4:
        _wander_q(state, dt, params, out)
    elif kind == 5:
        _turn_q(state, dt, params, out)
    elif kind == 6:
        _acceleration_q(state, dt, params, out)
    else:
        _continuous_q(state, dt, params, out)


class _Block(NamedTuple):
    """The part of the parameters that belongs to one motion."""

    share: float
    end: int
    kind: int
    noise: int
    places: Floats
    transition_params: Floats
    noise_params: Floats


@kernel
def _block(params: Floats, at: int) -> _Block:
    dim, end = int(params[at + 4]), at + int(params[at + 1])
    middle = at + _HEAD + dim + int(params[at + 5])
    places, own, noise = params[at + _HEAD : at + _HEAD + dim], params[at + _HEAD + dim : middle], params[middle:end]
    return _Block(params[at], end, int(params[at + 2]), int(params[at + 3]), places, own, noise)


@kernel
def _taken(state: Floats, places: Floats) -> Floats:
    out = np.empty(len(places))
    for i in range(len(places)):
        out[i] = state[int(places[i])]
    return out


@inlined
def _is_alone(params: Floats, dim: int) -> bool:
    """Return True if the only motion is that of all components of the state in their order, as in most modes."""
    num_in_order = 0
    for i in range(dim if params[4] == dim else 0):
        num_in_order += params[_HEAD + i] == i
    return bool(params[0] == 1.0 and num_in_order == dim)


@model_function("transition")
def _transition(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    if _is_alone(params, len(state)):
        _move(int(params[2]), state, dt, params[_HEAD + len(state) :], out)
        return
    out[:] = 0.0
    at = 0
    while at < len(params) and params[at] > 0.0:
        block = _block(params, at)
        moved = np.empty(len(block.places))
        _move(block.kind, _taken(state, block.places), dt, block.transition_params, moved)
        image = state.copy()
        for i in range(len(moved)):
            image[int(block.places[i])] = moved[i]
        for i in range(len(out)):
            out[i] += block.share * image[i]
        at = block.end


@model_function("transition_jacobian")
def _jacobian(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    if _is_alone(params, len(state)):
        _slope(int(params[2]), state, dt, params[_HEAD + len(state) :], out)
        return
    out[:, :] = 0.0
    at = 0
    while at < len(params) and params[at] > 0.0:
        block = _block(params, at)
        dim = len(block.places)
        slope, image = np.empty((dim, dim)), np.eye(len(state))
        _slope(block.kind, _taken(state, block.places), dt, block.transition_params, slope)
        for i in range(dim):
            for j in range(dim):
                image[int(block.places[i]), int(block.places[j])] = slope[i, j]
        for i in range(len(state)):
            for j in range(len(state)):
                out[i, j] += block.share * image[i, j]
        at = block.end


@model_function("process_noise_cov")
def _noise(state: Floats, dt: float, params: Floats, out: Floats) -> None:
    """Mean of the noise of all motions, with the spread of the states to which they lead."""
    if _is_alone(params, len(state)):
        _disturb(int(params[3]), state, dt, params[_HEAD + len(state) + int(params[5]) :], out)
        return
    out[:, :] = 0.0
    at, mean = 0, np.zeros(len(state))
    while at < len(params) and params[at] > 0.0:
        block = _block(params, at)
        dim, image = len(block.places), state.copy()
        noise, moved, own = np.empty((dim, dim)), np.empty(dim), _taken(state, block.places)
        _disturb(block.noise, own, dt, block.noise_params, noise)
        _move(block.kind, own, dt, block.transition_params, moved)
        for i in range(dim):
            image[int(block.places[i])] = moved[i]
            for j in range(dim):
                out[int(block.places[i]), int(block.places[j])] += block.share * noise[i, j]
        if block.share < 1.0:
            mean += block.share * image
            for i in range(len(state)):
                for j in range(len(state)):
                    out[i, j] += block.share * (image[i] - state[i]) * (image[j] - state[j])
        at = block.end
    if mean.any():
        for i in range(len(state)):
            for j in range(len(state)):
                out[i, j] -= (mean[i] - state[i]) * (mean[j] - state[j])


def is_built_in(motion: MotionModel) -> bool:
    """Return True if a motion may be part of a mixture."""
    return motion.transition in _KINDS and motion.process_noise_cov in _NOISES


def mixed_motion(
    motions: Sequence[MotionModel], shares: Floats, method: str = "auto", components: tuple[str, ...] = ()
) -> MotionModel:
    """Return the mixture of built-in motions with these shares, as one motion of the same moments.

    components: of its states; (): those of the motions. Raises `InputError` for a custom motion.
    """
    names, blocks = components or common_components([motion.components for motion in motions]), list[float]()
    for i, (motion, share) in enumerate(zip(motions, shares, strict=True)):
        if share == 0.0:
            continue
        if not is_built_in(motion):
            expected = "a built-in motion, or in all modes the same functions and components"
            raise reject(f"motions[{i}]", expected, motion.transition)
        kind, noise = _KINDS.index(motion.transition), _NOISES.index(motion.process_noise_cov)
        places = [place_of(name, names) for name in motion.components]
        own = [*places, *motion.transition_params, *motion.noise_params]
        head = [share, _HEAD + len(own), kind, noise, len(places), len(motion.transition_params)]
        blocks += [*head, *own]
    params = np.array(blocks, float)
    return MotionModel(len(names), _transition, _noise, params, params, _jacobian, method, names)
