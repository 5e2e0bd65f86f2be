"""Splitting a GLMB into independent factors, at a stated L1 error.

Of the hypotheses of a GLMB, each a choice of one symbol a label (a track, or absence) with weight w, the product of the
marginals of some parts of the labels has the weights pi = prod over parts of w_part. It differs from the GLMB by

    sum over choices |w - pi| = sum over hypotheses |w - pi| + 1 - sum over hypotheses pi,

as the choices that are no hypothesis have w = 0, and all pi sum to 1. That bounds the L1 distance of the densities.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import counted_ints, filled_ints, hashed
from vedette.kernels.base.compile import kernel
from vedette.kernels.base.types import Floats, Glmb, Ints
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.labelled.labels import increasing_labels, label_place

# Rounding leaves a product this far from what it is equal to.
_EQUAL = 1e-11


class Choices(NamedTuple):
    """The hypotheses of a GLMB as choices of one symbol a label."""

    labels: Ints  # (num_labels, 2) increasing
    symbols: Ints  # (num_hyps, num_labels) the label's track, -1 where it is absent
    weights: Floats  # (num_hyps,) linear


@kernel
def choices_of(glmb: Glmb) -> Choices:
    """The hypotheses of a normalised GLMB."""
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
    """Number the choices of the labels of a part by first occurrence: (num_hyps,) into `groups`; the first of each."""
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


@kernel
def _product_error(symbols: Ints, weights: Floats, part_of: Ints) -> float:
    """L1 distance of the product of the parts from the choices; equal ones count as one."""
    num, num_labels = symbols.shape
    groups, products = np.empty(num, np.int64), np.empty(num)
    distinct = group_choices(symbols, filled_ints(num_labels, 0), 0, groups)
    own = np.zeros(len(distinct))
    for h in range(num):
        own[groups[h]] += weights[h]
        products[h] = 1.0
    for part in range(num_labels):
        if part_of[part] != part:
            continue
        firsts = group_choices(symbols, part_of, part, groups)
        sums = np.zeros(len(firsts))
        for h in range(num):
            sums[groups[h]] += weights[h]
        for h in distinct:
            products[h] *= sums[groups[h]]
    error, left = 0.0, 1.0
    for g in range(len(distinct)):
        error += abs(own[g] - products[distinct[g]])
        left -= products[distinct[g]]
    return error + max(0.0, left)


@kernel
def _dependences(choices: Choices) -> tuple[Ints, Ints, Floats]:
    """Every two labels, and the L1 distance of their joint choices from those of independent ones."""
    num_hyps, num = choices.symbols.shape
    most = num * (num - 1) // 2
    firsts, seconds, errors = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    pair, alone, filled = np.empty((num_hyps, 2), np.int64), counted_ints(2), 0
    for a in range(num):
        for b in range(a):
            for h in range(num_hyps):
                pair[h, 0], pair[h, 1] = choices.symbols[h, b], choices.symbols[h, a]
            firsts[filled], seconds[filled] = b, a
            errors[filled] = _product_error(pair, choices.weights, alone)
            filled += 1
    return firsts, seconds, errors


@kernel
def _existences(choices: Choices) -> Floats:
    existences = np.zeros(len(choices.labels))
    for h in range(len(choices.weights)):
        for k in range(len(existences)):
            if choices.symbols[h, k] >= 0:
                existences[k] += choices.weights[h]
    return existences


@kernel
def independent_parts(choices: Choices, max_error: float, max_labels: int, min_existence: float) -> tuple[Ints, float]:
    """(num_labels,) the first label of the part that each is in, and the L1 error of their product.

    The parts are as small as an error of at most `max_error` allows, labels that depend on each other most joined
    first, but none is made larger than `max_labels`, and labels less probable than `min_existence` stay alone, whatever
    the error then is.
    """
    num = len(choices.labels)
    part_of, sizes = counted_ints(num), filled_ints(num, 1)
    if num < 2:
        return part_of, 0.0
    error = _product_error(choices.symbols, choices.weights, part_of)
    if error <= max(max_error, _EQUAL):
        return part_of, error
    existences, num_parts = _existences(choices), num
    firsts, seconds, errors = _dependences(choices)
    for pair in descending_order(errors):
        a, b = part_of[firsts[pair]], part_of[seconds[pair]]
        improbable = existences[firsts[pair]] < min_existence or existences[seconds[pair]] < min_existence
        if a == b or improbable or sizes[a] + sizes[b] > max_labels:
            continue
        first, last = min(a, b), max(a, b)
        for k in range(num):
            if part_of[k] == last:
                part_of[k] = first
        sizes[first] += sizes[last]
        num_parts -= 1
        error = _product_error(choices.symbols, choices.weights, part_of) if num_parts > 1 else 0.0
        if error <= max(max_error, _EQUAL):
            break
    return part_of, error


__all__ = ["Choices", "choices_of", "group_choices", "independent_parts"]
