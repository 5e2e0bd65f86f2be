"""Every fault that the containers look for, and the constructors from a user's plain data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vedette.densities import GLMB, LMB, Estimate, FactoredGLMB, IidCluster, MultiBernoulli, Poisson, TrackTable
from vedette.densities.containers import unchecked
from vedette.errors import InputError, NumericalError

TRACKS = TrackTable.from_mixtures(
    [[0, 0], [0, 1], [1, 0]],
    [
        ([1.0], [[0.0, 0.0]], [np.eye(2)]),
        ([0.25, 0.75], [[1.0, 0.0], [2.0, 0.0]], [np.eye(2), 2.0 * np.eye(2)]),
        ([1.0], [[3.0, 0.0]], [np.eye(2)]),
    ],
)
GOOD_GLMB = GLMB.from_hypotheses(TRACKS, [[0, 2], [], [1]], [0.5, 0.2, 0.3])
GOOD_LMB = LMB(TRACKS, np.array([2.0, -np.inf, np.inf]))
GOOD_POISSON = Poisson.from_gaussians([0.5, 0.0], np.zeros((2, 2)), [np.eye(2)] * 2)


def _changed(array, place, value):
    copy = array.copy()
    copy[place] = value
    return copy


LOPSIDED = np.array([[1.0, 0.5], [0.0, 1.0]])
INDEFINITE = np.array([[1.0, 2.0], [2.0, 1.0]])

TRACK_FAULTS = [
    ("labels", TRACKS.labels.astype(float), InputError, "int64; got one of float64"),
    ("labels", np.zeros((3, 3), np.int64), InputError, r"shape \(any, 2\)"),
    ("labels", TRACKS.labels.tolist(), InputError, "got list"),
    ("offsets", np.array([0, 1, 3]), InputError, r"shape \(4\)"),
    ("offsets", np.array([1, 2, 3, 4]), InputError, "from 0 to 4; got 1 to 4"),
    ("offsets", np.array([0, 1, 3, 3]), InputError, "from 0 to 4; got 0 to 3"),
    ("offsets", np.array([0, 3, 1, 4]), InputError, "increase; got 1 after 3"),
    ("offsets", np.array([0, 1, 1, 4]), InputError, "increase; got 1 after 1"),
    ("log_weights", np.zeros(3), InputError, r"shape \(4\)"),
    ("log_weights", TRACKS.log_weights.astype(np.float32), InputError, "float32"),
    ("log_weights", _changed(TRACKS.log_weights, 1, np.nan), NumericalError, "nan"),
    ("log_weights", _changed(TRACKS.log_weights, 1, np.inf), NumericalError, "inf"),
    ("log_weights", _changed(TRACKS.log_weights, 1, -np.inf), NumericalError, "sum to 1"),
    ("log_weights", _changed(TRACKS.log_weights, 0, -np.inf), NumericalError, "sum to 1"),
    ("log_weights", _changed(TRACKS.log_weights, 0, 1e-8), NumericalError, "sum to 1"),
    ("means", np.zeros(4), InputError, r"shape \(any, any\)"),
    ("means", np.empty((4, 0)), InputError, "at least 1 dimension"),
    ("means", _changed(TRACKS.means, (2, 1), np.inf), NumericalError, r"\[2, 1\]: expected a finite number"),
    ("covs", np.zeros((4, 2, 3)), InputError, r"shape \(4, 2, 2\)"),
    ("covs", _changed(TRACKS.covs, (3, 0, 1), np.nan), NumericalError, r"\[3, 0, 1\]: expected a finite number"),
    ("covs", _changed(TRACKS.covs, 2, LOPSIDED), NumericalError, r"\[2\]: expected a symmetric"),
    ("covs", _changed(TRACKS.covs, 1, INDEFINITE), NumericalError, r"\[1\]: expected a positive definite.* -1"),
    ("covs", _changed(TRACKS.covs, 1, 0.0), NumericalError, r"\[1\]: expected a positive definite"),
    ("sources", [[0, 0]] * 3, InputError, "an array of int64; got list"),
    ("sources", np.zeros((2, 2), np.int64), InputError, r"shape \(3, 2\)"),
    (
        "sources",
        np.array([[0, 1], [-1, -3], [-1, -2]]),
        InputError,
        r"\[1\]: expected at least \[-1, -2\]; got \[-1, -3\]",
    ),
    ("sources", np.array([[0, 1], [-1, -2], [-2, 0]]), InputError, r"\[2\]: expected at least"),
]


def _spoilt(density: Any, **fields: Any) -> Any:
    """The density with other fields, as if its arrays had been changed after it was made."""
    return unchecked(
        type(density), *(fields.get(name, getattr(density, name)) for name in type(density).__match_args__)
    )


def _refused(density: Any, field: str, value: Any, error: type[Exception], match: str) -> None:
    """A user cannot make it, and `validate` finds it when it has come about."""
    with pytest.raises(InputError, match=match):
        replace(density, **{field: value})
    with pytest.raises(error, match=match):
        _spoilt(density, **{field: value}).validate()


@pytest.mark.parametrize(("field", "value", "error", "message"), TRACK_FAULTS)
def test_faults_of_a_track_table(field, value, error, message):
    _refused(TRACKS, field, value, error, rf"^tracks\.{field}.*{message}")
    tracks = _spoilt(TRACKS, **{field: value})
    for invalid in (_spoilt(GOOD_GLMB, tracks=tracks), _spoilt(GOOD_LMB, tracks=tracks)):
        with pytest.raises(error, match=rf"^tracks\.{field}.*{message}"):
            invalid.validate()


GLMB_FAULTS = [
    ("hyp_offsets", np.array([0, 2, 3]), InputError, r"shape \(4\)"),
    ("hyp_offsets", np.array([0, 2, 1, 3]), InputError, "no decrease; got 1 after 2"),
    ("hyp_offsets", np.array([0, 2, 2, 2]), InputError, "from 0 to 3"),
    ("hyp_tracks", np.array([[0, 2, 1]]), InputError, r"shape \(any\)"),
    ("hyp_tracks", np.array([0, 2, 3]), InputError, r"\[2\]: expected an index into 3 tracks; got 3"),
    ("hyp_tracks", np.array([-1, 2, 1]), InputError, r"\[0\]: expected an index into 3 tracks; got -1"),
    ("hyp_tracks", np.array([2, 0, 1]), InputError, r"hypothesis 0 has \[\[1, 0\], \[0, 0\]\]"),
    ("hyp_tracks", np.array([2, 2, 1]), InputError, r"distinct labels in increasing order; hypothesis 0"),
    ("hyp_log_weights", np.zeros((3, 1)), InputError, r"shape \(any\)"),
    ("hyp_log_weights", np.log([0.5, 0.2, 0.2]), NumericalError, r"sum to 1; got .*0\.9"),
    ("hyp_log_weights", np.array([0.0, np.nan, -1.0]), NumericalError, r"\[1\].*nan"),
    ("hyp_log_weights", np.full(3, -np.inf), NumericalError, "sum to 1"),
]


@pytest.mark.parametrize(("field", "value", "error", "message"), GLMB_FAULTS)
def test_faults_of_a_glmb(field, value, error, message):
    _refused(GOOD_GLMB, field, value, error, rf"^{field}.*{message}")


def test_a_glmb_of_no_hypothesis_is_a_fault():
    with pytest.raises(InputError, match="at least one hypothesis"):
        GLMB(TRACKS, np.zeros(1, np.int64), np.empty(0, np.int64), np.empty(0))


def test_the_last_hypothesis_is_checked_too():
    with pytest.raises(InputError, match="hypothesis 1"):
        GLMB(TRACKS, np.array([0, 0, 2]), np.array([1, 0]), np.log([0.5, 0.5]))


@pytest.mark.parametrize("density", [GOOD_GLMB, GOOD_LMB])
def test_the_tracks_are_a_track_table(density):
    with pytest.raises(InputError, match="tracks: expected a TrackTable; got tuple"):
        replace(density, tracks=tuple(TRACKS.to_kernel()))


@pytest.mark.parametrize(
    ("means", "message"),
    [
        (np.ma.masked_equal(TRACKS.means, 3.0), "got MaskedArray"),
        (TRACKS.means.astype(">f8"), "got one of >f8"),
        (np.broadcast_to(np.zeros(2), (4, 2)).copy().view(np.matrix), "got matrix"),
    ],
)
def test_arrays_that_would_be_compiled_for_anew_are_refused(means, message):
    with pytest.raises(InputError, match=rf"tracks\.means: expected .*{message}"):
        replace(TRACKS, means=means)


@pytest.mark.parametrize("labels", [[[0, 0], [0, 0], [1, 0]], [[0, 1], [0, 0], [1, 0]], [[2, 0], [3, 0], [1, 5]]])
def test_labels_of_an_lmb_must_increase(labels):
    tracks = replace(TRACKS, labels=np.array(labels))
    with pytest.raises(InputError, match=r"tracks\.labels.*increasing order"):
        LMB(tracks, np.zeros(3))


def test_faults_of_existence():
    _refused(GOOD_LMB, "existence_logit", np.zeros(2), InputError, r"existence_logit.*shape \(3\)")
    nan = np.array([0.0, np.nan, 0.0])
    _refused(GOOD_LMB, "existence_logit", nan, NumericalError, r"existence_logit\[1\].*nan")


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("log_weights", np.zeros(3), InputError),
        ("log_weights", np.array([np.nan, 0.0]), NumericalError),
        ("means", np.zeros(2), InputError),
        ("means", np.empty((2, 0)), InputError),
        ("means", np.full((2, 2), np.nan), NumericalError),
        ("covs", np.zeros((2, 2)), InputError),
        ("covs", np.zeros((2, 2, 2)), NumericalError),
    ],
)
def test_faults_of_a_poisson(field, value, error):
    _refused(GOOD_POISSON, field, value, error, rf"^{field}")


def test_good_and_empty_densities_pass():
    for density in (TRACKS, GOOD_GLMB, GOOD_LMB, GOOD_POISSON, TrackTable.empty(3), GLMB.empty(3), LMB.empty(3)):
        density.validate()


def test_roundings_pass():
    near = GOOD_GLMB.hyp_log_weights + 5e-10
    replace(GOOD_GLMB, hyp_log_weights=near).validate()
    covs = _changed(TRACKS.covs, (0, 0, 1), 1e-12)
    replace(TRACKS, covs=covs).validate()


def test_track_tables_from_gaussians():
    tracks = TrackTable.from_gaussians([(1, 0), (0, 2)], [[1, 2], [3, 4]], [np.eye(2), 2 * np.eye(2)])
    assert tracks.labels.dtype == np.int64
    assert tracks.means.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert (tracks.num_tracks, tracks.state_dim) == (2, 2)
    means = np.zeros((1, 2))
    copied = TrackTable.from_gaussians([(0, 0)], means, [np.eye(2)])
    means[0, 0] = 9.0
    assert copied.means[0, 0] == 0.0
    assert TrackTable.from_gaussians([], np.empty((0, 4)), np.empty((0, 4, 4))).state_dim == 4


@pytest.mark.parametrize(
    ("labels", "means", "covs", "message"),
    [
        ([(0.5, 0)], [[0.0]], [[[1.0]]], "labels: expected an array of integers"),
        (np.array([[2**63, 0]], np.uint64), [[0.0]], [[[1.0]]], "labels: expected integers below"),
        ([(0, 0, 0)], [[0.0]], [[[1.0]]], "labels: expected shape"),
        ([(0, 0), (0,)], [[0.0]], [[[1.0]]], "labels: expected an array of integers"),
        ([(0, 0)], [[0.0], [1.0]], [[[1.0]]], r"means: expected shape \(1, any\)"),
        ([(0, 0)], [["a"]], [[[1.0]]], "means: expected an array of numbers"),
        ([(0, 0)], [[1j]], [[[1.0]]], "means: expected an array of numbers"),
        ([(0, 0)], [[np.nan]], [[[1.0]]], r"means\[0, 0\]: expected a finite"),
        ([(0, 0)], [[0.0]], [[[-1.0]]], r"covs\[0\]: expected a positive definite"),
        ([(0, 0)], [[0.0]], [[1.0]], r"covs: expected shape \(1, 1, 1\)"),
    ],
)
def test_bad_user_data_is_refused(labels, means, covs, message):
    with pytest.raises(InputError, match=message):
        TrackTable.from_gaussians(labels, means, covs)


@pytest.mark.parametrize(
    ("mixtures", "message"),
    [
        ([], r"labels: expected shape \(0, 2\)"),
        ([([0.5, 0.4], np.zeros((2, 1)), np.ones((2, 1, 1)))], "sum to 1"),
        (
            [([1.5, -0.5], np.zeros((2, 1)), np.ones((2, 1, 1)))],
            r"mixtures\[0\] weights: expected numbers of at least 0",
        ),
        ([([1.0], np.zeros((2, 1)), np.ones((2, 1, 1)))], r"mixtures\[0\] means: expected shape \(1, any\)"),
        ([([], np.zeros((0, 1)), np.ones((0, 1, 1)))], r"tracks\.offsets\[1\]: expected an increase"),
    ],
)
def test_bad_mixtures_are_refused(mixtures, message):
    with pytest.raises(InputError, match=message):
        TrackTable.from_mixtures([[0, 0]], mixtures)


def test_mixtures_of_different_dimensions_are_refused():
    one, two = ([1.0], np.zeros((1, 1)), np.ones((1, 1, 1))), ([1.0], np.zeros((1, 2)), np.eye(2)[None])
    with pytest.raises(InputError, match=r"mixtures\[1\] means: expected shape \(1, 1\)"):
        TrackTable.from_mixtures([[0, 0], [0, 1]], [one, two])
    with pytest.raises(InputError, match=r"TrackTable\.empty"):
        TrackTable.from_mixtures(np.empty((0, 2), int), [])


def test_hypotheses_are_put_in_label_order():
    glmb = GLMB.from_hypotheses(TRACKS, [[2, 1, 0]], [1.0])
    assert glmb.hyp_tracks.tolist() == [0, 1, 2]
    assert not GLMB.from_hypotheses(TRACKS, [[0], [0]], [0.5, 0.5]).is_marginalised
    assert GOOD_GLMB.is_marginalised


@pytest.mark.parametrize(
    ("hypotheses", "weights", "message"),
    [
        ([[0], [1]], [0.5, 0.4], "hyp_log_weights.*sum to 1"),
        ([[0], [1]], [1.5, -0.5], "weights: expected numbers of at least 0"),
        ([[0], [1]], [np.nan, 1.0], "weights: expected numbers of at least 0"),
        ([[0], [1]], [1.0], "weights: expected 2, one a hypothesis; got 1"),
        ([[0, 7]], [1.0], r"hypotheses\[0\]\[1\]: expected an index into 3 tracks; got 7"),
        ([[0, 0]], [1.0], "distinct labels"),
        ([["a"]], [1.0], r"hypotheses\[0\]: expected an array of integers"),
        ([], [], "at least one hypothesis"),
    ],
)
def test_bad_hypotheses_are_refused(hypotheses, weights, message):
    with pytest.raises(InputError, match=message):
        GLMB.from_hypotheses(TRACKS, hypotheses, weights)


def test_bernoullis_are_put_in_label_order():
    lmb = LMB.from_bernoullis([(1, 0), (0, 5)], [0.25, 1.0], [[1.0], [2.0]], [[[1.0]], [[4.0]]])
    assert lmb.tracks.labels.tolist() == [[0, 5], [1, 0]]
    assert lmb.existence.tolist() == [1.0, pytest.approx(0.25)]
    assert lmb.tracks.means.tolist() == [[2.0], [1.0]]
    assert lmb.tracks.covs.ravel().tolist() == [4.0, 1.0]
    assert lmb.state_dim == 1


@pytest.mark.parametrize(
    ("labels", "existence", "message"),
    [
        ([(0, 0), (0, 0)], [0.5, 0.5], "distinct labels"),
        ([(0, 0), (0, 1)], [0.5, 1.1], "existence: expected probabilities"),
        ([(0, 0), (0, 1)], [0.5, -0.1], "existence: expected probabilities"),
        ([(0, 0), (0, 1)], [0.5, np.nan], "existence: expected probabilities"),
        ([(0, 0), (0, 1)], [0.5], r"existence: expected shape \(2\)"),
    ],
)
def test_bad_bernoullis_are_refused(labels, existence, message):
    with pytest.raises(InputError, match=message):
        LMB.from_bernoullis(labels, existence, np.zeros((2, 1)), np.ones((2, 1, 1)))


@pytest.mark.parametrize(
    ("numbers", "covs", "message"),
    [
        ([-1.0], [[[1.0]]], "expected_numbers: expected numbers of at least 0"),
        ([np.inf], [[[1.0]]], "expected_numbers: expected numbers of at least 0"),
        ([1.0], [[[0.0]]], r"covs\[0\]: expected a positive definite"),
        ([1.0, 1.0], [[[1.0]]], r"means: expected shape \(2, any\)"),
    ],
)
def test_bad_intensities_are_refused(numbers, covs, message):
    with pytest.raises(InputError, match=message):
        Poisson.from_gaussians(numbers, [[0.0]], covs)


@pytest.mark.parametrize("kind", [TrackTable, GLMB, LMB, FactoredGLMB, Poisson, IidCluster, MultiBernoulli, Estimate])
@pytest.mark.parametrize("state_dim", [0, -1, 2.5, True, "4", None, 10**12, 10**30])
def test_a_state_has_a_number_of_components(kind, state_dim):
    with pytest.raises(InputError, match="state_dim: expected a whole number of at "):
        kind.empty(state_dim)
