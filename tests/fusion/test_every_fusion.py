"""What all fusions do alike: what they refuse and how they say so, what they return, and what changes nothing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reference
from densities.examples import (
    plain_glmb,
    plain_lmb,
    plain_moments,
    plain_product,
    random_factored,
    random_glmb,
    random_lmb,
)
from fusion.examples import A, B, C, lmb
from reference import glmb as oracle
from vedette.densities import GLMB, LMB, FactoredGLMB, Poisson, TrackTable, as_glmb, marginalise
from vedette.densities.containers import unchecked
from vedette.errors import InputError
from vedette.fusion import (
    ArithmeticAverage,
    Clmb,
    CmDeltaGlmb,
    FusionLimits,
    LabelMatchedFusion,
    ParallelUpdate,
    match_labels,
)

EQUAL = (0.5, 0.5)
RULES: dict[str, Any] = {"clmb": Clmb, "cm": CmDeltaGlmb, "average": ArithmeticAverage, "parallel": ParallelUpdate}
WEIGHTED: dict[str, Any] = {"clmb": Clmb, "cm": CmDeltaGlmb, "cm of factors": CmDeltaGlmb, "average": ArithmeticAverage}
every_rule = pytest.mark.parametrize("name", RULES)
weighted = pytest.mark.parametrize("name", WEIGHTED)
seeds = st.integers(0, 2**32 - 1)


def drawn(name: str, rng: np.random.Generator, max_components: int = 1) -> Any:
    """A belief that the rule takes."""
    if name == "cm":
        return random_glmb(rng, 3, 5, max_components)
    return random_factored(rng, [1, 2], max_components) if name == "cm of factors" else random_lmb(rng, 4)


def of_labels(name: str, existences: dict[Any, float], rng: np.random.Generator) -> Any:
    """Targets that exist independently, in one dimension, as the rule takes them."""
    own = lmb(tuple(existences), tuple(existences.values()), rng)
    if name == "cm":
        return as_glmb(own, max_hypotheses=100)[0]
    return FactoredGLMB.of(own) if name == "cm of factors" else own


def plain(belief: Any) -> reference.Glmb:
    if isinstance(belief, LMB):
        return oracle.expand_lmb(plain_lmb(belief))
    return plain_product(belief) if isinstance(belief, FactoredGLMB) else plain_glmb(belief)


def assert_same(one: Any, other: Any, tolerance: float) -> None:
    """Weights of label sets, existences and the moments of every label's density."""
    assert type(one) is type(other)
    if isinstance(one, LMB):  # whose existences say all of its label sets
        mine, its = plain_lmb(one), plain_lmb(other)
    else:
        first, second = (oracle.label_set_weights(plain(belief)) for belief in (one, other))
        for labels in first.keys() | second.keys():
            assert abs(first.get(labels, 0.0) - second.get(labels, 0.0)) <= tolerance
        mine, its = (oracle.to_lmb(plain(belief)) for belief in (one, other))
    assert mine.keys() == its.keys()
    for label, (existence, mixture) in mine.items():
        assert abs(existence - its[label][0]) <= tolerance
        for moment, wanted in zip(plain_moments(mixture), plain_moments(its[label][1]), strict=True):
            np.testing.assert_allclose(moment, wanted, rtol=tolerance, atol=tolerance)


def relabelled(belief: Any) -> Any:
    """Later births for what was born earlier: all labels in the reverse order."""
    tracks, labels = belief.tracks, 9 - belief.tracks.labels
    if isinstance(belief, LMB):
        means, covs = tracks.means, tracks.covs
        return LMB.from_bernoullis(labels, belief.existence, means, covs)
    turned = TrackTable(labels, tracks.offsets, tracks.log_weights, tracks.means, tracks.covs)
    hyps = np.split(belief.hyp_tracks, belief.hyp_offsets[1:-1])
    return GLMB.from_hypotheses(turned, [hyp.tolist() for hyp in hyps], np.exp(belief.hyp_log_weights))


# What they return, and what changes nothing.


@weighted
@given(seeds)
def test_equal_beliefs_of_single_gaussians_are_returned(name: str, seed: int) -> None:
    belief = drawn(name, np.random.default_rng(seed))
    belief = marginalise(belief) if name == "cm" else belief
    if name == "cm of factors":
        belief = FactoredGLMB.from_factors([marginalise(factor) for factor in belief.factors], 2)
    fused, info = WEIGHTED[name]((0.2, 0.5, 0.3)).fuse([belief] * 3)
    fused.validate()
    assert_same(fused, belief, 1e-9)
    assert info.log_normaliser == pytest.approx(0.0, abs=1e-9)
    assert (info.num_missing_sets, info.num_missing_labels) == (0, 0)


@weighted
@given(seeds, st.permutations(range(3)))
def test_the_order_of_sensors_changes_nothing(name: str, seed: int, order: list[int]) -> None:
    rng = np.random.default_rng(seed)
    beliefs, weights = [drawn(name, rng) for _ in range(3)], rng.dirichlet(np.ones(3))
    fused, info = WEIGHTED[name](weights).fuse(beliefs)
    fused.validate()
    again, other = WEIGHTED[name](weights[order]).fuse([beliefs[i] for i in order])
    assert_same(fused, again, 1e-8)
    assert (info.num_missing_sets, info.num_missing_labels) == (other.num_missing_sets, other.num_missing_labels)
    assert info.log_normaliser == pytest.approx(other.log_normaliser, abs=1e-9)


