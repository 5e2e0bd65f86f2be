"""Divergences of products of GLMBs, factor by factor: against those of all their combinations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import random_factored, random_glmb, random_lmb
from vedette.densities import GLMB, LMB, FactoredGLMB, as_lmb, marginalise
from vedette.divergence import cauchy_schwarz, log_inner_product, power_integrals, reference_unit_volume, renyi
from vedette.divergence.closed_form import MAX_PRODUCTS
from vedette.errors import InputError

PAIRS = ((1.0, 1.0), (2.0, 0.0), (0.0, 2.0), (0.5, 0.5), (0.3, 0.7), (1.0, 0.0), (0.0, 1.0))
K = 3.0
NAMES = [(0, 1), (0, 2), (1, 0), (1, 1), (2, 5), (3, 0)]
SIZES = st.sampled_from([[1] * 5, [2, 1, 2], [3, 2], [1, 2, 1, 1], [2, 2], [5], [1], []])
SEEDS = st.integers(0, 2**32 - 1)


def drawn(rng: np.random.Generator, sizes: list[int], max_components: int = 1, names: Any = NAMES) -> FactoredGLMB:
    """A product over so many labels, which are drawn from a few."""
    labels = [names[i] for i in rng.permutation(len(names))[: sum(sizes)]]
    return random_factored(rng, sizes, max_components, labels=labels or np.empty((0, 2), np.int64))


def all_of(density: FactoredGLMB) -> GLMB:
    """The GLMB of all combinations, made by NumPy alone."""
    hyps: list[tuple[float, list[int]]] = [(1.0, [])]
    for f in range(density.num_factors):
        own = range(density.factor_offsets[f], density.factor_offsets[f + 1])
        members = [density.hyp_tracks[density.hyp_offsets[h] : density.hyp_offsets[h + 1]].tolist() for h in own]
        weights = np.exp(density.hyp_log_weights[list(own)]).tolist()
        hyps = [(w * v, [*a, *b]) for w, a in hyps for v, b in zip(weights, members, strict=True)]
    total = math.fsum(weight for weight, _ in hyps)
    return GLMB.from_hypotheses(density.tracks, [tracks for _, tracks in hyps], [w / total for w, _ in hyps])


@given(SEEDS, SIZES, SIZES)
def test_cauchy_schwarz_is_that_of_all_combinations(seed: int, first: Any, second: Any) -> None:
    rng = np.random.default_rng(seed)
    a, b = drawn(rng, first, 2), drawn(rng, second, 2)
    expected = cauchy_schwarz(all_of(a), all_of(b), unit_volume=K)
    assert cauchy_schwarz(a, b, unit_volume=K) == pytest.approx(expected, abs=1e-10)
    assert cauchy_schwarz(b, a, unit_volume=K) == pytest.approx(expected, abs=1e-10)
    assert cauchy_schwarz(a, a, unit_volume=K) == 0.0
    inner = log_inner_product(all_of(a), all_of(b), unit_volume=K)
    assert log_inner_product(a, b, unit_volume=K) == pytest.approx(inner, abs=1e-10)


@given(SEEDS, SIZES)
def test_against_a_glmb_and_an_lmb(seed: int, sizes: Any) -> None:
    rng = np.random.default_rng(seed)
    a, other, lmb = drawn(rng, sizes), random_glmb(rng, 3, 6, 2), random_lmb(rng, 4)
    for b in (other, lmb):
        expected = cauchy_schwarz(all_of(a), b, unit_volume=K)
        assert cauchy_schwarz(a, b, unit_volume=K) == pytest.approx(expected, abs=1e-10)
        assert cauchy_schwarz(b, a, unit_volume=K) == pytest.approx(expected, abs=1e-10)


@given(SEEDS, SIZES, SIZES)
def test_power_integrals_are_those_of_all_combinations(seed: int, first: Any, second: Any) -> None:
    rng = np.random.default_rng(seed)
    a, b = marginalise(drawn(rng, first, 2)), marginalise(drawn(rng, second, 2))
    expected = power_integrals(all_of(a), all_of(b), PAIRS, unit_volume=K)
    np.testing.assert_allclose(power_integrals(a, b, PAIRS, unit_volume=K), expected, atol=1e-10)
    assert renyi(a, b, 0.5) == pytest.approx(renyi(all_of(a), all_of(b), 0.5), abs=1e-9)


@given(SEEDS, SIZES)
def test_of_mixtures_those_in_closed_form(seed: int, sizes: Any) -> None:
    rng = np.random.default_rng(seed)
    a, b = drawn(rng, sizes, 3), drawn(rng, sizes[::-1], 3)
    closed = ((2.0, 0.0), (0.0, 2.0), (1.0, 1.0), (1.0, 0.0))
    expected = power_integrals(all_of(a), all_of(b), closed, unit_volume=K)
    np.testing.assert_allclose(power_integrals(a, b, closed, unit_volume=K), expected, atol=1e-10)


@given(SEEDS, st.sampled_from(["full", "common"]))
def test_products_of_single_labels_are_lmbs(seed: int, support: Any) -> None:
    rng = np.random.default_rng(seed)
    a, b = drawn(rng, [1] * 4), drawn(rng, [1] * 5)
    lmbs = as_lmb(a), as_lmb(b)
    got = cauchy_schwarz(a, b, unit_volume=K, support=support)
    assert got == pytest.approx(cauchy_schwarz(*lmbs, unit_volume=K, support=support), abs=1e-10)
    np.testing.assert_allclose(
        power_integrals(a, b, PAIRS, unit_volume=K, support=support),
        power_integrals(*lmbs, PAIRS, unit_volume=K, support=support),
        atol=1e-10,
    )


@given(SEEDS)
def test_what_both_have_is_what_all_combinations_share(seed: int) -> None:
    """Where both know the same labels."""
    rng = np.random.default_rng(seed)
    a, b = (drawn(rng, sizes, names=NAMES[:5]) for sizes in ([2, 1, 2], [1, 1, 1, 2]))
    try:
        expected = cauchy_schwarz(all_of(a), all_of(b), support="common")
    except InputError:
        with pytest.raises(InputError, match="'common' is for densities that share a label set"):
            cauchy_schwarz(a, b, support="common")
        return
    assert cauchy_schwarz(a, b, support="common") == pytest.approx(expected, abs=1e-10)


def test_nobody_on_one_side_and_on_both() -> None:
    nobody = FactoredGLMB.empty(2)
    assert cauchy_schwarz(nobody, nobody) == 0.0
    np.testing.assert_array_equal(power_integrals(nobody, LMB.empty(2), PAIRS), 0.0)
    someone = drawn(np.random.default_rng(1), [1, 2])
    assert cauchy_schwarz(someone, nobody) == pytest.approx(cauchy_schwarz(all_of(someone), GLMB.empty(2)), abs=1e-10)


def test_the_unit_volume_is_that_of_all_combinations() -> None:
    density = drawn(np.random.default_rng(2), [1, 2, 2], 3)
    assert reference_unit_volume(density) == pytest.approx(reference_unit_volume(all_of(density)), rel=1e-10)


def test_more_products_than_anyone_waits_for_are_refused() -> None:
    rng = np.random.default_rng(3)
    labels = [(0, i) for i in range(24)]
    pairs = random_factored(rng, [2] * 12, labels=labels)
    whole = random_factored(rng, [24], labels=labels)
    with pytest.raises(InputError, match=f"at most {MAX_PRODUCTS} products of their hypotheses; got {4**12}"):
        cauchy_schwarz(pairs, whole)
