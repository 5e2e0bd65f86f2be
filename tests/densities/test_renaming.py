"""Labels that are only the improbable other name of a target."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vedette import models
from vedette.densities import FactoredGLMB, existence_probabilities
from vedette.filters import FactoredGlmbFilter
from vedette.kernels.base.types import FactoredGlmb, Glmb, Tracks
from vedette.kernels.gaussian.components import components_of
from vedette.kernels.labelled.established_labels import with_established_labels
from vedette.kernels.labelled.splitting import choices_of

LABELS = np.array([[1, 0], [2, 0], [2, 1]])


def glmb(hypotheses: dict[tuple[int, ...], float]) -> Glmb:
    """Of three labels with one track each. hypotheses: weights of sets of tracks."""
    components = components_of(np.zeros(3), np.arange(12.0).reshape(3, 4), np.tile(np.eye(4), (3, 1, 1)))
    tracks = Tracks(LABELS, np.arange(4), components)
    sizes = [len(held) for held in hypotheses]
    members = np.array([track for held in hypotheses for track in held], np.int64)
    return Glmb(tracks, np.cumsum([0, *sizes]), members, np.log(list(hypotheses.values())))


def listed(density: Glmb) -> dict[tuple[tuple[float, ...], ...], float]:
    """The weight of each set of labels, each with the first number of its track's mean."""
    found: dict[tuple[tuple[float, ...], ...], float] = {}
    for h, log_weight in enumerate(density.hyp_log_weights):
        held = density.hyp_tracks[density.hyp_offsets[h] : density.hyp_offsets[h + 1]]
        key = tuple((*map(float, density.tracks.labels[t]), float(density.tracks.components.means[t, 0])) for t in held)
        found[key] = math.exp(log_weight)
    return found


def test_an_improbable_other_name_takes_the_known_one_and_keeps_its_track() -> None:
    before = glmb({(0,): 0.992, (1,): 0.004, (): 0.004})
    after, choices, error = with_established_labels(before, choices_of(before), 0.01)
    assert listed(after) == pytest.approx({((1, 0, 0.0),): 0.992, ((1, 0, 4.0),): 0.004, (): 0.004}, rel=1e-12)
    assert choices.labels.tolist() == [[1, 0]]
    assert error == pytest.approx(0.008, rel=1e-12)


def test_another_target_keeps_its_name() -> None:
    before = glmb({(0,): 0.992, (0, 1): 0.004, (): 0.004})
    after, _, error = with_established_labels(before, choices_of(before), 0.01)
    assert error == 0.0
    assert listed(after) == listed(before)


def test_the_least_probable_names_go_first_and_no_more_than_the_error_allows() -> None:
    before = glmb({(0,): 0.99, (1,): 0.006, (2,): 0.004})
    after, choices, error = with_established_labels(before, choices_of(before), 0.01)
    assert error == pytest.approx(0.008, rel=1e-12)
    assert choices.labels.tolist() == [[1, 0], [2, 0]]
    assert listed(after)[((1, 0, 8.0),)] == pytest.approx(0.004, rel=1e-12)


def test_hypotheses_that_hold_both_names_are_left_out() -> None:
    before = glmb({(0,): 0.99, (1,): 0.0038, (0, 1): 0.0002, (): 0.006})
    after, _, _ = with_established_labels(before, choices_of(before), 0.01)
    assert listed(after) == pytest.approx(
        {((1, 0, 0.0),): 0.99 / 0.9998, ((1, 0, 4.0),): 0.0038 / 0.9998, (): 0.006 / 0.9998}, rel=1e-12
    )


def test_a_prediction_keeps_improbable_names() -> None:
    """A parallel update needs the same labels, one Gaussian each, in the prediction and in what sensors made of it."""
    pair = glmb({(0,): 0.992, (1,): 0.004, (): 0.004})
    own = pair.tracks.components
    tracks = Tracks(LABELS[:2], np.arange(3), components_of(np.zeros(2), own.means[:2], own.covs[:2]))
    factor = np.array([0, 2]), pair.hyp_offsets, pair.hyp_tracks, pair.hyp_log_weights, np.array([0, 3])
    belief = FactoredGLMB.from_kernel(FactoredGlmb(tracks, *factor))
    targets = models.TargetModel(
        models.constant_velocity(1.0), models.constant_survival(1.0), models.BirthModel.none(4)
    )
    sensor = models.SensorModel(
        models.position(),
        models.constant_noise([1.0, 1.0]),
        models.constant_detection(0.9),
        models.region_clutter(1.0, models.Region(0.0, 1.0, 0.0, 1.0), "position"),
    )
    predicted = FactoredGlmbFilter(targets, sensor, births="labelled").predict(belief, 1.0, 3)[0]
    labels, existence = existence_probabilities(predicted)
    assert labels.tolist() == LABELS[:2].tolist()
    assert existence == pytest.approx([0.992, 0.004], rel=1e-9)
