"""Protocols of fusion rules, the report of a fusion, and checks of its input."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from vedette.densities import LabelledDensity
from vedette.errors import InputError
from vedette.fusion.views import FieldsOfView
from vedette.internal.text import join_alternatives
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.labelled.set_fusion import LOST, SURE
from vedette.kernels.labelled.validity import is_valid_lmb
from vedette.models.arguments import real, reject, sequence

# Data type and number of dimensions of the arrays of an LMB: labels, offsets, columns of the components, logits.
_INT, _FLOAT = np.dtype(np.int64), np.dtype(np.float64)
_FORMS = (_INT, 2), (_INT, 1), (_FLOAT, 1), (_FLOAT, 1), (_FLOAT, 2), (_FLOAT, 3), (_FLOAT, 2)


@dataclass(frozen=True, slots=True)
class FusionInfo:
    """Report of one fusion: repairs and truncations.

    Attributes:
        missing_sets: for each sensor, number of label sets that another sensor has and this one lacks, so that a floor
            replaced their weight, or for LMBs, number of labels whose existence was replaced by a floor. 0 for a sensor
            of weight 0, which takes no part.
        missing_labels: for each sensor, number of labels that it lacks altogether, so that its density was left out of
            their fused density.
        num_sets: number of label sets (LMB: labels) that were fused, over all sensors.
        num_lost_labels: number of labels that one sensor holds with an existence of `SURE` or more and the fused
            density with an existence below `LOST`: targets that one sensor observes, and that were lost because another
            sensor lacks them or does not observe their position.
        empty_intersection: True if no label set (LMB: no label) is common to all sensors. False if there is none at
            all.
        log_normaliser: log of the set integral of the product of the powers. It is at most 0, apart from the effect of
            floors and of the inflation of component-wise powers. Far below 0 the sensors contradict each other.
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
        """Number of missing label sets, summed over all sensors."""
        return sum(self.missing_sets)

    @property
    def num_missing_labels(self) -> int:
        """Number of missing labels, summed over all sensors."""
        return sum(self.missing_labels)


@runtime_checkable
class Fusion(Protocol):
    """A rule that combines the densities of all sensors into one. `beliefs` are in the order of the fusion weights."""

    def fuse(self, beliefs: Sequence[Any], views: FieldsOfView | None = None) -> tuple[Any, FusionInfo]:
        """Return the fused density and the report of the fusion.

        views: fields of view of the sensors, and the density that they were updated from, or None if not known, as in
        the decisions of a planner.
        """


@runtime_checkable
class RequiresCommonPrior(Protocol):
    """A fusion that declares whether its beliefs must all be updated from one prediction (default: no)."""

    @property
    def requires_common_prior(self) -> bool:
        """True if all beliefs must be updated from one prediction."""


@runtime_checkable
class SupportsLabelMatching(Protocol):
    """A fusion that declares whether labels may differ across sensors (default: no)."""

    @property
    def matches_labels(self) -> bool:
        """True if labels may differ across sensors."""


def requires_common_prior(fusion: Any) -> bool:
    """Return True if the fusion needs beliefs that were all updated from one prediction, as `ParallelUpdate` does."""
    return isinstance(fusion, RequiresCommonPrior) and bool(fusion.requires_common_prior)


class LogLinearPool(NamedTuple):
    """A fusion of LMBs whose log is linear in the sensors' logs, label by label.

    In proportion to pi+^prior_power prod_s pi_s^(powers_s).

    prior_power: of the common prediction. Not 0 if the sensors' beliefs must be updated from one. powers: one per
    sensor. missing_existence: replaces the existence of a label that a sensor lacks.
    """

    prior_power: float
    powers: tuple[float, ...]
    missing_existence: float


@runtime_checkable
class LogLinearFusion(Protocol):
    """A fusion that a planner can evaluate by summing the contributions of the sensors to each label."""

    def log_linear_pool(self, num_sensors: int) -> LogLinearPool | None:
        """Return the pool for `num_sensors` sensors and single Gaussians, or None if the fusion is not log-linear."""


class PrevalidatedBeliefs(tuple[Any, ...]):
    """A tuple of beliefs whose values need no check, because filters of this library made them at this step.

    A fusion accepts them like any other sequence. It still checks their kinds and state dimensions.
    """

    __slots__ = ()


def all_valid(beliefs: Sequence[Any]) -> bool:
    """Return True if all beliefs are valid LMBs of the same states and classes, fast, without reporting faults."""
    if not beliefs or not all(isinstance(belief, LabelledDensity) and belief.is_lmb for belief in beliefs):
        return False
    if not all(map(_has_kernel_arrays, beliefs)) or len(set(map(_sizes, beliefs))) > 1:
        return False
    return all(is_valid_lmb(belief.to_kernel()) for belief in beliefs)


def _sizes(belief: LabelledDensity) -> tuple[int, int]:
    return belief.state_dim, belief.tracks.num_classes


