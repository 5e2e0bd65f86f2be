"""The LMB filters of `multisensor-lmb-filters-rs` as an entrant; for the Python that the wheel is installed for.

    vedette benchmark --tracker "rust-lmb=PYTHON benchmarks/entrants/rust_lmb.py"

The iterated corrector of several sensors, the LMB filter of one, with loopy belief propagation. It takes positions
(bearings and ranges are turned into them, with the mean noise of the region), one probability of detection for all
places, so that what is out of view is missed, and births at fixed places: at sixteen over the region where the scene
has them born of measurements. Targets that turn are followed as if they went straight with more noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import multisensor_lmb_filters_rs as peer
import numpy as np
from lines import Told, noise_std, place_of, serve


def begin(told: Told) -> Callable[[Told], Told]:
    scene, seed = told["scene"], told["seed"]
    region, dt = scene["region"], scene["time"]["step_period"]
    motion = peer.MotionModel(transition(dt), noise(scene, dt), np.zeros(4), scene["survival"]["probability"])
    sensors = [sensor_of(own, region) for own in scene["sensors"]]
    births = births_of(scene)
    spread, thresholds = peer.AssociatorConfig.lbp(100, 1e-6), peer.FilterThresholds(1e-3, 1e-4, 20, 3)
    if len(sensors) == 1:
        tracker: Any = peer.FilterLmb(motion, sensors[0], births, spread, thresholds, seed)
    else:
        tracker = peer.FilterIcLmb(motion, peer.SensorConfigMulti(sensors), births, spread, thresholds, seed)

    def step(asked: Told) -> Told:
        given = [
            [] if scan is None else [np.array(place_of(own, scan["pose"], row)) for row in scan["measurements"]]
            for own, scan in zip(scene["sensors"], asked["scans"], strict=True)
        ]
        tracker.step(given if len(sensors) > 1 else given[0], asked["step"])
        found = []
        for track in tracker.get_tracks():
            best = int(np.argmax(track.w))
            found.append({"state": list(track.mu[best]), "cov": np.asarray(track.sigma[best]).tolist()})
            found[-1] |= {"existence": min(float(track.existence), 1.0), "label": list(track.label)}
        return {"estimates": found}

    return step


def transition(dt: float) -> np.ndarray:
    return np.array([[1.0, 0, dt, 0], [0, 1, 0, dt], [0, 0, 1, 0], [0, 0, 0, 1]])


def noise(scene: Told, dt: float) -> np.ndarray:
    """Of an acceleration that is held over a period, or is white."""
    motion = scene["motion"]
    turning = motion["kind"] == "coordinated_turn"
    variance = max(motion["sigma_v"], 8.0 if turning else 0.0) ** 2
    held = motion.get("noise_model") != "continuous_white"
    one = np.array([[dt**4 / 4, dt**3 / 2], [dt**3 / 2, dt**2]] if held else [[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    return variance * np.kron(one, np.eye(2))


def sensor_of(own: Told, region: Told) -> Any:
    width, height = region["x_max"] - region["x_min"], region["y_max"] - region["y_min"]
    middle = [(region["x_min"] + region["x_max"]) / 2, (region["y_min"] + region["y_max"]) / 2]
    stds = noise_std(own, [*own["position"], 0.0], middle)
    if own["measurement"]["kind"] != "position":
        stds = [max(stds[0] * math.dist(own["position"], middle), stds[1])] * 2
    clutter, area = own["clutter"], width * height
    if clutter["kind"] == "around_sensor":
        area = (2.0 * clutter["half_side"]) ** 2 if clutter["half_side"] else 0.0
        area = area or math.radians(clutter["half_width_deg"]) * clutter["radius"] ** 2
    seen = min(own["detection"].get("probability", 0.95), 0.99)
    return peer.SensorModel(np.eye(2, 4), np.diag(np.square(stds)), seen, clutter["rate"], area)


def births_of(scene: Told) -> Any:
    """At the sites, or at sixteen places."""
    sites, region = scene["birth"]["sites"], scene["region"]
    if sites:
        means = [site["mean"][:4] for site in sites]
        stds = [site["std"][:4] for site in sites]
        existence = float(np.mean([site["existence"] for site in sites]))
    else:
        sides = [np.linspace(region[f"{axis}_min"], region[f"{axis}_max"], 9)[1::2] for axis in "xy"]
        means = [[x, y, 0.0, 0.0] for x in sides[0] for y in sides[1]]
        stds = [[sides[0][1] - sides[0][0], sides[1][1] - sides[1][0], 20.0, 20.0]] * 16
        existence = scene["birth"]["from_measurements"]["expected"] / 16.0
    places = [
        peer.BirthLocation(i, np.array(mean), np.diag(np.square(std)))
        for i, (mean, std) in enumerate(zip(means, stds, strict=True))
    ]
    return peer.BirthModel(places, existence, existence)


if __name__ == "__main__":
    serve(begin)
