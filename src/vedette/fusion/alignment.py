"""Alignment of marginalised GLMBs, or products of them: one factor for each group on the union of their label sets."""

from collections.abc import Sequence

import numpy as np

from vedette.densities import GLMB, LMB, FactoredGLMB
from vedette.densities.containers import unchecked
from vedette.densities.conversions import as_glmb
from vedette.densities.label_sets import in_label_order, join_factors, take_factors, without_zero_weights
from vedette.densities.tracks import take_tracks
from vedette.kernels.base.types import Floats, Ints


def align_factors(beliefs: Sequence[FactoredGLMB], max_products: int) -> tuple[list[FactoredGLMB], Floats]:
    """Return the beliefs with one factor for each of the smallest groups of labels that no factor crosses.

    Factor g of each belief holds labels of group g alone. If a belief has none of them, its factor g is certain of no
    target. Several factors of a belief in one group become the heaviest `max_products` of their products. Hypotheses of
    weight zero are left out. Also returns the log of the product of the retained weights, shape (num_groups,).
    """
    joined = join_factors(beliefs)
    log_kept, regrouped = np.zeros(len(joined.alone)), []
    for belief, groups in zip(beliefs, joined.groups, strict=True):
        own, log_own = _one_a_group(without_zero_weights(belief), groups, len(joined.alone), max_products)
        regrouped.append(own)
        log_kept += log_own
    return regrouped, log_kept


def _one_a_group(belief: FactoredGLMB, groups: Ints, num_groups: int, max_products: int) -> tuple[FactoredGLMB, Floats]:
    """Return one factor for each group, and the logs of the retained weights. groups: of each factor, or -1."""
    order, log_kept = np.argsort(groups, kind="stable"), np.zeros(num_groups)
    ends = np.searchsorted(groups[order], np.arange(num_groups + 1))
    counts = np.diff(ends)
    single, none = np.flatnonzero(counts == 1), np.flatnonzero(counts == 0)
    empty = FactoredGLMB.of(GLMB.empty(belief.tracks))
    parts = [take_factors(belief, order[ends[single]]), take_factors(empty, np.zeros(len(none), np.int64))]
    several = np.flatnonzero(counts > 1)
    for group in several.tolist():
        factors = take_factors(belief, order[ends[group] : ends[group + 1]])
        product, lost = as_glmb(factors, max_hypotheses=max_products)
        with np.errstate(divide="ignore"):
            log_kept[group] = np.log1p(-lost)
        parts.append(FactoredGLMB.of(product))
    place = np.argsort(np.concatenate([single, none, several]))
    return take_factors(FactoredGLMB.product(parts, belief.state_dim), place), log_kept


def sort_factors(marginalised: FactoredGLMB) -> FactoredGLMB:
    """Return the factors in the order of their first labels, with those of one label in the form of `FactoredGLMB.of`.

    marginalised: each hypothesis must have its own tracks. Factors without tracks are dropped.
    """
    counts, sizes = np.diff(marginalised.track_offsets), np.diff(marginalised.hyp_offsets)
    factor, log_odds = marginalised.factor_of, np.full((2, marginalised.num_factors), -np.inf)
    alone = counts[factor] == 1
    log_odds[sizes[alone], factor[alone]] = marginalised.hyp_log_weights[alone]
    single = np.flatnonzero(counts == 1)
    tracks = take_tracks(marginalised.tracks, marginalised.track_offsets[single])
    lmb = unchecked(LMB, tracks, log_odds[1, single] - log_odds[0, single])
    others = take_factors(marginalised, np.flatnonzero(counts > 1))
    return in_label_order(FactoredGLMB.product([FactoredGLMB.of(lmb), others], marginalised.state_dim))
