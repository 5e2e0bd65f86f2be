"""Radio links between sensors: connectivity, message delays and uncompressed bytes sent."""

import math
from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import pairwise
from typing import Any

import numpy as np

from vedette.densities import FactoredGLMB, LabelledDensity, as_lmb
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import reject
from vedette.models.fields import Count, Limit, Natural, Share, check_fields
from vedette.tracking.base import NUMBER_BYTES, belief_bytes

# Stands for "never" among step numbers and numbers of hops.
NEVER = np.iinfo(np.int64).max // 2


@dataclass(frozen=True, slots=True)
class Network:
    """Radio network of moving sensors, in which every message is passed on from neighbour to neighbour.

    Attributes:
        radio_range: distance up to which two sensors have a link. none: unlimited [m].
        max_hops: maximum number of links that a message may travel. none: unlimited.
        link_loss_probability: probability that a link fails at a scan, in both directions, for all messages.
        delay: number of scans that a message takes for each link.
        consensus_rounds: rounds of averaging with the neighbours (Metropolis weights) after each scan, instead of
            passing messages on, for fusions of densities. none: no consensus.

    Raises:
        InputError: an invalid field. The message has its name, the expected and the given value.
    """

    radio_range: Limit = math.inf
    max_hops: Count | None = None
    link_loss_probability: Share = 0.0
    delay: Natural = 0
    consensus_rounds: Count | None = None

    def __post_init__(self) -> None:
        check_fields(self, "Network.")
        if self.consensus_rounds is not None and (self.delay > 0 or self.max_hops is not None):
            raise reject("Network.consensus_rounds", "None with a delay or a number of hops", self.consensus_rounds)

    @property
    def _hop_limit(self) -> int:
        return NEVER - 1 if self.max_hops is None else self.max_hops

    def links(self, poses: Floats, rng: np.random.Generator) -> Bools:
        """Return the direct links, (num_sensors, num_sensors): symmetric, False on the diagonal.

        Random numbers are drawn from `rng` only if links can fail (`link_loss_probability` > 0).
        """
        offsets = poses[:, None, :2] - poses[None, :, :2]
        linked: Bools = np.hypot(offsets[..., 0], offsets[..., 1]) <= self.radio_range
        np.fill_diagonal(linked, False)
        if self.link_loss_probability > 0.0:
            intact = np.triu(rng.random(linked.shape) >= self.link_loss_probability, 1)
            linked &= intact | intact.T
        return linked

    def arrivals(self, hops: Ints, step: int) -> Ints:
        """Step at which sensor i has the message that sensor j sends now, or `NEVER`, (num_sensors, num_sensors).

        hops: `hop_counts` of the links of this step. Messages travel over the links of the step at which they are sent.
        step: number of the step, where all steps at one time count once.
        """
        return np.where(self.reaches(hops), step + self.delay * np.minimum(hops, len(hops)), NEVER)

    def reaches(self, hops: Ints) -> Bools:
        """Return True, elementwise, if messages may travel over this number of links."""
        return np.asarray(hops <= self._hop_limit)

    def longest_delay(self, num_sensors: int) -> int:
        """Return the largest delay of a message, in scans."""
        return self.delay * min(num_sensors - 1, self._hop_limit)

    def bytes_sent(self, hops: Ints, sizes: Sequence[int]) -> tuple[int, ...]:
        """Return the bytes that each sensor sends at a step, if sensor j has a message of `sizes[j]` bytes.

        A message is sent once by each sensor that has it and may still pass it on, and received by all its neighbours.
        With consensus, each sensor sends its average, as large as the largest message, in each round. hops: as in
        `arrivals`.
        """
        has_neighbours: Bools = (hops == 1).sum(axis=1) > 0
        if self.consensus_rounds is not None:
            return tuple(
                self.consensus_rounds * max(sizes) if has_neighbour else 0 for has_neighbour in has_neighbours.tolist()
            )
        passes_on = (hops < self._hop_limit) & has_neighbours.reshape(-1, 1)
        return tuple((passes_on @ np.asarray(sizes, np.int64)).tolist())


def received_from(sensor: int, arrives: Ints, step: int) -> tuple[int, ...]:
    """Return the sensors whose messages a sensor has by a step, itself included. arrives: from `Network.arrivals`."""
    return tuple(np.flatnonzero(arrives[sensor] <= step).tolist())


def hop_counts(links: Bools) -> Ints:
    """Smallest number of links between any two sensors, (n, n), with 0 on the diagonal, `NEVER` if not connected."""
    reached = np.eye(len(links), dtype=np.bool_)
    hops, count = np.where(reached, 0, NEVER), 0
    while reached.any():  # sensors first reached over the last link
        count += 1
        reached = (reached @ links) & (hops == NEVER)
        hops[reached] = count
    return hops


