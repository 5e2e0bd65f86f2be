"""What trackers do with products of GLMBs: what they send, and who may be born beside them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tracking.scenes import lmb, sensor
from vedette.densities import GLMB, FactoredGLMB, LabelledDensity, TrackTable, as_lmb
from vedette.models import BirthModel, MeasurementBirth
from vedette.tracking.base import belief_bytes
from vedette.tracking.births import births_from_scans

STD = np.array([10.0, 10.0, 5.0, 5.0])
BIRTH = replace(BirthModel.none(4), from_measurements=MeasurementBirth(expected=0.4, max_existence=0.3, std=STD))
COV = np.diag([9.0, 9.0, 4.0, 4.0])


def targets(labels: Any, existence: Any) -> Any:
    means = np.array([[100.0 * index, 0.0, 1.0, 1.0] for _, index in labels])
    return lmb(labels, existence, means, np.tile(COV, (len(labels), 1, 1)))


def pair() -> GLMB:
    """Two targets of which at most one is there, at one of two places."""
    means = [[200.0, 0.0, 0.0, 0.0], [300.0, 0.0, 0.0, 0.0], [310.0, 0.0, 0.0, 0.0]]
    tracks = TrackTable.from_gaussians([[1, 2], [1, 3], [1, 3]], means, [COV] * 3)
    return GLMB.from_hypotheses(tracks, [[0], [1], [2]], [0.5, 0.3, 0.2])


def test_bytes_are_those_of_an_lmb_where_labels_are_alone() -> None:
    alone = targets([[1, 0], [1, 1]], [0.6, 0.9])
    product = FactoredGLMB.of(alone)
    assert belief_bytes(product) == belief_bytes(alone)
    both = FactoredGLMB.product([product, FactoredGLMB.of(pair())], 4)
    assert belief_bytes(both) == belief_bytes(alone) + belief_bytes(pair())


def test_births_match_those_of_the_lmb_filter() -> None:
    alone = FactoredGLMB.of(targets([[1, 0], [1, 1]], [0.6, 0.9]))
    product = FactoredGLMB.product([alone, FactoredGLMB.of(pair())], 4)
    scan = np.array([[2.0, -1.0], [101.0, 0.0], [302.0, 1.0], [-300.0, 50.0]])
    own: list[LabelledDensity] = [product, as_lmb(product)]
    born, wanted = (
        births_from_scans(BIRTH, belief, [sensor(3.0, 0.9, 4.0)], [scan], np.zeros((1, 3)), 7) for belief in own
    )
    assert born is not None
    assert wanted is not None
    np.testing.assert_array_equal(born.tracks.means, wanted.tracks.means)
    np.testing.assert_array_equal(born.existence_logit, wanted.existence_logit)
