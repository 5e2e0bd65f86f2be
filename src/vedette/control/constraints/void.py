"""Sensors that keep their distance from targets, by the probability that a disc around a sensor is free of them."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

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


# Beyond this number of standard deviations a Gaussian in the plane has 1.3e-14 of its mass, and one on a line less.
_FAR = 8.0

# Number of quadrature nodes held in memory at a time.
_NODES_AT_ONCE = 1 << 19


def near_pairs(centres: Floats, means: Floats, covs: Floats, radius: float) -> tuple[Ints, Ints]:
    """Return indices of the discs (num_discs, 2) and Gaussians (num_gaussians, 2) that are close enough to matter.

    The omitted pairs have less than exp(-32) = 1.3e-14 in the disc, the mass of a Gaussian beyond 8 of its largest
    standard deviations.
    """
    reach = radius + _FAR * np.sqrt(_largest_variance(covs))
    off_x = centres[:, 0, np.newaxis] - means[:, 0]
    off_y = centres[:, 1, np.newaxis] - means[:, 1]
    disc, gaussian = np.nonzero(off_x**2 + off_y**2 <= reach**2)
    return disc, gaussian


def disc_probabilities(offsets: Floats, gaussians: Ints, covs: Floats, radius: float) -> Floats:
    """Return the probability (num,) that a Gaussian of mean 0 is within `radius` of `offsets` (num, 2), to about 1e-13.

    Along the axes of the covariance, with standard deviations s <= l and offset (x, y),

        P = integral over t in [-pi / 2, pi / 2] of N(x + r sin t; 0, s^2) (Phi((y + h) / l) - Phi((y - h) / l)) h,

    where h = r cos t. As a function of t on the full circle the integrand is periodic and analytic, so the midpoint
    rule converges geometrically: 8 r / s + 40 nodes. Nodes beyond 8 s from the mean are omitted.

    covs: (num_gaussians, 2, 2). `gaussians` (num,) are their indices. Discs wholly within 8 l have probability 1, discs
    beyond it 0.
    """
    variances, axes = np.linalg.eigh(covs)
    small, large = np.sqrt(np.maximum(variances, np.finfo(float).tiny))[gaussians].T
    x, y = (axes[gaussians] * offsets[:, :, np.newaxis]).sum(axis=1).T
    distance = np.hypot(offsets[:, 0], offsets[:, 1])
    probabilities = (distance + _FAR * large <= radius).astype(np.float64)
    rest = np.flatnonzero((probabilities == 0.0) & (distance <= radius + _FAR * large))
    half = np.ceil(4.0 * radius / small[rest]) + 20.0
    first = _node(x[rest], -1.0, small[rest], half, radius)
    last = _node(x[rest], 1.0, small[rest], half, radius)
    num = np.asarray(last - first + 1.0, np.int64)
    start, block = 0, np.cumsum(num) // _NODES_AT_ONCE
    while start < len(rest):
        end = int(np.searchsorted(block, block[start], side="right"))
        part = slice(start, end)
        chosen = rest[part]
        shape = (x[chosen], y[chosen], small[chosen], large[chosen])
        probabilities[chosen] = _midpoints(shape, radius, half[part], first[part], num[part])
        start = end
    return np.asarray(probabilities)


def _node(x: Floats, side: float, small: Floats, half: Floats, radius: float) -> Floats:
    """Return the index of the node at x + r sin t = 8 s to one side, among the nodes in [-pi / 2, pi / 2]."""
    angle = np.arcsin(np.clip((side * _FAR * small - x) / radius, -1.0, 1.0))
    return np.asarray(np.clip(np.floor((angle + math.pi / 2.0) * half / math.pi), 0.0, half - 1.0))


def _midpoints(shape: tuple[Floats, ...], radius: float, half: Floats, first: Floats, num: Ints) -> Floats:
    """Return sums (num_pairs,) over the nodes first .. first + num - 1 of `half` in [-pi / 2, pi / 2]."""
    from scipy.special import ndtr

    pair = np.repeat(np.arange(len(num)), num)
    begins = np.cumsum(num) - num
    node = np.arange(len(pair)) - begins[pair] + first[pair] + 0.5
    angle = node * (math.pi / half)[pair] - math.pi / 2.0
    x, y, small, large = shape
    h = radius * np.cos(angle)
    across = (x[pair] + radius * np.sin(angle)) / small[pair]
    upper, lower = (y[pair] + h) / large[pair], (y[pair] - h) / large[pair]
    values = np.exp(-0.5 * across**2) * h * (ndtr(upper) - ndtr(lower))
    weight = math.pi / half / (math.sqrt(2.0 * math.pi) * small)
    return np.asarray(np.minimum(weight * np.bincount(pair, values, minlength=len(num)), 1.0))


def _largest_variance(covs: Floats) -> Floats:
    """Return the larger eigenvalue (num,) of each covariance (num, 2, 2)."""
    middle, apart = (covs[:, 0, 0] + covs[:, 1, 1]) / 2.0, (covs[:, 0, 0] - covs[:, 1, 1]) / 2.0
    return np.asarray(middle + np.hypot(apart, covs[:, 0, 1]))
