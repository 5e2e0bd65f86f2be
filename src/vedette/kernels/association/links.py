"""Which factors of a belief contend for a measurement so much that a scan must be taken by them together.

Two factors that may both take a measurement j exclude each other there. If the exclusion is ignored, the joint choices
of a scan are those of independent factors, Q, some of which let both take j; the true ones are Q given that none does,
P = Q(. | no measurement is taken twice), and

    sum |P - Q| = 2 Q(some measurement is taken twice) <= 2 sum_j sum_{a < b} Q_a(j) Q_b(j)

over pairs of factors. A link is such a pair; strong links are kept, and the bound of those that were cut is reported.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.clusters import root_of
from vedette.kernels.base.arrays import counted_ints, filled_ints
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_sum
from vedette.kernels.gaussian.mixtures import descending_order


class Claims(NamedTuple):
    """How probable it is that a factor takes a measurement, of every measurement that one of its rows gates."""

    offsets: Ints  # (num_factors + 1,) into the others
    measurements: Ints  # of each factor
    strengths: Floats  # the most that one of its rows takes it with


class Contest(NamedTuple):
    """Who claims a measurement most."""

    first: Floats  # (num_measurements,) the strongest claim, 0 for none
    second: Floats  # (num_measurements,) the next one, of another factor
    owner: Ints  # (num_measurements,) factor of the strongest, -1 for none


@borrowing
def _rank_claims(claims: Claims, contest: Contest) -> None:
    for j in range(len(contest.owner)):
        contest.first[j], contest.second[j], contest.owner[j] = 0.0, 0.0, -1
    for factor in range(len(claims.offsets) - 1):
        for i in range(claims.offsets[factor], claims.offsets[factor + 1]):
            j, strength = claims.measurements[i], claims.strengths[i]
            if contest.owner[j] < 0 or strength > contest.first[j]:
                contest.second[j], contest.first[j], contest.owner[j] = contest.first[j], strength, factor
            elif strength > contest.second[j]:
                contest.second[j] = strength


@inlined
def _others_claim(contest: Contest, factor: int, measurement: int) -> float:
    return contest.second[measurement] if contest.owner[measurement] == factor else contest.first[measurement]


@kernel
def _claims(options: Options, row_offsets: Ints) -> Claims:
    """What rows claim by themselves. row_offsets: (num_factors + 1,) rows of each factor."""
    num_factors, num = len(row_offsets) - 1, options.offsets[-1]
    offsets, measurements, strengths = np.zeros(num_factors + 1, np.int64), np.empty(num, np.int64), np.empty(num)
    place, filled = filled_ints(options.num_measurements, -1), 0
    for factor in range(num_factors):
        for row in range(row_offsets[factor], row_offsets[factor + 1]):
            start, stop = options.offsets[row], options.offsets[row + 1]
            log_total = log_sum(options.log_weights[start:stop])
            for option in range(start, stop):
                j = options.columns[option]
                if j < 0:
                    continue
                if place[j] < offsets[factor]:
                    place[j] = filled
                    measurements[filled], strengths[filled] = j, 0.0
                    filled += 1
                strength = math.exp(options.log_weights[option] - log_total)
                strengths[place[j]] = max(strengths[place[j]], strength)
        offsets[factor + 1] = filled
    return Claims(offsets, measurements[:filled], strengths[:filled])


@borrowing
def _strengthen(
    options: Options, row_offsets: Ints, contest: Contest, least: float, place: Ints, claims: Claims
) -> None:
    """Raise each claim to what it is if a row's other contested measurements go to others.

    least: a measurement is contested where another factor claims it with more. place: (num_measurements,) to work in.
    """
    for factor in range(len(row_offsets) - 1):
        for i in range(claims.offsets[factor], claims.offsets[factor + 1]):
            place[claims.measurements[i]] = i
        for row in range(row_offsets[factor], row_offsets[factor + 1]):
            start, stop = options.offsets[row], options.offsets[row + 1]
            if start == stop:
                continue
            peak, sure = options.log_weights[start], 0.0
            for option in range(start, stop):
                j = options.columns[option]
                if j < 0 or _others_claim(contest, factor, j) <= least:
                    sure += math.exp(options.log_weights[option] - peak)
            for option in range(start, stop):
                j = options.columns[option]
                if j >= 0:
                    own = math.exp(options.log_weights[option] - peak)
                    total = sure if _others_claim(contest, factor, j) <= least else sure + own
                    at = place[j]
                    claims.strengths[at] = max(claims.strengths[at], own / total if total > 0.0 else 1.0)


@borrowing
def _join(order: Ints, ends: Ints, others: Ints, sizes: Ints, most: int, leaders: Ints) -> None:
    """Join the two factors of each link in turn, unless they would have more than `most` labels together."""
    for link in order:
        a, b = root_of(leaders, ends[link]), root_of(leaders, others[link])
        if a != b and sizes[a] + sizes[b] <= most:
            first, last = min(a, b), max(a, b)
            leaders[last] = first
            sizes[first] += sizes[last]


@kernel
def linked_factors(options: Options, row_offsets: Ints, sizes: Ints, least: float, most: int) -> Ints:
    """(num_factors,) the first factor of the group that each is taken with.

    row_offsets: (num_factors + 1,) rows of each. sizes: (num_factors,) labels of each, overwritten. least: links of the
    product of two claims up to this are cut. most: labels of a group; links are made from the strongest on, and
    left out where they would join more.
    """
    num_factors, num = len(row_offsets) - 1, options.num_measurements
    leaders, claims = counted_ints(num_factors), _claims(options, row_offsets)
    contest = Contest(np.empty(num), np.empty(num), np.empty(num, np.int64))
    _rank_claims(claims, contest)
    _strengthen(options, row_offsets, contest, least, filled_ints(num, -1), claims)
    _rank_claims(claims, contest)
    ends, others = np.empty(len(claims.strengths), np.int64), np.empty(len(claims.strengths), np.int64)
    strengths, filled = np.empty(len(claims.strengths)), 0
    for factor in range(num_factors):
        for i in range(claims.offsets[factor], claims.offsets[factor + 1]):
            j = claims.measurements[i]
            # Whoever is linked to anybody at a measurement is linked to the one that claims it most.
            strength = claims.strengths[i] * contest.first[j]
            if contest.owner[j] != factor and strength > least:
                ends[filled], others[filled], strengths[filled] = factor, contest.owner[j], strength
                filled += 1
    _join(descending_order(strengths[:filled]), ends, others, sizes, most, leaders)
    for factor in range(num_factors):
        leaders[factor] = root_of(leaders, factor)
    return leaders
