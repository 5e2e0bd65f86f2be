"""What all fusions share: the protocol, what they report, and the checks of what they are given."""

from __future__ import annotations

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

# Type and number of dimensions of the arrays of an LMB: labels, offsets, log weights, means, covariances, logits.
_INT, _FLOAT = np.dtype(np.int64), np.dtype(np.float64)
_FORMS = ((_INT, 2), (_INT, 1), (_FLOAT, 1), (_FLOAT, 2), (_FLOAT, 3), (_FLOAT, 1))


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

    def fuse(self, beliefs: Sequence[Any], views: FieldsOfView | None = None) -> tuple[Any, FusionInfo]:
        """The fused belief, and what had to be repaired or thrown away.

        views: what each sensor could see, and what they were updated from; None where that is not known, as in the
        decisions of a planner.
        """
        ...


@runtime_checkable
class RequiresCommonPrior(Protocol):
    """A fusion that says whether its beliefs must all be updated from one prediction; one that does not: no."""

    @property
    def requires_common_prior(self) -> bool:
        """Whether they must."""
        ...


@runtime_checkable
class SupportsLabelMatching(Protocol):
    """A fusion that says whether labels need not agree across sensors; of one that does not they must."""

    @property
    def matches_labels(self) -> bool:
        """Whether they need not."""
        ...


def requires_common_prior(fusion: Any) -> bool:
    """Whether the fusion is of beliefs that were all updated from one prediction, as `ParallelUpdate` is."""
    return isinstance(fusion, RequiresCommonPrior) and bool(fusion.requires_common_prior)


class LogLinearPool(NamedTuple):
    """A fusion of LMBs whose log is linear in the sensors' logs, label by label.

    In proportion to pi+^prior_power prod_s pi_s^(powers_s).

    prior_power: of the common prediction; not 0 where the sensors' beliefs must be updated from one. powers: one a
    sensor. missing_existence: stands in for the existence of a label that a sensor lacks.
    """

    prior_power: float
    powers: tuple[float, ...]
    missing_existence: float


@runtime_checkable
class LogLinearFusion(Protocol):
    """A fusion whose decisions a planner can take by adding up what each sensor says of each label."""

    def log_linear_pool(self, num_sensors: int) -> LogLinearPool | None:
        """The rule for so many sensors, of single Gaussians; None where the fusion is none such."""
        ...


class PrevalidatedBeliefs(tuple[Any, ...]):
    """Beliefs that need no check of their values, as filters of this library have made them at this step.

    A fusion takes them like any other sequence. It still checks their kinds and state dimensions.
    """

    __slots__ = ()


def all_valid(beliefs: Sequence[Any]) -> bool:
    """Whether all beliefs are valid LMBs of one state dimension: a fast check that does not report what is wrong."""
    if not beliefs or not all(isinstance(belief, LabelledDensity) and belief.is_lmb for belief in beliefs):
        return False
    if not all(map(_formed, beliefs)) or len({belief.state_dim for belief in beliefs}) > 1:
        return False
    return all(is_valid_lmb(belief.to_kernel()) for belief in beliefs)


def _formed(belief: Any) -> bool:
    """Whether the arrays of an LMB have the types that kernels take."""
    tracks, logits = belief.tracks, belief.existence_logit
    arrays = tracks.labels, tracks.offsets, tracks.log_weights, tracks.means, tracks.covs, logits
    for array, (dtype, ndim) in zip(arrays, _FORMS, strict=True):
        if type(array) is not np.ndarray or array.dtype != dtype or array.ndim != ndim:
            return False
    return True


def check_weights(weights: Sequence[float] | Floats) -> tuple[float, ...]:
    """The fusion weights as a tuple. Raises `InputError` unless they are non-negative and sum to one within 1e-9."""
    given = sequence("fusion weights", weights, "non-negative numbers that sum to 1, one a sensor")
    checked = tuple(real(f"fusion weights[{s}]", weight) for s, weight in enumerate(given))
    if not checked or not all(weight >= 0.0 for weight in checked) or not abs(math.fsum(checked) - 1.0) <= 1e-9:
        raise reject("fusion weights", "non-negative numbers that sum to 1, one a sensor", checked)
    return checked


def check_kinds(given: Sequence[type], kinds: tuple[type, ...], num_sensors: int) -> None:
    """Raise `InputError` unless one belief a sensor is given, all of the kinds expected."""
    if len(given) != num_sensors:
        raise InputError(f"beliefs: expected {num_sensors}, one for each fusion weight; got {len(given)}")
    expected = join_alternatives([kind.__name__ for kind in kinds])
    for i, kind in enumerate(given):
        if not issubclass(kind, kinds):
            raise InputError(f"beliefs[{i}]: expected {expected}; got {kind.__name__}")


def check_beliefs(beliefs: Sequence[Any], kinds: tuple[type, ...], num_sensors: int) -> None:
    """Raise `InputError` unless there is one belief a sensor, all valid, of the given kinds and of one state dimension.

    `PrevalidatedBeliefs` are taken to be what they say.
    """
    if not isinstance(beliefs, PrevalidatedBeliefs):
        beliefs = sequence("beliefs", beliefs, "densities, one a sensor")
    check_kinds([type(belief) for belief in beliefs], kinds, num_sensors)
    dims = [belief.state_dim for belief in beliefs]
    if len(set(dims)) > 1:
        raise InputError(f"beliefs: expected one state dimension at all sensors; got {dims}")
    if isinstance(beliefs, PrevalidatedBeliefs) or all_valid(beliefs):
        return
    for i, belief in enumerate(beliefs):
        try:
            belief.validate(error=InputError)
        except InputError as fault:
            raise InputError(f"beliefs[{i}]: {fault}") from None


def count_lost(existence: Floats, fused: Floats) -> int:
    """Labels lost by a fusion, of (num_labels, S) existence at the sensors and (num_labels,) fused."""
    return int(np.count_nonzero((existence.max(axis=1, initial=0.0) >= SURE) & (fused < LOST)))


def per_sensor_counts(counts: Ints, active: Sequence[int], num_sensors: int) -> tuple[int, ...]:
    """A number for each sensor from those of the sensors that take part; 0 for the others."""
    numbers = np.zeros(num_sensors, np.int64)
    numbers[list(active)] = counts
    return tuple(numbers.tolist())


def label_fusion_info(
    lacking: Bools, active: Sequence[int], num_sensors: int, existence: Floats, fused: Floats, log_normaliser: float
) -> FusionInfo:
    """The report of a fusion label by label.

    lacking: (num_labels, len(active)) whether a sensor that takes part at a label lacks it. existence: the same shape.
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
    """The sensors of positive weight, and their weights."""
    active = [i for i, weight in enumerate(weights) if weight > 0.0]
    return active, np.array([weights[i] for i in active])
