"""Splitting a GLMB into independent factors within a given L1 error.

The hypotheses of a GLMB are choices of one symbol per label (a track, or absence) with weight w. The product of the
marginals of some parts of the labels has the weights pi = prod over parts of w_part. It differs from the GLMB by

    sum over choices |w - pi| = sum over hypotheses |w - pi| + 1 - sum over hypotheses pi,

as the choices that are not hypotheses have w = 0, and all pi sum to 1. That bounds the L1 distance of the densities.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import counted_ints, filled_ints, hashed
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Glmb, Ints
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.labelled.labels import increasing_labels, label_place

# Rounding error of a product that is exact.
_EQUAL = 1e-11


class Choices(NamedTuple):
    """The hypotheses of a GLMB as choices of one symbol per label."""

    labels: Ints  # (num_labels, 2) increasing
    symbols: Ints  # (num_hyps, num_labels) the label's track, -1 if absent
    weights: Floats  # (num_hyps,) linear


@kernel
def choices_of(glmb: Glmb) -> Choices:
    """Return the hypotheses of a normalised GLMB as choices."""
    labels = increasing_labels(glmb)
    num, num_labels = len(glmb.hyp_log_weights), len(labels)
    symbols, weights = np.empty((num, num_labels), np.int64), np.empty(num)
    for h in range(num):
        weights[h] = math.exp(glmb.hyp_log_weights[h])
        for k in range(num_labels):
            symbols[h, k] = -1
        for e in range(glmb.hyp_offsets[h], glmb.hyp_offsets[h + 1]):
            track = glmb.hyp_tracks[e]
            place = label_place(labels, num_labels, glmb.tracks.labels[track, 0], glmb.tracks.labels[track, 1])
            symbols[h, place] = track
    return Choices(labels, symbols, weights)


@kernel
def group_choices(symbols: Ints, part_of: Ints, part: int, groups: Ints) -> Ints:
    """Number the choices of the labels of a part by first occurrence, (num_hyps,) into `groups`.

    Return the first of each.
    """
    num, size = len(symbols), 4
    while size < 2 * num:
        size *= 2
    table, firsts, count = filled_ints(size, -1), np.empty(num, np.int64), 0
    for h in range(num):
        key = 0
        for k in range(len(part_of)):
            if part_of[k] == part:
                key = hashed(key, symbols[h, k] + 1)
        slot = key & (size - 1)
        while table[slot] >= 0 and not _same_choice(symbols, firsts[table[slot]], h, part_of, part):
            slot = (slot + 1) & (size - 1)
        if table[slot] < 0:
            table[slot] = count
            firsts[count] = h
            count += 1
        groups[h] = table[slot]
    return firsts[:count]


@kernel
def _same_choice(symbols: Ints, a: int, b: int, part_of: Ints, part: int) -> bool:
    same = True
    for k in range(len(part_of)):
        same = same and (part_of[k] != part or symbols[a, k] == symbols[b, k])
    return same


class _Parts(NamedTuple):
    """Parts of the labels, each identified by its first label. Rows of other labels are not current."""

    groups: Ints  # (num_labels, num_hyps) number of each hypothesis's choice among those of the part
    sums: Floats  # (num_labels, num_hyps) weight of each of the part's choices
    counts: Ints  # (num_labels,) choices of the part
    part_of: Ints  # (num_labels,) first label of the part of each
    sizes: Ints  # (num_labels,) labels of the part
    table: Ints  # hash table for pairs of choices, its size a power of two, all -1
    keys: Ints  # of the same size


@kernel
def _alone(choices: Choices) -> _Parts:
    """Return every label as its own part."""
    num_hyps, num = choices.symbols.shape
    size = 4
    while size < 2 * num_hyps:
        size *= 2
    parts = _Parts(
        np.empty((num, num_hyps), np.int64),
        np.zeros((num, num_hyps)),
        np.zeros(num, np.int64),
        counted_ints(num),
        filled_ints(num, 1),
        filled_ints(size, -1),
        np.empty(size, np.int64),
    )
    most = 0
    for h in range(num_hyps):
        for k in range(num):
            most = max(most, choices.symbols[h, k] + 2)
    number = np.empty(most, np.int64)
    for k in range(num):
        for symbol in range(most):
            number[symbol] = -1
        for h in range(num_hyps):
            symbol = choices.symbols[h, k] + 1
            if number[symbol] < 0:
                number[symbol] = parts.counts[k]
                parts.counts[k] += 1
            parts.groups[k, h] = number[symbol]
            parts.sums[k, number[symbol]] += choices.weights[h]
    return parts


@borrowing
def _pair_choices(parts: _Parts, a: int, b: int, weights: Floats, groups: Ints, sums: Floats) -> int:
    """Number the joint choices of two parts, sum their weights, and return their number.

    groups, sums: (num_hyps,) written. The rows of either part may be given.
    """
    table, keys, count, last = parts.table, parts.keys, 0, len(parts.table) - 1
    num_b = parts.counts[b]
    for h in range(len(weights)):
        key = parts.groups[a, h] * num_b + parts.groups[b, h]
        slot = hashed(0, key) & last
        while table[slot] >= 0 and keys[slot] != key:
            slot = (slot + 1) & last
        if table[slot] < 0:
            table[slot], keys[slot] = count, key
            count += 1
        groups[h] = table[slot]
    for slot in range(last + 1):
        table[slot] = -1
    for group in range(count):
        sums[group] = 0.0
    for h in range(len(weights)):
        sums[groups[h]] += weights[h]
    return count


@borrowing
def _dependence(parts: _Parts, a: int, b: int, weights: Floats, groups: Ints, sums: Floats, seen: Ints) -> float:
    """L1 distance of two parts' joint choices from those of independent ones. groups, sums, seen: working arrays."""
    for group in range(_pair_choices(parts, a, b, weights, groups, sums)):
        seen[group] = 0
    error, left = 0.0, 1.0
    for h in range(len(weights)):
        if seen[groups[h]] == 0:
            seen[groups[h]] = 1
            product = parts.sums[a, parts.groups[a, h]] * parts.sums[b, parts.groups[b, h]]
            error += abs(sums[groups[h]] - product)
            left -= product
    return error + max(0.0, left)


