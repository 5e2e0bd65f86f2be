"""What filters give from what their kernels left: the posterior, without labels too spread out, and the report."""

from __future__ import annotations

import math
from collections.abc import Sequence

from vedette.densities import GLMB, LMB, FactoredGLMB
from vedette.filters.info import FilterInfo
from vedette.filters.limits import Limits
from vedette.kernels.base.types import FactoredGlmb, Glmb, Lmb
from vedette.kernels.labelled.conversions import marginalise
from vedette.kernels.steps.factored import FactoredReport
from vedette.kernels.steps.glmb import StepReport
from vedette.kernels.steps.lmb import LmbReport


def lmb_posterior(
    posterior: Lmb,
    reports: Sequence[LmbReport],
    limits: Limits,
    *,
    log_likelihood: float,
    num_duplicates: int,
) -> tuple[LMB, FilterInfo]:
    """An LMB after updates, one report each; see `FilterInfo` for what is not of them."""
    kept, spread = limits.without_spread(LMB.from_kernel(posterior))
    sums, _, num_raised, dropped, cut = zip(*reports, strict=True)
    _, num_ranked, log_kept = zip(*sums, strict=True)
    return kept, FilterInfo(
        log_likelihood=log_likelihood,
        num_hypotheses=1,
        num_tracks=kept.tracks.num_tracks,
        discarded_weight_bound=max(-math.expm1(sum(log_kept)), 0.0),  # NaN stays
        dropped_existence=sum(dropped) + spread,
        num_clutter_raised=sum(num_raised),
        num_duplicates=num_duplicates,
        num_inexact_clusters=sum(num_ranked),
        search_cut=any(cut),
        cap_met=len(posterior.existence_logit) >= limits.max_labels,
    )


def glmb_posterior(
    posterior: Glmb,
    reports: Sequence[StepReport],
    limits: Limits,
    *,
    log_likelihood: float,
    num_duplicates: int,
    marginalised: bool,
) -> tuple[GLMB, FilterInfo]:
    """A delta-GLMB after updates, one report each, `marginalised` or not."""
    if marginalised:
        posterior = marginalise(posterior, limits.track_caps())
    kept, spread = limits.without_spread(GLMB.from_kernel(posterior))
    _, log_kept, _, num_raised, cut, full = zip(*reports, strict=True)
    return kept, FilterInfo(
        log_likelihood=log_likelihood,
        num_hypotheses=kept.num_hyps,
        num_tracks=kept.tracks.num_tracks,
        discarded_weight_bound=max(0.0, -math.expm1(sum(log_kept))),
        dropped_existence=spread,
        num_clutter_raised=sum(num_raised),
        num_duplicates=num_duplicates,
        num_inexact_clusters=0,
        search_cut=any(cut),
        cap_met=any(full),
    )


def factored_posterior(
    posterior: FactoredGlmb,
    reports: Sequence[FactoredReport],
    limits: Limits,
    *,
    log_likelihood: float,
    num_duplicates: int,
) -> tuple[FactoredGLMB, FilterInfo]:
    """A factored density after updates, one report each; see `FilterInfo` for what is not of them."""
    found, dropped, is_full = limits.without_excess(FactoredGLMB.from_kernel(posterior))
    return found, FilterInfo(
        log_likelihood=log_likelihood,
        num_hypotheses=found.num_hyps,
        num_tracks=found.tracks.num_tracks,
        discarded_weight_bound=max(0.0, -math.expm1(sum(report.log_kept for report in reports))),
        dropped_existence=sum(float(report.dropped_existence) for report in reports) + dropped,
        num_clutter_raised=sum(int(report.num_raised) for report in reports),
        num_duplicates=num_duplicates,
        num_inexact_clusters=0,
        search_cut=any(bool(report.cut) for report in reports),
        cap_met=is_full or any(bool(report.full) for report in reports),
        factoring_error=min(2.0, sum(float(report.split_error + 2.0 * report.taken_twice) for report in reports)),
        reduction_error=min(2.0, sum(float(report.reduction_error) for report in reports)),
    )
