"""The planner's divergence of a fusion that is never formed, against forming it with the public functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_expit

from densities.examples import plain_moments, random_glmb, random_lmb
from vedette.densities import GLMB, LMB, marginalise
from vedette.divergence import cauchy_schwarz, log_inner_product
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.kernels.gaussian.information import row_size, to_information
from vedette.kernels.planning.fused_divergence import Cases, Prediction, fused_glmb_divergence, fused_lmb_divergence

pytestmark = pytest.mark.lanes

DIM = 2
LOG_FLOOR = math.log(1e-6)


def _row(mean, cov, power):
    row = np.empty(row_size(DIM))
    assert to_information(mean, cov, np.zeros(DIM), power, row, np.empty((DIM, DIM)), np.empty((DIM, DIM)))
    return row


def _sets_of(density: GLMB):
    """Place of each label set's hypothesis and of each label's track in it; marginalised, single Gaussians."""
    found = {}
    for h in range(density.num_hyps):
        tracks = density.hyp_tracks[density.hyp_offsets[h] : density.hyp_offsets[h + 1]]
        found[tuple(map(tuple, density.tracks.labels[tracks].tolist()))] = h, tracks
    return found


def _glmb_case(density: GLMB, weight: float, sets):
    """One sensor's belief laid out on `sets`, as a planner lays it out: scaled log weights, held, rows."""
    own = _sets_of(density)
    floor = min(LOG_FLOOR, float(density.hyp_log_weights.min()))
    log_weights = np.array([density.hyp_log_weights[own[s][0]] if s in own else floor for s in sets])
    rows = []
    for s in sets:
        for i, label in enumerate(s):
            if s in own:
                versions = [(1.0, own[s][1][i])]
            else:
                versions = [
                    (float(np.exp(density.hyp_log_weights[h])), tracks[other.index(label)])
                    for other, (h, tracks) in own.items()
                    if label in other
                ]
            mixture = [(share, density.tracks.means[t], density.tracks.covs[t]) for share, t in versions]
            rows.append(_row(*plain_moments(mixture), weight) if mixture else np.zeros(row_size(DIM)))
    return weight * log_weights, np.array([s in own for s in sets]), np.reshape(rows, (-1, row_size(DIM)))


@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_cm_delta_glmb(seed, num_sensors):
    rng = np.random.default_rng(seed)
    beliefs = [marginalise(random_glmb(rng, 3, 4, 1)) for _ in range(num_sensors)]
    predicted = marginalise(random_glmb(rng, 3, 4, 1))
    # Common labels, so that something is shared.
    labels = [(0, 0), (0, 1), (1, 0)]
    beliefs, predicted = [_with_labels(b, labels) for b in beliefs], _with_labels(predicted, labels)
    weights = rng.dirichlet(np.ones(num_sensors))
    sets = sorted({s for belief in beliefs for s in _sets_of(belief)})
    laid_out = [_glmb_case(b, w, sets) for b, w in zip(beliefs, weights, strict=True)]
    offsets = np.cumsum([0, *(len(s) for s in sets)])
    fused, info = CmDeltaGlmb(weights).fuse(beliefs)
    assert sum(int((~held).sum()) for _, held, _ in laid_out) == info.num_missing_sets
    cases = Cases(
        offsets,
        np.array([log_present for log_present, _, _ in laid_out]),
        np.empty((0, 0)),
        np.array([held for _, held, _ in laid_out]),
        np.array([rows for _, _, rows in laid_out]),
    )
    own = _sets_of(predicted)
    log_present, rows = np.full(len(sets), -math.inf), np.zeros((offsets[-1], row_size(DIM)))
    for i, s in enumerate(sets):
        if s in own:
            log_present[i] = predicted.hyp_log_weights[own[s][0]]
            for m, track in zip(range(offsets[i], offsets[i + 1]), own[s][1], strict=True):
                rows[m] = _row(predicted.tracks.means[track], predicted.tracks.covs[track], 1.0)
    unit_volume = 3.0
    log_self = log_inner_product(predicted, predicted, unit_volume=unit_volume)
    prediction = Prediction(log_present, np.empty(0), rows, 0.0, log_self)
    got = fused_glmb_divergence(
        cases, np.arange(num_sensors), prediction, DIM, math.log(unit_volume), np.empty((2, row_size(DIM)))
    )
    expected = cauchy_schwarz(predicted, fused, unit_volume=unit_volume)
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-9)


def _with_labels(density: GLMB, labels) -> GLMB:
    known = sorted(set(map(tuple, density.tracks.labels.tolist())))
    renamed = np.array([labels[known.index(tuple(label))] for label in density.tracks.labels.tolist()], np.int64)
    tracks = type(density.tracks)(
        renamed.reshape(-1, 2),
        density.tracks.offsets,
        density.tracks.log_weights,
        density.tracks.means,
        density.tracks.covs,
    )
    return GLMB(tracks, density.hyp_offsets, density.hyp_tracks, density.hyp_log_weights)


@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_clmb(seed, num_sensors):
    rng = np.random.default_rng(seed)
    beliefs, predicted = [random_lmb(rng, 20) for _ in range(num_sensors)], random_lmb(rng, 20)
    weights = rng.dirichlet(np.ones(num_sensors))
    floor = 1e-9
    places = [{tuple(label): i for i, label in enumerate(b.tracks.labels.tolist())} for b in (*beliefs, predicted)]
    labels = sorted(set().union(*places[:-1]))
    log_floor, log_not_floor = math.log(floor), math.log1p(-floor)
    present, absent = np.empty((num_sensors, len(labels))), np.empty((num_sensors, len(labels)))
    held, rows = np.zeros(present.shape, np.bool_), np.zeros((*present.shape, row_size(DIM)))
    for s, (belief, weight) in enumerate(zip(beliefs, weights, strict=True)):
        for i, label in enumerate(labels):
            at = places[s].get(label)
            held[s, i] = at is not None
            logit = belief.existence_logit[at] if at is not None else log_floor - log_not_floor
            present[s, i], absent[s, i] = weight * log_expit(logit), weight * log_expit(-logit)
            if at is not None:
                rows[s, i] = _row(belief.tracks.means[at], belief.tracks.covs[at], weight)
    cases = Cases(np.arange(len(labels) + 1), present, absent, held, rows)
    got = fused_lmb_divergence(
        cases,
        np.arange(num_sensors),
        _lmb_prediction(predicted, labels, places[-1]),
        DIM,
        0.0,
        np.empty((2, row_size(DIM))),
    )
    fused, _ = Clmb(weights, missing_existence=floor).fuse(beliefs)
    assert got == pytest.approx(cauchy_schwarz(predicted, fused), rel=1e-9, abs=1e-9)


def _lmb_prediction(predicted: LMB, labels, place_of) -> Prediction:
    log_present, log_absent = np.full(len(labels), -math.inf), np.zeros(len(labels))
    rows = np.zeros((len(labels), row_size(DIM)))
    for i, label in enumerate(labels):
        if label in place_of:
            at = place_of[label]
            log_present[i], log_absent[i] = (
                log_expit(predicted.existence_logit[at]),
                log_expit(-predicted.existence_logit[at]),
            )
            rows[i] = _row(predicted.tracks.means[at], predicted.tracks.covs[at], 1.0)
    others = [at for label, at in place_of.items() if label not in labels]
    log_rest = float(log_expit(-predicted.existence_logit[others]).sum())
    return Prediction(log_present, log_absent, rows, log_rest, log_inner_product(predicted, predicted))
