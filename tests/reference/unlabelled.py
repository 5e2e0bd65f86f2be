"""Steps of densities without labels by full enumeration, or by the published formulas written out.

An iid cluster is (probabilities of 0, 1, ... targets, mixture of one target); an intensity is a mixture whose weights
sum to the expected number; a multi-Bernoulli is a list of (existence, mixture). Clutter is Poisson.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np

from reference import Floats, Mixture
from reference.glmb import Model, normalised, observe, survive

Bernoullis: TypeAlias = list[tuple[float, Mixture]]


def poisson_distribution(mean: float, most: int) -> Floats:
    """Probabilities of 0 to `most` events."""
    return np.array([math.exp(-mean) * mean**n / math.factorial(n) for n in range(most + 1)])


def expected_number(cardinality: Floats) -> float:
    return float(sum(n * probability for n, probability in enumerate(cardinality)))


def predict_intensity(intensity: Mixture, births: Bernoullis, model: Model) -> Mixture:
    """Survivors, moved, and births."""
    survivors = [(w * model.prob_survival(m), *model.predict(m, c)) for w, m, c in intensity]
    return survivors + [(r * w, m, c) for r, mixture in births for w, m, c in mixture]


def predict_cardinality(cardinality: Floats, prob_survival: float, existences: Sequence[float]) -> Floats:
    """Every target lives on or dies and every birth happens or does not, one by one."""
    predicted = np.zeros(len(cardinality) + len(existences))
    for number, prior in enumerate(cardinality):
        events = [prob_survival] * number + list(existences)
        for outcome in itertools.product([False, True], repeat=len(events)):
            chance = [p if happens else 1.0 - p for p, happens in zip(events, outcome, strict=True)]
            predicted[sum(outcome)] += prior * math.prod(chance)
    return predicted


def predict_cluster(cardinality: Floats, density: Mixture, births: Bernoullis, model: Model) -> tuple[Floats, Mixture]:
    """Cardinality distribution and intensity of the union of the survivors of an iid cluster and the births."""
    mean_survival = survive(density, model)[0]
    predicted = predict_cardinality(cardinality, mean_survival, [r for r, _ in births])
    prior_intensity = [(expected_number(cardinality) * w, m, c) for w, m, c in density]
    return predicted, predict_intensity(prior_intensity, births, model)


def associations(num_targets: int, num_measurements: int) -> Iterator[dict[int, int]]:
    """Every way in which measurements are of targets or of none, at most one a target: target -> measurement."""
    for num_detected in range(min(num_targets, num_measurements) + 1):
        for measurements in itertools.combinations(range(num_measurements), num_detected):
            for targets in itertools.permutations(range(num_targets), num_detected):
                yield dict(zip(targets, measurements, strict=True))


def correct_cluster(
    cardinality: Floats, density: Mixture, scan: Sequence[Floats], model: Model
) -> tuple[Floats, Mixture, float]:
    """Cardinality distribution and intensity of the exact posterior of an iid cluster, and the scan's likelihood.

    The likelihood is relative to all measurements being clutter. Every number of targets, every association: what
    happened to a target is None (missed) or a measurement, and all that is asked of the joint posterior is how often.
    """
    outcomes = {None: observe(density, None, model)} | {j: observe(density, z, model) for j, z in enumerate(scan)}
    posterior, counts = np.zeros(len(cardinality)), dict.fromkeys(outcomes, 0.0)
    for number, prior in enumerate(cardinality):
        for association in associations(number, len(scan)):
            happened = [association.get(target) for target in range(number)]
            weight = prior * math.prod(outcomes[outcome][0] for outcome in happened)
            posterior[number] += weight
            for outcome in happened:
                counts[outcome] += weight
    total = float(posterior.sum())
    intensity = [(counts[o] / total * w, m, c) for o, (_, updated) in outcomes.items() for w, m, c in updated]
    return posterior / total, intensity, total


def predict_bernoullis(prior: Bernoullis, births: Bernoullis, model: Model) -> Bernoullis:
    """Each lives on or not; births join as they are."""
    predicted = []
    for existence, mixture in prior:
        survival, survivor = survive(mixture, model)
        predicted.append((existence * survival, survivor))
    return predicted + births


def correct_cb_member(prior: Bernoullis, scan: Sequence[Floats], model: Model) -> Bernoullis:
    """The cardinality-balanced update of Vo, Vo and Cantoni (2009): legacy Bernoullis, then one a measurement."""
    detections = [sum(w * model.prob_detection(m) for w, m, _ in mixture) for _, mixture in prior]
    posterior = []
    for (r, mixture), detected in zip(prior, detections, strict=True):
        legacy = [(w * (1.0 - model.prob_detection(m)) / (1.0 - detected), m, c) for w, m, c in mixture]
        posterior.append((r * (1.0 - detected) / (1.0 - r * detected), legacy))
    for z in scan:
        kappa = model.clutter_intensity(z)
        numerator, denominator, updated = 0.0, kappa, []
        for (r, mixture), detected in zip(prior, detections, strict=True):
            ratio, density = observe(mixture, z, model)
            psi = ratio * kappa  # <p, pD g(z | .)>
            numerator += r * (1.0 - r) * psi / (1.0 - r * detected) ** 2
            denominator += r * psi / (1.0 - r * detected)
            updated += [(r / (1.0 - r) * psi * w, m, c) for w, m, c in density]
        posterior.append((numerator / denominator, normalised(updated)[1]))
    return posterior
