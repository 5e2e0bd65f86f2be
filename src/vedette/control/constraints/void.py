"""Sensors that keep their distance from targets, by the probability that a disc around a sensor is free of them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vedette.control.constraints.discs import disc_probabilities, near_pairs
from vedette.control.constraints.protocol import ConstraintContext, PerSensorConstraint
from vedette.densities import LabelledDensity, TrackTable
from vedette.densities.labelled import LABELLED
from vedette.kernels.base.types import FactoredGlmb, Floats, Ints
from vedette.models.arguments import float_array, positive, reject
from vedette.models.fields import Checked, Positive, Probability, part

# Maximum number of table entries for the hypotheses of a GLMB at a time.
_BLOCK = 1 << 21


@part("void_probability", "constraint")
@dataclass(frozen=True, slots=True)
class VoidProbability(PerSensorConstraint, Checked):
    """A minimum probability, at each time of the horizon, that no target is near a sensor (Beard et al.).

    M. Beard, B.-T. Vo, B.-N. Vo and S. Arulampalam, Void probabilities and Cauchy-Schwarz divergence for generalized
    labeled multi-Bernoulli models, IEEE Transactions on Signal Processing 65 (2017) 5047-5061, arXiv:1510.05532.

    Attributes:
        radius: radius of the disc around a sensor that must be free of targets [m].
        probability: minimum probability that it is, at each time of the horizon.

    Raises:
        InputError: a radius that is not above 0, or no probability.
    """

    radius: Positive
    probability: Probability
    name: ClassVar[str] = "void_probability"
    needs_beliefs: ClassVar[bool] = True

    def violations(self, situation: ConstraintContext) -> tuple[Floats, ...]:
        """Return the amounts by which the void probability is below `probability`, summed over the times."""
        places = np.concatenate([own[:, :, :2] for own in situation.courses])
        lacking = np.zeros(len(places))
        for t, belief in enumerate(situation.beliefs):
            lacking += np.maximum(self.probability - void_probability(belief, places[:, t], self.radius), 0.0)
        return situation.split(lacking)


def void_probability(belief: LabelledDensity, centres: Floats, radius: float) -> Floats:
    """Return the probability (num,) that no target is within `radius`, m, of `centres` (num, 2).

    With P_l the probability of the disc under a track: the product over l of 1 - r_l P_l for an LMB. For a GLMB the sum
    over hypotheses of weight times the product over their tracks of 1 - P_l (Beard et al., as in `VoidProbability`).
    For a product of GLMBs the product of theirs. Tracks with less than 1.3e-14 in the disc are ignored. Raises
    `InputError` for invalid centres, or a radius that is not above 0.
    """
    positive("radius", radius)
    if not isinstance(belief, LabelledDensity):
        raise reject("belief", LABELLED, type(belief).__name__)
    places = float_array("centres", centres, (None, 2))
    disc, track, inside = _inside(belief.tracks, places, radius)
    if belief.is_lmb:
        with np.errstate(divide="ignore"):
            log_void = np.log1p(-belief.track_existence[track] * inside)
        return np.asarray(np.exp(np.bincount(disc, log_void, minlength=len(places))))
    outside = np.ones((len(places), belief.tracks.num_tracks))
    outside[disc, track] = 1.0 - inside
    return _over_hypotheses(belief.to_factors(), outside)


def _inside(tracks: TrackTable, centres: Floats, radius: float) -> tuple[Ints, Ints, Floats]:
    """Return discs, tracks, and the probability of the disc under the track, for pairs near each other."""
    means, covs = tracks.means[:, :2], tracks.covs[:, :2, :2]
    disc, component = near_pairs(centres, means, covs, radius)
    parts = disc_probabilities(centres[disc] - means[component], component, covs, radius)
    owner = np.repeat(np.arange(tracks.num_tracks), np.diff(tracks.offsets))
    track = owner[component]
    # Components of one track are contiguous, and so are the entries of one disc and track.
    new = (np.diff(disc, prepend=-1) != 0) | (np.diff(track, prepend=-1) != 0)
    total = np.bincount(np.cumsum(new) - 1, np.exp(tracks.log_weights[component]) * parts)
    return disc[new], track[new], np.minimum(total, 1.0)


def _over_hypotheses(belief: FactoredGlmb, outside: Floats) -> Floats:
    """Return (num,) the product over factors of the mean over hypotheses of the products of their tracks' `outside`.

    outside: (num, num_tracks).
    """
    products = np.ones(len(outside))
    weights, sizes = np.exp(belief.hyp_log_weights), np.diff(belief.hyp_offsets)
    filled = np.flatnonzero(sizes)
    if len(filled) == 0:
        return products
    rows = max(1, _BLOCK // len(belief.hyp_tracks))
    for first in range(0, len(outside), rows):
        columns = outside[first : first + rows, belief.hyp_tracks]
        terms = np.tile(weights, (len(columns), 1))
        # Between the starts of hypotheses with tracks there are no tracks of other hypotheses.
        terms[:, filled] *= np.multiply.reduceat(columns, belief.hyp_offsets[filled], axis=1)
        products[first : first + rows] = np.add.reduceat(terms, belief.factor_offsets[:-1], axis=1).prod(axis=1)
    return products
