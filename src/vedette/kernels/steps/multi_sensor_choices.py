"""Tracks that compete for measurements of several sensors: their clusters, and their choices as bit sets."""

import math
from typing import NamedTuple

import numpy as np

from vedette.kernels.association.clusters import root_of
from vedette.kernels.base.arrays import filled_ints
from vedette.kernels.base.compile import inlined, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import log_add

_BITS = 31  # bits of a mask in one word, so that words hash without overflow


class Choices(NamedTuple):
    """Choices of each track: `offsets[t]:offsets[t + 1]` for track `t`, and absence.

    columns: (num_choices, num_sensors) measurements taken, numbered over all sensors. Negative: none.
    log_weights: (num_choices,). log_absent: (num_tracks,).
    """

    offsets: Ints
    columns: Ints
    log_weights: Floats
    log_absent: Floats


class Classes(NamedTuple):
    """Choices of the tracks of a cluster, grouped by the contested measurements that they take.

    offsets: (num_members + 1,) classes of each member, of which the first takes nothing.
    masks: (num_classes, num_words).
    log_weights: (num_classes,). alive: (num_members, num_words) measurements that a later member may take.
    """

    offsets: Ints
    masks: Ints
    log_weights: Floats
    alive: Ints


@kernel
def find_clusters(choices: Choices, num_columns: int) -> tuple[Ints, Ints]:
    """Return the leader of each track's cluster, and the contested measurements.

    leaders: (num_tracks,) a track of the same cluster, not after the track itself. The first one is its own leader.
    contested: (num_columns,) 1 if more than one track may take the measurement.
    """
    num_tracks = len(choices.log_absent)
    leaders = np.empty(num_tracks, np.int64)
    owners = filled_ints(num_columns, -1)
    contested = filled_ints(num_columns, 0)
    for track in range(num_tracks):
        leaders[track] = track
        for choice in range(choices.offsets[track], choices.offsets[track + 1]):
            for sensor in range(choices.columns.shape[1]):
                column = choices.columns[choice, sensor]
                if column < 0 or owners[column] == track:
                    continue
                if owners[column] >= 0:
                    contested[column] = 1
                    a, b = root_of(leaders, owners[column]), root_of(leaders, track)
                    leaders[max(a, b)] = min(a, b)
                owners[column] = track
    return leaders, contested


@kernel
def members_of(leaders: Ints, leader: int) -> Ints:
    members, count = np.empty(len(leaders) - leader, np.int64), 0
    for track in range(leader, len(leaders)):
        if root_of(leaders, track) == leader:
            members[count] = track
            count += 1
    return members[:count]


@kernel
def _number_contested(choices: Choices, members: Ints, contested: Ints) -> tuple[Ints, int]:
    """Number of each contested measurement of the cluster, else -1, shape (num_columns,), and how many there are."""
    bit_of, num_bits = filled_ints(len(contested), -1), 0
    for track in members:
        for choice in range(choices.offsets[track], choices.offsets[track + 1]):
            for sensor in range(choices.columns.shape[1]):
                column = choices.columns[choice, sensor]
                if column >= 0 and contested[column] == 1 and bit_of[column] < 0:
                    bit_of[column] = num_bits
                    num_bits += 1
    return bit_of, num_bits


@kernel
def _order_members(choices: Choices, members: Ints, bit_of: Ints, num_bits: int) -> None:
    """Sort members greedily: next is the one that leaves the fewest measurements open.

    An open measurement may be taken both by earlier and by later members.
    """
    num = len(members)
    wants = np.zeros((num, num_bits), np.int64)
    asked = np.zeros(num_bits, np.int64)
    is_open = np.zeros(num_bits, np.int64)
    for i in range(num):
        for choice in range(choices.offsets[members[i]], choices.offsets[members[i] + 1]):
            for sensor in range(choices.columns.shape[1]):
                column = choices.columns[choice, sensor]
                if column >= 0 and bit_of[column] >= 0 and wants[i, bit_of[column]] == 0:
                    wants[i, bit_of[column]] = 1
                    asked[bit_of[column]] += 1
    for place in range(num):
        best, fewest = place, num_bits + 1
        for i in range(place, num):
            count = 0
            for bit in range(num_bits):
                if is_open[bit] + wants[i, bit] > 0 and asked[bit] > wants[i, bit]:
                    count += 1
            if count < fewest:
                best, fewest = i, count
        chosen = members[best]
        for i in range(best, place, -1):
            members[i] = members[i - 1]
        members[place] = chosen
        for bit in range(num_bits):
            wanted = wants[best, bit]
            for i in range(best, place, -1):
                wants[i, bit] = wants[i - 1, bit]
            wants[place, bit] = wanted
            asked[bit] -= wanted
            is_open[bit] = max(is_open[bit], wanted)


@inlined
def _write_mask(columns: Ints, choice: int, bit_of: Ints, mask: Ints) -> None:
    for word in range(len(mask)):
        mask[word] = 0
    for sensor in range(columns.shape[1]):
        column = columns[choice, sensor]
        if column >= 0 and bit_of[column] >= 0:
            mask[bit_of[column] // _BITS] |= 1 << (bit_of[column] % _BITS)


@inlined
def same_mask(first: Ints, second: Ints) -> bool:
    difference = 0
    for word in range(len(first)):
        difference |= first[word] ^ second[word]
    return difference == 0


@kernel
def make_classes(choices: Choices, members: Ints, contested: Ints, class_of: Ints) -> Classes:
    """Return the classes of the members, which are sorted.

    class_of: (num_choices,) receives the class of their choices.
    """
    bit_of, num_bits = _number_contested(choices, members, contested)
    _order_members(choices, members, bit_of, num_bits)
    num_words, most = max(1, (num_bits + _BITS - 1) // _BITS), len(members)
    for track in members:
        most += choices.offsets[track + 1] - choices.offsets[track]
    offsets = np.zeros(len(members) + 1, np.int64)
    masks = np.empty((most, num_words), np.int64)
    log_weights = np.empty(most)
    filled = 0
    for i in range(len(members)):
        first = filled
        log_weights[filled] = choices.log_absent[members[i]]
        for word in range(num_words):
            masks[filled, word] = 0
        filled += 1
        for choice in range(choices.offsets[members[i]], choices.offsets[members[i] + 1]):
            _write_mask(choices.columns, choice, bit_of, masks[filled])
            found = first
            while not same_mask(masks[found], masks[filled]):
                found += 1
            if found == filled:
                log_weights[filled] = -math.inf
                filled += 1
            log_weights[found] = log_add(log_weights[found], choices.log_weights[choice])
            class_of[choice] = found
        offsets[i + 1] = filled
    alive = np.zeros((len(members), num_words), np.int64)
    for i in range(len(members) - 2, -1, -1):
        for word in range(num_words):
            alive[i, word] = alive[i + 1, word]
            for later in range(offsets[i + 1], offsets[i + 2]):
                alive[i, word] |= masks[later, word]
    return Classes(offsets, masks[:filled], log_weights[:filled], alive)
