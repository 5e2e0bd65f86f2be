"""Marginals of tracks that contend for measurements of several sensors, against enumeration of all joint choices."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vedette.kernels.steps.multi_sensor_choices import Choices
from vedette.kernels.steps.multi_sensor_marginals import StateCaps, choice_marginals

pytestmark = pytest.mark.lanes

NO_CAPS = StateCaps(2**62, math.inf)


def make_choices(tracks, log_absent, num_sensors):
    """From (columns, log weight) pairs of each track."""
    flat = [choice for track in tracks for choice in track]
    return Choices(
        np.cumsum([0, *(len(track) for track in tracks)]),
        np.array([columns for columns, _ in flat], np.int64).reshape(len(flat), num_sensors),
        np.array([weight for _, weight in flat], np.float64),
        np.array(log_absent, np.float64),
    )


def enumerated(choices):
    """Log total weight of all joint choices; probability of each choice, and of each track's absence."""
    num_tracks = len(choices.log_absent)
    lists = [[-1, *range(choices.offsets[t], choices.offsets[t + 1])] for t in range(num_tracks)]
    found = []
    for chosen in itertools.product(*lists):
        taken = [column for choice in chosen if choice >= 0 for column in choices.columns[choice] if column >= 0]
        if len(set(taken)) == len(taken):
            weights = [choices.log_absent[t] if c < 0 else choices.log_weights[c] for t, c in enumerate(chosen)]
            found.append((sum(weights), chosen))
    log_all = float(np.logaddexp.reduce([weight for weight, _ in found], initial=-np.inf))
    marginals, absent = np.zeros(len(choices.log_weights)), np.zeros(num_tracks)
    if log_all > -math.inf:
        for weight, chosen in found:
            for track, choice in enumerate(chosen):
                if choice < 0:
                    absent[track] += math.exp(weight - log_all)
                else:
                    marginals[choice] += math.exp(weight - log_all)
    return log_all, marginals, absent


def solve(choices, num_columns, caps=NO_CAPS):
    marginals, absent = np.zeros(len(choices.log_weights)), np.zeros(len(choices.log_absent))
    return *choice_marginals(choices, num_columns, caps, marginals, absent), np.exp(marginals), np.exp(absent)


@st.composite
def tables(draw):
    num_sensors, num_columns = draw(st.integers(1, 3)), draw(st.integers(0, 4))
    weight = draw(st.sampled_from([st.integers(-3, 1).map(float), st.floats(-30.0, 30.0), st.floats(-900.0, 900.0)]))
    column = st.one_of(st.just(-1), st.integers(0, num_columns - 1)) if num_columns else st.just(-1)
    tracks, log_absent = [], []
    for _ in range(draw(st.integers(0, 5))):
        drawn = draw(st.lists(st.tuples(*[column] * num_sensors), max_size=5, unique=True))
        # A measurement is of one sensor, and of a sensor a track takes one.
        own = [tuple(num_columns * s + c if c >= 0 else -1 for s, c in enumerate(columns)) for columns in drawn]
        tracks.append([(columns, draw(weight)) for columns in own])
        log_absent.append(draw(st.one_of(weight, st.just(-math.inf))))
    return make_choices(tracks, log_absent, num_sensors), num_sensors * num_columns


@given(tables())
def test_marginals(table):
    choices, num_columns = table
    log_all, marginals, absent = enumerated(choices)
    log_total, num_inexact, log_kept, got, got_absent = solve(choices, num_columns)
    if log_all == -math.inf:
        assert log_total == -math.inf
        return
    assert log_total == pytest.approx(log_all, rel=1e-12, abs=1e-10)
    assert (num_inexact, log_kept) == (0, 0.0)
    np.testing.assert_allclose(got, marginals, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(got_absent, absent, rtol=1e-9, atol=1e-13)


def crowd(rng, scale, num_tracks=4, num_columns=3):
    """Tracks that may each take any measurement of two sensors, in one cluster."""
    pairs = list(itertools.product([-1, *range(num_columns)], [-1, *range(num_columns, 2 * num_columns)]))
    tracks = [[(pair, scale * rng.normal()) for pair in pairs] for _ in range(num_tracks)]
    return make_choices(tracks, scale * rng.normal(size=num_tracks), 2), 2 * num_columns


@pytest.mark.parametrize("scale", [0.3, 2.0, 8.0])
@pytest.mark.parametrize("caps", [StateCaps(1, math.inf), StateCaps(5, math.inf), StateCaps(1000, 3.0)])
def test_marginals_are_within_the_share_that_may_be_amiss(scale, caps):
    for seed in range(2):
        choices, num_columns = crowd(np.random.default_rng(seed), scale, num_tracks=3)
        _, marginals, absent = enumerated(choices)
        _, num_inexact, log_kept, got, got_absent = solve(choices, num_columns, caps)
        assert num_inexact == (log_kept < 0.0)
        most = max(np.abs(got - marginals).max(), np.abs(got_absent - absent).max())
        assert most <= -math.expm1(log_kept) + 1e-12
        assert np.all((got_absent > 0.0) & (got_absent < 1.0))
        for track in range(3):
            own = slice(choices.offsets[track], choices.offsets[track + 1])
            assert got[own].sum() + got_absent[track] == pytest.approx(1.0, abs=1e-12)


@settings(max_examples=5)
@given(st.integers(0, 2**32 - 1))
def test_more_contested_measurements_than_a_word_holds(seed):
    """A chain of tracks, each contending with the next for one of 70 measurements: the sum is a product of matrices."""
    rng, num = np.random.default_rng(seed), 71
    weights = rng.normal(size=(num, 3))
    tracks = [
        [((column,), weights[t, i]) for i, column in enumerate((t - 1, t)) if 0 <= column < num - 1] for t in range(num)
    ]
    choices = make_choices(tracks, weights[:, 2], 1)
    log_total, num_inexact, _, _, _ = solve(choices, num - 1)
    assert num_inexact == 0
    # States: whether the measurement shared with the next track is taken.
    free, taken = 1.0, 0.0
    for t in range(num):
        own = {column[0]: math.exp(weight) for column, weight in tracks[t]}
        stays = math.exp(weights[t, 2]) * (free + taken) + own.get(t - 1, 0.0) * free
        free, taken = stays, own.get(t, 0.0) * (free + taken)
    assert log_total == pytest.approx(math.log(free + taken), abs=1e-10)
