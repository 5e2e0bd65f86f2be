"""Parts that belong together of two labelled densities of which one is a product."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB, Labelled
from vedette.densities.containers import unchecked
from vedette.densities.conversions import as_glmb
from vedette.densities.factored import as_factored
from vedette.densities.joining import join_factors
from vedette.densities.label_sets import in_label_order, take_factors
from vedette.errors import InputError

Part: TypeAlias = GLMB | LMB

MAX_PRODUCTS = 100_000


def paired_parts(p: Labelled, q: Labelled) -> list[tuple[Part, Part]]:
    """Parts of which p and q are the products, pair by pair of the same labels, no two pairs sharing one.

    The densities themselves where neither is a product. Labels that are alone in both come together in one pair of
    LMBs. The parts of the other pairs are GLMBs of all products of their factors, or LMBs where each factor is of one
    label.

    Raises `InputError` for more than `MAX_PRODUCTS` products of factors of one density in one pair.
    """
    if isinstance(p, GLMB | LMB) and isinstance(q, GLMB | LMB):
        return [(p, q)]
    joined = join_factors([as_factored(p), as_factored(q)])
    pairs: list[tuple[Part, Part]] = []
    places = joined.places()
    if len(places):
        first, second = (
            _as_lmb(take_factors(density, own[own >= 0]))
            for density, own in zip(joined.densities, places.T, strict=True)
        )
        pairs.append((first, second))
    for group in np.flatnonzero(~joined.alone).tolist():
        own_p, own_q = joined.parts(group)
        pairs.append((_part(own_p), _part(own_q)))
    return pairs


def _part(product: FactoredGLMB) -> Part:
    if product.is_bernoulli.all():
        return _as_lmb(product)
    if product.num_factors == 1:
        return product.factor(0)
    num_products = math.prod(np.diff(product.factor_offsets).tolist())
    if num_products > MAX_PRODUCTS:
        raise InputError(
            f"p, q: expected factors that share labels with at most {MAX_PRODUCTS} products of their hypotheses; got "
            f"{num_products}"
        )
    return as_glmb(product, max_hypotheses=MAX_PRODUCTS)[0]


def _as_lmb(product: FactoredGLMB) -> LMB:
    """Factors of one label each, laid out as `FactoredGLMB.from_lmb` does, with their tracks as they are."""
    ordered = in_label_order(product)
    return unchecked(LMB, ordered.tracks, ordered.hyp_log_weights[1::2] - ordered.hyp_log_weights[::2])


__all__ = ["MAX_PRODUCTS", "Part", "paired_parts"]
