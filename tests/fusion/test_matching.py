"""Matching of labels: the best assignment by brute force, who keeps a label and who does not, densities as before."""

from __future__ import annotations

from itertools import permutations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from densities.examples import random_glmb, random_lmb
from fusion.sights import assert_same_bits
from vedette.densities import GLMB, LMB, Poisson, as_lmb
from vedette.errors import InputError
from vedette.fusion import Clmb, CmDeltaGlmb, LabelMatchedFusion, match_labels
from vedette.kernels.gaussian.distances import near_pairs

Label = tuple[int, int]


def at(places: dict[Label, float], existence: float = 0.9, var: float = 1.0) -> LMB:
    """One-dimensional targets."""
    return LMB.from_bernoullis(
        list(places), [existence] * len(places), [[x] for x in places.values()], [[[var]]] * len(places)
    )


def places(belief: LMB) -> dict[Label, float]:
    return {(a, b): float(m[0]) for (a, b), m in zip(belief.tracks.labels.tolist(), belief.tracks.means, strict=True)}


def lmbs(*beliefs: LMB) -> list[dict[Label, float]]:
    matched = match_labels(beliefs)
    for belief in matched:
        belief.validate()
        assert isinstance(belief, LMB)
    return [places(belief) for belief in matched]  # type: ignore[arg-type]


def test_the_first_sensor_leads_and_the_order_of_labels_is_of_no_account() -> None:
    first, second = at({(1, 0): 0.0, (5, 1): 10.0}), at({(2, 0): 10.4, (2, 1): -0.3, (1, 0): 20.0})
    assert lmbs(first, second) == [
        {(1, 0): 0.0, (5, 1): 10.0},
        {(1, 0): -0.3, (5, 1): 10.4, (1, 2_000_000): 20.0},
    ]
    assert match_labels([first, second])[0] is first


def test_unmatched_labels_stay_or_get_one_of_the_sensors_own() -> None:
    first = at({(1, 0): 0.0})
    second, third = at({(1, 0): 100.0, (3, 0): 200.0}), at({(1, 0): 100.5, (3, 0): 300.0, (1, 2_000_000): 400.0})
    assert lmbs(first, second, third) == [
        {(1, 0): 0.0},
        {(1, 2_000_000): 100.0, (3, 0): 200.0},
        {(1, 2_000_000): 100.5, (3, 3_000_000): 300.0, (1, 3_000_000): 400.0},
    ]


