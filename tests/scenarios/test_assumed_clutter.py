"""Clutter that a file about sensors does not give is estimated from the recording."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from vedette.scenarios.assumed_clutter import PlacedScan, target_share
from vedette.scenarios.from_recording import RecordingScenario, scenario_from_recording

NOISE, SIDE, PERIOD, SCANS, SPEED = 15.0, 5000.0, 2.5, 60, 10.0


def drawn(targets: int, detection: float, clutter: float, seed: int = 0, scans: int = SCANS) -> list[PlacedScan]:
    """Targets of 2 to 8 m/s and uniform clutter in a square."""
    rng = np.random.default_rng(seed)
    start, angles = rng.uniform(-SIDE, SIDE, (targets, 2)), rng.uniform(0.0, 2.0 * math.pi, targets)
    velocity = rng.uniform(2.0, 8.0, targets)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    found = []
    for time in (PERIOD * np.arange(scans)).tolist():
        seen = (start + time * velocity)[rng.random(targets) < detection]
        false = rng.uniform(-SIDE, SIDE, (rng.poisson(clutter), 2))
        places = np.concatenate([seen + rng.normal(0.0, NOISE, seen.shape), false])
        found.append(PlacedScan(time, places, np.full(len(places), NOISE), np.full(len(places), detection)))
    return found


def stated(looks: list[PlacedScan], detection: float) -> list[PlacedScan]:
    """The same, with another probability of detection in the file."""
    return [look._replace(detection=np.full(len(look.places), detection)) for look in looks]


def share_by_loops(looks: list[PlacedScan]) -> float:
    """By the sums of one neighbour and of two, all written out."""
    one, two, given = [0.0, 0.0], [0.0, 0.0], 0.0
    for k, own in enumerate(looks):
        for place, std, detection in zip(*own[1:], strict=True):
            sides = []
            for other in looks[max(k - 1, 0) : k] + looks[k + 1 : k + 2]:
                radius = 2.5 * math.sqrt(2.0) * std + 1.5 * SPEED * abs(other.time - own.time)
                distances = [math.dist(place, each) for each in other.places]
                near = sum(distance <= radius for distance in distances)
                alone = (7.0 / 8.0) ** sum(radius < distance <= 3.0 * radius for distance in distances)
                sides.append(((near > 0) - 1.0 + alone, alone))
                given += alone * detection
            one = [one[i] + sum(side[i] for side in sides) for i in (0, 1)]
            if len(sides) == 2:
                two = [two[i] + sides[0][i] * sides[1][i] for i in (0, 1)]
    repeated = one[0] / one[1]
    return repeated / max(given / one[1], two[0] / two[1] / repeated)


@pytest.mark.parametrize("given", [0.4, 0.95])
def test_unexplained_fraction_equals_that_of_a_loop_over_all_pairs(given: float) -> None:
    looks = stated(drawn(8, 0.8, 20.0, scans=12), given)
    assert target_share(looks, SPEED) == pytest.approx(share_by_loops(looks), rel=1e-12)


@pytest.mark.parametrize("detection", [0.5, 0.9])
@pytest.mark.parametrize(
    ("targets", "clutter"), [(1, 10.0), (3, 0.0), (5, 25.0), (8, 0.5), (30, 0.0), (30, 2.0), (30, 25.0)]
)
def test_clutter_rate_is_estimated(targets: int, clutter: float, detection: float) -> None:
    rates = []
    for seed in range(5):
        looks = drawn(targets, detection, clutter, seed)
        mean = float(np.mean([len(look.places) for look in looks]))
        rates.append((1.0 - target_share(looks, SPEED)) * mean)
    # The share is of all that is measured: half of the measurements would miss by 2.5 to 14.
    assert np.mean(rates) == pytest.approx(clutter, abs=0.1 + 0.03 * (targets + clutter))


def test_a_probability_of_detection_that_is_given_too_low_does_no_harm() -> None:
    rates = []
    for seed in range(5):
        looks = drawn(8, 0.95, 5.0, seed)
        mean = float(np.mean([len(look.places) for look in looks]))
        rates.append((1.0 - target_share(stated(looks, 0.6), SPEED)) * mean)
    assert np.mean(rates) == pytest.approx(5.0, abs=0.4)


@pytest.mark.parametrize("looks", [[], drawn(5, 0.9, 10.0, scans=1), drawn(1, 0.9, 0.0, scans=2)])
def test_a_short_recording_gives_no_estimate(looks: list[PlacedScan]) -> None:
    assert math.isnan(target_share(looks, SPEED))


def recorded(folder: Path, kind: str = "position", std: str = "[15.0, 15.0]", given: str = "") -> RecordingScenario:
    """Two sensors of one scene, of clutter 25 and 2 a scan."""
    rows = [
        f"{look.time + 0.5 * s},{name},{x},{y}"
        for s, (name, clutter) in enumerate([("A", 25.0), ("B", 2.0)])
        for look in drawn(5, 0.9, clutter)
        for x, y in (look.places if kind == "position" else np.abs(look.places) / SIDE)
    ]
    columns = "x,y" if kind == "position" else "bearing_rad,unread"
    (folder / "scans.csv").write_text(f"time,sensor,{columns}\n" + "\n".join(rows) + "\n", "utf-8")
    models = f"measurement: {{kind: {kind}}}, noise: {{kind: constant, std: {std}}}"
    sensor = f"{models}, detection: {{kind: constant, probability: 0.9}}"
    sites = "{sites: [{mean: [0, 0, 0, 0], std: [3000, 3000, 10, 10], existence: 0.1}]}"
    text = "recording: {bearings: east}\nregion: {x_min: -6000, x_max: 6000, y_min: -6000, y_max: 6000}\nsensors:\n"
    text += f"  - {{name: A, position: [0, 0], {sensor}{given}}}\n  - {{name: B, position: [100, 0], {sensor}}}\n"
    (folder / "sensors.yaml").write_text(text if kind == "position" else f"birth: {sites}\n{text}", "utf-8")
    return scenario_from_recording(folder / "sensors.yaml", folder / "scans.csv")


def test_each_sensor_has_its_own_reported_rate(tmp_path: Path) -> None:
    found = recorded(tmp_path)
    rates = [sensor.clutter.rate for sensor in found.scenario.model.sensors]
    assert rates == pytest.approx([25.0, 2.0], rel=0.1, abs=0.3)
    how = "estimated from the measurements without a neighbour in the scans before and after"
    assert found.assumed["clutter"] == f"A {rates[0]:g}, B {rates[1]:g} per scan ({how})"


def test_a_given_rate_takes_precedence(tmp_path: Path) -> None:
    found = recorded(tmp_path, given=", clutter: {kind: region, rate: 7.0}")
    assert found.scenario.model.sensors[0].clutter.rate == 7.0
    assert found.assumed["clutter"].startswith("B ")


def test_of_sensors_that_measure_no_places_it_is_half(tmp_path: Path) -> None:
    found = recorded(tmp_path, "bearing_only", "[0.01]")
    counts = [len(look.places) for look in drawn(5, 0.9, 25.0)]
    assert found.scenario.model.sensors[0].clutter.rate == pytest.approx(np.mean(counts) / 2.0, abs=0.01)
    assert "(half of the measurements" in found.assumed["clutter"]


def test_scans_between_which_targets_go_anywhere_show_nothing() -> None:
    rng = np.random.default_rng(0)
    places = [rng.uniform(0.0, 1000.0, (50, 2)) for _ in range(40)]
    looks = [PlacedScan(float(k), own, np.full(50, 5.0), np.full(50, 0.9)) for k, own in enumerate(places)]
    assert np.isnan(target_share(looks, 1000.0))
    assert target_share(looks, 10.0) < 0.1
