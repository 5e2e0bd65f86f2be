"""Scans that come late: put in their place, or dropped.

    python examples/late_scans.py [--picture FILE]

Two radars scan in turn; the second one's link brings its scans 4 to 20 s late, in any order. `OutOfSequenceTracker`
makes the steps since then again, so that in the end all is believed as if nothing had been late.
"""

from __future__ import annotations

import numpy as np

from vedette import models
from vedette.densities import map_estimate
from vedette.filters import SequentialLmbFilter
from vedette.simulation import simulate_scan
from vedette.tracking import Central, OutOfSequenceTracker, SensorScan

TIMES = np.arange(0.0, 120.0, 2.0)
POSES = np.array([[-3000.0, 0.0, 0.0], [2000.0, -1500.0, 0.0]])


def ship(time: float) -> np.ndarray:
    """A ship that goes round a buoy."""
    angle = 0.02 * time
    return np.array([600.0 * np.cos(angle), 600.0 * np.sin(angle), -12.0 * np.sin(angle), 12.0 * np.cos(angle)])


def make_tracker() -> Central:
    radar = models.SensorModel(
        models.bearing_range(),
        models.range_dependent_noise(sigma_range=20.0, sigma_bearing=0.012),
        models.constant_detection(0.8),
        models.region_clutter(3.0, models.Region(-5000.0, 5000.0, -5000.0, 5000.0), "bearing_range"),
    )
    birth = models.BirthModel([0.5], [[600.0, 0.0, 0.0, 0.0]], [np.diag([100.0, 100.0, 15.0, 15.0]) ** 2], {1})
    survival = models.constant_survival(0.999, period=1.0)
    targets = models.TargetModel(models.constant_velocity(0.5, noise_model="continuous_white"), survival, birth)
    return Central(SequentialLmbFilter(targets, (radar, radar)))


def arrivals(rng: np.random.Generator) -> list[tuple[float, SensorScan]]:
    """When each scan comes, and the scan, in the order in which they come."""
    tracker, found = make_tracker(), []
    for k, time in enumerate(TIMES):
        sensor = k % 2
        scan = simulate_scan(ship(time)[None], POSES[sensor], tracker.sensors[sensor], rng=rng).measurements
        delay = rng.uniform(4.0, 20.0) if sensor == 1 else 0.0
        found.append((time + delay, SensorScan(sensor, time, scan, POSES[sensor])))
    return sorted(found, key=lambda own: own[0])


def follow(scans: list[tuple[float, SensorScan]], window: float) -> tuple[np.ndarray, int]:
    """(num_times,) error of what is believed at each time, NaN where nobody is; and how many scans were dropped."""
    late = OutOfSequenceTracker(make_tracker(), POSES, window=window)
    timeline, waiting, errors = late.initial(), list(scans), []
    for now in TIMES:
        while waiting and waiting[0][0] <= now:
            timeline, _ = late.process(timeline, [waiting.pop(0)[1]])
        means = map_estimate(late.state_at(timeline, now).fused).means
        errors.append(np.linalg.norm(means[0, :2] - ship(now)[:2]) if len(means) else np.nan)
    return np.array(errors), timeline.num_dropped


def main() -> dict[str, np.ndarray]:
    scans, errors = arrivals(np.random.default_rng(5)), {}
    for name, window in (("late scans dropped", 1.0), ("late scans in their place", 30.0)):
        errors[name], dropped = follow(scans, window)
        print(f"{name:26} mean error {np.nanmean(errors[name]):5.1f} m, {dropped} of {len(scans)} scans dropped")
    return errors


def draw(errors: dict[str, np.ndarray]):
    figure, (left, right) = panels(2)
    draw_paths(left, [np.array([ship(time)[:2] for time in TIMES])])
    for pose, name in zip(POSES, ("radar", "radar, late"), strict=True):
        left.plot(*pose[:2], "s", color="0.3")
        left.annotate(name, pose[:2], xytext=(0, 8), textcoords="offset points", ha="center")
    left.margins(0.3)
    draw_errors(right, TIMES, errors)
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, draw_paths, panels, show

    show(main, draw)
