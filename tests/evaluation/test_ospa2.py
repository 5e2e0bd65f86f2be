from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evaluation.synthetic import make_record
from reference import tracks as reference
from vedette.errors import InputError
from vedette.evaluation import TrackSet, ospa2, ospa2_of_run, ospa_of_run

NUM_SCANS = 6
coordinates = st.floats(-100.0, 100.0, allow_subnormal=False) | st.sampled_from([0.0, 3.0, 4.0])
cutoffs = st.floats(0.1, 200.0) | st.sampled_from([3.0, 5.0])
windows = st.integers(1, NUM_SCANS + 2)
orders = st.sampled_from([1.0, 2.0, 3.5])


@st.composite
def track_sets(draw: st.DrawFn) -> TrackSet:
    num = draw(st.integers(0, 3))
    alive = draw(hnp.arrays(np.bool_, (num, NUM_SCANS)))
    return TrackSet(alive, draw(hnp.arrays(np.float64, (num, NUM_SCANS, 2), elements=coordinates)))


def plain(tracks: TrackSet) -> dict[Any, reference.Track]:
    return {
        row: {scan: tracks.positions[row, scan] for scan in np.flatnonzero(tracks.alive[row]).tolist()}
        for row in range(len(tracks.alive))
    }


@given(track_sets(), track_sets(), cutoffs, orders, windows)
def test_equals_brute_force(first: TrackSet, second: TrackSet, cutoff: float, order: float, window: int) -> None:
    actual = ospa2(first, second, cutoff=cutoff, order=order, window=window)
    for scan in range(NUM_SCANS):
        expected = reference.ospa2(plain(first), plain(second), scan, window, cutoff, order)
        assert actual[scan, 0] == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert actual[scan, 1] ** order + actual[scan, 2] ** order == pytest.approx(actual[scan, 0] ** order)


@given(track_sets(), track_sets(), track_sets(), cutoffs, st.sampled_from([1.0, 2.0, math.inf]), windows)
def test_is_a_metric(a: TrackSet, b: TrackSet, c: TrackSet, cutoff: float, order: float, window: int) -> None:
    def distance(x: TrackSet, y: TrackSet) -> Any:
        return ospa2(x, y, cutoff=cutoff, order=order, window=window)[:, 0]

    assert not distance(a, TrackSet(a.alive[::-1], a.positions[::-1])).any()
    assert distance(a, b) == pytest.approx(distance(b, a))
    assert (distance(a, b) <= cutoff * (1.0 + 1e-12)).all()
    assert (distance(a, c) <= distance(a, b) + distance(b, c) + 1e-9).all()


@pytest.mark.parametrize("order", [1.0, 2.0, math.inf])
def test_a_window_of_one_scan_is_ospa(order: float) -> None:
    record = make_record("random")
    actual = ospa2_of_run(record.truth, record.estimates, cutoff=20.0, order=order, window=1)
    assert actual == pytest.approx(ospa_of_run(record.truth, record.estimates, cutoff=20.0, order=order))


def test_by_hand() -> None:
    """One target for four scans; estimated 3 m off for two scans, then under another label."""
    truth = TrackSet(np.ones((1, 4), np.bool_), np.zeros((1, 4, 2)))
    found = TrackSet(np.array([[1, 1, 0, 0], [0, 0, 1, 1]], np.bool_), np.full((2, 4, 2), [3.0, 0.0]))
    actual = ospa2(found, truth, cutoff=10.0, order=1.0, window=3)
    # Third scan: the first label is 3, 3, 10 off on average over three scans, and a second track is too many.
    assert actual[:, 0] == pytest.approx([3.0, 3.0, (16.0 / 3.0 + 10.0) / 2.0, (16.0 / 3.0 + 10.0) / 2.0])
    assert actual[3] == pytest.approx([23.0 / 3.0, 8.0 / 3.0, 5.0])


def test_labels_and_ids_make_the_tracks_of_a_run() -> None:
    record = make_record("constant", num_scans=14)
    found: dict[Any, reference.Track] = {}
    true: dict[Any, reference.Track] = {}
    for scan, estimate in enumerate(record.estimates):
        for label, mean in zip(estimate.labels.tolist(), estimate.means, strict=True):
            found.setdefault(tuple(label), {})[scan] = mean[:2]
        for target, state in zip(*record.truth.at(scan), strict=True):
            true.setdefault(int(target), {})[scan] = state[:2]
    actual = ospa2_of_run(record.truth, record.estimates, cutoff=30.0, order=2.0, window=5)
    expected = [reference.ospa2(found, true, scan, 5, 30.0, 2.0) for scan in range(14)]
    assert actual[:, 0] == pytest.approx(expected)


def test_bad_input_is_named() -> None:
    one, none = (
        TrackSet(np.ones((1, 3), np.bool_), np.zeros((1, 3, 2))),
        TrackSet(np.ones((0, 4), np.bool_), np.empty((0, 4, 2))),
    )
    with pytest.raises(InputError, match=r"estimates: expected 3 scans; got 4"):
        ospa2(none, one, cutoff=1.0, order=1.0, window=1)
    with pytest.raises(InputError, match=r"truths: expected one position a track and scan"):
        ospa2(one, TrackSet(one.alive, one.positions[:, :2]), cutoff=1.0, order=1.0, window=1)
    with pytest.raises(InputError, match=r"estimates: expected finite positions"):
        ospa2(TrackSet(one.alive, one.positions + math.nan), one, cutoff=1.0, order=1.0, window=1)
    with pytest.raises(InputError, match=r"window: expected a whole number of at least 1; got 0"):
        ospa2(one, one, cutoff=1.0, order=1.0, window=0)
    with pytest.raises(InputError, match=r"cutoff: expected a finite distance above 0; got inf"):
        ospa2(one, one, cutoff=math.inf, order=1.0, window=1)
    record = make_record()
    with pytest.raises(InputError, match=r"one for each of 40 scans; got 39"):
        ospa2_of_run(record.truth, record.estimates[1:], cutoff=1.0, order=1.0, window=1)