@borrowing
def _product_error(parts: _Parts, weights: Floats) -> float:
    """L1 distance of the product of the parts from the hypotheses, no two of which are the same choice."""
    error, left = 0.0, 1.0
    for h in range(len(weights)):
        product = 1.0
        for part in range(len(parts.part_of)):
            if parts.part_of[part] == part:
                product *= parts.sums[part, parts.groups[part, h]]
        error += abs(weights[h] - product)
        left -= product
    return error + max(0.0, left)


@borrowing
def _join(parts: _Parts, a: int, b: int, weights: Floats) -> None:
    """Merge two parts."""
    first, last = min(a, b), max(a, b)
    # The rows of the first are read up to each hypothesis before they are overwritten.
    parts.counts[first] = _pair_choices(parts, first, last, weights, parts.groups[first], parts.sums[first])
    for k in range(len(parts.part_of)):
        if parts.part_of[k] == last:
            parts.part_of[k] = first
    parts.sizes[first] += parts.sizes[last]


@kernel
def _by_dependence(parts: _Parts, weights: Floats) -> tuple[Ints, Ints]:
    """Return all pairs of labels, the most dependent ones first."""
    num, num_hyps, filled = len(parts.part_of), len(weights), 0
    most = num * (num - 1) // 2
    firsts, seconds, errors = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    groups, sums, seen = np.empty(num_hyps, np.int64), np.empty(num_hyps), np.empty(num_hyps, np.int64)
    for a in range(num):
        for b in range(a):
            firsts[filled], seconds[filled] = b, a
            errors[filled] = _dependence(parts, b, a, weights, groups, sums, seen)
            filled += 1
    order = descending_order(errors)
    return firsts[order], seconds[order]


@kernel
def existences_of(choices: Choices) -> Floats:
    """Existence probability of each label, shape (num_labels,)."""
    existences = np.zeros(len(choices.labels))
    for h in range(len(choices.weights)):
        for k in range(len(existences)):
            if choices.symbols[h, k] >= 0:
                existences[k] += choices.weights[h]
    return existences


@kernel
def independent_parts(choices: Choices, max_error: float, max_labels: int, min_existence: float) -> tuple[Ints, float]:
    """First label of the part of each label, shape (num_labels,), and the L1 error of the product of the parts.

    choices: no two hypotheses are the same. The parts are as small as an error of at most `max_error` allows. The most
    dependent labels are joined first, but no part becomes larger than `max_labels`, and labels less probable than
    `min_existence` stay alone, whatever the resulting error.
    """
    weights, parts = choices.weights, _alone(choices)
    part_of, sizes, num_parts = parts.part_of, parts.sizes, len(choices.labels)
    if num_parts < 2:
        return part_of, 0.0
    enough = max(max_error, _EQUAL)
    error = _product_error(parts, weights)
    if error <= enough:
        return part_of, error
    existences = existences_of(choices)
    firsts, seconds = _by_dependence(parts, weights)
    for pair in range(len(firsts)):
        a, b = part_of[firsts[pair]], part_of[seconds[pair]]
        improbable = existences[firsts[pair]] < min_existence or existences[seconds[pair]] < min_existence
        if a == b or improbable or sizes[a] + sizes[b] > max_labels:
            continue
        _join(parts, a, b, weights)
        num_parts -= 1
        error = _product_error(parts, weights) if num_parts > 1 else 0.0
        if error <= enough:
            break
    return part_of, error