def test_the_assignment_is_the_best_of_all() -> None:
    """Against all assignments, of four labels within each other's gates."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        means, covs = rng.normal(size=(2, 4, 2)), np.array([[np.diag(rng.uniform(0.5, 2.0, 2))] * 4] * 2)
        beliefs = [LMB.from_bernoullis([(1 + s, i) for i in range(4)], [0.9] * 4, means[s], covs[s]) for s in range(2)]
        costs = np.empty((4, 4))
        for i in range(4):
            for j in range(4):
                total, d = covs[0, i] + covs[1, j], means[0, i] - means[1, j]
                costs[i, j] = d @ np.linalg.inv(total) @ d + np.linalg.slogdet(total)[1]
        best = min(permutations(range(4)), key=lambda p: sum(costs[i, p[i]] for i in range(4)))
        matched = match_labels(beliefs)[1]
        for i, j in enumerate(best):
            place = [tuple(label) for label in matched.tracks.labels.tolist()].index((1, i))
            np.testing.assert_array_equal(matched.tracks.means[place], means[1, j])


def test_likely_labels_are_matched_before_the_others() -> None:
    """A birth that was never taken up lies nearer than the target that was born later."""
    first = LMB.from_bernoullis([(1, 0), (2, 0)], [0.95, 0.01], [[0.0], [1.0]], [[[1.0]]] * 2)
    second = LMB.from_bernoullis([(1, 0), (2, 0)], [0.01, 0.9], [[0.2], [1.1]], [[[1.0]]] * 2)
    assert lmbs(first, second)[1] == {(1, 0): 1.1, (2, 0): 0.2}


def test_of_equal_costs_equal_labels_are_matched() -> None:
    same = at({(1, 0): 0.0, (2, 0): 0.0, (3, 0): 0.0})
    assert match_labels([same, same])[1] is same
    rotated = at({(3, 0): 0.0, (4, 0): 0.0, (1, 0): 0.0})
    assert set(lmbs(same, rotated)[1]) == {(1, 0), (2, 0), (3, 0)}


def test_beyond_the_gate_nothing_is_matched() -> None:
    gate = (2.0 * 10.8276) ** 0.5  # chi-squared of one degree of freedom, 0.999
    assert lmbs(at({(1, 0): 0.0}), at({(2, 0): gate - 0.01}))[1].keys() == {(1, 0)}
    assert lmbs(at({(1, 0): 0.0}), at({(1, 0): gate + 0.01}))[1].keys() == {(1, 2_000_000)}


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_densities_stay_what_they_are_and_labels_distinct(seed: int, labelled_sets: bool) -> None:
    rng = np.random.default_rng(seed)
    make = (lambda: random_glmb(rng, 4, 8, 2)) if labelled_sets else (lambda: random_lmb(rng, 4))
    beliefs = [make() for _ in range(3)]
    matched = match_labels(beliefs)
    again = match_labels(matched)
    for before, after, twice in zip(beliefs, matched, again, strict=True):
        after.validate(error=InputError)
        lmb, other = as_lmb(before), as_lmb(after)
        assert len({tuple(label) for label in other.tracks.labels.tolist()}) == lmb.tracks.num_tracks
        np.testing.assert_allclose(np.sort(lmb.existence), np.sort(other.existence), rtol=1e-9, atol=1e-12)
        if isinstance(before, GLMB):
            assert isinstance(after, GLMB)
            np.testing.assert_array_equal(before.hyp_log_weights, after.hyp_log_weights)
            for low, high in zip(before.hyp_offsets[:-1], before.hyp_offsets[1:], strict=True):
                assert set(before.hyp_tracks[low:high]) == set(after.hyp_tracks[low:high])
        np.testing.assert_array_equal(after.tracks.labels, twice.tracks.labels)


def test_a_label_stays_when_the_sensor_that_led_it_loses_it() -> None:
    _, second = match_labels([at({(1, 0): 0.0}), at({(4, 0): 0.3, (2, 0): 50.0})])
    assert isinstance(second, LMB)
    assert lmbs(LMB.empty(1), second)[1] == {(1, 0): 0.3, (2, 0): 50.0}


def test_a_matched_fusion_is_the_rule_on_matched_beliefs() -> None:
    halves = (0.5, 0.5)
    beliefs = [at({(1, 0): 0.0}, 0.95), at({(2, 0): 0.2}, 0.95)]
    assert Clmb(halves).fuse(beliefs)[0].existence.max() < 0.1
    fused, info = LabelMatchedFusion(Clmb(halves)).fuse(beliefs)
    assert_same_bits(fused, Clmb(halves).fuse(match_labels(beliefs))[0])
    assert (fused.tracks.labels.tolist(), info.num_missing_labels) == ([[1, 0]], 0)
    assert fused.existence[0] > 0.9
    matched: Any = LabelMatchedFusion(Clmb(halves))
    assert matched.precompute([], fused) is None
    rng = np.random.default_rng(3)
    glmbs = [random_glmb(rng, 4, 8, 2) for _ in range(2)]
    LabelMatchedFusion(CmDeltaGlmb(halves)).fuse(glmbs)[0].validate()


def test_nothing_to_match_and_what_is_refused() -> None:
    assert match_labels([]) == []
    nothing = LMB.empty(4)
    assert match_labels([nothing, nothing])[1] is nothing
    assert match_labels([nothing, GLMB.empty(4)])[1].state_dim == 4
    with pytest.raises(InputError, match=r"beliefs\[1\]: expected GLMB, LMB or FactoredGLMB; got Poisson"):
        match_labels([nothing, Poisson(np.zeros(0), np.zeros((0, 4)), np.zeros((0, 4, 4)))])  # type: ignore[list-item]
    with pytest.raises(InputError, match="one state dimension"):
        match_labels([nothing, LMB.empty(2)])
    for gate in (0.0, 1.0):
        with pytest.raises(InputError, match="gate_probability"):
            match_labels([nothing], gate_probability=gate)
        with pytest.raises(InputError, match="gate_probability"):
            LabelMatchedFusion(Clmb((1.0,)), gate)


def test_near_pairs_are_those_within_the_gate() -> None:
    rng = np.random.default_rng(5)
    means, others = rng.normal(0.0, 30.0, (60, 3)), rng.normal(0.0, 30.0, (80, 3))
    roots = rng.normal(0.0, 6.0, (60, 3, 4)), rng.normal(0.0, 4.0, (80, 3, 4))
    covs, other_covs = (root @ root.swapaxes(1, 2) for root in roots)
    found, gate = near_pairs(means, covs, others, other_covs, 9.0), 9.0
    total, off = covs[:, None] + other_covs[None], means[:, None] - others[None]
    squares = np.einsum("abi,abij,abj->ab", off, np.linalg.inv(total), off)
    np.testing.assert_array_equal(np.argwhere(squares <= gate), np.column_stack([found.firsts, found.seconds]))
    assert 100 < len(found.squares) < 4000
    np.testing.assert_allclose(found.squares, squares[squares <= gate], rtol=1e-9)
    np.testing.assert_allclose(found.log_dets, np.linalg.slogdet(total)[1][squares <= gate], rtol=1e-9)
