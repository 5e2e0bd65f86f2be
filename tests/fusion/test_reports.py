"""What a fusion says of the labels that a sensor lacks, and of those that it loses."""

from __future__ import annotations

import numpy as np
import pytest

from fusion.examples import A, B, glmb, lmb
from vedette.fusion import Clmb, CmDeltaGlmb

HALVES = (0.5, 0.5)


@pytest.mark.parametrize(("sure", "unsure", "lost"), [(0.95, 0.01, 1), (0.95, 0.8, 0), (0.8, 0.01, 0)])
def test_a_label_that_one_sensor_is_sure_of_is_lost_where_another_does_not_see_it(
    sure: float, unsure: float, lost: int
) -> None:
    rng = np.random.default_rng(3)
    lmbs = [lmb((A,), (existence,), rng) for existence in (sure, unsure)]
    glmbs = [glmb({(): 1.0 - existence, (A,): existence}, rng) for existence in (sure, unsure)]
    fused, of_lmbs = Clmb(HALVES).fuse(lmbs)
    _, of_glmbs = CmDeltaGlmb(HALVES).fuse(glmbs)
    assert (fused.existence[0] < 0.5) == bool(lost or sure < 0.9)
    for info in (of_lmbs, of_glmbs):
        assert info.num_lost_labels == lost
        assert info.missing_labels == (0, 0)


def test_what_is_missing_is_told_by_sensor_and_a_sensor_of_weight_zero_lacks_nothing() -> None:
    rng = np.random.default_rng(3)
    whole, part = glmb({(): 0.1, (A,): 0.2, (A, B): 0.7}, rng), glmb({(A,): 1.0}, rng)
    _, info = CmDeltaGlmb((0.5, 0.0, 0.5)).fuse([whole, part, part])
    assert info.missing_sets == (0, 0, 2)
    assert info.missing_labels == (0, 0, 1)
    assert (info.num_missing_sets, info.num_missing_labels, info.num_sets) == (2, 1, 3)
    _, info = Clmb((0.5, 0.0, 0.5)).fuse([lmb((A, B), (0.5, 0.5), rng), lmb((A,), (0.5,), rng), lmb((A,), (0.5,), rng)])
    assert (info.missing_sets, info.missing_labels, info.num_sets) == ((0, 0, 1), (0, 0, 1), 2)
