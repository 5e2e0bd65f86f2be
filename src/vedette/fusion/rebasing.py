"""Rebasing: apply the information of a sensor's scan to a prediction other than the one that it updated."""

import numpy as np

from vedette.densities import LMB, TrackTable
from vedette.densities.containers import unchecked
from vedette.densities.tracks import gaussian_tracks, merged_tracks, place_labels, take_tracks
from vedette.fusion.base import refuse_modes
from vedette.fusion.classes import class_gains, updated_classes
from vedette.kernels.base.types import CLASSES, Floats
from vedette.kernels.labelled.stacking import stack_tracks


def with_labels_of(prediction: LMB, others: LMB) -> LMB:
    """Return the prediction, with the labels that it lacks added from another LMB."""
    _, places = place_labels([prediction.tracks.labels, others.tracks.labels])
    lacking = places[places[:, 0] < 0, 1]
    if len(lacking) == 0:
        return prediction
    table = stack_tracks([prediction.tracks.to_kernel(), take_tracks(others.tracks, lacking).to_kernel()])
    logits = np.concatenate([prediction.existence_logit, others.existence_logit[lacking]])
    both: LMB = unchecked(LMB, TrackTable.from_kernel(table), logits)
    return both.take(np.lexsort(table.labels.T[::-1]))


def rebase(posterior: LMB, own: LMB, prediction: LMB) -> LMB:
    """Return a sensor's posterior as if its scan had updated `prediction` instead of `own`, label by label.

    The information of the scan is the ratio of the sensor's posterior to its own prediction, a Gaussian of information
    Y = P^-1 - P_own^-1, its negative eigenvalues set to 0. With p(x) the new prediction,

        logit = l_new + (l - l_own) + log integral of p(x) N(x; m, P) / N(x; m_own, P_own),

    and the class probabilities times the ratio of those of the posterior and its own prediction.

    Labels that the sensor's own prediction or posterior lacks are taken from the prediction: the scan has no
    information about them. Mixtures become Gaussians of their moments. If both predictions are the same object, the
    posterior itself is returned.
    """
    if own is prediction:
        return posterior
    refuse_modes("fusion of late beliefs", (posterior, own, prediction))
    _, means, covs, marks = merged_tracks(prediction.tracks)
    old, new, logits = merged_tracks(own.tracks), merged_tracks(posterior.tracks), prediction.existence_logit.copy()
    _, places = place_labels([belief.tracks.labels for belief in (prediction, own, posterior)])
    at, before, after = places[(places >= 0).all(axis=1)].T
    known_moments, said_moments = (old.means[before], old.covs[before]), (new.means[after], new.covs[after])
    means[at], covs[at], gained = _updated((means[at], covs[at]), known_moments, said_moments)
    said, known = posterior.existence_logit[after], own.existence_logit[before]
    gains = class_gains(new.marks[after, CLASSES:], old.marks[before, CLASSES:])
    marks[at, CLASSES:], log_factors = updated_classes(marks[at, CLASSES:], gains)
    with np.errstate(invalid="ignore"):  # an impossible or certain label that stays so carries no information
        logits[at] += np.where(said == known, 0.0, said - known) + gained + log_factors
    return unchecked(LMB, gaussian_tracks(prediction.tracks.labels, means, covs, marks), logits)


def _updated(
    prediction: tuple[Floats, Floats], own: tuple[Floats, Floats], posterior: tuple[Floats, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Means (n, dim) and covariances (n, dim, dim) of prediction times posterior over own, and the log of its integral.

    About the prediction's mean: the ratio is exp(c + y'u - u'Yu / 2) of u = x - m.
    """
    mean, cov = prediction
    before, after = _inverse(own[1]), _inverse(posterior[1])
    values, vectors = np.linalg.eigh(after - before)
    information: Floats = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.swapaxes(1, 2)
    clipped = before + information  # information of the posterior, with the scan's contribution clipped
    ahead, behind = posterior[0] - mean, own[0] - mean
    pull = _times(clipped, ahead) - _times(before, behind)
    constant = 0.5 * (_log_det(clipped) - _log_det(before) - _form(clipped, ahead) + _form(before, behind))
    total = _inverse(cov) + information
    fused = _inverse(total)
    gained = constant + 0.5 * (_form(fused, pull) - _log_det(total) - _log_det(cov))
    return mean + _times(fused, pull), 0.5 * (fused + fused.swapaxes(1, 2)), gained


def _inverse(matrices: Floats) -> Floats:
    return np.asarray(np.linalg.inv(matrices), np.float64)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    return np.asarray(np.einsum("lij,lj->li", matrices, vectors))


def _form(matrices: Floats, vectors: Floats) -> Floats:
    return np.asarray(np.einsum("li,lij,lj->l", vectors, matrices, vectors))


def _log_det(matrices: Floats) -> Floats:
    return np.asarray(np.linalg.slogdet(matrices)[1])
