"""Joined tracks: the likelihood ratio of a gap against enumeration, and what is made of it."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from evaluation.synthetic import make_record
from vedette import models
from vedette.densities import Estimate, track_histories
from vedette.errors import InputError
from vedette.evaluation import gaps
from vedette.evaluation.gaps import gap_log_ratios
from vedette.evaluation.joining import Join, find_joins, track_names, with_joined_tracks
from vedette.evaluation.observation_history import ObservationHistory, birth_count_ratio

DT, SURVIVAL, DETECTION, SIGMA, NOISE = 2.0, 0.97, 0.8, 0.6, 3.0
LAST, BEGINS, ENDS = 2, 6, 9  # scans, from 1
SITE = np.array([40.0, 5.0, 1.0, 0.0]), np.diag([900.0, 700.0, 16.0, 9.0]), 0.01
F = np.eye(4) + DT * np.eye(4, k=2)
Q = SIGMA**2 * np.kron([[DT**4 / 4, DT**3 / 2], [DT**3 / 2, DT**2]], np.eye(2))
H = np.eye(2, 4)


def updated(mean: Any, cov: Any, z: Any) -> tuple[Any, Any, float]:
    """Kalman update of a position, and the log likelihood."""
    spread = H @ cov @ H.T + NOISE**2 * np.eye(2)
    gain, apart = cov @ H.T @ np.linalg.inv(spread), z - H @ mean
    log = -0.5 * (apart @ np.linalg.solve(spread, apart) + np.linalg.slogdet(2.0 * np.pi * spread)[1])
    return mean + gain @ apart, (np.eye(4) - gain @ H) @ cov, float(log)


def moved(mean: Any, cov: Any) -> tuple[Any, Any]:
    return F @ mean, F @ cov @ F.T + Q


def gone(existence: float, hidden: float) -> float:
    """Probability that no scan after the last estimate detects the target: all deaths and detections enumerated."""
    num, total = ENDS - LAST, 1.0 - existence
    for lives in range(num + 1):
        path = SURVIVAL**lives * (1.0 - SURVIVAL if lives < num else 1.0)
        missed = sum(
            float(np.prod([DETECTION if seen else 1.0 - DETECTION for seen in pattern]))
            for pattern in itertools.product([False, True], repeat=lives)
            if not any(pattern)
        )
        total += existence * path * (hidden + (1.0 - hidden) * missed)
    return float(total)


def make_observations(hidden: float, **changed: Any) -> ObservationHistory:
    region = models.Region(-1e3, 1e3, -1e3, 1e3)
    mean, cov, existence = SITE
    birth = models.BirthModel(np.array([existence]), mean[None], cov[None], frozenset({BEGINS}))
    targets = models.TargetModel(models.constant_velocity(SIGMA), models.constant_survival(SURVIVAL), birth)
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([NOISE, NOISE]),
        models.constant_detection(DETECTION),
        models.region_clutter(1.0, region, "position"),
    )
    given: dict[str, Any] = {
        "poses": np.zeros((ENDS, 1, 3)),
        "scanned": np.ones((ENDS, 1), np.bool_),
        "prob_hidden": hidden,
    }
    given |= {"targets": targets, "sensors": (sensor,), "times": DT * np.arange(float(ENDS))}
    return ObservationHistory(**{**given, **changed})


def estimates_of(rows: dict[int, list[tuple[tuple[int, int], Any, Any, float]]]) -> list[Estimate]:
    """Estimates of all scans; rows: label, mean, covariance and existence of those of each scan."""
    found = []
    for step in range(1, ENDS + 1):
        own = sorted(rows.get(step, []))
        if not own:
            found.append(Estimate.empty(4))
            continue
        labels, means, covs, existence = zip(*own, strict=True)
        found.append(Estimate(np.array(labels), np.array(means), np.array(covs), np.array(existence)))
    return found


def scene() -> tuple[list[Estimate], float, tuple[Any, Any], list[Any]]:
    """Estimates of a label that ends and one that begins, the log likelihood of the second's scans as a birth, the last
    estimate of the first, and these scans."""
    rng = np.random.default_rng(3)
    ended = np.array([0.0, 0.0, 4.0, 1.0]), np.diag([16.0, 9.0, 1.0, 2.0])
    zs = [np.array([33.0, 9.0]) + DT * k * np.array([4.0, 1.0]) + rng.normal(0.0, NOISE, 2) for k in range(4)]
    rows: dict[int, Any] = {LAST: [((1, 0), *ended, 0.8)]}
    mean, cov, total = *SITE[:2], 0.0
    for step, z in zip(range(BEGINS, ENDS + 1), zs, strict=True):
        if step > BEGINS:
            mean, cov = moved(mean, cov)
        mean, cov, log = updated(mean, cov, z)
        total += log
        rows[step] = [((BEGINS, 0), mean, cov, 0.9)]
    return estimates_of(rows), total, ended, zs


def dense(estimates: list[Estimate], observations: ObservationHistory) -> Any:
    """The log ratio of each pair of labels, -inf of those that are left out."""
    histories = track_histories(estimates, observations.times)
    ratios = np.full((len(histories), len(histories)), -np.inf)
    pairs = gap_log_ratios(histories, observations)
    ratios[pairs.ended, pairs.began] = pairs.log_ratios
    return ratios


@pytest.mark.parametrize("hidden", [0.0, 0.3, 1.0])
def test_the_ratio_of_a_gap_is_that_of_enumeration(hidden: float) -> None:
    estimates, log_born, (mean, cov), zs = scene()
    observations = make_observations(hidden)
    log_same = np.log(0.8) + (BEGINS - LAST) * np.log(SURVIVAL)
    log_same += np.log(hidden / (BEGINS - LAST) + (1.0 - hidden) * (1.0 - DETECTION) ** (BEGINS - LAST - 1))
    for _ in range(LAST, BEGINS):
        mean, cov = moved(mean, cov)
    for k, z in enumerate(zs):
        if k:
            mean, cov = moved(mean, cov)
        mean, cov, log = updated(mean, cov, z)
        log_same += log
    # One label of three estimates; .01 births are expected.
    expected = log_same - np.log(1.5 / 0.51 + 0.1 / 0.9) - np.log(gone(0.8, hidden)) - np.log(SITE[2]) - log_born
    ratios = dense(estimates, observations)
    assert ratios[0, 1] == pytest.approx(expected, abs=1e-7)
    assert (ratios[[0, 1, 1], [0, 0, 1]] == -np.inf).all()
    joins = find_joins(estimates, observations, threshold=0.0)
    if expected > 0.0:
        assert [(join.ended, join.began) for join in joins] == [((1, 0), (BEGINS, 0))]
        assert joins[0].probability == pytest.approx(1.0 / (1.0 + np.exp(-expected)))


def test_scans_that_did_not_take_place_miss_nothing() -> None:
    estimates, *_ = scene()
    scanned = np.ones((ENDS, 1), np.bool_)
    scanned[LAST : BEGINS - 1] = False
    missed = make_observations(0.0)
    blind, unseen = make_observations(0.0, scanned=scanned), make_observations(1.0)
    ratio, least, most = (dense(estimates, observations)[0, 1] for observations in (blind, missed, unseen))
    assert least < ratio
    log_seen = np.log(gone(0.8, 1.0))
    assert ratio > most + log_seen  # of no scan the hypothesis that the target died is no more probable


def test_a_sensor_that_is_too_far_away_misses_nothing() -> None:
    """A target without detections while the sensor is out of range is as one without scans."""
    estimates, *_ = scene()
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([NOISE, NOISE]),
        models.limited_range(DETECTION, 500.0),
        models.region_clutter(1.0, models.Region(-1e3, 1e3, -1e3, 1e3), "position"),
    )
    poses, scanned = np.zeros((ENDS, 1, 3)), np.ones((ENDS, 1), np.bool_)
    poses[LAST : BEGINS - 1, 0, 0] = 1e5
    scanned[LAST : BEGINS - 1] = False
    near = make_observations(0.0, sensors=(sensor,))
    far, blind = (replace(near, poses=poses), replace(near, scanned=scanned))
    ratio, away, without = (dense(estimates, observations)[0, 1] for observations in (near, far, blind))
    assert away == pytest.approx(without)
    assert away > ratio + 1.0


def test_earlier_estimates_of_an_ended_label_do_not_count() -> None:
    estimates, _, (mean, cov), _ = scene()
    observations = make_observations(0.5)
    expected = dense(estimates, observations)[0, 1]
    sure = Estimate(np.array([[1, 0]]), mean[np.newaxis] - 1.0, 2.0 * cov[np.newaxis], np.array([0.999]))
    assert dense([sure, *estimates[1:]], observations)[0, 1] == expected


@pytest.mark.parametrize(("gap", "num_joins"), [(150, 1), (250, 0)])
def test_a_label_continues_after_many_scans_but_not_after_more_than_200(gap: int, num_joins: int) -> None:
    """A target that is known to stand still, far from where targets are born."""
    state, cov = np.array([-150.0, 0.0, 0.0, 0.0]), np.diag([4.0, 4.0, 1e-6, 1e-6])
    seen = [Estimate(np.array([[label, 0]]), state[np.newaxis], cov[np.newaxis], np.ones(1)) for label in (1, 2)]
    estimates = [seen[0], *[Estimate.empty(4)] * (gap - 1), seen[1]]
    observations = make_observations(
        1.0,
        poses=np.zeros((gap + 1, 1, 3)),
        scanned=np.ones((gap + 1, 1), np.bool_),
        times=DT * np.arange(gap + 1.0),
        targets=targets_of(models.Region(-1e3, 1e3, -1e3, 1e3), 0.01, survival=1.0, sigma=1e-6),
    )
    assert len(find_joins(estimates, observations)) == num_joins


def test_finished_scans_are_reported_from_one() -> None:
    estimates, *_ = scene()
    told = list[int]()
    find_joins(estimates, make_observations(0.5), progress=told.append)
    assert told == list(range(1, ENDS + 1))


@pytest.mark.parametrize("threshold", [-0.1, 1.5])
def test_a_threshold_that_is_no_probability_is_rejected(threshold: float) -> None:
    estimates, *_ = scene()
    with pytest.raises(InputError, match="threshold: expected"):
        find_joins(estimates, make_observations(0.5), threshold=threshold)


def test_one_of_two_ended_labels_continues() -> None:
    estimates, *_ = scene()
    first = estimates[LAST - 1]
    both = [np.concatenate([part, part]) for part in (first.means, first.covs, first.existence)]
    estimates[LAST - 1] = Estimate(np.array([[1, 0], [1, 1]]), *both)
    observations = make_observations(1.0)
    (join,) = find_joins(estimates, observations, threshold=0.0)
    assert join.probability == pytest.approx(0.5, abs=0.02)
    assert find_joins(estimates, observations, threshold=0.6) == ()


def joins_of_dense(estimates: list[Estimate], observations: ObservationHistory) -> list[tuple[Any, Any, float]]:
    """The joins by whole matrices and a dense assignment."""
    ratios = dense(estimates, observations)
    rows, columns = (np.logaddexp.reduce(ratios, axis=axis) for axis in (1, 0))
    others = np.logaddexp(rows[:, None], columns)
    with np.errstate(invalid="ignore"):
        own = np.where(ratios > -np.inf, np.exp(ratios - others), 0.0)
    probabilities = np.exp(ratios - np.logaddexp(0.0, others + np.log1p(-np.minimum(own, 0.5))))
    gains = np.maximum(ratios, 0.0)
    labels = [history.label for history in track_histories(estimates, observations.times)]
    chosen = zip(*linear_sum_assignment(gains, maximize=True), strict=True)
    return sorted(
        ((labels[i], labels[j], float(probabilities[i, j])) for i, j in chosen if gains[i, j] > 0.0),
        key=lambda join: join[1],
    )


def random_estimates(rng: np.random.Generator) -> list[Estimate]:
    """Short tracks that begin near where others end, and elsewhere."""
    rows: dict[int, list[Any]] = {}
    places = rng.uniform(-200.0, 200.0, (rng.integers(1, 4), 2))
    for number in range(rng.integers(2, 25)):
        first = int(rng.integers(1, ENDS + 1))
        state = np.concatenate([places[rng.integers(len(places))] + rng.normal(0.0, 15.0, 2), rng.normal(0.0, 3.0, 2)])
        for step in range(first, min(first + int(rng.integers(1, 4)), ENDS + 1)):
            cov = np.diag(rng.uniform([4.0, 4.0, 0.5, 0.5], [30.0, 30.0, 4.0, 4.0]))
            rows.setdefault(step, []).append(((first, number), state, cov, float(rng.uniform(0.3, 0.99))))
            state = F @ state + rng.normal(0.0, 1.0, 4)
    return estimates_of(rows)


def test_joins_are_those_of_whole_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs that are left out change no bit, and rivals are resolved as by a dense assignment."""
    numbers, left_out = [], 0
    for seed in range(60):
        estimates, observations = random_estimates(np.random.default_rng(seed)), make_observations(0.5)
        joins = find_joins(estimates, observations, threshold=0.0)
        num_pairs = np.isfinite(dense(estimates, observations)).sum()
        with monkeypatch.context() as patch:
            patch.setattr(gaps, "LEAST_LOG_RATIO", -1e300)
            left_out += np.isfinite(dense(estimates, observations)).sum() - num_pairs
            assert list(joins) == joins_of_dense(estimates, observations)
        numbers.append(len(joins))
    assert left_out > 0
    assert max(numbers) > 2


