"""What all fusions share: the protocol, what they report, their limits, and the checks of what they are given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np

from vedette.errors import InputError
from vedette.fusion.cubature import MAX_DIM, fifth_degree_rule
from vedette.fusion.validity import ValidBeliefs, all_valid
from vedette.fusion.views import Views
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.mixtures import MixtureCaps
from vedette.models.arguments import instance, one_of, real, reject, sequence
from vedette.models.fields import Count, NonNegative, check_fields
from vedette.text import either

MixturePower = Literal["auto", "moment_matched", "component_wise", "quadrature"]
MIXTURE_POWERS: tuple[MixturePower, ...] = ("auto", "moment_matched", "component_wise", "quadrature")

# Within these distances a merged Gaussian is as near to the truth as the power is: docs/decisions/0003.
_MERGE_DISTANCE = {"auto": 2.0, "moment_matched": 0.0, "component_wise": 2.0, "quadrature": 0.5}

# Existence from which a sensor is sure of a label, and below which the fusion has lost it.
SURE, LOST = 0.9, 0.5


@dataclass(frozen=True, slots=True)
class FusionInfo:
    """What a fusion had to repair and what it threw away.

    Attributes:
        missing_sets: one number a sensor, of label sets that another sensor has and this one does not, so that a floor
            stood in for their weight there; of an LMB, of labels with a floor for the existence. 0 for a sensor of
            weight 0, which takes no part.
        missing_labels: one number a sensor, of labels that it does not know at all, so that its density was left out of
            them.
        num_sets: label sets (LMB: labels) that were fused, those of all sensors together.
        num_lost_labels: labels that a sensor is sure of (existence of `SURE` or more) and the fused density has with an
            existence below `LOST`: targets that one sensor sees, and that a sensor which lacks them, or does not see
            where they are, pulled down.
        empty_intersection: no label set (LMB: no label) is held by every sensor. False where there is none at all.
        log_normaliser: log of the set integral of the product of the powers, at most 0 but for the floors and the
            inflation of component-wise powers; far below 0 the sensors contradict each other.
        discarded_weight: probability of the fused label sets beyond the cap.
    """

    missing_sets: tuple[int, ...]
    missing_labels: tuple[int, ...]
    num_sets: int
    num_lost_labels: int
    empty_intersection: bool
    log_normaliser: float
    discarded_weight: float

    @property
    def num_missing_sets(self) -> int:
        """Label sets missing at a sensor, of all sensors together."""
        return sum(self.missing_sets)

    @property
    def num_missing_labels(self) -> int:
        """Labels unknown to a sensor, of all sensors together."""
        return sum(self.missing_labels)


@runtime_checkable
class Fusion(Protocol):
    """One belief of all the sensors'. The order of `beliefs` is that of the fusion weights."""

    def fuse(self, beliefs: Sequence[Any], views: Views | None = None) -> tuple[Any, FusionInfo]:
        """The fused belief, and what had to be repaired or thrown away.

        views: what each sensor could see, and what they were updated from; None where that is not known, as in the
        decisions of a planner.
        """
        ...


@runtime_checkable
class SharesPrediction(Protocol):
    """A fusion that says whether its beliefs must all be updated from one prediction; one that does not: no."""

    @property
    def shares_prediction(self) -> bool:
        """Whether they must."""
        ...


@runtime_checkable
class MatchesLabels(Protocol):
    """A fusion that says whether labels need not agree across sensors; of one that does not they must."""

    @property
    def matches_labels(self) -> bool:
        """Whether they need not."""
        ...


def shares_prediction(fusion: Any) -> bool:
    """Whether the fusion is of beliefs that were all updated from one prediction, as `ParallelUpdate` is."""
    return isinstance(fusion, SharesPrediction) and bool(fusion.shares_prediction)


class LinearRule(NamedTuple):
    """A fusion of LMBs whose log is linear in the sensors' logs, label by label.

    In proportion to pi+^prior_power prod_s pi_s^(powers_s).

    prior_power: of the common prediction; not 0 where the sensors' beliefs must be updated from one. powers: one a
    sensor. missing_existence: stands in for the existence of a label that a sensor lacks.
    """

    prior_power: float
    powers: tuple[float, ...]
    missing_existence: float


@runtime_checkable
class Linear(Protocol):
    """A fusion whose decisions a planner can take by adding up what each sensor says of each label."""

    def linear_rule(self, num_sensors: int) -> LinearRule | None:
        """The rule for so many sensors, of single Gaussians; None where the fusion is none such."""
        ...


class FusionLimits(NamedTuple):
    """Caps on the cost of a fusion.

    Attributes:
        log_min_component_weight: log of the weight below which components of a track's mixture are dropped before it is
            raised to a power and after the fusion; unused when moment matched.
        merge_distance: components within this Mahalanobis distance are merged then; none: 2 for component_wise, 0.5 for
            quadrature powers.
        max_components: most components of a track before its power is taken; unused when moment matched.
        max_combinations: bound on the combinations of components of one label at all sensors, max_components^sensors;
            under `auto` so many fewer components are kept.
        max_hypotheses: most label sets of the fused density.
    """

    log_min_component_weight: float = math.log(1e-5)
    merge_distance: NonNegative | None = None
    max_components: Count = 4
    max_combinations: Count = 4096
    max_hypotheses: Count = 1000


