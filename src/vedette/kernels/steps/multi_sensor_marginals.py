"""Marginal probability of every combination of every track, if tracks compete for the measurements of all sensors.

Within a cluster of tracks that share a measurement of any sensor, directly or not, the sum over all joint choices runs
forward and backward over the tracks. Its state is the set of contested measurements that earlier tracks have taken and
later ones may still take. Only sets that occur are stored, and the tracks are ordered to keep few measurements open at
a time. Everything is in logs, so that nothing underflows.
"""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.base.arrays import filled_ints, hashed
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_add
from vedette.kernels.gaussian.mixtures import descending_order
from vedette.kernels.steps.multi_sensor_choices import (
    Choices,
    Classes,
    find_clusters,
    make_classes,
    members_of,
    same_mask,
)

_NUM_PARTS = 32  # number of kept states that are tried as replacement of a dropped one


class StateCaps(NamedTuple):
    """Largest number of sets of taken measurements that are followed, and their log weight gap below the heaviest."""

    max_states: int
    max_log_gap: float


class States(NamedTuple):
    """Sets of contested measurements that have been taken.

    masks: (num_states, num_words). log_weights: (num_states,) total weight of the paths to each. log_lent: (num_states,
    2) weight of the dropped sets that a state replaces: in the sum, and in the bound on the error of the sum.
    """

    masks: Ints
    log_weights: Floats
    log_lent: Floats


@inlined
def _slot(table: Ints, masks: Ints, mask: Ints) -> int:
    """Return the slot of `mask` in the hash table, or the free slot for it."""
    key = 0
    for word in range(len(mask)):
        key = hashed(key, mask[word])
    slot = key & (len(table) - 1)
    while table[slot] >= 0 and not same_mask(masks[table[slot]], mask):
        slot = (slot + 1) & (len(table) - 1)
    return slot


@kernel
def _advance(classes: Classes, member: int, states: States) -> tuple[States, Ints]:
    """Return the states after a member's choice, and the state that follows from each state and class, -1 for none.

    The latter has two columns as `States.log_lent`.
    """
    first, num_classes = classes.offsets[member], classes.offsets[member + 1] - classes.offsets[member]
    most, num_words = len(states.masks) * num_classes, states.masks.shape[1]
    size = 4
    while size < 2 * most:
        size *= 2
    table, targets = filled_ints(size, -1), np.full((most, 2), -1)
    masks, log_weights, count = np.empty((most + 1, num_words), np.int64), np.empty(most), 0
    for state in range(len(states.masks)):
        for c in range(num_classes):
            log_weight, free = states.log_weights[state] + classes.log_weights[first + c], True
            for word in range(num_words):
                before, taken = states.masks[state, word], classes.masks[first + c, word]
                free = free and before & taken == 0
                masks[count, word] = (before | taken) & classes.alive[member, word]
            if not free or classes.log_weights[first + c] == -math.inf:
                continue
            slot = _slot(table, masks, masks[count])
            if table[slot] < 0:
                table[slot], log_weights[count] = count, log_weight
                count += 1
            else:
                log_weights[table[slot]] = log_add(log_weights[table[slot]], log_weight)
            targets[state * num_classes + c, 0] = targets[state * num_classes + c, 1] = table[slot]
    return States(masks[:count], log_weights[:count], np.full((count, 2), -math.inf)), targets


@inlined
def _part_of(masks: Ints, num: int, mask: Ints) -> int:
    """Return the first of `num` sets that is a subset of `mask`. -1: none."""
    for place in range(num):
        is_part = True
        for word in range(len(mask)):
            is_part = is_part and masks[place, word] & ~mask[word] == 0
        if is_part:
            return place
    return -1


@kernel
def _keep_heaviest(states: States, targets: Ints, caps: StateCaps) -> States:
    """Return the heaviest states, with `targets` redirected to them.

    A dropped state is replaced by the heaviest of the first few that is a subset of it. If there is none, the sum uses
    the heaviest of all, so that no choice is ruled out for lack of a state, and the bound uses the empty set, since
    fewer taken measurements leave more choices to the later members.
    """
    order, num_words = descending_order(states.log_weights), states.masks.shape[1]
    heaviest, most = states.log_weights[order[0]], 0
    if heaviest == -math.inf:
        return states
    while most < min(len(order), caps.max_states) and heaviest - states.log_weights[order[most]] <= caps.max_log_gap:
        most += 1
    if most == len(order):
        return states
    places, masks = np.empty((len(order), 2), np.int64), np.zeros((most + 1, num_words), np.int64)
    log_weights, log_lent = np.full(most + 1, -math.inf), np.full((most + 1, 2), -math.inf)
    for place in range(len(order)):
        state, follower, bound = order[place], place, place
        if place < most:
            for word in range(num_words):
                masks[place, word] = states.masks[state, word]
        else:
            part = _part_of(masks, min(most, _NUM_PARTS), states.masks[state])
            follower, bound = (part, part) if part >= 0 else (0, most)
            log_lent[follower, 0] = log_add(log_lent[follower, 0], states.log_weights[state])
            log_lent[bound, 1] = log_add(log_lent[bound, 1], states.log_weights[state])
        places[state, 0], places[state, 1] = follower, bound
        log_weights[follower] = log_add(log_weights[follower], states.log_weights[state])
    for i in range(len(targets)):
        if targets[i, 0] >= 0:
            targets[i, 1] = places[targets[i, 0], 1]
            targets[i, 0] = places[targets[i, 0], 0]
    return States(masks, log_weights, log_lent)


