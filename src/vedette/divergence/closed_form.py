"""Cauchy-Schwarz divergence of multi-target densities, in closed form."""

import math
from typing import Literal, TypeAlias

import numpy as np

from vedette.densities import LMB, FactoredGLMB, LabelledDensity, Poisson, as_lmb
from vedette.densities.conversions import as_glmb, lmb_on_label_sets
from vedette.densities.label_sets import in_label_order, join_factors, label_sets, lmb_of_factors
from vedette.densities.labelled import LABELLED
from vedette.errors import InputError, NumericalError
from vedette.kernels.base.types import Glmb, Tracks
from vedette.kernels.gaussian.components import joined_components
from vedette.kernels.labelled.inner_products import log_glmbs, log_lmbs, log_tracks
from vedette.kernels.labelled.stacking import stack_glmbs, stack_tracks
from vedette.models.arguments import positive

Density: TypeAlias = LabelledDensity | Poisson
Support = Literal["full", "common"]

MAX_PRODUCTS = 100_000

# Tolerance relative to the magnitude of the logs: rounding of sums over a million pairs of hypotheses stays below.
_ROUNDING = 1e-11


def cauchy_schwarz(a: Density, b: Density, *, unit_volume: float = 1.0, support: Support = "full") -> float:
    """Return the Cauchy-Schwarz divergence of two densities (paper eqs. 5, 8 and 9), at least 0, symmetric.

    It is 0 for equal densities, up to rounding, and exactly for a density and itself.

    GLMB (Beard et al. 2017, "Void probabilities and Cauchy-Schwarz divergence for generalized labeled multi-Bernoulli
    models"): all pairs of hypotheses that share a label set. LMB: the sum over labels of the Bernoulli divergences. An
    LMB and a GLMB: the LMB is evaluated on the GLMB's label sets. Products of GLMBs: the sum over the smallest groups
    of labels such that no factor of either density spans two groups. Labels that form factors of their own in both are
    compared as LMBs, the others on all products of their factors. Two Poisson densities (Hoang et al. 2015): K / 2
    times the squared L2 distance of the intensities.

    unit_volume: K, the unit of hyper-volume of a state (units of the state multiplied), which weighs cardinalities
        against each other. See `reference_unit_volume`.
    support: "full" as in the paper. "common" leaves out, in all three terms, the label sets that one of the densities
        lacks (two LMBs, and labels that form factors of their own in both: the labels), because a set that was only
        removed by a cap is not a difference of the beliefs. The divergence is then 0 too for densities that are
        proportional on their common label sets.

    Infinite if the densities have no label set in common. A result below 0 by rounding (1e-11 of the logs' magnitude)
    is 0. Raises `InputError` for densities that cannot be compared (labelled with unlabelled, other state dimensions,
    support "common" for Poisson or with nothing in common) or are not valid, and `NumericalError` if the inner products
    contradict the Cauchy-Schwarz inequality.
    """
    log_unit_volume = check_densities({"a": a, "b": b}, unit_volume)
    check_support(support)
    if isinstance(a, Poisson) and isinstance(b, Poisson):
        if support == "common":
            raise InputError("support: 'common' is for densities with label sets; got two Poisson densities")
        return _poisson(a, b, log_unit_volume)
    assert not isinstance(a, Poisson)
    assert not isinstance(b, Poisson)
    cross, own_a, own_b = log_inner_products(a, b, log_unit_volume, support == "common", self_terms=True)
    if support == "common" and -math.inf in (own_a, own_b):
        raise InputError("support: 'common' is for densities that share a label set; got two that share none")
    if cross == -math.inf:
        return math.inf
    if a is b:
        cross = own_a  # the same terms, which the sums add in different orders
    return at_least_zero(0.5 * (own_a + own_b) - cross, max(abs(own_a), abs(own_b)))


def log_inner_product(a: Density, b: Density, *, unit_volume: float = 1.0) -> float:
    """Return log zeta(a, b), with zeta the set integral of K^|X| a(X) b(X) (paper eq. 9), or -inf if nothing is shared.

    Raises `InputError` for densities that cannot be compared or are not valid.
    """
    log_unit_volume = check_densities({"a": a, "b": b}, unit_volume)
    if isinstance(a, Poisson) and isinstance(b, Poisson):
        shared = _overlap(_intensities(a, b), 0, 1, log_unit_volume)
        return shared - a.expected_number - b.expected_number
    assert not isinstance(a, Poisson)
    assert not isinstance(b, Poisson)
    return log_inner_products(a, b, log_unit_volume, False, self_terms=False)[0]


def check_densities(densities: dict[str, Density], unit_volume: float) -> float:
    """Return the log of the unit volume, and raise `InputError` for two densities that cannot be compared."""
    positive("unit_volume", unit_volume)
    for name, density in densities.items():
        if not isinstance(density, Density):
            raise InputError(f"{name}: expected {LABELLED} or a Poisson; got {type(density).__name__}")
        try:
            density.validate(error=InputError)
        except InputError as fault:
            raise InputError(f"{name}: {fault}") from None
    names, (a, b) = ", ".join(densities), densities.values()
    if isinstance(a, Poisson) != isinstance(b, Poisson):
        kinds = f"{type(a).__name__} and {type(b).__name__}"
        raise InputError(f"{names}: expected two labelled or two unlabelled densities; got {kinds}")
    if a.state_dim != b.state_dim:
        raise InputError(f"{names}: expected one state dimension; got {a.state_dim} and {b.state_dim}")
    return math.log(unit_volume)


def check_support(support: str) -> None:
    """Raise `InputError` unless the support is "full" or "common"."""
    if support not in ("full", "common"):
        raise InputError(f"support: expected 'full' or 'common'; got {support!r}")


