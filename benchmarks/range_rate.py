"""What range rates are worth: velocities of new tracks, and labels at crossings, from the same scans with and without.

    python benchmarks/range_rate.py                       # 1000 scenes with one radar, 1000 with two
    python benchmarks/range_rate.py --scenes 10
    python benchmarks/range_rate.py --write docs/evidence/range-rates.md

Each scene is drawn: two pairs of targets whose straight courses cross at an angle of 15 to 165 degrees, and two targets
that turn by 2 to 6 degrees a second; speeds of 8 to 30 m/s, 30 scans, one every 2 s. The radars are 3 to 5 km away
(where there are two, at right angles): range 15 m, bearing .5 degrees, range rate .5 m/s, P_D .9, 10 false measurements
a scan. Targets appear anywhere, with a velocity of 15 m/s along each axis (standard deviation).
Without range rates the filter gets the same scans without that component.
Prints root mean square errors of velocity at the first five scans at which a target has an estimate within 150 m, and
how often the label of one of its two targets differs three scans before and six after a crossing; 95 % intervals by
resampling scenes.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pages import write_between
from scipy.optimize import linear_sum_assignment

from vedette.kernels.base.types import Floats
from vedette.scenarios import Scenario, parse_scenario
from vedette.scenarios.build import build_experiment, build_sensors
from vedette.simulation import simulate_scans

SEED, STEPS, PERIOD, NEAR, FIRST = 11, 30, 2.0, 150.0, 5
CROSSING, BEFORE, AFTER = 15, 3, 6  # step at which pairs meet, and scans before and after it whose labels count
KINDS = {"without": "bearing_range", "with": "bearing_range_rate"}
PAIRS = 2


class Found(NamedTuple):
    """Of a scene: errors of velocity, squared, m^2/s^2, all and along the line of sight of the first radar; changes."""

    errors: Floats
    along: Floats
    switches: int


def scenario(places: Floats, kind: str) -> Scenario:
    """What a filter knows."""
    data: dict[str, Any] = {
        "format": 1,
        "name": "range-rate",
        "time": {"num_steps": STEPS, "step_period": PERIOD, "start": PERIOD},
        "region": {"x_min": -2000.0, "x_max": 2000.0, "y_min": -2000.0, "y_max": 2000.0},
        "motion": {"kind": "constant_velocity", "sigma_v": 1.0},
        "survival": {"kind": "constant", "probability": 0.99},
        "birth": {
            "sites": [],
            "from_measurements": {"expected": 0.2, "max_existence": 0.03, "std": [100.0, 100.0, 15.0, 15.0]},
        },
        "targets": {"kind": "scripted", "tracks": []},
        "sensor_defaults": {
            "measurement": {"kind": kind},
            "noise": {
                "kind": "range_dependent",
                "sigma_range": 15.0,
                "eta_range": 0.0,
                "sigma_bearing_deg": 0.5,
                "eta_bearing": 0.0,
                "sigma_range_rate": 0.5,
            },
            "detection": {"kind": "constant", "probability": 0.9},
            "clutter": {"kind": "region", "rate": 10.0, **({} if kind == KINDS["without"] else {"max_range_rate": 60})},
        },
        "sensors": [{"position": place} for place in places.tolist()],
        "fusion": {"kind": "none" if len(places) == 1 else "central"},
    }
    return Scenario(parse_scenario(json.dumps(data)), Path("range_rate.yaml"))


def truth(rng: np.random.Generator) -> Floats:
    """(STEPS, num_targets, 4) states."""
    times, tracks = PERIOD * (np.arange(STEPS) - CROSSING), list[Floats]()
    for _ in range(PAIRS):
        place, heading = rng.uniform(-900.0, 900.0, 2), rng.uniform(-np.pi, np.pi)
        for turn in (0.0, rng.choice([-1.0, 1.0]) * np.radians(rng.uniform(15.0, 165.0))):
            speed, at = rng.uniform(8.0, 30.0), heading + turn
            velocity = speed * np.array([np.cos(at), np.sin(at)])
            tracks.append(np.hstack([place + times[:, None] * velocity, np.tile(velocity, (STEPS, 1))]))
    for _ in range(2):
        place, speed = rng.uniform(-900.0, 900.0, 2), rng.uniform(8.0, 30.0)
        rate = rng.choice([-1.0, 1.0]) * np.radians(rng.uniform(2.0, 6.0))
        angles = rng.uniform(-np.pi, np.pi) + rate * times
        velocities = speed * np.column_stack([np.cos(angles), np.sin(angles)])
        circle = speed / rate * np.column_stack([np.sin(angles), -np.cos(angles)])
        tracks.append(np.hstack([place + circle - circle[CROSSING], velocities]))
    return np.stack(tracks, axis=1)


def compared(number: int, radars: int) -> dict[str, Found]:
    """One scene, with and without range rates."""
    rng = np.random.default_rng([SEED, number])
    bearing = rng.uniform(-np.pi, np.pi) + 0.5 * np.pi * np.arange(radars)
    places = rng.uniform(3000.0, 5000.0, radars)[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
    states = truth(rng)
    experiments = {name: build_experiment(scenario(places, kind)) for name, kind in KINDS.items()}
    poses = experiments["with"].poses
    rngs = [np.random.default_rng([SEED, number, s]) for s in range(radars)]
    sensors = [each.filter.sensor for each in build_sensors(scenario(places, KINDS["with"]))]
    scans = [[scan.measurements for scan in simulate_scans(now, poses, sensors, rngs=rngs)] for now in states]
    found = {}
    for name, experiment in experiments.items():
        size = 3 if name == "with" else 2
        state, pairs = experiment.tracker.initial(), list[dict[int, tuple[tuple[int, ...], Floats]]]()
        for step, (now, own) in enumerate(zip(states, scans, strict=True)):
            given = [np.ascontiguousarray(scan[:, :size]) for scan in own]
            own_poses = np.ascontiguousarray(experiment.poses)
            state, _ = experiment.tracker.step(state, given, own_poses, float(experiment.times[step]), rngs=rngs)
            estimate = experiment.estimate(state.fused, step + 1)
            gaps = np.hypot(*(now[:, None, :2] - estimate.means[None, :, :2]).transpose(2, 0, 1))
            matched = zip(*linear_sum_assignment(np.minimum(gaps, NEAR)), strict=True)
            pairs.append({i: (tuple(estimate.labels[j]), estimate.means[j]) for i, j in matched if gaps[i, j] < NEAR})
        found[name] = judged(states, pairs, places[0])
    return found


def judged(states: Floats, pairs: list[dict[int, tuple[tuple[int, ...], Floats]]], place: Floats) -> Found:
    """What the pairs of each scan, target -> label and mean, come to."""
    errors, along, switches = list[float](), list[float](), 0
    for i in range(states.shape[1]):
        own = [step for step in range(STEPS) if i in pairs[step]]
        for step in own[:FIRST]:
            error, sight = pairs[step][i][1][2:4] - states[step, i, 2:], states[step, i, :2] - place
            errors.append(float(error @ error))
            along.append(float(error @ sight) ** 2 / float(sight @ sight))
        if i < 2 * PAIRS:
            before = [pairs[step][i][0] for step in own if step <= CROSSING - BEFORE]
            after = [pairs[step][i][0] for step in own if step >= CROSSING + AFTER]
            switches += bool(before and after and before[-1] != after[0])
    return Found(np.array(errors), np.array(along), switches)


def rows(found: dict[str, list[Found]]) -> list[tuple[str, Floats]]:
    """Names and (scenes, 2, 2) sums and numbers without and with, whose quotients (or their roots) are the figures."""
    both = [found[name] for name in KINDS]
    sums = {
        "velocity, m/s": [[(each.errors.sum(), len(each.errors)) for each in own] for own in both],
        "velocity along the line of sight, m/s": [
            [(each.along.sum(), len(each.along)) for each in own] for own in both
        ],
        "changes of label a crossing": [[(each.switches, PAIRS) for each in own] for own in both],
    }
    return [(name, np.array(each, np.float64).transpose(1, 0, 2)) for name, each in sums.items()]


def table(found: dict[str, list[Found]], radars: int) -> list[str]:
    """Lines of the table, with intervals."""
    rng, lines = np.random.default_rng(SEED), []
    for name, sums in rows(found):
        root = 0.5 if name.startswith("velocity") else 1.0
        draws = rng.integers(0, len(sums), (2000, len(sums)))

        def figures(chosen: Floats, power: float = root) -> Floats:
            totals = chosen.sum(axis=-3)
            return np.asarray((totals[..., 0] / totals[..., 1]) ** power)

        mean, spread = figures(sums), figures(sums[draws])
        ratios = spread[:, 1] / np.maximum(spread[:, 0], 1e-300)
        low, high = np.quantile(ratios, [0.025, 0.975])
        without, with_rates = mean.tolist()
        cells = f"{without:.3g} | {with_rates:.3g} | {with_rates / max(without, 1e-300):.2f} ({low:.2f} to {high:.2f})"
        lines.append(f"| {radars} | {name} | {cells} |")
    return lines


def main() -> None:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="Markdown page with a place for the table")
    given = parser.parse_args()
    lines = ["| radars | what | without | with | ratio (95 % interval) |", "| --- | --- | ---: | ---: | ---: |"]
    for radars in (1, 2):
        all_found: dict[str, list[Found]] = {name: [] for name in KINDS}
        for number in range(given.scenes):
            for name, each in compared(number, radars).items():
                all_found[name].append(each)
        lines += table(all_found, radars)
        print("\n".join(lines), flush=True)
    if given.write is not None:
        write_between(given.write, "range_rate.py", "\n".join(lines))


if __name__ == "__main__":
    main()
