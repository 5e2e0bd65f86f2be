"""Power integrals of two labelled densities, the Renyi divergence made of them, and a unit of hyper-volume for both."""

import math
from collections.abc import Sequence

import numpy as np

from vedette.densities import GLMB, LMB, LabelledDensity, Poisson, as_lmb, track_moments
from vedette.densities.batches import DensityBatch
from vedette.densities.conversions import lmb_on_label_sets, with_single_gaussians
from vedette.densities.label_sets import label_sets
from vedette.densities.labelled import LABELLED
from vedette.densities.products import SensorPower, check_exponents, precompute_products
from vedette.divergence.closed_form import (
    Support,
    at_least_zero,
    check_densities,
    check_support,
    log_inner_products,
    paired_parts,
)
from vedette.errors import InputError
from vedette.kernels.base.types import Floats
from vedette.models.arguments import real, reject

# Exponents that mixtures allow, too: inner products are in closed form, the other two are sums of weights.
_INNER_PRODUCTS = {(1.0, 1.0): 0, (2.0, 0.0): 1, (0.0, 2.0): 2}
_MASSES = ((1.0, 0.0), (0.0, 1.0))


def power_integral(
    p: LabelledDensity, q: LabelledDensity, a: float, b: float, *, unit_volume: float = 1.0, support: Support = "full"
) -> float:
    """Return Z(a, b): the log of the set integral of K^((a + b - 1) |X|) p(X)^a q(X)^b, dimensionless.

    Divergences of the power family are made of these: Cauchy-Schwarz is (Z(2, 0) + Z(0, 2)) / 2 - Z(1, 1), Renyi of an
    order (Z(order, 1 - order) - order Z(1, 0) - (1 - order) Z(0, 1)) / (order - 1).

    Args:
        p, q: GLMBs, LMBs or products of GLMBs. With an LMB and a GLMB, the LMB is evaluated on the GLMB's label sets.
            With products, Z is the sum over groups of labels, as in `cauchy_schwarz`.
        a, b: exponents. One of them may be negative, or 0 if the other is above 0. A density to the power of 0 is 1.
        unit_volume: K, as in `cauchy_schwarz`.
        support: "full", or "common": only the label sets that both densities have (two LMBs, and labels that form
            factors of their own in products: the labels).

    It is -inf if nothing is shared, and inf if a negative power makes the integral infinite.

    Raises `InputError` for invalid exponents or densities (unlabelled ones, other state dimensions, support "common"
    with nothing in common), and for mixtures, for which only the exponents (1, 1), (2, 0), (0, 2), (1, 0) and (0, 1)
    are in closed form: in a GLMB, a track of several components or a label set of several hypotheses (`marginalise`
    makes one Gaussian of them).
    """
    return float(power_integrals(p, q, ((a, b),), unit_volume=unit_volume, support=support)[0])


def power_integrals(
    p: LabelledDensity,
    q: LabelledDensity,
    exponents: Sequence[tuple[float, float]],
    *,
    unit_volume: float = 1.0,
    support: Support = "full",
) -> Floats:
    """Return (num_exponents,) the `power_integral` of each pair (a, b)."""
    check_densities({"p": p, "q": q}, unit_volume)
    check_support(support)
    if not isinstance(p, LabelledDensity):
        raise InputError("p, q: expected labelled densities; got two Poisson densities")
    pairs = [(float(a), float(b)) for a, b in check_exponents(exponents).tolist()]
    found = np.zeros(len(pairs))
    for own_p, own_q in paired_parts(p, q):
        found += _of_parts(own_p, own_q, pairs, unit_volume, support)
    return found


def _of_parts(
    p: LabelledDensity, q: LabelledDensity, pairs: Sequence[tuple[float, float]], unit_volume: float, support: Support
) -> Floats:
    mixed = not (_is_single(p) and _is_single(q))
    if not mixed:
        return _of_singles(p, q, pairs, unit_volume, support)
    for pair in pairs:
        if pair not in _INNER_PRODUCTS and pair not in _MASSES:
            raise InputError(
                f"p, q: expected one Gaussian a track and one hypothesis a label set for the exponents {pair}; got "
                "mixtures"
            )
    products = log_inner_products(p, q, math.log(unit_volume), support == "common", self_terms=True)
    masses = dict(
        zip(
            _MASSES, _of_singles(with_single_gaussians(p), with_single_gaussians(q), _MASSES, 1.0, support), strict=True
        )
    )
    return np.array([products[_INNER_PRODUCTS[pair]] if pair in _INNER_PRODUCTS else masses[pair] for pair in pairs])


def renyi(p: LabelledDensity, q: LabelledDensity, order: float, *, support: Support = "full") -> float:
    """Return the Renyi divergence of p from q: log(integral of p^order q^(1 - order)) / (order - 1), both normalised.

    At least 0, and 0 for equal densities. Order 1/2 is symmetric and twice the Bhattacharyya distance. In general it is
    order / (1 - order) times that of q from p of order 1 - order. As the order approaches 1 it becomes the
    Kullback-Leibler divergence. Above 1 it is infinite if p is not small enough relative to q, as for a p much wider
    than q.

    Args:
        p, q: GLMBs, LMBs or products of GLMBs, of single Gaussians, as in `power_integral`.
        order: above 0 and not 1.
        support: "full", or "common", and then both are normalised on the label sets (labels) that both have.

    Infinite if they share none. A result below 0 by rounding is 0. Raises `InputError` as `power_integral` and for
    another order, and `NumericalError` if rounding leaves it further below.
    """
    if real("order", order) <= 0.0 or order == 1.0:
        raise reject("order", "a finite number above 0 other than 1", order)
    z, log_p, log_q = power_integrals(p, q, ((order, 1.0 - order), *_MASSES), support=support).tolist()
    if math.isinf(z):
        return math.inf
    divergence = (z - order * log_p - (1.0 - order) * log_q) / (order - 1.0)
    return at_least_zero(divergence, max(abs(z), abs(log_p), abs(log_q)), "Renyi")