def log_inner_products(
    a: LabelledDensity, b: LabelledDensity, log_unit_volume: float, common: bool, *, self_terms: bool
) -> tuple[float, float, float]:
    """Return log zeta(a, b), zeta(a, a), zeta(b, b) of labelled densities.

    The last two may be -inf unless `self_terms`.
    """
    parts = [_of_parts(p, q, log_unit_volume, common, self_terms) for p, q in paired_parts(a, b)]
    cross, own_a, own_b = (sum(logs) for logs in zip((0.0, 0.0, 0.0), *parts, strict=True))
    return cross, own_a, own_b


def paired_parts(p: LabelledDensity, q: LabelledDensity) -> list[tuple[LabelledDensity, LabelledDensity]]:
    """Return parts whose products are p and q, as pairs with the same labels. No two pairs share a label.

    If neither is a product, the only pair is the densities themselves. Labels that form factors of their own in both
    are combined in one pair of LMBs. The parts of the other pairs are GLMBs of all products of their factors, or LMBs
    if each factor has one label.

    Raises `InputError` for more than `MAX_PRODUCTS` products of factors of one density in one pair.
    """
    if not (p.is_product or q.is_product):
        return [(p, q)]
    joined = join_factors([FactoredGLMB.of(p), FactoredGLMB.of(q)])
    pairs: list[tuple[LabelledDensity, LabelledDensity]] = []
    if joined.alone.any():
        first, second = joined.lmbs_alone()
        pairs.append((first, second))
    for group in np.flatnonzero(~joined.alone).tolist():
        own_p, own_q = joined.parts(group)
        pairs.append((_part(own_p), _part(own_q)))
    return pairs


def _part(product: FactoredGLMB) -> LabelledDensity:
    if product.is_bernoulli.all():
        return lmb_of_factors(in_label_order(product), np.arange(product.num_factors))
    if product.num_factors == 1:
        return product.factor(0)
    num_products = math.prod(np.diff(product.factor_offsets).tolist())
    if num_products > MAX_PRODUCTS:
        raise InputError(
            f"p, q: expected factors that share labels with at most {MAX_PRODUCTS} products of their hypotheses; got "
            f"{num_products}"
        )
    return as_glmb(product, max_hypotheses=MAX_PRODUCTS)[0]


def _of_parts(
    a: LabelledDensity, b: LabelledDensity, log_unit_volume: float, common: bool, self_terms: bool
) -> tuple[float, float, float]:
    if a.is_lmb and b.is_lmb:
        return _lmbs(as_lmb(a), as_lmb(b), log_unit_volume, common)
    if a.is_lmb:
        cross, own_b, own_a = _of_parts(b, a, log_unit_volume, common, self_terms)
        return cross, own_a, own_b
    on_sets = lmb_on_label_sets(as_lmb(b), label_sets(a).sets) if b.is_lmb else b
    cross, own_a, own_b = _glmbs(a.as_hypotheses(), on_sets.as_hypotheses(), log_unit_volume, common, self_terms)
    if b.is_lmb and not common:
        own_b = _lmbs(as_lmb(b), as_lmb(b), log_unit_volume, False)[0]
    return cross, own_a, own_b


def _glmbs(a: Glmb, b: Glmb, log_unit_volume: float, common: bool, self_terms: bool) -> tuple[float, float, float]:
    split = len(a.hyp_log_weights)
    cross, own_a, own_b = log_glmbs(stack_glmbs([a, b]), split, log_unit_volume, common, self_terms)
    return float(cross), float(own_a), float(own_b)


def _lmbs(a: LMB, b: LMB, log_unit_volume: float, common: bool) -> tuple[float, float, float]:
    tracks = stack_tracks([a.tracks.to_kernel(), b.tracks.to_kernel()])
    logits = np.concatenate([a.existence_logit, b.existence_logit])
    cross, own_a, own_b = log_lmbs(tracks, logits, len(a.existence_logit), log_unit_volume, common)
    return float(cross), float(own_a), float(own_b)


def _intensities(a: Poisson, b: Poisson) -> Tracks:
    """Return the two intensities as tracks 0 and 1."""
    sizes = [len(a.log_weights), len(b.log_weights)]
    components = joined_components([a.to_kernel(), b.to_kernel()])
    return Tracks(np.zeros((2, 2), np.int64), np.cumsum([0, *sizes]), components)


def _poisson(a: Poisson, b: Poisson, log_unit_volume: float) -> float:
    tracks = _intensities(a, b)
    own_a, own_b, cross = (_overlap(tracks, i, j, log_unit_volume) for i, j in ((0, 0), (1, 1), (0, 1)))
    return at_least_zero(0.5 * (own_a + own_b) - cross, max(own_a, own_b))


def _overlap(tracks: Tracks, i: int, j: int, log_unit_volume: float) -> float:
    """Return K times the integral of the product of two intensities. Raises `NumericalError` if it is not a number."""
    try:
        return math.exp(log_unit_volume + log_tracks(tracks, i, j))
    except OverflowError:
        raise NumericalError("Poisson densities: expected an overlap that is a number; got one beyond 1e308") from None


def at_least_zero(divergence: float, magnitude: float, name: str = "Cauchy-Schwarz") -> float:
    """Return `divergence`, or 0 if it is below by rounding. Raises `NumericalError` if it is further below or NaN."""
    if not divergence >= -_ROUNDING * max(1.0, magnitude):
        raise NumericalError(f"{name} divergence: expected at least 0; got {divergence}")
    return max(divergence, 0.0) + 0.0  # no -0
