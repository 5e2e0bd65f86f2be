"""An LMB filter of position sensors in plain NumPy: one prediction, then an update by each sensor's scan in turn.

Marginal association probabilities by loopy belief propagation (Williams and Lau 2014, eqs. 30 to 32), as the published
figures of the scene have them; the library sums the associations of all sensors exactly. Nothing is shared with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

SWEEPS = 200


@dataclass
class Track:
    """A Bernoulli with a Gaussian mixture: existence, weights (n,), means (n, 4), covs (n, 4, 4)."""

    existence: float
    weights: Any
    means: Any
    covs: Any


@dataclass
class Sensor:
    """What a sensor sees: probability of detection, standard deviation m, clutter intensity 1/m^2."""

    detection: float
    std: float
    clutter: float


@dataclass
class World:
    """Transition and process noise of a scan period, probability of survival, and the tracks born at each scan."""

    transition: Any
    noise: Any
    survival: float
    births: list[Track]


@dataclass
class Caps:
    """Least existence and component weight, most components."""

    existence: float = 1e-2
    weight: float = 1e-6
    components: int = 20


def step(tracks: list[Track], world: World, sensors: list[Sensor], scans: list[Any], caps: Caps) -> list[Track]:
    """The tracks after a scan of every sensor, each (num, 2) measured positions."""
    f = world.transition
    tracks = [
        Track(t.existence * world.survival, t.weights, t.means @ f.T, f @ t.covs @ f.T + world.noise) for t in tracks
    ]
    tracks += [Track(b.existence, b.weights, b.means, b.covs) for b in world.births]
    for sensor, scan in zip(sensors, scans, strict=True):
        tracks = [reduced(track, caps) for track in correct(tracks, sensor, scan)]
    return [track for track in tracks if track.existence >= caps.existence]


def correct(tracks: list[Track], sensor: Sensor, scan: Any) -> list[Track]:
    """Every track after one sensor's scan."""
    updates = [updated(track, sensor, scan) for track in tracks]
    missed = np.array([1.0 - track.existence * sensor.detection for track in tracks])
    hits = np.array(
        [
            [track.existence * sensor.detection * each.sum() / sensor.clutter for each in likelihoods]
            for track, (likelihoods, _, _) in zip(tracks, updates, strict=True)
        ]
    ).reshape(len(tracks), len(scan))
    chances = marginals(hits / missed[:, None])
    found = []
    for track, miss, row, (likelihoods, means, cov) in zip(tracks, missed, chances, updates, strict=True):
        unseen = row[0] * track.existence * (1.0 - sensor.detection) / miss
        weights = [unseen * track.weights]
        weights += [row[j + 1] * each / each.sum() for j, each in enumerate(likelihoods)]
        total = unseen + row[1:].sum()
        found.append(
            Track(
                float(total),
                np.concatenate(weights) / total,
                np.concatenate([track.means, *means]),
                np.concatenate([track.covs] + [cov] * len(means)),
            )
        )
    return found


def updated(track: Track, sensor: Sensor, scan: Any) -> tuple[Any, list[Any], Any]:
    """Of each measurement the weighted likelihood of every component and its mean after it; and the covariances."""
    spread = track.covs[:, :2, :2] + sensor.std**2 * np.eye(2)
    gain = track.covs[:, :, :2] @ np.linalg.inv(spread)
    cov = track.covs - gain @ track.covs[:, :2, :]
    likelihoods, means = [], []
    for z in scan:
        off = z - track.means[:, :2]
        square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off)
        likelihoods.append(track.weights * np.exp(-square / 2) / (2 * np.pi * np.sqrt(np.linalg.det(spread))) + 1e-300)
        means.append(track.means + np.einsum("nij,nj->ni", gain, off))
    return likelihoods, means, cov


def marginals(odds: Any) -> Any:
    """(num_tracks, 1 + num_measurements) probability that a track is unseen, or behind each measurement."""
    back = np.ones_like(odds)
    for _ in range(SWEEPS):
        sums = 1.0 + (odds * back).sum(axis=1, keepdims=True)
        there = odds / (sums - odds * back)
        back = 1.0 / (1.0 + there.sum(axis=0, keepdims=True) - there)
    table = np.concatenate([np.ones((len(odds), 1)), odds * back], axis=1)
    return table / table.sum(axis=1, keepdims=True)


def reduced(track: Track, caps: Caps) -> Track:
    """With the heaviest components alone."""
    order = np.argsort(-track.weights, kind="stable")[: caps.components]
    order = order[track.weights[order] >= caps.weight]
    weights = track.weights[order]
    return Track(track.existence, weights / weights.sum(), track.means[order], track.covs[order])


def estimates(tracks: list[Track]) -> Any:
    """(num, 4) heaviest components of the surest tracks, as many as are most probable."""
    number = np.array([1.0])
    for track in tracks:
        number = np.convolve(number, [1.0 - track.existence, track.existence])
    surest = sorted(tracks, key=lambda track: -track.existence)[: int(number.argmax())]
    return np.array([track.means[0] for track in surest]).reshape(-1, 4)
