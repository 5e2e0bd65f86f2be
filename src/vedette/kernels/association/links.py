"""Links between independent factors that are updated jointly at a scan.

Two factors that may both take a measurement j exclude each other there. Treated as independent, with probabilities a of
taking it, they have an L1 error in proportion to

    the sum over pairs of factors of a_s(j) a_t(j).

For each measurement the weakest associations are cut while this sum over the pairs that are cut stays within a bound.
All others are linked. `vedette.kernels.association.contention` handles measurements that factors of different groups
may still take.
"""

from typing import NamedTuple

import numpy as np

from vedette.kernels.association.alternatives import Alternatives
from vedette.kernels.association.assignment import Options
from vedette.kernels.association.clusters import root_of
from vedette.kernels.base.arrays import counted_ints, filled_ints, group_members
from vedette.kernels.base.compile import borrowing, inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.mixtures import descending_order


class MeasurementProbabilities(NamedTuple):
    """Probability that a factor takes a measurement, for every measurement that one of its labels may take."""

    offsets: Ints  # (num_factors + 1,) into the others
    measurements: Ints  # of each factor
    strengths: Floats  # largest probability over its labels


class Contention(NamedTuple):
    """The two strongest factors at each measurement."""

    first: Floats  # (num_measurements,) largest probability, 0 for none
    second: Floats  # (num_measurements,) the next one, of another factor
    owner: Ints  # (num_measurements,) factor of the strongest, -1 for none


class Links(NamedTuple):
    """Pairs of factors that are updated jointly."""

    ends: Ints  # (num_links,) a factor
    others: Ints  # (num_links,) the factor of the largest probability at the measurement
    strengths: Floats  # (num_links,) product of the two probabilities


@borrowing
def _rank_measurements(claims: MeasurementProbabilities, contest: Contention) -> None:
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
def _others_claim(contest: Contention, factor: int, measurement: int) -> float:
    return contest.second[measurement] if contest.owner[measurement] == factor else contest.first[measurement]


@kernel
def _measurement_probabilities(options: Options, alone: Alternatives, row_offsets: Ints) -> MeasurementProbabilities:
    """Return the probabilities of the labels without competition.

    row_offsets: (num_factors + 1,) rows of each factor.
    """
    num_factors, num, label = len(row_offsets) - 1, len(alone.weights), 0
    offsets, measurements, strengths = np.zeros(num_factors + 1, np.int64), np.empty(num, np.int64), np.empty(num)
    place, filled = filled_ints(options.num_measurements, -1), 0
    for factor in range(num_factors):
        while label < len(alone.undetected) and alone.rows[label] < row_offsets[factor + 1]:
            first, last = alone.offsets[label], alone.offsets[label + 1]
            total = alone.undetected[label] + alone.weights[first:last].sum()
            for i in range(first, last):
                j = options.columns[alone.options[i]]
                if place[j] < offsets[factor]:
                    place[j], measurements[filled], strengths[filled] = filled, j, 0.0
                    filled += 1
                strengths[place[j]] = max(strengths[place[j]], alone.weights[i] / total)
            label += 1
        offsets[factor + 1] = filled
    return MeasurementProbabilities(offsets, measurements[:filled], strengths[:filled])


@borrowing
def _strengthen(
    options: Options,
    alone: Alternatives,
    row_offsets: Ints,
    contest: Contention,
    least: float,
    place: Ints,
    claims: MeasurementProbabilities,
) -> None:
    """Raise each probability to its value if all other contested measurements of a label go to other factors.

    least: a measurement is contested if another factor takes it with more. place: (num_measurements,) working array.
    """
    label = 0
    for factor in range(len(row_offsets) - 1):
        for i in range(claims.offsets[factor], claims.offsets[factor + 1]):
            place[claims.measurements[i]] = i
        while label < len(alone.undetected) and alone.rows[label] < row_offsets[factor + 1]:
            first, last, sure = alone.offsets[label], alone.offsets[label + 1], alone.undetected[label]
            for i in range(first, last):
                if _others_claim(contest, factor, options.columns[alone.options[i]]) <= least:
                    sure += alone.weights[i]
            for i in range(first, last):
                j, own = options.columns[alone.options[i]], alone.weights[i]
                total = sure if _others_claim(contest, factor, j) <= least else sure + own
                claims.strengths[place[j]] = max(claims.strengths[place[j]], own / total)
            label += 1


@kernel
def _links(claims: MeasurementProbabilities, contest: Contention, max_cut: float) -> Links:
    """Return the pairs of factors to link: at each measurement, those that are not cut with the strongest one.

    Associations are cut, the weakest first, while the products of the pairs that are cut sum to at most `max_cut`.
    """
    num, filled = len(claims.strengths), 0
    factor_of, products = np.empty(num, np.int64), np.empty(num)
    ends, others = np.empty(num, np.int64), np.empty(num, np.int64)
    for factor in range(len(claims.offsets) - 1):
        for i in range(claims.offsets[factor], claims.offsets[factor + 1]):
            factor_of[i] = factor
    offsets, members = group_members(claims.measurements, len(contest.owner))
    for j in range(len(contest.owner)):
        own = members[offsets[j] : offsets[j + 1]]
        if contest.second[j] == 0.0:
            continue
        order, stronger, cut = descending_order(claims.strengths[own]), 0.0, 0.0
        for i in own:
            stronger += claims.strengths[i]
        for k in range(len(own) - 1, 0, -1):
            strength = claims.strengths[own[order[k]]]
            stronger -= strength
            cut += strength * stronger
            if cut > max_cut:
                for i in range(1, k + 1):
                    claim = own[order[i]]
                    ends[filled], others[filled] = factor_of[claim], factor_of[own[order[0]]]
                    products[filled] = claims.strengths[claim] * contest.first[j]
                    filled += 1
                break
    return Links(ends[:filled], others[:filled], products[:filled])


@borrowing
def _join(links: Links, order: Ints, sizes: Ints, most: int, leaders: Ints) -> None:
    """Join the two factors of each link, in `order`, unless they would have more than `most` labels together."""
    for link in order:
        a, b = root_of(leaders, links.ends[link]), root_of(leaders, links.others[link])
        if a != b and sizes[a] + sizes[b] <= most:
            first, last = min(a, b), max(a, b)
            leaders[last] = first
            sizes[first] += sizes[last]


@kernel
def linked_factors(
    options: Options, alone: Alternatives, row_offsets: Ints, sizes: Ints, max_cut: float, most: int
) -> Ints:
    """First factor of the group that each factor belongs to, shape (num_factors,).

    alone: of the same options. row_offsets: (num_factors + 1,) rows of each. sizes: (num_factors,) labels of each,
    overwritten. max_cut: at each measurement, bound on the sum over pairs of the products of the cut probabilities.
    most: largest number of labels of a group. Links are made from the strongest on, and left out if they would exceed
    it.
    """
    num_factors, num = len(row_offsets) - 1, options.num_measurements
    leaders, claims = counted_ints(num_factors), _measurement_probabilities(options, alone, row_offsets)
    contest = Contention(np.empty(num), np.empty(num), np.empty(num, np.int64))
    _rank_measurements(claims, contest)
    _strengthen(options, alone, row_offsets, contest, max_cut, filled_ints(num, -1), claims)
    _rank_measurements(claims, contest)
    links = _links(claims, contest, max_cut)
    _join(links, descending_order(links.strengths), sizes, most, leaders)
    for factor in range(num_factors):
        leaders[factor] = root_of(leaders, factor)
    return leaders