def _has_kernel_arrays(belief: Any) -> bool:
    """Return True if the arrays of an LMB have the types that kernels expect."""
    tracks, logits = belief.tracks, belief.existence_logit
    columns = tracks.log_weights, tracks.means, tracks.covs, tracks.marks
    arrays = tracks.labels, tracks.offsets, logits, *columns
    for array, (dtype, ndim) in zip(arrays, _FORMS, strict=True):
        if type(array) is not np.ndarray or array.dtype != dtype or array.ndim != ndim:
            return False
    return len(tracks.marks) == len(tracks.log_weights)


def refuse_modes(what: str, beliefs: Sequence[LabelledDensity]) -> None:
    """Raise `InputError` if targets have modes of motion, which a fusion with one Gaussian for each label forgets."""
    if any(belief.tracks.has_modes for belief in beliefs):
        wanted = "a motion without modes, or sequential, central, GCI or average fusion"
        raise InputError(f"{what}: expected {wanted}; got tracks with modes of motion")


def check_weights(weights: Sequence[float] | Floats) -> tuple[float, ...]:
    """Return the fusion weights as a tuple. Raises `InputError` unless non-negative and summing to one within 1e-9."""
    given = sequence("fusion weights", weights, "non-negative numbers that sum to 1, one a sensor")
    checked = tuple(real(f"fusion weights[{s}]", weight) for s, weight in enumerate(given))
    if not checked or not all(weight >= 0.0 for weight in checked) or not abs(math.fsum(checked) - 1.0) <= 1e-9:
        raise reject("fusion weights", "non-negative numbers that sum to 1, one a sensor", checked)
    return checked


def check_kinds(given: Sequence[type], kinds: tuple[type, ...], num_sensors: int) -> None:
    """Raise `InputError` unless there is one belief per sensor and all are of the expected kinds."""
    if len(given) != num_sensors:
        raise InputError(f"beliefs: expected {num_sensors}, one for each fusion weight; got {len(given)}")
    for i, kind in enumerate(given):
        if not issubclass(kind, kinds):
            expected = join_alternatives([each.__name__ for each in kinds])
            raise InputError(f"beliefs[{i}]: expected {expected}; got {kind.__name__}")


def check_beliefs(beliefs: Sequence[Any], kinds: tuple[type, ...], num_sensors: int) -> None:
    """Raise `InputError` unless there is one valid belief per sensor, of the given kinds, states and classes.

    The values of `PrevalidatedBeliefs` are not checked.
    """
    if not isinstance(beliefs, PrevalidatedBeliefs):
        beliefs = sequence("beliefs", beliefs, "densities, one a sensor")
    check_kinds([type(belief) for belief in beliefs], kinds, num_sensors)
    dims = [belief.state_dim for belief in beliefs]
    if len(set(dims)) > 1:
        raise InputError(f"beliefs: expected one state dimension at all sensors; got {dims}")
    if isinstance(beliefs, PrevalidatedBeliefs) or all_valid(beliefs):
        return
    numbers = [belief.num_classes for belief in beliefs]
    if len(set(numbers)) > 1:
        raise InputError(f"beliefs: expected one number of classes at all sensors; got {numbers}")
    for i, belief in enumerate(beliefs):
        try:
            belief.validate(error=InputError)
        except InputError as fault:
            raise InputError(f"beliefs[{i}]: {fault}") from None


def count_lost(existence: Floats, fused: Floats) -> int:
    """Number of labels lost by a fusion, from existence (num_labels, S) at the sensors and (num_labels,) fused."""
    return int(np.count_nonzero((existence.max(axis=1, initial=0.0) >= SURE) & (fused < LOST)))


def per_sensor_counts(counts: Ints, active: Sequence[int], num_sensors: int) -> tuple[int, ...]:
    """Return one number per sensor, from the numbers of the active sensors, with 0 for the others."""
    numbers = np.zeros(num_sensors, np.int64)
    numbers[list(active)] = counts
    return tuple(numbers.tolist())


def label_fusion_info(
    lacking: Bools, active: Sequence[int], num_sensors: int, existence: Floats, fused: Floats, log_normaliser: float
) -> FusionInfo:
    """Return the report of a fusion that works label by label.

    lacking: (num_labels, len(active)) True if a sensor that takes part at a label lacks it. existence: the same shape.
    fused: (num_labels,) existence.
    """
    missing = per_sensor_counts(np.count_nonzero(lacking, axis=0), active, num_sensors)
    return FusionInfo(
        missing_sets=missing,
        missing_labels=missing,
        num_sets=len(lacking),
        num_lost_labels=count_lost(existence, fused),
        empty_intersection=len(lacking) > 0 and bool(lacking.any(axis=1).all()),
        log_normaliser=log_normaliser,
        discarded_weight=0.0,
    )


def active_sensors(weights: Sequence[float] | Floats) -> tuple[list[int], Floats]:
    """Return the indices of the sensors of positive weight, and their weights."""
    active = [i for i, weight in enumerate(weights) if weight > 0.0]
    return active, np.array([weights[i] for i in active])