@kernel
def _backward(classes: Classes, starts: Ints, forward: States, targets: Ints, out: Floats) -> float:
    """Write the log of the sum of all joint choices that hold each class. Return the log of a bound on their error."""
    amiss, amiss_at_most, last = -math.inf, -math.inf, len(targets)
    after = np.zeros((1, 2))
    for member in range(len(starts) - 2, -1, -1):
        first, num_classes = classes.offsets[member], classes.offsets[member + 1] - classes.offsets[member]
        num_states = starts[member + 1] - starts[member]
        before = np.full((num_states, 2), -math.inf)
        last -= num_states * num_classes
        for c in range(num_classes):
            out[first + c] = -math.inf
        for i in range(num_states):
            state = starts[member] + i
            for c in range(num_classes):
                target, bound = targets[last + i * num_classes + c, 0], targets[last + i * num_classes + c, 1]
                if target >= 0:
                    rest = classes.log_weights[first + c] + after[target, 0]
                    before[i, 0] = log_add(before[i, 0], rest)
                    before[i, 1] = log_add(before[i, 1], classes.log_weights[first + c] + after[bound, 1])
                    out[first + c] = log_add(out[first + c], forward.log_weights[state] + rest)
            amiss = log_add(amiss, forward.log_lent[state, 0] + before[i, 0])
            amiss_at_most = log_add(amiss_at_most, forward.log_lent[state, 1] + before[i, 1])
        after = before
    return max(amiss, amiss_at_most)


@kernel
def _append(forward: States, filled: int, states: States) -> States:
    """Return `forward` with the states of one more member from `filled` on. Their masks are no longer needed."""
    num = len(states.log_weights)
    log_weights, log_lent = forward.log_weights, forward.log_lent
    if filled + num > len(log_weights):
        room = 2 * (filled + num)
        log_weights, log_lent = np.empty(room), np.empty((room, 2))
        log_weights[:filled], log_lent[:filled] = forward.log_weights[:filled], forward.log_lent[:filled]
    log_weights[filled : filled + num], log_lent[filled : filled + num] = states.log_weights, states.log_lent
    return States(forward.masks, log_weights, log_lent)


@kernel
def _sum_cluster(classes: Classes, caps: StateCaps, out: Floats) -> tuple[float, float]:
    """Write the log of the sum of all joint choices that hold each class.

    Return the log of the total and of the error.
    """
    num_members = len(classes.offsets) - 1
    starts, num_targets = np.zeros(num_members + 1, np.int64), 0
    states = States(np.zeros((1, classes.masks.shape[1]), np.int64), np.zeros(1), np.full((1, 2), -math.inf))
    forward, targets = states, np.empty((256, 2), np.int64)
    for member in range(num_members):
        starts[member + 1] = starts[member] + len(states.log_weights)
        forward = _append(forward, starts[member], states)
        states, followers = _advance(classes, member, states)
        if len(states.log_weights) == 0:
            return -math.inf, -math.inf
        states = _keep_heaviest(states, followers, caps)
        filled, num_targets = num_targets, num_targets + len(followers)
        if num_targets > len(targets):
            longer = np.empty((2 * num_targets, 2), np.int64)
            longer[:filled] = targets[:filled]
            targets = longer
        targets[filled:num_targets] = followers
    return states.log_weights[0], _backward(classes, starts, forward, targets[:num_targets], out)


@inlined
def _single_track(choices: Choices, track: int, out: Floats, out_absent: Floats) -> float:
    log_total = choices.log_absent[track]
    for choice in range(choices.offsets[track], choices.offsets[track + 1]):
        log_total = log_add(log_total, choices.log_weights[choice])
    if log_total == -math.inf:
        return log_total
    out_absent[track] = choices.log_absent[track] - log_total
    for choice in range(choices.offsets[track], choices.offsets[track + 1]):
        out[choice] = choices.log_weights[choice] - log_total
    return log_total


@kernel
def choice_marginals(
    choices: Choices, num_columns: int, caps: StateCaps, out: Floats, out_absent: Floats
) -> tuple[float, int, float]:
    """Write the log marginal probability of each choice to `out`, and of each track's absence to `out_absent`.

    Returns the log total weight of all joint choices (-inf: none is possible), the number of clusters in which not all
    sets of taken measurements were followed, and the log of a lower bound on the share of weight that is correctly
    assigned (0 without such clusters): 1 minus that share bounds the error of each marginal.
    """
    log_total, num_inexact, log_kept = 0.0, 0, 0.0
    leaders, contested = find_clusters(choices, num_columns)
    class_of = np.empty(len(choices.log_weights), np.int64)
    for leader in range(len(leaders)):
        if leaders[leader] != leader:
            continue
        members = members_of(leaders, leader)
        if len(members) == 1:
            log_total += _single_track(choices, leader, out, out_absent)
            if log_total == -math.inf:
                return log_total, num_inexact, log_kept
            continue
        classes = make_classes(choices, members, contested, class_of)
        sums = np.empty(len(classes.log_weights))
        log_joint, log_amiss = _sum_cluster(classes, caps, sums)
        if log_joint == -math.inf:
            return -math.inf, num_inexact, log_kept
        log_total += log_joint
        if log_amiss > -math.inf:
            num_inexact += 1
            log_kept += math.log1p(-math.exp(log_amiss - log_joint)) if log_amiss < log_joint else -math.inf
        for i in range(len(members)):
            none, track = classes.offsets[i], members[i]
            # A class's share of all choices, times a choice's share of its class.
            out_absent[track] = choices.log_absent[track]
            if out_absent[track] > -math.inf:
                out_absent[track] += sums[none] - log_joint - classes.log_weights[none]
            for choice in range(choices.offsets[track], choices.offsets[track + 1]):
                c = class_of[choice]
                out[choice] = sums[c] - log_joint + choices.log_weights[choice] - classes.log_weights[c]
    return log_total, num_inexact, log_kept