@pytest.mark.parametrize("name", ["clmb", "cm", "average"])
@given(seeds)
def test_relabelling_changes_nothing(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    beliefs = [drawn(name, rng, 2) for _ in range(2)]
    limits = FusionLimits(max_components=1) if name == "average" else FusionLimits()
    fused, info = WEIGHTED[name](EQUAL, limits=limits).fuse(beliefs)
    turned, other = WEIGHTED[name](EQUAL, limits=limits).fuse([relabelled(belief) for belief in beliefs])
    assert_same(fused, relabelled(turned), 1e-8)
    assert info.log_normaliser == pytest.approx(other.log_normaliser, abs=1e-9)


@weighted
@pytest.mark.parametrize("weights", [(1.0, 0.0), (0.0, 1.0)])
def test_a_sensor_of_weight_zero_takes_no_part(name: str, weights: tuple[float, float]) -> None:
    rng = np.random.default_rng(5)
    beliefs = [of_labels(name, {A: 0.5, B: 0.9}, rng), of_labels(name, {C: 0.3}, rng)]
    fused, info = WEIGHTED[name](weights).fuse(beliefs)
    assert_same(fused, beliefs[int(np.argmax(weights))], 1e-12)
    assert (info.num_missing_sets, info.num_missing_labels) == (0, 0)


@weighted
def test_nothing_in_common_and_nothing_at_all(name: str) -> None:
    rng, rule = np.random.default_rng(2), WEIGHTED[name](EQUAL)
    beliefs = [of_labels(name, {A: 0.9}, rng), of_labels(name, {B: 0.9}, rng)]
    fused, info = rule.fuse(beliefs)
    fused.validate()
    assert info.num_missing_labels == 2
    nobody = type(beliefs[0]).empty(4)
    fused, info = rule.fuse([nobody, nobody])
    fused.validate()
    assert (type(fused), fused.state_dim, fused.tracks.num_tracks) == (type(nobody), 4, 0)
    assert (info.empty_intersection, info.log_normaliser) == (False, 0.0)


@pytest.mark.parametrize(("sure", "unsure", "lost"), [(0.95, 0.01, 1), (0.95, 0.8, 0), (0.8, 0.01, 0)])
@pytest.mark.parametrize("name", ["clmb", "cm", "cm of factors"])
def test_a_label_that_one_sensor_is_sure_of_is_lost_where_another_does_not_see_it(
    name: str, sure: float, unsure: float, lost: int
) -> None:
    rng = np.random.default_rng(3)
    fused, info = WEIGHTED[name](EQUAL).fuse([of_labels(name, {A: existence}, rng) for existence in (sure, unsure)])
    assert (oracle.to_lmb(plain(fused))[A][0] < 0.5) == bool(lost or sure < 0.9)
    assert info.num_lost_labels == lost
    assert info.missing_labels == (0, 0)


@weighted
def test_what_is_missing_is_told_by_sensor_and_a_sensor_of_weight_zero_lacks_nothing(name: str) -> None:
    rng = np.random.default_rng(3)
    part = of_labels(name, {A: 0.5}, rng)
    _, info = WEIGHTED[name]((0.5, 0.0, 0.5)).fuse([of_labels(name, {A: 0.5, B: 0.5}, rng), part, part])
    assert info.missing_labels == (0, 0, 1)
    assert info.missing_sets == (0, 0, 2 if name == "cm" else 1)
    assert (info.num_missing_sets, info.num_missing_labels) == (sum(info.missing_sets), 1)


# What is refused.


@every_rule
@pytest.mark.parametrize("weights", [0.5, "ab", ("a", 1.0), (None, 1.0), {0: 0.5}, (math.nan, 1.0), (1.5, -0.5), ()])
def test_weights(name: str, weights: Any) -> None:
    with pytest.raises(InputError, match="weights"):
        RULES[name](weights)


@weighted
@pytest.mark.parametrize("weights", [None, (0.5, 0.6), (0.5, 0.4)])
def test_weights_that_do_not_sum_to_one(name: str, weights: Any) -> None:
    with pytest.raises(InputError, match=r"fusion weights: expected non-negative numbers that sum to 1, .*; got"):
        WEIGHTED[name](weights)


BAD_LIMITS: list[Any] = [
    *(None, (), FusionLimits(max_components=0), FusionLimits(max_hypotheses=0), FusionLimits(max_hypotheses=1.5)),  # type: ignore[arg-type]
    FusionLimits(max_combinations=None),  # type: ignore[arg-type]
]


@every_rule
@pytest.mark.parametrize("limits", BAD_LIMITS)
def test_limits(name: str, limits: Any) -> None:
    with pytest.raises(InputError, match=r"limits(\.max_\w+)?: expected"):
        RULES[name](EQUAL, limits=limits)


@pytest.mark.parametrize("floor", [None, "a", 0.0, 1.0, -0.5, math.nan, np.zeros(2)])
def test_floors(floor: Any) -> None:
    for rule in (Clmb, ParallelUpdate):
        with pytest.raises(InputError, match="missing_existence: expected"):
            rule(EQUAL, missing_existence=floor)
    for log_floor in (0.0 if isinstance(floor, float) else floor, 0.5):
        with pytest.raises(InputError, match="missing_log_weight: expected"):
            CmDeltaGlmb(EQUAL, missing_log_weight=log_floor)


def test_words_and_flags() -> None:
    given_words: list[tuple[Any, dict[str, Any], str]] = [
        *((rule, {"mixture_power": word}, "mixture_power") for rule in (Clmb, CmDeltaGlmb) for word in (["auto"], "x")),
        *(
            (rule, {"field_of_view_weighting": "yes"}, "field_of_view_weighting: expected true or false; got yes")
            for rule in (Clmb, ArithmeticAverage)
        ),
    ]
    for rule, words, message in given_words:
        with pytest.raises(InputError, match=message):
            rule(EQUAL, **words)
    with pytest.raises(InputError, match="max_components"):
        CmDeltaGlmb([0.125] * 8, "component_wise")
    with pytest.raises(InputError, match="quadrature"):
        CmDeltaGlmb(EQUAL, "quadrature").fuse([GLMB.empty(9)] * 2)
    with pytest.raises(InputError, match="rule: expected a Fusion; got None"):
        LabelMatchedFusion(None)  # type: ignore[arg-type]
    for gate in (None, "a", 0.0, math.nan):
        with pytest.raises(InputError, match="gate_probability: expected"):
            LabelMatchedFusion(Clmb(EQUAL), gate)  # type: ignore[arg-type]


@pytest.mark.parametrize("beliefs", [None, 3, "ab", {0: 1}, [None, None], [LMB.empty(4)], [LMB.empty(4), LMB.empty(5)]])
@pytest.mark.parametrize("name", [*WEIGHTED, "matched"])
def test_beliefs(name: str, beliefs: Any) -> None:
    rule = LabelMatchedFusion(Clmb(EQUAL)) if name == "matched" else WEIGHTED[name](EQUAL)
    with pytest.raises(InputError, match=r"beliefs(\[0\])?: expected"):
        rule.fuse(beliefs)
    if beliefs is None or isinstance(beliefs, int | str | dict):
        with pytest.raises(InputError, match="beliefs: expected"):
            match_labels(beliefs)  # type: ignore[arg-type]


@weighted
def test_beliefs_that_cannot_be_fused(name: str) -> None:
    rng, rule = np.random.default_rng(1), WEIGHTED[name](EQUAL)
    one = of_labels(name, {A: 0.9}, rng)
    takes = "GLMB or FactoredGLMB" if "cm" in name else "LMB, GLMB or FactoredGLMB"
    unlabelled = Poisson(np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1, 1)))
    others: list[tuple[Any, str]] = [(unlabelled, "Poisson"), *([(LMB.empty(1), "LMB")] if "cm" in name else [])]
    for other, kind in others:
        with pytest.raises(InputError, match=rf"beliefs\[1\]: expected {takes}; got {kind}"):
            rule.fuse([one, other])
    with pytest.raises(InputError, match="expected 2, one for each fusion weight; got 1"):
        rule.fuse([one])
    with pytest.raises(InputError, match="state dimension"):
        rule.fuse([one, type(one).empty(2)])
    fields = {field: getattr(one, field) for field in type(one).__match_args__}
    indefinite = one.tracks.with_fields(covs=-one.tracks.covs)
    with pytest.raises(InputError, match=r"beliefs\[0\].*positive definite"):
        rule.fuse([unchecked(type(one), *(fields | {"tracks": indefinite}).values()), one])


def test_labels_out_of_order() -> None:
    tracks = TrackTable.from_gaussians([B, A], [[0.0], [1.0]], np.ones((2, 1, 1)))
    with pytest.raises(InputError, match=r"beliefs\[0\].*increasing order"):
        Clmb(EQUAL).fuse([unchecked(LMB, tracks, np.zeros(2)), lmb((A,), (0.9,), np.random.default_rng(2))])


def test_views_that_are_none() -> None:
    nobody, seen = [LMB.empty(4)] * 2, "views: expected a FieldsOfView; got bool"
    for field_of_view_weighting in (
        Clmb(EQUAL, field_of_view_weighting=True),
        ArithmeticAverage(EQUAL, field_of_view_weighting=True),
    ):
        with pytest.raises(InputError, match=seen):
            field_of_view_weighting.fuse(nobody, True)  # type: ignore[arg-type]
        with pytest.raises(InputError, match="field_of_view_weighting; got None"):
            field_of_view_weighting.fuse(nobody)
    with pytest.raises(InputError, match=r"views\.prediction: expected the LMB or FactoredGLMB"):
        ParallelUpdate().fuse(nobody, True)  # type: ignore[arg-type]
