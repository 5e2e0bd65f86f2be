"""Tracks that manoeuvre are counted, against exact probabilities, and other faults are not taken for manoeuvres."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from vedette.evaluation.fit import Fit, fit_of_run
from vedette.evaluation.innovations import Matches
from vedette.evaluation.manoeuvres import manoeuvring_tracks
from vedette.evaluation.runs import track_recording
from vedette.kernels.base.types import Floats
from vedette.scenarios.from_recording import scenario_from_recording

SENSORS = """
region: {{x_min: -2000.0, x_max: 2000.0, y_min: -2000.0, y_max: 2000.0}}
motion: {motion}
sensors:
  - name: camera
    position: [0.0, 0.0]
    measurement: {{kind: position}}
    noise: {{kind: constant, std: [2.0, 2.0]}}
    detection: {{kind: constant, probability: 0.95}}
    clutter: {{kind: region, rate: 1.0}}
    extent: 0.0
"""
STIFF = "{kind: constant_velocity, sigma_v: 0.1, noise_model: continuous_white}"
MODES = """
  kind: modes
  modes:
    cruise: {motion: {kind: constant_velocity, sigma_v: 0.1}, stay_s: 40.0}
    left: {motion: {kind: constant_turn, turn_rate_deg: 9.0, sigma_v: 1.0}, stay_s: 8.0}
    right: {motion: {kind: constant_turn, turn_rate_deg: -9.0, sigma_v: 1.0}, stay_s: 8.0}
"""


def matches_of(tracks: list[Floats]) -> Matches:
    """Matches with these whitened innovations, of the tracks in turn."""
    whitened = np.concatenate(tracks)
    labels = np.repeat(np.arange(len(tracks)), [len(own) for own in tracks])
    return Matches.none(whitened.shape[1])._replace(labels=np.column_stack([labels, labels]), whitened=whitened)


def white(rng: np.random.Generator, num: int = 5, length: int = 60) -> list[Floats]:
    return [rng.normal(size=(length, 2)) for _ in range(num)]


def test_the_probability_of_one_sum_is_that_of_chi_square() -> None:
    """Two innovations of one track have one sum. The others are zero, so that their spread is that of the model."""
    quiet = [np.zeros((2, 2))] * 99
    loud = np.array([[3.0, 1.0], [3.0, 1.0]])
    number, by_chance = manoeuvring_tracks(matches_of([*quiet, loud]))
    smallest = chi2.sf(2.0 * (3.0**2 + 1.0**2), 2)
    assert number == 1
    assert by_chance == pytest.approx(8 * (1.0 - (1.0 - smallest) ** 100), rel=1e-9)


def test_the_level_holds_for_white_innovations() -> None:
    rng = np.random.default_rng(1)
    results = [manoeuvring_tracks(matches_of(white(rng)))[1] for _ in range(400)]
    assert sum(each < 0.05 for each in results) <= 0.05 * 400 + 3.0 * math.sqrt(0.05 * 400)


@pytest.mark.parametrize("memory", [0.0, 0.7])
def test_errors_of_another_size_or_that_always_last_are_no_manoeuvres(memory: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        tracks = []
        for own in white(rng):
            lasting = own.copy()
            for k in range(1, len(own)):
                lasting[k] = memory * lasting[k - 1] + math.sqrt(1.0 - memory**2) * own[k]
            tracks.append(3.0 * lasting + [2.0, -1.0])
        assert manoeuvring_tracks(matches_of(tracks))[1] > 1e-3


def test_manoeuvring_tracks_are_counted() -> None:
    """Three of eight tracks have innovations of 2.5 standard deviations in one direction for eight scans."""
    tracks = white(np.random.default_rng(3), num=8)
    for own in tracks[:3]:
        own[20:28] += [0.0, 2.5]
    number, by_chance = manoeuvring_tracks(matches_of(tracks))
    assert (number, by_chance < 1e-12) == (3, True)


def test_without_two_innovations_there_is_no_result() -> None:
    unknown = np.full((4, 2), np.nan)
    assert manoeuvring_tracks(Matches.none(2)) == (0, 1.0)
    assert manoeuvring_tracks(matches_of([unknown, np.zeros((1, 2))])) == (0, 1.0)


def fit_of_boats(folder: Path, motion: str, turns: bool) -> Fit:
    """Fit of boats at 10 m/s, which turn by 90 degrees within 8 s, or do not."""
    rng, rows = np.random.default_rng(4), []
    headings = np.array([0.0, 2.0, 4.0])
    places = np.array([[-800.0, -800.0], [800.0, 0.0], [0.0, 800.0]])
    for k in range(150):
        turning = turns & ((k + np.array([0, 10, 20])) % 40 < 8)
        headings = headings + turning * math.radians(90.0) / 8.0
        places = places + 10.0 * np.column_stack([np.cos(headings), np.sin(headings)])
        seen = places[rng.random(3) < 0.95]
        rows += [[k, "camera", *(place + rng.normal(0.0, 2.0, 2))] for place in seen]
    with (folder / "scans.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time", "sensor", "x_m", "y_m"], *rows])
    (folder / "sensors.yaml").write_text(SENSORS.format(motion=motion))
    made = scenario_from_recording(folder / "sensors.yaml", folder / "scans.csv")
    return fit_of_run(track_recording(made.scenario), made.scenario)


@pytest.mark.parametrize(
    ("motion", "turns", "number"),
    [(STIFF, True, 1), (STIFF, False, 0), (MODES, True, 0)],
    ids=["stiff", "right", "modes"],
)
def test_modes_are_advised_where_they_are_missing(tmp_path: Path, motion: str, turns: bool, number: int) -> None:
    fit = fit_of_boats(tmp_path, motion, turns)
    texts = [each.text for each in fit.findings if each.test == "manoeuvres"]
    assert len(texts) == number
    assert all(text.endswith("(turns or changes of speed): add `motion: {kind: modes}`") for text in texts)
