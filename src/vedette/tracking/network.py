"""Radio links between sensors: who hears whom, how late, and how much is sent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import reject
from vedette.models.fields import Count, Limit, Natural, Share, check_fields

# Stands for "never" among step numbers and numbers of hops.
NEVER = np.iinfo(np.int64).max // 2


@dataclass(frozen=True, slots=True)
class Network:
    """A radio network of moving sensors, in which every message is passed on from neighbour to neighbour.

    Attributes:
        radio_range: distance up to which sensors hear each other; none: any [m].
        hops: links that a message may travel; none: as far as they reach.
        loss: probability that a link fails at a scan, in both directions, for all messages.
        delay: scans that a message takes for each link.
        consensus_rounds: rounds of averaging with the neighbours (Metropolis weights) after each scan, instead of
            passing messages on; for fusions of densities; none: no consensus.

    Raises:
        InputError: names the field, what was expected and what came.
    """

    radio_range: Limit = math.inf
    hops: Count | None = None
    loss: Share = 0.0
    delay: Natural = 0
    consensus_rounds: Count | None = None

    def __post_init__(self) -> None:
        check_fields(self, "Network.")
        if self.consensus_rounds is not None and (self.delay > 0 or self.hops is not None):
            raise reject("Network.consensus_rounds", "None with a delay or a number of hops", self.consensus_rounds)

    @property
    def _most_hops(self) -> int:
        return NEVER - 1 if self.hops is None else self.hops

    def links(self, poses: Floats, rng: np.random.Generator) -> Bools:
        """(num_sensors, num_sensors) which sensors hear each other directly; symmetric, nobody itself.

        Drawn from `rng` only where links fail.
        """
        offsets = poses[:, None, :2] - poses[None, :, :2]
        near: Bools = np.hypot(offsets[..., 0], offsets[..., 1]) <= self.radio_range
        np.fill_diagonal(near, False)
        if self.loss > 0.0:
            works = np.triu(rng.random(near.shape) >= self.loss, 1)
            near &= works | works.T
        return near

    def arrivals(self, hops: Ints, step: int) -> Ints:
        """(num_sensors, num_sensors) step at which sensor i has the message that sensor j sends now, or `NEVER`.

        hops: `hop_counts` of the links of the step; messages travel over those of the step at which they are sent.
        """
        return np.where(self.reaches(hops), step + self.delay * np.minimum(hops, len(hops)), NEVER)

    def reaches(self, hops: Ints) -> Bools:
        """Whether messages travel over so many links."""
        return np.asarray(hops <= self._most_hops)

    def longest_delay(self, num_sensors: int) -> int:
        """Scans after which no message arrives any more."""
        return self.delay * min(num_sensors - 1, self._most_hops)

    def bytes_sent(self, hops: Ints, sizes: Sequence[int]) -> tuple[int, ...]:
        """What each sensor sends at a step, where sensor j has a message of `sizes[j]` bytes; hops: as of `arrivals`.

        A message is sent once by each sensor that has it and may still pass it on, and heard by all its neighbours;
        with consensus, each sensor sends its average, as large as the largest message, in each round.
        """
        heard: Bools = (hops == 1).sum(axis=1) > 0
        if self.consensus_rounds is not None:
            return tuple(self.consensus_rounds * max(sizes) if hears else 0 for hears in heard.tolist())
        passes_on = (hops < self._most_hops) & heard.reshape(-1, 1)
        return tuple((passes_on @ np.asarray(sizes, np.int64)).tolist())


def heard_by(sensor: int, arrives: Ints, step: int) -> tuple[int, ...]:
    """The sensors whose messages, of `Network.arrivals`, a sensor has by a step; its own among them."""
    return tuple(np.flatnonzero(arrives[sensor] <= step).tolist())


def hop_counts(links: Bools) -> Ints:
    """(n, n) fewest links between any two sensors; 0 from each to itself, `NEVER` where there is no way."""
    reached = np.eye(len(links), dtype=np.bool_)
    hops, count = np.where(reached, 0, NEVER), 0
    while reached.any():  # those that the last link has brought
        count += 1
        reached = (reached @ links) & (hops == NEVER)
        hops[reached] = count
    return hops


def metropolis_weights(links: Bools) -> Floats:
    """(n, n) symmetric weights of one round of averaging: 1 / (1 + the larger number of neighbours) on each link.

    Rows and columns sum to one, so that averages are kept and rounds converge to the mean of each connected group
    (Xiao, Boyd and Lall 2005).
    """
    degrees = links.sum(axis=1)
    weights = np.where(links, 1.0 / (1.0 + np.maximum(degrees[:, None], degrees[None, :])), 0.0)
    return weights + np.diag(1.0 - weights.sum(axis=1))
