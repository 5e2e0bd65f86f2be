"""How many bytes a sensor sends: numbers of 8 bytes, each symmetric matrix as its triangle, without compression."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from hashlib import blake2b
from itertools import pairwise
from typing import Any

import numpy as np

from vedette.densities import FactoredGLMB, Labelled, as_lmb
from vedette.kernels.base.types import Ints
from vedette.tracking.network import Network

NUMBER = 8  # bytes


def bytes_of_scan(scan: Any, pose: Any) -> int:
    """The measurements, and the pose that they were taken from; 0 where there was no scan."""
    return 0 if scan is None else NUMBER * (np.size(scan) + len(pose))


def bytes_of_belief(belief: Any) -> int:
    """Labels, existences or hypotheses, and the components of all tracks; 0 of a density without labels."""
    if not isinstance(belief, Labelled):
        return 0
    tracks, dim = belief.tracks, belief.state_dim
    numbers = 2 * tracks.num_tracks + len(tracks.log_weights) * (1 + dim + dim * (dim + 1) // 2)
    if belief.is_lmb:
        return NUMBER * (numbers + tracks.num_tracks)
    own = belief.to_factors()
    hyps = len(own.hyp_log_weights) + len(own.hyp_tracks)
    # Of those of one label an existence says all.
    singles = int(np.count_nonzero(FactoredGLMB.of(belief).is_bernoulli)) if belief.is_product else 0
    return NUMBER * (numbers + hyps - 2 * singles)


def parts_of_belief(belief: Any) -> dict[bytes, int]:
    """The independent parts of a belief, each by a fingerprint of its content, with its bytes as of `bytes_of_belief`.

    A label of an LMB, a factor of a factored density, a GLMB as a whole; nothing of a density without labels.
    """
    if not isinstance(belief, Labelled):
        return {}
    tracks, dim = belief.tracks, belief.state_dim
    of_component = 1 + dim + dim * (dim + 1) // 2
    if belief.is_lmb:
        firsts, own = np.arange(tracks.num_tracks + 1), np.ones(tracks.num_tracks, np.int64)
        others = [logit.tobytes() for logit in as_lmb(belief).existence_logit]
    else:
        factored = FactoredGLMB.of(belief)
        firsts, hyps = factored.track_offsets, factored.factor_offsets
        entries = factored.hyp_offsets[hyps]
        own = np.diff(hyps) + np.diff(entries) - 2 * factored.is_bernoulli
        others = [
            factored.hyp_log_weights[low:high].tobytes()
            + (factored.hyp_offsets[low : high + 1] - factored.hyp_offsets[low]).tobytes()
            + (factored.hyp_tracks[first:last] - firsts[i]).tobytes()
            for i, ((low, high), (first, last)) in enumerate(
                zip(pairwise(hyps.tolist()), pairwise(entries.tolist()), strict=True)
            )
        ]
        tracks = factored.tracks
    sizes = NUMBER * (2 * np.diff(firsts) + np.diff(tracks.offsets[firsts]) * of_component + own)
    parts = {}
    for (low, high), size, other in zip(pairwise(firsts.tolist()), sizes.tolist(), others, strict=True):
        start, end = tracks.offsets[low], tracks.offsets[high]
        of_tracks = tracks.labels[low:high], tracks.offsets[low:high] - start
        of_components = (array[start:end] for array in (tracks.log_weights, tracks.means, tracks.covs))
        content = b"".join([other, *(array.tobytes() for array in (*of_tracks, *of_components))])
        parts[blake2b(content, digest_size=NUMBER).digest()] = size
    return parts


def bytes_of_messages(network: Network, hops: Ints, messages: Sequence[Sequence[Any]]) -> tuple[int, ...]:
    """What each sensor sends so that all have the beliefs of those whom they hear.

    Each sends the fingerprints of its own parts, a number each, as far as messages travel; then each part goes to those
    who lack it, from the nearest who hold it, by one neighbour of each. In consensus, averages are sent whole.

    hops: as of `Network.arrivals`. messages: the beliefs that each sensor sends.
    """
    if network.consensus_rounds is not None:
        return network.bytes_sent(hops, [sum(map(bytes_of_belief, beliefs)) for beliefs in messages])
    held: list[dict[bytes, int]] = []
    known: dict[int, dict[bytes, int]] = {}
    for beliefs in messages:
        held.append({})
        for belief in beliefs:
            if id(belief) not in known:
                known[id(belief)] = parts_of_belief(belief)
            held[-1] |= known[id(belief)]
    sent = np.array(network.bytes_sent(hops, [NUMBER * len(parts) for parts in held]))
    holders, sizes = defaultdict[bytes, list[int]](list), dict[bytes, int]()
    for sensor, parts in enumerate(held):
        sizes |= parts
        for name in parts:
            holders[name].append(sensor)
    together = defaultdict[tuple[int, ...], int](int)
    for name, sensors in holders.items():
        together[tuple(sensors)] += sizes[name]
    for owners, size in together.items():
        sent[_senders(network, hops, owners)] += size
    return tuple(sent.tolist())


def _senders(network: Network, hops: Ints, holders: Collection[int]) -> Ints:
    """Who passes on what these sensors hold until all who hear them have it."""
    away = hops[:, list(holders)].min(axis=1)
    lacking = np.flatnonzero((away > 0) & network.reaches(away))
    before = (hops[lacking] == 1) & (away == away[lacking, None] - 1)
    return np.unique(before.argmax(axis=1))
