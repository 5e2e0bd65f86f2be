"""Power integrals and the Renyi divergence, against sums over all label sets in plain NumPy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import random_glmb, random_lmb
from vedette.densities import GLMB, LMB, Poisson, as_glmb, marginalise
from vedette.divergence import cauchy_schwarz, power_integral, power_integrals, renyi
from vedette.errors import InputError

pytestmark = pytest.mark.lanes

PAIRS = ((1.0, 1.0), (2.0, 0.0), (0.0, 2.0), (0.0, 0.7), (0.5, 0.5), (0.3, 0.7), (1.0, 0.0), (0.0, 1.0), (2.5, 0.4))
K = 3.0


def log_integral(a: float, p: Any, b: float, q: Any) -> float:
    """log of the integral of N(p)^a N(q)^b."""
    precision: Any = 0.0
    linear: Any = 0.0
    constant = 0.0
    for power, (mean, cov) in ((a, p), (b, q)):
        inverse = np.linalg.inv(cov)
        precision, linear = precision + power * inverse, linear + power * inverse @ mean
        constant -= 0.5 * power * (mean @ inverse @ mean + np.linalg.slogdet(2.0 * np.pi * cov)[1])
    if np.linalg.eigvalsh(precision).min() <= 0.0:
        return math.inf
    spread = np.linalg.slogdet(2.0 * np.pi * np.linalg.inv(precision))[1]
    return float(constant + 0.5 * (linear @ np.linalg.solve(precision, linear) + spread))


def sets_of(density: Any, labels: Any = None) -> dict[Any, tuple[float, dict[Any, Any]]]:
    """Log weight of each label set and the Gaussian of each label in it; of an LMB all subsets of its labels."""
    tracks, found = density.tracks, {}
    names = [tuple(label) for label in tracks.labels.tolist()]
    gaussians = list(zip(tracks.means, tracks.covs, strict=True))
    if isinstance(density, GLMB):
        for h, weight in enumerate(density.hyp_log_weights):
            members = density.hyp_tracks[density.hyp_offsets[h] : density.hyp_offsets[h + 1]]
            found[tuple(names[m] for m in members)] = weight, {names[m]: gaussians[m] for m in members}
        return found
    used = [i for i, name in enumerate(names) if labels is None or name in labels]
    for exists in itertools.product((False, True), repeat=len(used)):
        weight = sum(
            -np.logaddexp(0.0, (-1 if one else 1) * density.existence_logit[i])
            for i, one in zip(used, exists, strict=True)
        )
        chosen = [i for i, one in zip(used, exists, strict=True) if one]
        found[tuple(names[i] for i in chosen)] = weight, {names[i]: gaussians[i] for i in chosen}
    return found


def enumerated(p: Any, q: Any, a: float, b: float, support: str) -> float:
    common = None
    if support == "common" and isinstance(p, LMB) and isinstance(q, LMB):
        common = set(map(tuple, p.tracks.labels.tolist())) & set(map(tuple, q.tracks.labels.tolist()))
    of_p, of_q = sets_of(p, common), sets_of(q, common)
    terms = [-math.inf]
    for labels in of_p.keys() & of_q.keys() if support == "common" else of_p.keys() | of_q.keys():
        if (a != 0.0 and labels not in of_p) or (b != 0.0 and labels not in of_q):
            continue  # zero to a positive power
        term = (a + b - 1.0) * len(labels) * math.log(K)
        for power, sets in ((a, of_p), (b, of_q)):
            term += power * sets[labels][0] if power != 0.0 else 0.0
        for label in labels:
            first = of_p[labels][1][label] if a != 0.0 else of_q[labels][1][label]
            second = of_q[labels][1][label] if b != 0.0 else first
            term += log_integral(a, first, b, second)
        terms.append(term)
    return float(np.logaddexp.reduce(terms))


def pair_of(kinds: str, rng: np.random.Generator) -> tuple[Any, Any]:
    make = {"glmb": lambda: marginalise(random_glmb(rng, 3, 4, 1)), "lmb": lambda: random_lmb(rng, 4)}
    first, second = kinds.split()
    return make[first](), make[second]()


def share_a_set(p: Any, q: Any) -> bool:
    return bool(sets_of(p).keys() & sets_of(q).keys())


@given(st.integers(0, 2**32 - 1), st.sampled_from(["glmb glmb", "lmb lmb", "lmb glmb", "glmb lmb"]))
def test_power_integrals_are_sums_over_label_sets(seed: int, kinds: str) -> None:
    p, q = pair_of(kinds, np.random.default_rng(seed))
    for support in ("full", "common"):
        if support == "common" and not share_a_set(p, q):
            with pytest.raises(InputError, match="support: 'common' is for densities that share a label set"):
                power_integrals(p, q, PAIRS, support=support)
            continue
        got = power_integrals(p, q, PAIRS, unit_volume=K, support=support)
        expected = [enumerated(p, q, a, b, support) for a, b in PAIRS]
        np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-10)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["glmb", "lmb"]))
def test_renyi(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    p, q = pair_of(f"{kind} {kind}", rng)
    assert renyi(p, p, 0.3) == pytest.approx(0.0, abs=1e-9)
    assert renyi(p, q, 0.5) == pytest.approx(renyi(q, p, 0.5), rel=1e-9)
    assert renyi(p, q, 0.3) == pytest.approx(0.3 / 0.7 * renyi(q, p, 0.7), rel=1e-9)
    if share_a_set(p, q) and math.isfinite(renyi(p, q, 0.5)):
        assert renyi(p, q, 0.5) == pytest.approx(-2.0 * enumerated(p, q, 0.5, 0.5, "full"), rel=1e-9, abs=1e-9)
        assert renyi(p, q, 0.3) <= renyi(p, q, 0.6) + 1e-9


def test_orders_above_one() -> None:
    """Infinite where a label set, or the tail of a Gaussian, of the first is none of the second."""
    wide, narrow = [10.0 * np.eye(2)], [np.eye(2)]
    p = LMB.from_bernoullis([(0, 0)], [0.5], [[0.0, 0.0]], wide)
    q = LMB.from_bernoullis([(0, 0)], [0.5], [[0.0, 0.0]], narrow)
    assert renyi(p, q, 2.0) == math.inf
    # log(1 / 4 / (1 / 2) + 1 / 4 / (1 / 2) integral) of N(0, I)^2 / N(0, 10 I) in two dimensions.
    integral = 100.0 / 19.0
    assert renyi(q, p, 2.0) == pytest.approx(math.log(0.5 + 0.5 * integral), rel=1e-12)
    assert renyi(LMB.empty(2), q, 2.0) == pytest.approx(math.log(2.0))
    assert renyi(q, LMB.empty(2), 2.0) == math.inf
    glmb, _ = as_glmb(q, max_hypotheses=2)
    only, _ = as_glmb(q, max_hypotheses=1)
    assert renyi(q, glmb, 2.0) == pytest.approx(0.0, abs=1e-12)
    assert renyi(q, only, 2.0) == math.inf


@given(st.integers(0, 2**32 - 1), st.sampled_from(["full", "common"]))
def test_mixtures_where_they_are_in_closed_form(seed: int, support: Any) -> None:
    rng = np.random.default_rng(seed)
    p = q = random_glmb(rng, 3, 5, 3)
    pairs = ((2.0, 0.0), (0.0, 2.0), (1.0, 1.0), (1.0, 0.0))
    z = power_integrals(p, q, pairs, unit_volume=K, support=support)
    assert 0.5 * (z[0] + z[1]) - z[2] == pytest.approx(cauchy_schwarz(p, q, unit_volume=K, support=support), abs=1e-9)
    assert z[3] == pytest.approx(0.0, abs=1e-9)


def test_what_is_refused() -> None:
    rng = np.random.default_rng(0)
    mixtures = random_glmb(rng, 3, 5, 3)
    with pytest.raises(InputError, match="expected one Gaussian a track and one hypothesis a label set for the exp"):
        power_integral(mixtures, mixtures, 0.5, 0.5)
    lmb = random_lmb(rng, 3)
    for a, b in ((0.0, 0.0), (-1.0, 0.0), (0.0, -0.5), (math.nan, 1.0), (1.0, math.inf)):
        with pytest.raises(InputError, match="exponents: expected finite numbers, the one above 0 where the other"):
            power_integral(lmb, lmb, a, b)
    for order in (0.0, 1.0, -1.0, math.inf, math.nan):
        with pytest.raises(InputError, match="order: expected a finite number"):
            renyi(lmb, lmb, order)
    poisson = Poisson(np.zeros(1), np.zeros((1, 2)), np.eye(2)[None])
    with pytest.raises(InputError, match="expected labelled densities; got two Poisson densities"):
        power_integral(poisson, poisson, 1.0, 1.0)  # type: ignore[arg-type]
