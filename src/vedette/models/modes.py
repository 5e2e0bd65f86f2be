"""Motions of targets that change their mode: cruise, turn, stop or hide."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vedette.kernels.base.types import Floats, Motion, Sensor, Switching, common_components
from vedette.models.arguments import float_array, instance, is_infinite, non_negative, reject
from vedette.models.mixed_motion import is_built_in, mixed_motion
from vedette.models.motion import MotionModel, SurvivalModel, kernel_motion
from vedette.models.sensor import SensorModel


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Modes(MotionModel):
    """Motion of a target with a hidden mode, which changes its motion and its probability of detection.

    The mode is a Markov chain in continuous time. It is drawn at the first prediction of a new target, which until then
    moves and is seen as if it had none. States have the components of all motions, by name. A motion leaves those that
    it does not have as they are. Filters with labels and without keep components of each mode. As a `MotionModel` by
    itself, for planners, it is the mixture of all motions, with the long-term probabilities of the modes, as one
    Gaussian of the same moments, and of own motions the most frequent one.

    Args:
        motions: motion in each mode. They are built-in models, or own ones of the same functions and components.
        stay_s: (num_modes,) mean time in each mode, s. inf: for ever.
        names: of the modes, for outputs. (): their numbers.
        to: (num_modes, num_modes) probability of each next mode (column) after a mode (row). None: all others alike.
        at_birth: (num_modes,) probability of each mode of a new target. None: those of the long term.
        detection_factors: (num_modes,) factor on the probability of detection, in [0, 1]. 0 is hidden. None: 1.
        merge_distance: Mahalanobis distance within which predicted components of one mode merge. inf: all of them, as
            in the interacting multiple model. 0: none, so that their number grows without bound.
        method: Gaussian method, see `MotionModel`.

    Attributes:
        state_dim, components, method: of all motions.
        transition, transition_jacobian, process_noise_cov, transition_params, noise_params: of their mixture.
        motions, names, merge_distance: as given.
        in_common: the motions for states of all components, with parameters of the same lengths.
        rates: (num_modes, num_modes) rates of the changes, 1/s. Rows sum to 0.
        at_birth, detection_factors: as given, or their defaults.

    Raises:
        InputError: an invalid argument, or motions that cannot be mixed.
    """

    motions: tuple[MotionModel, ...] = field(init=False)
    in_common: tuple[MotionModel, ...] = field(init=False)
    names: tuple[str, ...] = field(init=False)
    rates: Floats = field(init=False)
    at_birth: Floats = field(init=False)
    detection_factors: Floats = field(init=False)
    merge_distance: float = field(init=False)

    def __init__(
        self,
        motions: Sequence[MotionModel],
        stay_s: ArrayLike,
        *,
        names: Sequence[str] = (),
        to: ArrayLike | None = None,
        at_birth: ArrayLike | None = None,
        detection_factors: ArrayLike | None = None,
        merge_distance: float = 2.0,
        method: str = "auto",
    ) -> None:
        given, names = tuple(motions), tuple(names)
        for i, motion in enumerate(given):
            instance(f"Modes.motions[{i}]", motion, MotionModel)
        num = len(given)
        names = names or tuple(map(str, range(num)))
        if num == 0 or len(names) != num or len(set(names)) < num:
            raise reject("Modes.names", f"a different name for each of {num} motions", names)
        rates = _rates(float_array("Modes.stay_s", stay_s, (num,), finite=False), to)
        often = _long_term(rates)
        birth = often if at_birth is None else float_array("Modes.at_birth", at_birth, (num,))
        factors = np.ones(num) if detection_factors is None else detection_factors
        factors = float_array("Modes.detection_factors", factors, (num,))
        if (birth < 0.0).any() or abs(birth.sum() - 1.0) > 1e-6:
            raise reject("Modes.at_birth", "probabilities that sum to 1", birth.tolist())
        if (factors < 0.0).any() or (factors > 1.0).any():
            raise reject("Modes.detection_factors", "numbers in [0, 1]", factors.tolist())
        reach = np.inf if is_infinite(merge_distance) else non_negative("Modes.merge_distance", merge_distance)
        mean = _mixture(given, often, method)
        MotionModel.__init__(self, *(getattr(mean, name) for name in MotionModel.__match_args__))
        common = given if _are_alike(given) else _in_common(given, method)
        own = {"motions": given, "in_common": common, "names": names, "rates": rates, "merge_distance": reach}
        for name, value in {**own, "at_birth": birth / birth.sum(), "detection_factors": factors}.items():
            object.__setattr__(self, name, value)


def _mixture(motions: Sequence[MotionModel], shares: Floats, method: str) -> MotionModel:
    """Return one motion in place of all: their mixture, or of own motions the most frequent one."""
    if _are_alike(motions) and (len(motions) == 1 or not is_built_in(motions[0])):
        return motions[int(shares.argmax())]
    return mixed_motion(motions, shares, method)


def _are_alike(motions: Sequence[MotionModel]) -> bool:
    """Return True if the motions differ in numbers alone."""
    kinds = {(each.transition, each.process_noise_cov, each.transition_jacobian, each.components) for each in motions}
    lengths = {(len(each.transition_params), len(each.noise_params)) for each in motions}
    return len(kinds) == 1 and len(lengths) == 1


def _in_common(motions: Sequence[MotionModel], method: str) -> tuple[MotionModel, ...]:
    """Return the motions for states of all components, with parameters of one length."""
    names = common_components([own.components for own in motions])
    each = [mixed_motion([own], np.ones(1), method, names) for own in motions]
    longest = max(len(own.transition_params) for own in each)
    padded = [np.pad(own.transition_params, (0, longest - len(own.transition_params))) for own in each]
    return tuple(replace(own, transition_params=row, noise_params=row) for own, row in zip(each, padded, strict=True))


def _rates(stay_s: Floats, to: ArrayLike | None) -> Floats:
    """Return the rates of the changes, 1/s. stay_s, to: as in `Modes`."""
    num = len(stay_s)
    if not (stay_s > 0.0).all():
        raise reject("Modes.stay_s", "times above 0 in s", stay_s.tolist())
    others = (np.ones((num, num)) - np.eye(num)) / max(num - 1, 1)
    table = others if to is None else float_array("Modes.to", to, (num, num))
    if (table < 0.0).any() or np.diag(table).any() or (num > 1 and np.abs(table.sum(axis=1) - 1.0).max() > 1e-6):
        raise reject("Modes.to", "rows of probabilities that sum to 1, with 0 on the diagonal", table.tolist())
    return np.asarray((table - np.diag(table.sum(axis=1))) / stay_s[:, np.newaxis])


def _long_term(rates: Floats) -> Floats:
    """Return the share of time in each mode in the long term, all alike where it depends on the first mode."""
    num = len(rates)
    system = np.vstack([rates.T / max(np.abs(rates).max(), np.finfo(float).tiny), np.ones(num)])
    shares, _, rank, _ = np.linalg.lstsq(system, np.append(np.zeros(num), 1.0), rcond=1e-12)
    return np.maximum(shares, 0.0) / np.maximum(shares, 0.0).sum() if rank == num else np.full(num, 1.0 / num)


@lru_cache(maxsize=1000)
def motion_of_filter(motion: MotionModel, survival: SurvivalModel) -> Motion:
    """Return the functions and parameters for filters, a row for each mode, the same object for the same models."""
    single = kernel_motion(motion, survival)
    if not isinstance(motion, Modes) or len(motion.motions) == 1:
        return single
    rows = [kernel_motion(own, survival) for own in motion.in_common]
    transitions = np.concatenate([row.transition_params for row in rows])
    noises = np.concatenate([row.noise_params for row in rows])
    chain = Switching(motion.rates, motion.at_birth, motion.merge_distance)
    return rows[0]._replace(transition_params=transitions, noise_params=noises, switching=chain)


def check_room_for_modes(motion: MotionModel, max_components: int) -> None:
    """Raise `InputError` if a filter keeps one Gaussian for each track of a motion with several modes."""
    if isinstance(motion, Modes) and len(motion.motions) > 1 and max_components < 2:
        raise reject("limits.max_components", "at least 2 for a motion with modes", max_components)


@lru_cache(maxsize=1000)
def sensor_of_filter(sensor: SensorModel, motion: MotionModel) -> Sensor:
    """Return a sensor in kernel form, with the factors of the modes on its probability of detection.

    Raises `InputError` for factors of the sensor that are not one for each mode of the motion.
    """
    seen, factors = sensor.to_kernel(), sensor.mode_factors
    num = len(motion.motions) if isinstance(motion, Modes) else 1
    if factors is not None and len(factors) != num:
        raise reject("SensorModel.mode_factors", f"a factor for each of {num} modes of the motion", factors.tolist())
    if factors is None and isinstance(motion, Modes):
        factors = motion.detection_factors
    return seen if factors is None or factors.min() == 1.0 else seen._replace(mode_factors=factors)


def hiding_modes(motion: MotionModel, stays_s: Mapping[str, tuple[float, float]]) -> tuple[Modes, dict[str, Floats]]:
    """Return the motion of targets that hide from sensors, from each by itself, and the factors of each sensor.

    A mode of the result is a mode of the given motion with a visible or hidden target for each of the sensors, which
    change independently of each other. A new target is visible to a sensor as often as in the long term.

    Args:
        motion: in the time between, which may have modes.
        stays_s: mean times for which a target is visible to a sensor, and hidden from it, s, by the sensor's name.

    Returns the motion and, for each sensor, its `SensorModel.mode_factors`.
    """
    base = motion if isinstance(motion, Modes) else Modes((motion,), (np.inf,), names=("",), method=motion.method)
    motions, names, rates, at_birth = list(base.motions), list(base.names), base.rates, base.at_birth
    own, factors = base.detection_factors, dict[str, Floats]()
    for sensor, (visible, hidden) in stays_s.items():
        chain = np.array([[-1.0 / visible, 1.0 / visible], [1.0 / hidden, -1.0 / hidden]])
        rates = np.asarray(np.kron(rates, np.eye(2)) + np.kron(np.eye(len(rates)), chain), np.float64)
        at_birth = np.asarray(np.kron(at_birth, np.array([visible, hidden]) / (visible + hidden)), np.float64)
        motions = [each for each in motions for _ in range(2)]
        hides = [f"{name}, hidden from {sensor}".removeprefix(", ") for name in names]
        names = [name for pair in zip(names, hides, strict=True) for name in pair]
        own, factors = np.repeat(own, 2), {name: np.repeat(each, 2) for name, each in factors.items()}
        factors[sensor] = np.tile([1.0, 0.0], len(names) // 2)
    stays = -1.0 / np.diag(rates)
    made = Modes(
        motions,
        stays,
        names=["visible", *names[1:]] if names[0] == "" else names,
        to=(rates - np.diag(np.diag(rates))) * stays[:, np.newaxis],
        at_birth=at_birth,
        detection_factors=own,
        merge_distance=base.merge_distance,
        method=motion.method,
    )
    return made, {name: own * each for name, each in factors.items()}
