"""Several LMBs are found valid together exactly where each is on its own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from densities.examples import random_glmb, random_lmb
from vedette.densities import LMB, TrackTable
from vedette.densities.containers import unchecked
from vedette.errors import InputError
from vedette.fusion import Clmb, CmDeltaGlmb, PrevalidatedBeliefs
from vedette.fusion.base import all_valid


def spoilt(belief: LMB, field: str, value: Any) -> LMB:
    parts: dict[str, Any] = {name: getattr(belief.tracks, name) for name in TrackTable.__match_args__}
    if field == "existence_logit":
        return unchecked(LMB, belief.tracks, value(belief.existence_logit.copy()))
    parts[field] = value(parts[field].copy())
    return unchecked(LMB, unchecked(TrackTable, *parts.values()), belief.existence_logit)


def first(value: Any) -> Any:
    def change(array: Any) -> Any:
        array[(0,) * array.ndim] = value
        return array

    return change


FAULTS = [
    ("labels", lambda a: a[::-1].copy()),
    ("labels", lambda a: np.repeat(a[:1], len(a), axis=0)),
    ("labels", lambda a: a.astype(np.int32)),
    ("labels", lambda a: np.c_[a, a]),
    ("offsets", lambda a: a[:-1].copy()),
    ("offsets", first(1)),
    ("offsets", lambda a: np.r_[a[:-1], a[-1] + 1]),
    ("offsets", lambda a: np.r_[a[0], a[2], a[1], a[3:]]),
    ("log_weights", first(0.5)),
    ("log_weights", first(np.nan)),
    ("means", first(np.inf)),
    ("covs", first(-1.0)),
    ("covs", first(np.nan)),
    ("existence_logit", first(np.nan)),
    ("existence_logit", lambda a: a[:-1].copy()),
]


@pytest.mark.parametrize(("field", "change"), FAULTS)
def test_each_fault_of_one_is_found_and_told_as_that_of_it(field: str, change: Any) -> None:
    rng = np.random.default_rng(0)
    beliefs = [belief for belief in (random_lmb(rng, 4) for _ in range(60)) if belief.tracks.num_tracks > 2][:3]
    assert all_valid(beliefs)
    for place in range(3):
        given = [spoilt(own, field, change) if s == place else own for s, own in enumerate(beliefs)]
        assert not all_valid(given)
        with pytest.raises(InputError, match=rf"beliefs\[{place}\]: "):
            Clmb((0.2, 0.3, 0.5)).fuse(given)


def test_valid_ones_pass_and_other_kinds_are_left_to_their_own_check() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        assert all_valid([random_lmb(rng, 4), LMB.empty(2), random_lmb(rng, 4), LMB.empty(2)])
    assert all_valid([LMB.empty(4)] * 3)
    assert not all_valid([random_glmb(rng, 3, 10, 2)])
    assert not all_valid([LMB.empty(4), LMB.empty(2)])
    assert not all_valid([])


def test_beliefs_that_need_no_check_are_fused_to_the_same_bytes() -> None:
    rng = np.random.default_rng(2)
    for _ in range(10):
        glmbs = [random_glmb(rng, 4, 10, 2) for _ in range(2)]
        lmbs = [random_lmb(rng, 4) for _ in range(2)]
        cases: list[tuple[Any, list[Any]]] = [(CmDeltaGlmb((0.4, 0.6)), glmbs), (Clmb((0.4, 0.6)), lmbs)]
        for rule, beliefs in (*cases, (Clmb((0.4, 0.6)), glmbs)):
            checked, report = rule.fuse(beliefs)
            taken, same = rule.fuse(PrevalidatedBeliefs(beliefs))
            assert report == same
            for mine, other in zip(checked.to_kernel(), taken.to_kernel(), strict=True):
                np.testing.assert_equal(mine, other)


def test_their_kinds_are_checked_all_the_same() -> None:
    with pytest.raises(InputError, match=r"beliefs\[1\]: expected GLMB or FactoredGLMB; got LMB"):
        CmDeltaGlmb((0.5, 0.5)).fuse(
            PrevalidatedBeliefs([random_glmb(np.random.default_rng(0), 2, 3, 2), LMB.empty(2)])
        )
    with pytest.raises(InputError, match="one state dimension"):
        Clmb((0.5, 0.5)).fuse(PrevalidatedBeliefs([LMB.empty(4), LMB.empty(2)]))
