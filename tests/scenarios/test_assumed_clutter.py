"""The rate of clutter that is assumed for a recording, against the rate that it was drawn with."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette.scenarios.assumed_clutter import Look, target_share

SIDE, SPEED, STD, STEPS = 4000.0, 20.0, 10.0, 60


def _looks(rng: np.random.Generator, num_targets: int, detection: float, clutter: float, steps: int) -> list[Look]:
    """Scans, a second apart, of targets that go straight on in a square."""
    places = rng.uniform(0.0, SIDE, (num_targets, 2))
    headings, speeds = rng.uniform(-np.pi, np.pi, num_targets), rng.uniform(0.2, 1.0, num_targets) * SPEED
    velocities = speeds[:, np.newaxis] * np.column_stack([np.cos(headings), np.sin(headings)])
    looks = []
    for step in range(steps):
        seen = (places + step * velocities)[rng.random(num_targets) < detection]
        false = rng.uniform(0.0, SIDE, (rng.poisson(clutter), 2))
        measured = np.concatenate([seen + rng.normal(0.0, STD, seen.shape), false])
        looks.append(Look(float(step), measured, np.full(len(measured), STD), np.full(len(measured), detection)))
    return looks


@pytest.mark.parametrize(
    ("num_targets", "detection", "clutter"),
    [(5, 0.9, 25.0), (20, 0.9, 2.0), (20, 0.55, 10.0), (12, 0.8, 0.0), (2, 0.6, 50.0), (28, 0.95, 1.0)],
)
def test_the_rate_is_that_of_the_scene(num_targets: int, detection: float, clutter: float) -> None:
    looks = _looks(np.random.default_rng(3), num_targets, detection, clutter, STEPS)
    mean = float(np.mean([len(look.places) for look in looks]))
    assert (1.0 - target_share(looks, SPEED)) * mean == pytest.approx(clutter, rel=0.1, abs=0.5)


def test_a_recording_that_shows_too_little_has_no_share() -> None:
    looks = _looks(np.random.default_rng(0), 3, 0.9, 5.0, 3)
    assert math.isnan(target_share(looks[:1], SPEED))
    assert math.isnan(target_share([], SPEED))
    # Between two scans a target could have gone anywhere.
    assert math.isnan(target_share(_looks(np.random.default_rng(0), 3, 0.9, 50.0, STEPS), SIDE))


def test_clutter_alone_has_no_targets() -> None:
    assert target_share(_looks(np.random.default_rng(1), 0, 0.9, 20.0, STEPS), SPEED) < 0.05
