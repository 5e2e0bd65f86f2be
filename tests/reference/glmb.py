"""Joint prediction and update of delta-GLMB and LMB densities by full enumeration.

Every prior hypothesis, every choice of deaths, births and associations (Vo, Vo and Hoang 2017, eq. 14-18). Nothing is
gated, capped or pruned, so the cost is exponential.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from reference import Floats, Glmb, Label, Lmb, Mixture, gaussian

ABSENT, MISSED = -2, -1

# Measurement index (or MISSED) at every scan since birth.
History: TypeAlias = tuple[int, ...]
Key: TypeAlias = tuple[tuple[Label, History], ...]
Hypotheses: TypeAlias = dict[Key, tuple[float, dict[Label, Mixture]]]


@dataclass(frozen=True)
class Model:
    """Motion and sensor as plain functions; the time step and the sensor's pose are already in them.

    Survival, detection and noise are evaluated at the mean of each Gaussian. method: "ekf", "ukf" (kappa 1) or "ckf".
    """

    transition: Callable[[Floats], Floats]
    transition_jacobian: Callable[[Floats], Floats]
    process_noise_cov: Callable[[Floats], Floats]
    prob_survival: Callable[[Floats], float]
    measurement: Callable[[Floats], Floats]
    measurement_jacobian: Callable[[Floats], Floats]
    measurement_noise_cov: Callable[[Floats], Floats]
    prob_detection: Callable[[Floats], float]
    clutter_intensity: Callable[[Floats], float]
    angular: tuple[bool, ...]
    method: str = "ekf"

    def predict(self, mean: Floats, cov: Floats) -> tuple[Floats, Floats]:
        noise = self.process_noise_cov(mean)
        if self.method == "ekf":
            return gaussian.ekf_predict(mean, cov, self.transition, self.transition_jacobian, noise)
        return gaussian.sigma_predict(mean, cov, self.transition, noise, kappa=self._kappa())

    def predictions(self, mean: Floats, cov: Floats) -> list[tuple[float, Floats, Floats]]:
        """The components that one becomes, with their shares of its weight: one, without modes."""
        return [(1.0, *self.predict(mean, cov))]

    def update(self, mean: Floats, cov: Floats, measurement: Floats) -> gaussian.Update:
        noise = self.measurement_noise_cov(mean)
        if self.method == "ekf":
            return gaussian.ekf_update(
                mean, cov, measurement, self.measurement, self.measurement_jacobian, noise, self.angular
            )
        return gaussian.sigma_update(mean, cov, measurement, self.measurement, noise, self.angular, kappa=self._kappa())

    def _kappa(self) -> float:
        return {"ukf": 1.0, "ckf": 0.0}[self.method]


def normalised(mixture: Mixture) -> tuple[float, Mixture]:
    """Total weight, and the mixture with weights that sum to one."""
    total = sum(weight for weight, _, _ in mixture)
    return total, [(weight / total, mean, cov) for weight, mean, cov in mixture] if total > 0.0 else []


def survive(mixture: Mixture, model: Model) -> tuple[float, Mixture]:
    """Probability of survival, and the predicted density of a survivor."""
    total, survivors = normalised([(w * model.prob_survival(m), m, c) for w, m, c in mixture])
    return total, [(w * share, m, c) for w, *before in survivors for share, m, c in model.predictions(*before)]


def observe(mixture: Mixture, measurement: Floats | None, model: Model) -> tuple[float, Mixture]:
    """Factor of the hypothesis weight, and the updated density; a measurement of None is a missed detection."""
    if measurement is None:
        return normalised([(w * (1.0 - model.prob_detection(m)), m, c) for w, m, c in mixture])
    updated: Mixture = []
    for w, m, c in mixture:
        new_mean, new_cov, likelihood = model.update(m, c, measurement)
        updated.append((w * model.prob_detection(m) * likelihood, new_mean, new_cov))
    total, density = normalised(updated)
    return total / model.clutter_intensity(measurement), density


def associations(num_rows: int, num_measurements: int) -> Iterator[tuple[int, ...]]:
    """Every way to give each row ABSENT, MISSED or a measurement, no measurement twice."""
    options = [ABSENT, MISSED, *range(num_measurements)]
    for choice in itertools.product(options, repeat=num_rows):
        used = [column for column in choice if column >= 0]
        if len(set(used)) == len(used):
            yield choice


def step(hypotheses: Hypotheses, births: Lmb, scan: Sequence[Floats], model: Model) -> tuple[Hypotheses, float]:
    """Posterior hypotheses, normalised, and the sum of their weights before normalisation.

    Hypotheses with the same labels and histories are one, whoever else died.
    """
    posterior: Hypotheses = {}
    for key, (prior_weight, tracks) in hypotheses.items():
        rows = [(label, history, *survive(tracks[label], model)) for label, history in key]
        rows += [(label, (), existence, mixture) for label, (existence, mixture) in births.items()]
        columns = [MISSED, *range(len(scan))]
        outcomes = [
            {column: observe(mixture, None if column == MISSED else scan[column], model) for column in columns}
            for _, _, _, mixture in rows
        ]
        for choice in associations(len(rows), len(scan)):
            weight, new_key, new_tracks = prior_weight, [], {}
            for (label, history, presence, _), outcome, column in zip(rows, outcomes, choice, strict=True):
                if column == ABSENT:
                    weight *= 1.0 - presence
                    continue
                if weight == 0.0 or presence == 0.0:
                    weight = 0.0
                    break
                factor, new_tracks[label] = outcome[column]
                weight *= presence * factor
                new_key.append((label, (*history, column)))
            if weight > 0.0:
                sorted_key = tuple(sorted(new_key))
                before = posterior.get(sorted_key, (0.0, {}))[0]
                posterior[sorted_key] = (before + weight, new_tracks)
    total = sum(weight for weight, _ in posterior.values())
    return {key: (weight / total, tracks) for key, (weight, tracks) in posterior.items()}, total


def no_target() -> Hypotheses:
    """The density that is certain of no target."""
    return {(): (1.0, {})}


def as_glmb(hypotheses: Hypotheses) -> Glmb:
    """The hypotheses as a list, heaviest first."""
    return sorted(hypotheses.values(), key=lambda hypothesis: -hypothesis[0])


def label_set_weights(glmb: Glmb) -> dict[tuple[Label, ...], float]:
    """Probability of each label set."""
    weights: dict[tuple[Label, ...], float] = {}
    for weight, tracks in glmb:
        labels = tuple(sorted(tracks))
        weights[labels] = weights.get(labels, 0.0) + weight
    return weights


def expand_lmb(lmb: Lmb) -> Glmb:
    """All 2^n label subsets of an LMB that have weight."""
    glmb: Glmb = []
    for present in itertools.product([False, True], repeat=len(lmb)):
        weight, tracks = 1.0, {}
        for (label, (existence, mixture)), is_present in zip(lmb.items(), present, strict=True):
            weight *= existence if is_present else 1.0 - existence
            if is_present:
                tracks[label] = mixture
        if weight > 0.0:
            glmb.append((weight, tracks))
    return glmb


def to_lmb(glmb: Glmb) -> Lmb:
    """Existence of each label, and the mixture of its tracks under the hypotheses' weights."""
    pooled: dict[Label, Mixture] = {}
    for weight, tracks in glmb:
        for label, mixture in tracks.items():
            pooled.setdefault(label, []).extend((weight * w, m, c) for w, m, c in mixture)
    return {label: normalised(mixture) for label, mixture in sorted(pooled.items())}


def lmb_step(lmb: Lmb, births: Lmb, scan: Sequence[Floats], model: Model) -> tuple[Lmb, float]:
    """Prediction and update of an LMB: all subsets, all associations, then each label's marginals; sum of weights."""
    posterior, total = step(hypotheses_of(lmb), births, scan, model)
    return to_lmb(as_glmb(posterior)), total


def hypotheses_of(lmb: Lmb) -> Hypotheses:
    """All its label subsets, as if nothing had happened before."""
    return {tuple((label, ()) for label in sorted(tracks)): (weight, tracks) for weight, tracks in expand_lmb(lmb)}
