"""Fusions laid out for a planner: the power integrals of all joint actions without forming a fused density."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.densities.batches import DensityBatch
from vedette.densities.conversions import lmb_on_label_sets
from vedette.densities.products import PowerProducts, SensorPower, precompute_products
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints

_ALL_BUT_CERTAIN = 700.0  # logit; its exponential is still a number


class PrecomputedFusion(Protocol):
    """A prediction p and, for any choice of one case a sensor, the fused density q, ready for their power integrals."""

    def z(self, actions: Ints, exponents: Sequence[tuple[float, float]], unit_volume: float = 1.0) -> Floats:
        """(num_joint, num_samples, num_exponents) log of the set integral of K^((a + b - 1) |X|) p(X)^a q(X)^b.

        Over the label sets (of an LMB: labels) that p and q both have. q need not be normalised: its scale cancels in
        what is a reward. actions: (num_joint, num_sensors) one action of each sensor. exponents: pairs (a, b).
        unit_volume: K.
        """
        ...


@runtime_checkable
class SupportsPrecomputation(Protocol):
    """A fusion that a planner need not call for every joint action and sample."""

    def precompute(self, cases: Sequence[DensityBatch], prediction: GLMB | LMB) -> PrecomputedFusion | None:
        """The fusions of any of the sensors' cases, or None where they cannot be had this way.

        cases: one a sensor. prediction: what they are compared with, of one Gaussian a track; a GLMB marginalised. What
        is laid out equals `fuse` of each choice, but for the scale.
        """
        ...


def precompute_single_sensor(own: DensityBatch, prediction: GLMB | LMB) -> PowerProducts | None:
    """A sensor's cases as they are; None for LMBs and a GLMB prediction.

    An LMB prediction is taken on a GLMB's label sets. Raises `InputError` for GLMBs without a label set in common.
    """
    share = SensorPower.whole(own, np.ones_like(own.possible) if own.is_lmb else own.possible)
    if own.is_lmb:
        return precompute_products([share], DensityBatch.of(prediction)) if prediction.is_lmb else None
    compared = _on_label_sets(prediction, own) if prediction.is_lmb else prediction
    return precompute_glmbs([share], DensityBatch.of(compared))


def precompute_glmbs(
    shares: Sequence[SensorPower], prediction: DensityBatch, sensors: Sequence[int] | None = None
) -> PowerProducts | None:
    """GLMBs laid out; None where a choice may have no label set in common with the prediction.

    Raises `InputError` where that is so of all.
    """
    common = set(prediction.sets)
    if not any(common.intersection(share.cases.sets) for share in shares):
        raise InputError("fused belief: expected a label set in common with the local beliefs; got none")
    places = [[i for i, labels in enumerate(share.cases.sets) if labels in common] for share in shares]
    if not any(share.held[:, own].any(axis=1).all() for share, own in zip(shares, places, strict=True)):
        return None
    return precompute_products(shares, prediction, sensors)


def _on_label_sets(lmb: LMB, own: DensityBatch) -> GLMB:
    """The LMB's hypotheses on those of the label sets that it has; their weights do not sum to one.

    A certain or impossible label is taken as all but that: a divergence on common label sets does not depend on the
    scale of the weights, and so it is defined also where the GLMB lacks that label in every set.
    """
    logits = np.clip(lmb.existence_logit, -_ALL_BUT_CERTAIN, _ALL_BUT_CERTAIN)
    return lmb_on_label_sets(lmb.with_fields(existence_logit=logits), own.sets)