class PowerRule(NamedTuple):
    """How powers of mixtures of one state dimension are taken."""

    caps: MixtureCaps
    points: Floats  # (num_points, state_dim) of a cubature rule for the standard normal, empty without quadrature
    point_weights: Floats  # (num_points,)


def check_weights(weights: Sequence[float] | Floats) -> tuple[float, ...]:
    """The fusion weights as a tuple. Raises `InputError` unless they are non-negative and sum to one within 1e-9."""
    given = sequence("fusion weights", weights, "non-negative numbers that sum to 1, one a sensor")
    checked = tuple(real(f"fusion weights[{s}]", weight) for s, weight in enumerate(given))
    if not checked or not all(weight >= 0.0 for weight in checked) or not abs(math.fsum(checked) - 1.0) <= 1e-9:
        raise reject("fusion weights", "non-negative numbers that sum to 1, one a sensor", checked)
    return checked


def check_power(mixture_power: str, limits: FusionLimits, num_sensors: int) -> None:
    """Raise `InputError` for an unknown power of mixtures or limits that cannot be kept."""
    one_of("mixture_power", mixture_power, MIXTURE_POWERS)
    check_limits(limits)
    combinations = limits.max_components**num_sensors
    if mixture_power in ("component_wise", "quadrature") and combinations > limits.max_combinations:
        raise InputError(
            f"limits.max_components: expected {limits.max_components}^{num_sensors} (components to the power of the "
            f"number of sensors) to be at most max_combinations = {limits.max_combinations}; got {combinations}; "
            f"lower max_components or use auto"
        )


def check_limits(limits: Any) -> None:
    """Raise `InputError` unless these are caps that can be kept."""
    instance("limits", limits, FusionLimits)
    check_fields(limits, "limits.")
    least = limits.log_min_component_weight
    if not (isinstance(least, float) and least == -math.inf):
        real("limits.log_min_component_weight", least)


def power_rule(mixture_power: str, limits: FusionLimits, state_dim: int, num_sensors: int = 1) -> PowerRule:
    """The caps and the cubature rule of a power of mixtures. Raises `InputError` where there is no rule."""
    points, point_weights, most = np.empty((0, state_dim)), np.empty(0), int(limits.max_components)
    if mixture_power == "auto":
        most = min(most, int(limits.max_combinations ** (1.0 / num_sensors)) + 1)
        while most > 1 and most**num_sensors > limits.max_combinations:
            most -= 1
    if mixture_power == "moment_matched" or (mixture_power == "auto" and most == 1):
        return PowerRule(MixtureCaps(-math.inf, 0.0, 1), points, point_weights)
    if mixture_power == "quadrature":
        if state_dim > MAX_DIM:
            raise InputError(f"mixture_power: quadrature needs at most {MAX_DIM} state dimensions; got {state_dim}")
        points, point_weights = fifth_degree_rule(state_dim)
    distance = limits.merge_distance if limits.merge_distance is not None else _MERGE_DISTANCE[mixture_power]
    caps = MixtureCaps(float(limits.log_min_component_weight), float(distance), most)
    return PowerRule(caps, points, point_weights)


def check_kinds(given: Sequence[type], kinds: tuple[type, ...], num_sensors: int) -> None:
    """Raise `InputError` unless one belief a sensor is given, all of the kinds expected."""
    if len(given) != num_sensors:
        raise InputError(f"beliefs: expected {num_sensors}, one for each fusion weight; got {len(given)}")
    expected = either([kind.__name__ for kind in kinds])
    for i, kind in enumerate(given):
        if not issubclass(kind, kinds):
            raise InputError(f"beliefs[{i}]: expected {expected}; got {kind.__name__}")


def check_beliefs(beliefs: Sequence[Any], kinds: tuple[type, ...], num_sensors: int) -> None:
    """Raise `InputError` unless there is one belief a sensor, all valid, of the given kinds and of one state dimension.

    `ValidBeliefs` are taken to be what they say.
    """
    if not isinstance(beliefs, ValidBeliefs):
        beliefs = sequence("beliefs", beliefs, "densities, one a sensor")
    check_kinds([type(belief) for belief in beliefs], kinds, num_sensors)
    dims = [belief.state_dim for belief in beliefs]
    if len(set(dims)) > 1:
        raise InputError(f"beliefs: expected one state dimension at all sensors; got {dims}")
    if isinstance(beliefs, ValidBeliefs) or all_valid(beliefs):
        return
    for i, belief in enumerate(beliefs):
        try:
            belief.validate(error=InputError)
        except InputError as fault:
            raise InputError(f"beliefs[{i}]: {fault}") from None


def count_lost(existence: Floats, fused: Floats) -> int:
    """Labels lost by a fusion, of (num_labels, S) existence at the sensors and (num_labels,) fused."""
    return int(np.count_nonzero((existence.max(axis=1, initial=0.0) >= SURE) & (fused < LOST)))


def by_sensor(counts: Ints, active: Sequence[int], num_sensors: int) -> tuple[int, ...]:
    """A number for each sensor from those of the sensors that take part; 0 for the others."""
    numbers = np.zeros(num_sensors, np.int64)
    numbers[list(active)] = counts
    return tuple(numbers.tolist())
