"""The parallel update: against Kalman updates in turn, numerical integration and plain NumPy; what changes nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import logit

from fusion.sights import LABELS, assert_same_bits, views
from vedette.densities import GLMB, LMB, TrackTable
from vedette.errors import InputError, NumericalError
from vedette.fusion import ParallelUpdate
from vedette.kernels.gaussian.eigen import clip_negative

Floats = NDArray[np.float64]


def spd(rng: np.random.Generator, dim: int) -> Floats:
    root = rng.normal(size=(dim, dim))
    return np.asarray(root @ root.T + 0.3 * np.eye(dim))


def one(mean: Any, cov: Any, log_odds: float) -> LMB:
    tracks = TrackTable.from_gaussians(LABELS[:1], [mean], [cov])
    return LMB(tracks, np.array([log_odds]))


def shared(prediction: Any, num: int = 2) -> Any:
    return views([0.9] * num, prediction=prediction)


def gaussian(points: Floats, mean: Any, cov: Any) -> Floats:
    offsets = points - mean
    squares = np.einsum("pi,ij,pj->p", offsets, np.linalg.inv(cov), offsets)
    return np.asarray(np.exp(-0.5 * (squares + np.linalg.slogdet(2.0 * np.pi * np.asarray(cov))[1])))


def in_numpy(prior: LMB, posteriors: list[LMB], v: Any) -> tuple[float, Floats, Floats]:
    """The formulas of `ParallelUpdate` for the only label, with NumPy's own eigenvalues and inverses."""
    m, cov, start = prior.tracks.means[0], prior.tracks.covs[0], float(prior.existence_logit[0])
    root = np.linalg.cholesky(cov)
    back = np.linalg.inv(root)
    information, pull, log_odds = np.eye(len(m)), np.zeros(len(m)), start
    for weight, posterior in zip(v, posteriors, strict=True):
        gain = root.T @ np.linalg.inv(posterior.tracks.covs[0]) @ root - np.eye(len(m))
        values, vectors = np.linalg.eigh(0.5 * (gain + gain.T))
        gain = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
        z = back @ (posterior.tracks.means[0] - m)
        eta = z + gain @ z
        information, pull = information + weight * gain, pull + weight * eta
        log_odds += weight * (float(posterior.existence_logit[0]) - start)
        log_odds += weight * 0.5 * (np.linalg.slogdet(np.eye(len(m)) + gain)[1] - eta @ z)
    centre = np.linalg.solve(information, pull)
    log_odds += 0.5 * (pull @ centre - np.linalg.slogdet(information)[1])
    return log_odds, m + root @ centre, root @ np.linalg.inv(information) @ root.T


def assert_is(fused: LMB, expected: tuple[float, Floats, Floats], tolerance: float) -> None:
    assert fused.existence_logit[0] == pytest.approx(expected[0], rel=tolerance, abs=tolerance)
    scale = np.abs(expected[2]).max()
    np.testing.assert_allclose(fused.tracks.means[0], expected[1], rtol=tolerance, atol=tolerance * scale**0.5)
    np.testing.assert_allclose(fused.tracks.covs[0], expected[2], rtol=tolerance, atol=tolerance * scale)


@pytest.mark.parametrize("seed", range(6))
def test_linear_sensors_give_what_kalman_updates_in_turn_give(seed: int) -> None:
    """Every posterior is a Kalman update, and its odds rise by the likelihood ratio of the detection."""
    rng = np.random.default_rng(seed)
    dim, num = 4, 5
    mean, cov, start = rng.normal(size=dim) * 50.0, 100.0 * spd(rng, dim), logit(0.3)
    in_turn, posteriors = (start, mean, cov), []
    for s in range(num):
        h, noise = rng.normal(size=(1 + s % 2, dim)), spd(rng, 1 + s % 2)
        z = h @ mean + rng.normal(size=len(h)) * 10.0
        log_ratio = 12.0  # P_D over the intensity of clutter

        def updated(log_odds: float, m: Floats, p: Floats, h: Any, noise: Any, z: Any, ratio: float) -> Any:
            innovation = h @ p @ h.T + noise
            gain = p @ h.T @ np.linalg.inv(innovation)
            ratio += float(np.log(gaussian(z[None], h @ m, innovation)[0]))
            after = (np.eye(dim) - gain @ h) @ p @ (np.eye(dim) - gain @ h).T + gain @ noise @ gain.T
            return log_odds + ratio, m + gain @ (z - h @ m), after

        log_odds, m, p = updated(start, mean, cov, h, noise, z, log_ratio)
        posteriors.append(one(m, p, log_odds))
        in_turn = updated(*in_turn, h, noise, z, log_ratio)
    fused, info = ParallelUpdate().fuse(posteriors, shared(one(mean, cov, start), num))
    fused.validate()
    assert_is(fused, in_turn, 1e-9)
    np.testing.assert_allclose(fused.tracks.means[0], in_turn[1], rtol=1e-10, atol=1e-10 * np.sqrt(cov.max()))
    assert info.missing_labels == (0,) * num


