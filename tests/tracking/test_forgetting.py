"""Own tracks through many scans: what has left a sensor's view goes once a birth says more of it, and is counted."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tracking.scenes import rngs, scans_of
from vedette import models
from vedette.densities import LMB, existence_probabilities
from vedette.errors import InputError
from vedette.filters import FactoredGlmbFilter, LmbFilter
from vedette.fusion import Clmb, FieldsOfView, LabelMatchedFusion
from vedette.tracking import Distributed, State
from vedette.tracking.lost_labels import drop_forgotten_labels

BORN = models.MeasurementBirth(0.5, 0.03, np.array([20.0, 20.0, 8.0, 8.0]))
WORLD = models.TargetModel(
    models.constant_velocity(0.5),
    models.constant_survival(0.99),
    replace(models.BirthModel.none(4), from_measurements=BORN),
)
SENSOR = models.SensorModel(
    models.position(),
    models.constant_noise([5.0, 5.0]),
    models.limited_range(0.95, 200.0),
    models.around_sensor(2.0, "position", radius=200.0),
)
POSES = np.array([[-150.0, 0.0, 0.0], [150.0, 0.0, 0.0]])


def passing(step: int, every: int = 15) -> Any:
    """Targets that go by at 20 m/s, one after the other, through both views and on."""
    ages = np.arange(step % every, 40, every)
    return np.column_stack([-400.0 + 20.0 * ages, 30.0 * np.sin(ages), np.full(len(ages), 20.0), np.zeros(len(ages))])


def follow(tracker: Distributed, num_steps: int, truth: Any) -> tuple[list[State], list[Any]]:
    rng, state, states, infos = np.random.default_rng(2), tracker.initial(), [], []
    for step in range(1, num_steps + 1):
        scans = scans_of(truth(step), (SENSOR, SENSOR), POSES, rng)
        state, info = tracker.step(state, scans, POSES, float(step), rngs=rngs(2, step))
        states.append(state)
        infos.append(info)
    return states, infos


def mean_labels(states: list[State]) -> float:
    return float(np.mean([len(existence_probabilities(belief)[0]) for state in states for belief in state.local]))


@pytest.mark.parametrize("kind", [LmbFilter, FactoredGlmbFilter])
def test_local_tracks_do_not_accumulate(kind: Any) -> None:
    fusion = LabelMatchedFusion(Clmb((0.5, 0.5), field_of_view_weighting=True))
    filters = tuple(kind(WORLD, SENSOR) for _ in range(2))
    states, infos = follow(Distributed(filters, fusion), 150, passing)
    piled, others = follow(Distributed(filters, fusion, min_detection=0.0), 150, passing)
    assert mean_labels(states[100:]) < 1.2 * mean_labels(states[50:100])
    assert mean_labels(states[100:]) < 0.4 * mean_labels(piled[100:])
    dropped, before = (
        sum(info.filters[s].dropped_existence for info in every for s in range(2)) for every in (infos, others)
    )
    assert dropped > before + 1.0  # as many as have left a view, and were almost sure before


@pytest.mark.parametrize("away", [5, 15])
def test_a_target_that_is_out_of_view_for_a_while_keeps_its_label(away: int) -> None:
    fusion = LabelMatchedFusion(Clmb((0.5, 0.5), field_of_view_weighting=True))
    tracker = Distributed((LmbFilter(WORLD, SENSOR), LmbFilter(WORLD, SENSOR)), fusion)

    rng, state, sure = np.random.default_rng(2), tracker.initial(), []
    for step in range(1, 50):
        at = POSES + (1e4 if 20 <= step < 20 + away else 0.0)  # m, too far to see anything
        scans = scans_of(np.zeros((1, 4)), (SENSOR, SENSOR), at, rng)
        state, _ = tracker.step(state, scans, at, float(step), rngs=rngs(2, step))
        labels, existence = existence_probabilities(state.fused)
        sure.append({tuple(label) for label in labels[existence > 0.5].tolist()})
    assert sure[18] == sure[18 + away] == sure[-1]
    assert len(sure[-1]) == 1


def test_forgotten_labels_are_out_of_view_and_vaguer_than_a_birth() -> None:
    places = np.array([[-150.0, 0.0], [900.0, 0.0], [900.0, 100.0], [900.0, 200.0], [-150.0, 50.0]])
    existence, stds = np.array([0.9, 0.9, 0.9, 0.02, 0.02]), np.array([10.0, 100.0, 120.0, 10.0, 60.0])
    means = np.hstack([places, np.zeros((5, 2))])
    covs = np.array([np.diag([std**2, std**2, 1.0, 1.0]) for std in stds])
    belief = LMB.from_bernoullis([(1, i) for i in range(5)], existence, means, covs)
    views = FieldsOfView((SENSOR, SENSOR), POSES, (False, False))
    peaks, of_birth = existence / stds**2, 0.03 / 20.0**2
    gone = [2]
    assert [i for i in range(5) if peaks[i] < of_birth and abs(places[i, 0]) > 400.0] == gone
    kept, dropped = drop_forgotten_labels(belief, BORN, views, 0, 0.1)
    assert [label[1] for label in kept.tracks.labels.tolist()] == [0, 1, 3, 4]
    assert dropped == pytest.approx(0.9)
    assert drop_forgotten_labels(belief, BORN, views, 0, 0.0) == (belief, 0.0)


def test_the_least_detection_is_a_probability() -> None:
    with pytest.raises(InputError, match=r"Distributed\.min_detection"):
        Distributed((LmbFilter(WORLD, SENSOR),), min_detection=1.5)
