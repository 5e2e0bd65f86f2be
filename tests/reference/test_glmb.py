"""The enumeration oracle against weights worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from reference import glmb
from reference.gaussian import gaussian_pdf

ONE = np.eye(1)
MODEL = glmb.Model(
    transition=lambda x: x,
    transition_jacobian=lambda x: ONE,
    process_noise_cov=lambda x: ONE,
    prob_survival=lambda x: 0.75,
    measurement=lambda x: x,
    measurement_jacobian=lambda x: ONE,
    measurement_noise_cov=lambda x: 2.0 * ONE,
    prob_detection=lambda x: 0.9,
    clutter_intensity=lambda z: 0.2,
    angular=(False,),
)
BIRTHS = {(0, 0): (0.5, [(1.0, np.zeros(1), ONE)])}
SCAN = [np.array([1.0])]
DETECTED = 0.9 * np.exp(-1.0 / 6.0) / np.sqrt(6.0 * np.pi) / 0.2


def test_birth_and_survival_by_hand():
    posterior, total = glmb.step(glmb.no_target(), BIRTHS, SCAN, MODEL)
    assert total == pytest.approx(0.5 + 0.5 * 0.1 + 0.5 * DETECTED)
    key = (((0, 0), (0,)),)
    assert posterior[key][0] == pytest.approx(0.5 * DETECTED / total)
    ((_, mean, cov),) = posterior[key][1][0, 0]
    assert mean == pytest.approx([1.0 / 3.0])
    assert cov == pytest.approx(2.0 / 3.0 * ONE)
    # An empty scan: the target survived and was missed, or died, or had never been.
    later, _ = glmb.step(posterior, {}, [], MODEL)
    alive = {(0,): 0.5 * DETECTED * 0.75 * 0.1, (glmb.MISSED,): 0.5 * 0.1 * 0.75 * 0.1}
    dead = 0.5 + 0.25 * 0.5 * (DETECTED + 0.1)
    for history, weight in alive.items():
        assert later[((0, 0), (*history, glmb.MISSED)),][0] == pytest.approx(weight / (dead + sum(alive.values())))
    assert later[()][0] == pytest.approx(dead / (dead + sum(alive.values())))


def test_association_count():
    # 2 rows, 2 measurements: 4 x 4 choices less the 2 that share a measurement.
    assert len(list(glmb.associations(2, 2))) == 14


def test_lmb_step_by_hand():
    lmb, _ = glmb.lmb_step(BIRTHS, {}, SCAN, MODEL)
    predicted = 0.5 * 0.75
    detected = 0.9 * gaussian_pdf(np.ones(1), np.zeros(1), 4.0 * ONE) / 0.2
    odds = predicted / (1.0 - predicted) * (0.1 + detected)
    existence, mixture = lmb[0, 0]
    assert existence == pytest.approx(odds / (1.0 + odds))
    assert sorted(weight for weight, _, _ in mixture) == pytest.approx(
        sorted([0.1 / (0.1 + detected), detected / (0.1 + detected)])
    )


def test_lmb_expansion_and_back():
    lmb = {
        (0, 0): (0.25, [(1.0, np.zeros(1), ONE)]),
        (0, 1): (0.5, [(0.5, np.zeros(1), ONE), (0.5, np.ones(1), ONE)]),
    }
    expanded = glmb.expand_lmb(lmb)
    assert glmb.label_set_weights(expanded) == pytest.approx(
        {(): 0.375, ((0, 0),): 0.125, ((0, 1),): 0.375, ((0, 0), (0, 1)): 0.125}
    )
    assert {label: existence for label, (existence, _) in glmb.to_lmb(expanded).items()} == pytest.approx(
        {(0, 0): 0.25, (0, 1): 0.5}
    )
