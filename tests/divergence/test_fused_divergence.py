"""The planner's divergence of a fusion that is never formed, against forming it with the public functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import log_expit

from densities.examples import random_glmb, random_lmb
from vedette.densities import GLMB, LMB, marginalise
from vedette.divergence import cauchy_schwarz, log_inner_product
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.kernels.fused_divergence import (
    Cases,
    Prediction,
    fill_missing_sets,
    fused_glmb_divergence,
    fused_lmb_divergence,
)
from vedette.kernels.information import row_size, to_information

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


def _glmb_case(density: GLMB, weight: float, sets, labels):
    """One sensor's belief laid out on `sets`, as a planner lays it out."""
    own, sizes = _sets_of(density), [len(s) for s in sets]
    offsets = np.cumsum([0, *sizes])
    members = [labels.index(label) for s in sets for label in s]
    log_weights, held = np.full(len(sets), -math.inf), np.zeros(len(sets), np.bool_)
    means, covs = np.zeros((offsets[-1], DIM)), np.zeros((offsets[-1], DIM, DIM))
    for i, s in enumerate(sets):
        if s in own:
            h, tracks = own[s]
            log_weights[i], held[i] = density.hyp_log_weights[h], True
            means[offsets[i] : offsets[i + 1]] = density.tracks.means[tracks]
            covs[offsets[i] : offsets[i + 1]] = density.tracks.covs[tracks]
    known = np.ones(offsets[-1], np.bool_)
    counts = fill_missing_sets(
        offsets, np.array(members, np.int64), len(labels), LOG_FLOOR, log_weights, means, covs, known
    )
    rows = np.zeros((offsets[-1], row_size(DIM)))
    for m in range(offsets[-1]):
        if known[m]:
            rows[m] = _row(means[m], covs[m], weight)
    return offsets, weight * log_weights, held, rows, counts


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
    laid_out = [_glmb_case(b, w, sets, labels) for b, w in zip(beliefs, weights, strict=True)]
    offsets = laid_out[0][0]
    fused, info = CmDeltaGlmb(weights).fuse(beliefs)
    assert sum(item[4][0] for item in laid_out) == info.num_missing_sets
    cases = Cases(
        offsets,
        np.array([item[1] for item in laid_out]),
        np.empty((0, 0)),
        np.array([item[2] for item in laid_out]),
        np.array([item[3] for item in laid_out]),
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