def _is_single(density: LabelledDensity) -> bool:
    return len(density.tracks.log_weights) == density.tracks.num_tracks and density.is_marginalised


def _of_singles(
    p: LabelledDensity, q: LabelledDensity, pairs: Sequence[tuple[float, float]], unit_volume: float, support: Support
) -> Floats:
    if p.is_lmb == q.is_lmb:
        return _of_one_kind(DensityBatch.of(p), DensityBatch.of(q), pairs, unit_volume, support)
    if q.is_lmb:
        swapped = [(b, a) for a, b in pairs]
        return _of_singles(q, p, swapped, unit_volume, support)
    found = np.empty(len(pairs))
    lmb = as_lmb(p)
    on_sets = lmb_on_label_sets(lmb, label_sets(q).sets)
    for i, (a, b) in enumerate(pairs):
        if support == "full" and 0.0 in (a, b):
            own = p if b == 0.0 else q
            found[i] = _of_singles(own, own, ((a, b),), unit_volume, support)[0]
        elif support == "full" and b < 0.0 and _has_more_sets(lmb, on_sets):
            found[i] = math.inf
        else:
            views = DensityBatch.of(on_sets), DensityBatch.of(q)
            found[i] = _of_one_kind(*views, ((a, b),), unit_volume, support)[0]
    return found


def _has_more_sets(lmb: LMB, on_sets: GLMB) -> bool:
    """Return True if the LMB has label sets of positive weight beyond those of the GLMB."""
    num_sets = int(2 ** np.count_nonzero(np.isfinite(lmb.existence_logit)))
    return bool(num_sets > np.count_nonzero(on_sets.hyp_log_weights > -math.inf))


def _of_one_kind(
    p: DensityBatch, q: DensityBatch, pairs: Sequence[tuple[float, float]], unit_volume: float, support: Support
) -> Floats:
    if support == "full":
        p, q = _extended(p, q), _extended(q, p)
    elif not p.is_lmb and not set(p.sets) & set(q.sets):
        raise InputError("support: 'common' is for densities that share a label set; got two that share none")
    whole = SensorPower.whole(q, np.ones_like(q.possible))
    laid = precompute_products([whole], p)
    return np.asarray(laid.z(np.zeros((1, 1), np.int64), pairs, unit_volume)[0, 0])


def _extended(own: DensityBatch, other: DensityBatch) -> DensityBatch:
    """Return `own` with the label sets (labels) that only `other` has, at weight zero."""
    known, starts = set(own.places), other.set_offsets
    lacking = [i for i, place in enumerate(other.places) if place not in known]
    members = np.array([m for i in lacking for m in range(starts[i], starts[i + 1])], np.int64)
    means = np.concatenate([own.means, other.means[:, members]], axis=1)
    covs = np.concatenate([own.covs, other.covs[:, members]], axis=1)
    if own.is_lmb:
        labels = [labels[0] for labels in (*own.sets, *(other.sets[i] for i in lacking)) if labels]
        logits = np.full((1, len(labels)), -math.inf)
        logits[:, : len(own.factors)] = own.existence_logits
        return DensityBatch.of_lmbs(labels, logits, means, covs)
    log_weights = np.full((1, len(own.sets) + len(lacking)), -math.inf)
    log_weights[:, : len(own.sets)] = own.log_weights
    return DensityBatch.of_glmbs((*own.sets, *(other.sets[i] for i in lacking)), log_weights, means, covs)


def reference_unit_volume(density: LabelledDensity | Poisson) -> float:
    """Return (4 pi)^(d / 2) sqrt(det P_ref): the K for which K <p, p> is 1 for a Gaussian p of covariance P_ref.

    P_ref is the arithmetic mean of the track covariances (of a mixture's moments), each weighted by the probability of
    its track: GLMB, the weights of the hypotheses that have it; LMB, its existence. Poisson: of the components'
    covariances, weighted by their expected numbers. With K = 1 in SI units K <p, p> is 1e-6 to 1e-8 for a 4-D state,
    and a divergence then depends more on whether targets exist than on where they are.

    Raises `InputError` for a density that is not valid or expects no target.
    """
    if not isinstance(density, LabelledDensity | Poisson):
        raise InputError(f"density: expected {LABELLED} or a Poisson; got {type(density).__name__}")
    density.validate(error=InputError)
    if isinstance(density, Poisson):
        weights, covs = np.exp(density.log_weights), density.covs
    else:
        weights, covs = density.track_existence, track_moments(density.tracks)[1]
    total = float(weights.sum())
    if not total > 0.0:
        raise InputError("density: expected one that expects a target; got an expected number of 0")
    mean_cov = np.einsum("k,kij->ij", weights / total, covs)
    return float(math.exp(0.5 * (density.state_dim * math.log(4.0 * math.pi) + np.linalg.slogdet(mean_cov)[1])))
