"""Precomputed fusions for planners: power integrals of all joint actions without forming a fused density."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from vedette.densities import GLMB, LMB
from vedette.densities.batches import DensityBatch
from vedette.densities.conversions import lmb_on_label_sets
from vedette.densities.products import PowerProducts, SensorPower, precompute_products
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints

_ALL_BUT_CERTAIN = 700.0  # logit; its exponential is finite


class PrecomputedFusion(Protocol):
    """A prediction p and, for any choice of one case per sensor, the fused density q, prepared for power integrals."""

    def z(self, actions: Ints, exponents: Sequence[tuple[float, float]], unit_volume: float = 1.0) -> Floats:
        """Log of the set integral of K^((a + b - 1) |X|) p(X)^a q(X)^b, shape (num_joint, num_samples, num_exponents).

        The integral is over the label sets (for LMBs: labels) that both p and q have. q need not be normalised: its
        scale cancels in a reward. actions: (num_joint, num_sensors) one action of each sensor. exponents: pairs (a, b).
        unit_volume: K.
        """


@runtime_checkable
class SupportsPrecomputation(Protocol):
    """A fusion that a planner need not call for every joint action and sample."""

    def precompute(self, cases: Sequence[DensityBatch], prediction: GLMB | LMB) -> PrecomputedFusion | None:
        """Return the fusions of all combinations of the sensors' cases, or None if they cannot be precomputed.

        cases: one batch per sensor. prediction: the density to compare with, with one Gaussian per track. A GLMB must
        be marginalised. The result equals `fuse` of each combination, except for the scale.
        """


def precompute_single_sensor(own: DensityBatch, prediction: GLMB | LMB) -> PowerProducts | None:
    """Return the precomputed cases of a single sensor, or None for LMB cases and a GLMB prediction.

    An LMB prediction is evaluated on the label sets of GLMB cases. Raises `InputError` for GLMBs without a common label
    set.
    """
    share = SensorPower.whole(own, np.ones_like(own.possible) if own.is_lmb else own.possible)
    if own.is_lmb:
        return precompute_products([share], DensityBatch.of(prediction)) if prediction.is_lmb else None
    compared = _on_label_sets(prediction, own) if prediction.is_lmb else prediction
    return precompute_glmbs([share], DensityBatch.of(compared))


def precompute_glmbs(
    shares: Sequence[SensorPower], prediction: DensityBatch, sensors: Sequence[int] | None = None
) -> PowerProducts | None:
    """Return precomputed GLMB fusions, or None if some combination may have no label set in common with the prediction.

    Raises `InputError` if no combination has one.
    """
    common = set(prediction.sets)
    if not any(common.intersection(share.cases.sets) for share in shares):
        raise InputError("fused belief: expected a label set in common with the local beliefs; got none")
    places = [[i for i, labels in enumerate(share.cases.sets) if labels in common] for share in shares]
    if not any(share.held[:, own].any(axis=1).all() for share, own in zip(shares, places, strict=True)):
        return None
    return precompute_products(shares, prediction, sensors)


def _on_label_sets(lmb: LMB, own: DensityBatch) -> GLMB:
    """Return the LMB's hypotheses on those label sets that it has. Their weights do not sum to one.

    The existence of a certain or impossible label is clipped to almost 1 or 0. A divergence on common label sets does
    not depend on the scale of the weights, so it remains defined if the GLMB lacks that label in every set.
    """
    logits = np.clip(lmb.existence_logit, -_ALL_BUT_CERTAIN, _ALL_BUT_CERTAIN)
    return lmb_on_label_sets(lmb.with_fields(existence_logit=logits), own.sets)
