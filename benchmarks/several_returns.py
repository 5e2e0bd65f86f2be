"""Extents of targets that give several returns: how often they are found, and how often where there are none.

    python benchmarks/several_returns.py [--scenes FIRST LAST]

The scenes are numbered, and a number always gives the same scene. Drawn over decades are: the side of the region (1 m
to 10 km), noise relative to it, the extent relative to the noise (.3 to 16), false measurements a scan (.1 to 20);
further 1.5 to 6 returns a scan (Poisson), the probability of detection (.5 to .98), one to eight targets and 30 to 200
scans of one or two sensors. Targets with one return each move apart, meet in the middle, or keep a formation. A scene
with several returns counts as found if exactly the sensors that have them get an extent.
"""

from __future__ import annotations

import argparse
from typing import Any, NamedTuple

import numpy as np

from vedette.kernels.base.types import Floats
from vedette.recorded import RecordedScans, RecordedSensor
from vedette.recorded.returns import ReturnsModel, extents_of

KINDS = ("several returns", "apart", "meeting", "formation")


class Scene(NamedTuple):
    """Scans, sensors, their assumed parameters, and which of them have several returns a target."""

    recording: RecordedScans
    sites: list[RecordedSensor]
    models: list[ReturnsModel]
    several: list[bool]


def courses(rng: np.random.Generator, kind: str, half: float, noise: float, num_scans: int) -> Floats:
    """(num, 4) positions and steps of targets."""
    num = int(rng.integers(1, 9))
    steps = rng.normal(0.0, 0.4 * half / num_scans, (num, 2))
    places = rng.uniform(-0.7 * half, 0.7 * half, (num, 2))
    if kind == "meeting":
        places = -0.5 * num_scans * steps + rng.normal(0.0, 3.0 * noise, (num, 2))
    if kind == "formation":
        offsets = rng.normal(0.0, noise * 10 ** rng.uniform(0.0, 1.3), (int(rng.integers(2, 6)), 2))
        places = np.concatenate([places[0] + offsets, places[1:]])
        steps = np.concatenate([np.tile(steps[0], (len(offsets), 1)), steps[1:]])
    return np.column_stack([places, steps])


def scene(number: int, kind: str, num_sensors: int) -> Scene:
    """Scene of a number."""
    rng = np.random.default_rng([number, KINDS.index(kind), num_sensors])
    half, num_scans, probability = 10 ** rng.uniform(0.0, 4.0), int(rng.integers(30, 200)), rng.uniform(0.5, 0.98)
    noise = half * 10 ** rng.uniform(-3.0, -1.7)
    extent, mean, clutter = noise * 10 ** rng.uniform(-0.5, 1.2), rng.uniform(1.5, 6.0), 10 ** rng.uniform(-1.0, 1.3)
    targets = courses(rng, kind, half, noise, num_scans)
    several = [kind == KINDS[0] and (s == 0 or rng.random() < 0.3) for s in range(num_sensors)]
    is_polar = rng.random(num_sensors) < 0.5
    own = np.array([2.0 * half, 0.0])
    scans = []
    for k in range(num_scans):
        at, instant = targets[:, :2] + k * targets[:, 2:], list[Any]()
        for s in range(num_sensors):
            numbers = rng.poisson(mean, len(at)) if several[s] else rng.random(len(at)) < probability
            places = np.repeat(at, numbers.astype(np.int64), axis=0)
            if several[s]:
                places = places + rng.normal(0.0, 0.5 * extent, places.shape)
            places = places + rng.normal(0.0, noise, places.shape)
            places = np.concatenate([places, rng.uniform(-half, half, (rng.poisson(clutter), 2))])
            away = places - own
            polar = np.column_stack([np.arctan2(away[:, 1], away[:, 0]), np.hypot(*away.T)])
            instant.append(polar if is_polar[s] else places)
        scans.append(tuple(instant))
    kinds = ["bearing_range" if polar else "position" for polar in is_polar]
    sites = [RecordedSensor(f"s{s}", each, (*own.tolist(), 0.0)) for s, each in enumerate(kinds)]
    stds = [(0.5 * noise / half, noise) if polar else (noise, noise) for polar in is_polar]
    poses = np.tile([*own, 0.0], (num_scans, num_sensors, 1))
    times = np.arange(num_scans, dtype=np.float64)
    recording = RecordedScans(times, 0.0, False, tuple(scans), poses, (), (None,) * num_sensors)
    return Scene(recording, sites, [ReturnsModel(None, own, probability) for own in stds], several)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, nargs=2, default=(1, 40), metavar=("FIRST", "LAST"))
    first, last = parser.parse_args().scenes
    for kind in KINDS:
        for num_sensors in (1, 2):
            right, wrong = 0, list[int]()
            for number in range(first, last + 1):
                made = scene(number, kind, num_sensors)
                found = [each is not None for each in extents_of(*made[:3])]
                right += found == made.several
                if any(one and not other for one, other in zip(found, made.several, strict=True)):
                    wrong.append(number)
            what = f"{kind}, {num_sensors} sensor{'s'[: num_sensors - 1]}"
            print(f"{what:32} right {right} of {last - first + 1}, merged wrongly in scenes {wrong}", flush=True)


if __name__ == "__main__":
    main()