@pytest.mark.parametrize("dim", [1, 2])
@pytest.mark.parametrize("v", [(1.0, 1.0), (0.7, 1.6)])
def test_it_is_the_integral_of_the_prediction_and_what_each_scan_said(dim: int, v: tuple[float, float]) -> None:
    rng = np.random.default_rng(dim)
    cov = 2.0 * spd(rng, dim)
    root, mean = np.linalg.cholesky(cov), rng.normal(size=dim)
    own = [root @ np.linalg.inv(np.eye(dim) + spd(rng, dim)) @ root.T for _ in v]
    means = [mean + root @ rng.normal(size=dim) * 0.5 for _ in v]
    logits = [0.4, 1.3, 0.2]
    axis = np.linspace(-9.0, 9.0, 20001 if dim == 1 else 901)
    local = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    points, cell = mean + local @ root.T, (axis[1] - axis[0]) ** dim * np.prod(np.diag(root))
    values = gaussian(points, mean, cov)
    prior = values.copy()
    for weight, m, p in zip(v, means, own, strict=True):
        values *= (gaussian(points, m, p) / prior) ** weight
    total = cell * values.sum()
    centre = cell * values @ points / total
    spread = cell * (points - centre).T @ (values[:, None] * (points - centre)) / total
    log_odds = logits[0] + sum(w * (a - logits[0]) for w, a in zip(v, logits[1:], strict=True)) + np.log(total)
    beliefs = [one(m, p, a) for m, p, a in zip(means, own, logits[1:], strict=True)]
    fused, info = ParallelUpdate(v).fuse(beliefs, shared(one(mean, cov, logits[0])))
    assert_is(fused, (log_odds, centre, spread), 1e-9)
    r = [1.0 / (1.0 + np.exp(-a)) for a in logits]
    present = r[0] * np.prod([(a / r[0]) ** w for w, a in zip(v, r[1:], strict=True)]) * total
    absent = (1 - r[0]) * np.prod([((1 - a) / (1 - r[0])) ** w for w, a in zip(v, r[1:], strict=True)])
    assert info.log_normaliser == pytest.approx(np.log(present + absent), abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_it_is_what_numpy_makes_of_the_formulas(seed: int) -> None:
    """Also for posteriors that are wider than the prediction in some direction, whose information is clipped."""
    rng = np.random.default_rng(seed)
    dim, num = int(rng.integers(1, 7)), int(rng.integers(1, 6))
    prior = one(rng.normal(size=dim), spd(rng, dim), rng.normal())
    posteriors = [one(rng.normal(size=dim), spd(rng, dim), rng.normal()) for _ in range(num)]
    v = rng.uniform(0.0, 2.0, num)
    fused, _ = ParallelUpdate(v).fuse(posteriors, shared(prior, num))
    assert_is(fused, in_numpy(prior, posteriors, v), 1e-9)


def test_one_posterior_is_returned_and_mixtures_count_by_their_moments() -> None:
    rng = np.random.default_rng(4)
    cov = spd(rng, 3)
    prior, posterior = one(np.zeros(3), cov, 0.1), one(rng.normal(size=3), 0.3 * cov, 2.0)
    fused, _ = ParallelUpdate().fuse([posterior], shared(prior, 1))
    assert_is(fused, (2.0, posterior.tracks.means[0], posterior.tracks.covs[0]), 1e-12)
    parts = [0.25, 0.75], [[-3.0], [1.0]], [[[1.0]], [[2.0]]]
    mixed = LMB(TrackTable.from_mixtures(LABELS[:1], [parts]), np.array([1.0]))
    matched = one([0.0], [[0.25 + 1.5 + 0.25 * 9.0 + 0.75]], 1.0)
    narrow = one([0.3], [[0.4]], 2.0)
    assert_is(
        ParallelUpdate().fuse([narrow, mixed], shared(mixed))[0],
        in_numpy(matched, [narrow, matched], (1.0, 1.0)),
        1e-12,
    )


def three(rng: np.random.Generator, prediction: LMB | None = None) -> LMB:
    means, covs = rng.normal(size=(3, 4)), np.array([spd(rng, 4) for _ in range(3)])
    if prediction is not None:
        covs = 0.6 * prediction.tracks.covs
    return LMB.from_bernoullis(LABELS, rng.uniform(0.2, 0.9, 3), means, covs)


def test_a_blind_sensor_adds_nothing_to_the_last_bit() -> None:
    rng = np.random.default_rng(5)
    prediction = three(rng)
    told = [three(rng, prediction) for _ in range(2)]
    expected, _ = ParallelUpdate().fuse(told, shared(prediction))
    for place in range(3):
        beliefs = [*told[:place], prediction, *told[place:]]
        assert_same_bits(ParallelUpdate().fuse(beliefs, shared(prediction, 3))[0], expected)
    many = [*told, *[prediction] * 9]
    assert_same_bits(ParallelUpdate().fuse(many, shared(prediction, 11))[0], expected)
    assert_same_bits(ParallelUpdate().fuse([prediction] * 4, shared(prediction, 4))[0], prediction)
    assert_same_bits(ParallelUpdate((1.0, 1.0, 0.0)).fuse([*told, three(rng)], shared(prediction, 3))[0], expected)


def test_a_label_that_a_posterior_lacks_was_dropped_there_and_counts_so() -> None:
    rng = np.random.default_rng(6)
    prediction = three(rng)
    told, other = three(rng, prediction), three(rng, prediction)
    keep = np.array([0, 2])
    tracks = other.tracks
    less = LMB(
        TrackTable.from_gaussians(tracks.labels[keep], tracks.means[keep], tracks.covs[keep]),
        other.existence_logit[keep].copy(),
    )
    fused, info = ParallelUpdate(missing_existence=1e-3).fuse([told, less], shared(prediction))
    expected = told.existence_logit[1] + logit(1e-3) - prediction.existence_logit[1]
    assert fused.existence_logit[1] == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(fused.tracks.means[1], told.tracks.means[1], rtol=1e-10)
    assert (info.missing_labels, info.empty_intersection) == ((0, 1), False)
    # A prediction that was less sure than the floor loses nothing where it was dropped.
    faint = LMB(prediction.tracks, np.full(3, logit(1e-4)))
    fused, _ = ParallelUpdate(missing_existence=1e-3).fuse([faint, LMB.empty(4)], shared(faint))
    assert_same_bits(fused, faint)


def test_certain_and_impossible_labels() -> None:
    rng = np.random.default_rng(7)
    tracks = three(rng).tracks
    prediction = LMB(tracks, np.array([np.inf, 0.5, -np.inf]))
    fused, info = ParallelUpdate().fuse([LMB(tracks, np.array([np.inf, np.inf, -np.inf]))] * 2, shared(prediction))
    assert fused.tracks.labels.tolist() == [list(label) for label in LABELS]
    assert fused.existence.tolist() == [1.0, 1.0, 0.0]
    assert np.isfinite(info.log_normaliser)
    beliefs = [LMB(tracks, np.array([np.inf, sign * np.inf, -np.inf])) for sign in (1.0, -1.0)]
    with pytest.raises(NumericalError, match=r"label \[1, 1\] is certain to one sensor .* and impossible to another"):
        ParallelUpdate().fuse(beliefs, shared(prediction))
    with pytest.raises(NumericalError, match="certain"):
        ParallelUpdate().fuse([LMB.empty(4), LMB.empty(4)], shared(prediction))


def test_no_labels_at_all() -> None:
    fused, info = ParallelUpdate().fuse([LMB.empty(4)] * 2, shared(LMB.empty(4)))
    assert (fused.tracks.num_tracks, info.log_normaliser, info.empty_intersection) == (0, 0.0, False)


def test_what_cannot_be_fused_is_refused() -> None:
    rng = np.random.default_rng(9)
    prediction = three(rng)
    rule, beliefs = ParallelUpdate(), [three(rng, prediction)] * 2
    for seen in (None, shared(None), shared(GLMB.empty(4))):
        with pytest.raises(
            InputError, match=r"views.prediction: expected the LMB or FactoredGLMB that all beliefs were updated"
        ):
            rule.fuse(beliefs, seen)
    with pytest.raises(InputError, match=r"beliefs\[0\]: expected LMB or FactoredGLMB; got GLMB"):
        rule.fuse([GLMB.empty(4)] * 2, shared(prediction))  # type: ignore[type-var]
    with pytest.raises(InputError, match=r"beliefs\[0\]: expected labels of views.prediction.*got \[1, 0\]"):
        rule.fuse(beliefs, shared(LMB.empty(4)))
    with pytest.raises(InputError, match="dimension 2"):
        rule.fuse(beliefs, shared(LMB.empty(2)))
    with pytest.raises(InputError, match="expected 3"):
        ParallelUpdate((1.0, 1.0, 1.0)).fuse(beliefs, shared(prediction))
    for field, arguments in {
        "weights": {"weights": (1.0, -1.0)},
        "missing_existence": {"missing_existence": 0.0},
    }.items():
        with pytest.raises(InputError, match=field):
            ParallelUpdate(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("dim", range(1, 8))
def test_eigenvalues_are_clipped_as_by_numpy(dim: int) -> None:
    rng = np.random.default_rng(dim)
    for scale in (1e-8, 1.0, 1e8):
        root = rng.normal(size=(dim, dim))
        matrix = scale * (root + root.T)
        values, vectors = np.linalg.eigh(matrix)
        expected = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
        clip_negative(matrix, np.empty((dim, dim)), np.empty((dim, dim)))
        np.testing.assert_allclose(matrix, expected, atol=1e-13 * scale * dim)
    for plain in (np.zeros((dim, dim)), np.eye(dim), spd(rng, dim)):
        same = plain.copy()
        clip_negative(same, np.empty((dim, dim)), np.empty((dim, dim)))
        assert same.tobytes() == plain.tobytes()
