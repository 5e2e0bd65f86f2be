"""Targets that turn: coordinated turn, modes and constant velocity on the same scans.

    python examples/manoeuvres.py [--picture FILE]

The state of the turn has a fifth number, its rate. A constant velocity can follow a turn with enough process noise, and
pays for it on the straight.
"""

from __future__ import annotations

import numpy as np

from vedette import models
from vedette.densities import map_estimate
from vedette.filters import LmbFilter
from vedette.simulation import simulate_scan

TIMES = np.arange(1.0, 121.0)
REGION = models.Region(-1000.0, 3500.0, -1500.0, 3000.0)
POSE = np.zeros(3)


def path() -> np.ndarray:
    """(num_scans, 5) a target at 40 m/s: straight, 4 degrees a second to the left, straight, to the right, straight."""
    rates = np.radians(np.select([(TIMES > 30) & (TIMES <= 60), (TIMES > 80) & (TIMES <= 105)], [4.0, -4.0], 0.0))
    headings = np.cumsum(rates)
    velocities = 40.0 * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    places = np.cumsum(velocities, axis=0) - 500.0
    return np.column_stack([places, velocities, rates])


def track(motion: models.MotionModel, scans: list[np.ndarray], first: np.ndarray) -> np.ndarray:
    """(num_scans, 2) where the target is believed to be; NaN where it is not believed to be there."""
    spread = np.diag([30.0, 30.0, 10.0, 10.0, np.radians(1.0)][: motion.state_dim]) ** 2
    birth = models.BirthModel([0.9], [first[: motion.state_dim]], [spread], {1})
    tracker = LmbFilter(models.TargetModel(motion, models.constant_survival(0.99), birth), sensor())
    belief, rng, places = tracker.initial(), np.random.default_rng(0), []
    for step, scan in enumerate(scans, start=1):
        belief, _ = tracker.step(belief, scan, POSE, 1.0, step, rng=rng)
        estimate = map_estimate(belief)
        places.append(estimate.means[0, :2] if estimate.num_targets else np.full(2, np.nan))
    return np.array(places)


def sensor() -> models.SensorModel:
    return models.SensorModel(
        models.position(),
        models.constant_noise([20.0, 20.0]),
        models.constant_detection(0.9),
        models.region_clutter(10.0, REGION, "position"),
    )


def modes() -> models.Modes:
    """Straight on, and turns to both sides, at rates that are not those of the target."""
    turns = [models.constant_turn(np.radians(rate), 0.3) for rate in (5.0, -5.0)]
    return models.Modes([models.constant_velocity(0.1), *turns], stay_s=(30.0, 20.0, 20.0))


def main() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    states, rng = path(), np.random.default_rng(2)
    scans = [simulate_scan(state[None, :4], POSE, sensor(), rng=rng).measurements for state in states]
    motions = {
        "coordinated turn": models.coordinated_turn(0.3, np.radians(0.7)),
        "constant velocity, 0.3 m/s²": models.constant_velocity(0.3),
        "constant velocity, 3 m/s²": models.constant_velocity(3.0),
        "modes of motion": modes(),
    }
    found = {name: track(motion, scans, states[0]) for name, motion in motions.items()}
    turning = states[:, 4] != 0.0
    for name, places in found.items():
        errors = np.linalg.norm(places - states[:, :2], axis=1)
        straight, turns = np.nanmean(errors[~turning]), np.nanmean(errors[turning])
        last = TIMES[~np.isnan(errors)][-1]
        lost = f", lost after {last:.0f} s" if last < TIMES[-10] else ""
        print(f"{name:28} mean error {straight:5.1f} m straight on, {turns:5.1f} m in turns{lost}")
    return states, found


def draw(result: tuple[np.ndarray, dict[str, np.ndarray]]):
    states, found = result
    figure, (left, right) = panels(2)
    draw_paths(left, [states[:, :2]])
    for name, places in found.items():
        left.plot(*places.T, linewidth=1, label=name)
    left.plot(*states[0, :2], "ko", markersize=4, label="start")
    legend_above(left)
    errors = {name: np.linalg.norm(places - states[:, :2], axis=1) for name, places in found.items()}
    draw_errors(right, TIMES, errors)
    right.set(yscale="log", ylim=(1, None))
    return figure


if __name__ == "__main__":
    from pictures import draw_errors, draw_paths, legend_above, panels, show

    show(main, draw)