def test_a_renamed_track_keeps_its_row_of_every_column() -> None:
    rng, labels = np.random.default_rng(0), np.array([[2, 0], [3, 1], [7, 0]])
    covs = np.stack([np.diag(each) for each in rng.uniform(1.0, 9.0, (3, 4))])
    estimate = Estimate(labels, rng.normal(size=(3, 4)), covs, np.array([0.7, 0.8, 0.9]))
    record = replace(make_record(), estimates=(estimate,))
    (joined,) = with_joined_tracks(record, [Join((1, 0), (7, 0), 0.99)]).estimates
    assert joined.labels.tolist() == [[1, 0], [2, 0], [3, 1]]
    for column in ("means", "covs", "existence", "class_probs"):
        np.testing.assert_array_equal(getattr(joined, column), getattr(estimate, column)[[2, 0, 1]])
    joined.validate()


def test_tracks_are_named_by_their_first_label() -> None:
    joins = (Join((1, 0), (7, 2), 0.9), Join((7, 2), (20, 0), 0.8), Join((3, 1), (9, 0), 0.7))
    assert track_names(joins) == {(7, 2): (1, 0), (20, 0): (1, 0), (9, 0): (3, 1)}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"hidden": 1.5}, "prob_hidden: expected"),
        ({"hidden": 0.5, "poses": np.zeros((2, 1, 3))}, "poses, scanned: expected entries for each scan and sensor"),
    ],
)
def test_invalid_observation_histories_are_rejected(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_observations(changed.pop("hidden"), **changed)


def targets_of(
    region: models.Region | None,
    expected: Any,
    period: float | None = None,
    *,
    survival: float = SURVIVAL,
    sigma: float = SIGMA,
) -> models.TargetModel:
    measured = models.MeasurementBirth(expected, 0.1, np.array([6.0, 6.0, 4.0, 4.0]), region)
    birth = replace(models.BirthModel.none(4), from_measurements=measured, period=period)
    return models.TargetModel(models.constant_velocity(sigma), models.constant_survival(survival), birth)


@pytest.mark.parametrize(
    ("expected", "period", "births"),
    [(0.5, None, 1.5 / 5.0), (0.5, 4.0, 1.5 / (0.5 + 0.5 * 17.0 / 4.0)), ("learnt", None, 1.0)],
)
def test_births_are_counted_by_labels_that_last(expected: Any, period: float | None, births: float) -> None:
    estimates, *_ = scene()
    region = models.Region(-1e3, 1e3, -1e3, 1e3)
    observations = make_observations(0.5, targets=targets_of(region, expected, period))
    histories = track_histories(estimates, observations.times)
    assert birth_count_ratio(histories, observations) == pytest.approx(births)
    assert np.isfinite(dense(estimates, observations)[0, 1])


def test_births_need_a_region() -> None:
    with pytest.raises(InputError, match="expected births in a region; got none"):
        make_observations(0.5, targets=targets_of(None, 0.5))
