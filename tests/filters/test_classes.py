"""Classes of targets: features of measurements against an enumeration of all histories, in every filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp

from filters.examples import DT, SCENES, Scene
from filters.members import BELIEFS, CENTRAL, NEAR, UNLABELLED, arrays, birth, components, existences, make, step
from filters.test_histories import followed, weights_of
from reference import glmb as oracle
from vedette import models
from vedette.densities import GLMB, LMB, FactoredGLMB, Poisson, as_lmb, load_density, marks_of, save_density
from vedette.errors import InputError
from vedette.filters import DeltaGlmbFilter, FactoredGlmbFilter, Limits, MultiSensorGlmbFilter, SequentialFactoredFilter
from vedette.models import ScanRows
from vedette.tracking.births import births_from_scans

pytestmark = pytest.mark.lanes

every_kind = pytest.mark.parametrize("kind", BELIEFS)
PROBS = np.array([0.6, 0.3, 0.1])
RNG = np.random.default_rng(0)


def ratios(num: int, seed: int = 5, num_classes: int = 3) -> Any:
    """Log likelihood ratios of the classes for each measurement, some of them strong."""
    return np.random.default_rng(seed).normal(0.0, 1.5, (num, num_classes))


def with_features(scan: Any, log_ratios: Any) -> Any:
    return ScanRows(scan, np.zeros(np.shape(scan)), class_ratios=log_ratios)


def classified(scene: Scene) -> models.TargetModel:
    return models.TargetModel(scene.motion, scene.survival, replace(scene.births, class_probs=PROBS))


def evidence(history: oracle.History, features: list[Any]) -> Any:
    """Log of prior times likelihood of each class, of the measurements of a history that ends with the last scan."""
    begun = features[len(features) - len(history) :]
    return np.log(PROBS) + sum(each[j] for each, j in zip(begun, history, strict=True) if j >= 0)


def enumerated(scene: Scene) -> list[tuple[list[Any], dict[oracle.Key, float]]]:
    """Features of all scans so far, and the weight of every set of labels with their histories, after each scan."""
    hypotheses, features, found = oracle.no_target(), list[Any](), list[Any]()
    for number, scan in enumerate(scene.scans, 1):
        features = [*features, ratios(len(scan), number)]
        hypotheses, _ = oracle.step(hypotheses, scene.plain_births(number), list(scan), scene.plain)
        for key, (weight, rest) in hypotheses.items():
            for _, history in key:
                before = logsumexp(evidence(history[:-1], features[:-1]))
                weight *= float(np.exp(logsumexp(evidence(history, features)) - before))
            hypotheses[key] = weight, rest
        total = sum(weight for weight, _ in hypotheses.values())
        hypotheses = {key: (weight / total, rest) for key, (weight, rest) in hypotheses.items()}
        found.append((features, {key: weight for key, (weight, _) in hypotheses.items()}))
    return found


def class_probs(history: oracle.History, features: list[Any]) -> Any:
    logs = evidence(history, features)
    return np.exp(logs - logsumexp(logs))


@pytest.mark.parametrize("name", ["linear", "ekf", "ukf"])
def test_weights_and_classes_are_those_of_the_enumeration(name: str) -> None:
    scene = SCENES[name]()
    tracker = DeltaGlmbFilter(classified(scene), scene.sensor, Limits.none())
    belief, histories = tracker.initial(), list[oracle.History]()
    for number, (scan, (features, expected)) in enumerate(zip(scene.scans, enumerated(scene), strict=True), 1):
        belief, _ = tracker.step(belief, with_features(scan, features[-1]), scene.pose, DT, number, rng=RNG)
        histories = followed(belief, histories)
        assert weights_of(belief, histories) == pytest.approx(expected, abs=1e-10)
        for history, probs in zip(histories, np.exp(belief.tracks.log_class_probs), strict=True):
            np.testing.assert_allclose(probs, class_probs(history, features), rtol=1e-10)


@pytest.mark.parametrize("kind", [FactoredGlmbFilter, MultiSensorGlmbFilter, SequentialFactoredFilter])
def test_existence_and_class_of_each_label_are_those_of_the_enumeration(kind: Any) -> None:
    """Labels from the start, and nothing cut: these filters are exact then."""
    scene = SCENES["linear"]()
    sensors = (scene.sensor,) if kind in CENTRAL else scene.sensor
    options: dict[str, Any] = {} if kind is MultiSensorGlmbFilter else {"max_split_error": 0.0, "births": "labelled"}
    tracker = kind(classified(scene), sensors, Limits.none(), **options)
    belief = tracker.initial()
    for number, (scan, (features, weights)) in enumerate(zip(scene.scans, enumerated(scene), strict=True), 1):
        rows, expected = with_features(scan, features[-1]), dict[Any, Any]()
        given = ([rows], [scene.pose]) if kind in CENTRAL else (rows, scene.pose)
        belief, _ = tracker.step(belief, *given, DT, number, rng=RNG)
        for key, weight in weights.items():
            for label, history in key:
                expected[label] = expected.get(label, 0.0) + weight * class_probs(history, features)
        found = as_lmb(belief)
        assert [tuple(label) for label in found.tracks.labels.tolist()] == sorted(expected)
        probs = np.exp(found.tracks.log_class_probs) * found.existence[:, np.newaxis]
        np.testing.assert_allclose(probs, [expected[label] for label in sorted(expected)], rtol=1e-9)


@every_kind
def test_features_alike_for_all_classes_are_one_ratio(kind: Any) -> None:
    scan, log_ratios = np.array([[10.5, 9.0], [52.0, 47.0], [-40.0, 3.0]]), np.array([1.0, -0.5, 2.0])
    plain, classes = make(kind), make(kind, birth=replace(birth(), class_probs=PROBS))
    belief = other = None
    for number in (1, 2):
        belief, _ = step(classes, with_features(scan, np.tile(log_ratios[:, None], 3)), belief, number=number)
        other, _ = step(plain, ScanRows(scan, np.zeros((3, 2)), log_ratios=log_ratios), other, number=number)
        np.testing.assert_allclose(np.exp(log_class_probs(belief)), np.tile(PROBS, (len(log_class_probs(belief)), 1)))
        for mine, theirs in zip(components(belief), components(other), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-9)


def log_class_probs(belief: Any) -> Any:
    return getattr(belief, "tracks", belief).log_class_probs


@every_kind
def test_the_first_features_count_as_their_mean_over_the_classes(kind: Any) -> None:
    """Of one birth site and one scan; the class of the target is a mean over its components."""
    scan, features = np.array([[10.5, 9.0], [14.0, 12.0]]), ratios(2)
    site, mean = birth(1), logsumexp(features + np.log(PROBS), axis=1)
    found = step(make(kind, birth=replace(site, class_probs=PROBS)), with_features(scan, features))[0]
    expected = step(make(kind, birth=site), ScanRows(scan, np.zeros((2, 2)), log_ratios=mean))[0]
    np.testing.assert_allclose(existences(found), existences(expected), rtol=1e-10)
    for mine, theirs in zip(components(found), components(expected), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-9)
    by_measurement = np.exp(features + np.log(PROBS) - mean[:, np.newaxis])
    probs = np.exp(log_class_probs(found))
    np.testing.assert_allclose(probs.sum(axis=1), 1.0)
    low, high = (each(np.vstack([by_measurement, PROBS]), axis=0) for each in (np.min, np.max))
    assert ((probs > low - 1e-9) & (probs < high + 1e-9)).all()


@every_kind
def test_scans_without_features_leave_the_classes(kind: Any) -> None:
    """A sensor without features, and a scan without measurements."""
    plain, classes = make(kind), make(kind, birth=replace(birth(), class_probs=PROBS))
    belief = other = None
    for number, scan in enumerate([NEAR, np.empty((0, 2)), NEAR], 1):
        belief, other = step(classes, scan, belief, number=number)[0], step(plain, scan, other, number=number)[0]
        for mine, theirs in zip(components(belief), components(other), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(np.exp(log_class_probs(belief)), np.tile(PROBS, (len(log_class_probs(belief)), 1)))


@pytest.mark.parametrize("kind", [each for each in BELIEFS if each not in UNLABELLED])
def test_births_from_measurements_have_classes(kind: Any) -> None:
    """In the whole region, and at the measurements of the scan before."""
    region = models.Region(-100.0, 100.0, -100.0, 100.0)
    measured = models.MeasurementBirth(0.5, 0.3, np.array([6.0, 6.0, 5.0, 5.0]), region)
    born = models.BirthModel(np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)), from_measurements=measured)
    tracker = make(kind, birth=replace(born, class_probs=PROBS))
    features = np.array([[3.0, -3.0, -3.0]])
    belief, _ = step(tracker, with_features(NEAR, features))
    if not getattr(tracker, "starts_tracks", False):
        sensor = tracker.sensors[0] if kind in CENTRAL else tracker.sensor
        rows = with_features(NEAR, features)
        births = births_from_scans(tracker.targets.birth, belief, [sensor], [rows], [np.zeros(3)], 2)
        assert births is not None
        np.testing.assert_allclose(np.exp(births.tracks.log_class_probs), [PROBS])
        seen = ([rows], [np.zeros(3)]) if kind in CENTRAL else (rows, np.zeros(3))
        belief, _ = tracker.step(belief, *seen, 1.0, 2, rng=RNG, births=births)
    probs = np.exp(as_lmb(belief).tracks.log_class_probs)
    expected = PROBS * np.exp(features[0])
    assert len(probs) == 1
    assert probs[0, 0] > PROBS[0]
    if isinstance(belief, FactoredGLMB) and getattr(tracker, "starts_tracks", False):
        np.testing.assert_allclose(probs[0], expected / expected.sum())


def test_a_file_keeps_classes(tmp_path: Any) -> None:
    for kind in BELIEFS:
        tracker = make(kind, birth=replace(birth(), class_probs=PROBS))
        belief, _ = step(tracker, with_features(NEAR, ratios(1)))
        save_density(tmp_path / "belief.npz", belief)
        for mine, theirs in zip(arrays(load_density(tmp_path / "belief.npz")), arrays(belief), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_faults_are_named() -> None:
    with pytest.raises(InputError, match=r"BirthModel.class_probs: expected at least 2 probabilities above 0 that sum"):
        replace(birth(), class_probs=np.array([0.5, 0.2]))
    plain, classes = make(DeltaGlmbFilter), make(DeltaGlmbFilter, birth=replace(birth(), class_probs=PROBS))
    with pytest.raises(InputError, match=r"belief: expected 3 classes of targets, as in the birth model; got 0"):
        step(classes, NEAR, plain.initial())
    with pytest.raises(InputError, match="class ratios of 0 classes, as the targets have; got those of 3"):
        step(plain, with_features(NEAR, ratios(1)))
    with pytest.raises(InputError, match="class ratios of 3 classes, as the targets have; got those of 2"):
        step(classes, with_features(NEAR, ratios(1, num_classes=2)))
    with pytest.raises(InputError, match=r"class_ratios: expected an array of shape \(1, any\); got shape \(2, 3\)"):
        with_features(NEAR, ratios(2))
    with pytest.raises(InputError, match=r"log_class_probs\[0:2\]: expected weights that sum to 1"):
        Poisson(
            np.zeros(1),
            np.zeros((1, 4)),
            np.eye(4)[np.newaxis],
            marks_of(np.log([[0.5, 0.4]])),
        )
    like = replace(birth(), class_probs=PROBS)
    assert [kind.empty(like).num_classes for kind in (LMB, GLMB, FactoredGLMB)] == [3, 3, 3]