def metropolis_weights(links: Bools) -> Floats:
    """Symmetric (n, n) weights of one round of averaging: 1 / (1 + the larger number of neighbours) on each link.

    Rows and columns sum to one, so that averages are preserved and rounds converge to the mean of each connected group
    (Xiao, Boyd and Lall 2005).
    """
    degrees = links.sum(axis=1)
    weights = np.where(links, 1.0 / (1.0 + np.maximum(degrees[:, None], degrees[None, :])), 0.0)
    return weights + np.diag(1.0 - weights.sum(axis=1))


def belief_parts(belief: Any) -> dict[bytes, int]:
    """Return the sizes of the independent parts of a belief in bytes, by a fingerprint of their content.

    A part is a label of an LMB, a factor of a factored density, or a whole GLMB. Sizes are counted as in
    `belief_bytes`. The result is empty for a density without labels.
    """
    if not isinstance(belief, LabelledDensity):
        return {}
    tracks, dim = belief.tracks, belief.state_dim
    component_size = 1 + dim + dim * (dim + 1) // 2
    if belief.is_lmb:
        firsts, num_numbers = np.arange(tracks.num_tracks + 1), np.ones(tracks.num_tracks, np.int64)
        others = [logit.tobytes() for logit in as_lmb(belief).existence_logit]
    else:
        factored = FactoredGLMB.of(belief)
        firsts, hyps = factored.track_offsets, factored.factor_offsets
        entries = factored.hyp_offsets[hyps]
        num_numbers = np.diff(hyps) + np.diff(entries) - 2 * factored.is_bernoulli
        others = [
            factored.hyp_log_weights[low:high].tobytes()
            + (factored.hyp_offsets[low : high + 1] - factored.hyp_offsets[low]).tobytes()
            + (factored.hyp_tracks[first:last] - firsts[i]).tobytes()
            for i, ((low, high), (first, last)) in enumerate(
                zip(pairwise(hyps.tolist()), pairwise(entries.tolist()), strict=True)
            )
        ]
        tracks = factored.tracks
    sizes = NUMBER_BYTES * (2 * np.diff(firsts) + np.diff(tracks.offsets[firsts]) * component_size + num_numbers)
    parts = {}
    for (low, high), size, other in zip(pairwise(firsts.tolist()), sizes.tolist(), others, strict=True):
        start, end = tracks.offsets[low], tracks.offsets[high]
        track_arrays = tracks.labels[low:high], tracks.offsets[low:high] - start
        component_arrays = (array[start:end] for array in tracks.to_kernel().components)
        content = b"".join([other, *(array.tobytes() for array in (*track_arrays, *component_arrays))])
        parts[blake2b(content, digest_size=NUMBER_BYTES).digest()] = size
    return parts


def message_bytes(network: Network, hops: Ints, messages: Sequence[Sequence[Any]]) -> tuple[int, ...]:
    """Return the bytes that each sensor sends so that all sensors have the beliefs of those they can reach.

    Each sensor first sends the fingerprints of its own parts, one number each, as far as messages travel. Each part
    then goes to the sensors that lack it, from the nearest holders, through one neighbour of each receiver. In
    consensus, averages are sent whole.

    hops: as in `Network.arrivals`. messages: the beliefs that each sensor sends.
    """
    if network.consensus_rounds is not None:
        return network.bytes_sent(hops, [sum(map(belief_bytes, beliefs)) for beliefs in messages])
    parts_of_sensor: list[dict[bytes, int]] = []
    parts_of_object: dict[int, dict[bytes, int]] = {}
    for beliefs in messages:
        parts_of_sensor.append({})
        for belief in beliefs:
            if id(belief) not in parts_of_object:
                parts_of_object[id(belief)] = belief_parts(belief)
            parts_of_sensor[-1] |= parts_of_object[id(belief)]
    sent = np.array(network.bytes_sent(hops, [NUMBER_BYTES * len(parts) for parts in parts_of_sensor]))
    holders, sizes = defaultdict[bytes, list[int]](list), dict[bytes, int]()
    for sensor, parts in enumerate(parts_of_sensor):
        sizes |= parts
        for name in parts:
            holders[name].append(sensor)
    size_of_holders = defaultdict[tuple[int, ...], int](int)
    for name, sensors in holders.items():
        size_of_holders[tuple(sensors)] += sizes[name]
    for owners, size in size_of_holders.items():
        sent[_senders(network, hops, owners)] += size
    return tuple(sent.tolist())


def _senders(network: Network, hops: Ints, holders: Collection[int]) -> Ints:
    """Return the sensors that must transmit a part that `holders` have, so that every sensor in reach receives it."""
    distance = hops[:, list(holders)].min(axis=1)
    lacking = np.flatnonzero((distance > 0) & network.reaches(distance))
    candidates = (hops[lacking] == 1) & (distance == distance[lacking, None] - 1)
    return np.unique(candidates.argmax(axis=1))
