"""Update of delta-GLMB and LMB densities by the scans of several linear sensors at once, by full enumeration.

Each target takes a miss or a measurement of every sensor; what it takes is stacked into one measurement and weighed and
conditioned upon at once, so that no order of the sensors enters.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from reference import Floats, Lmb, Mixture, gaussian
from reference.glmb import ABSENT, MISSED, Hypotheses, as_glmb, hypotheses_of, normalised, to_lmb

# What each target takes: ABSENT, or a measurement (or MISSED) of every sensor.
Taken: TypeAlias = int | tuple[int, ...]


@dataclass(frozen=True)
class LinearSensor:
    """matrix: (meas_dim, state_dim). noise: (meas_dim, meas_dim). clutter_intensity: of any measurement."""

    matrix: Floats
    noise: Floats
    prob_detection: float
    clutter_intensity: float


@dataclass(frozen=True)
class LinearModel:
    """Motion and survival over the time step, and the sensors."""

    transition: Floats
    process_noise: Floats
    prob_survival: float
    sensors: tuple[LinearSensor, ...]


def observe(
    mixture: Mixture, taken: tuple[int, ...], scans: Sequence[Sequence[Floats]], sensors: Sequence[LinearSensor]
) -> tuple[float, Mixture]:
    """Factor of the hypothesis weight, and the updated density, of a target that takes these measurements."""
    factor, matrices, noises, values = 1.0, [], [], []
    for column, scan, sensor in zip(taken, scans, sensors, strict=True):
        if column == MISSED:
            factor *= 1.0 - sensor.prob_detection
            continue
        factor *= sensor.prob_detection / sensor.clutter_intensity
        matrices.append(sensor.matrix)
        noises.append(sensor.noise)
        values.append(scan[column])
    if not values:
        return factor, mixture
    matrix, value = np.vstack(matrices), np.concatenate(values)
    noise = np.zeros((len(value), len(value)))
    place = 0
    for block in noises:
        noise[place : place + len(block), place : place + len(block)] = block
        place += len(block)
    updated = []
    for weight, mean, cov in mixture:
        innovation = matrix @ cov @ matrix.T + noise
        gain = cov @ matrix.T @ np.linalg.inv(innovation)
        likelihood = gaussian.gaussian_pdf(value, matrix @ mean, innovation)
        updated.append((weight * likelihood, mean + gain @ (value - matrix @ mean), cov - gain @ innovation @ gain.T))
    total, density = normalised(updated)
    return factor * total, density


def joint_choices(num_rows: int, scans: Sequence[Sequence[Floats]]) -> Iterator[tuple[Taken, ...]]:
    """Every way to give each row ABSENT or a miss or measurement of every sensor, no measurement twice."""
    options: list[Taken] = [ABSENT, *itertools.product(*([MISSED, *range(len(scan))] for scan in scans))]
    for choice in itertools.product(options, repeat=num_rows):
        present = [taken for taken in choice if isinstance(taken, tuple)]
        used = [(s, column) for taken in present for s, column in enumerate(taken) if column != MISSED]
        if len(set(used)) == len(used):
            yield choice


def step(
    hypotheses: Hypotheses, births: Lmb, scans: Sequence[Sequence[Floats]], model: LinearModel
) -> tuple[Hypotheses, float]:
    """Posterior hypotheses, normalised, and the sum of their weights before normalisation.

    A history is the tuple of what a target has taken since its birth.
    """
    posterior: Hypotheses = {}
    moved, noise = model.transition, model.process_noise
    for key, (prior_weight, tracks) in hypotheses.items():
        rows = [
            (
                label,
                history,
                model.prob_survival,
                [(w, moved @ m, moved @ c @ moved.T + noise) for w, m, c in tracks[label]],
            )
            for label, history in key
        ]
        rows += [(label, (), existence, mixture) for label, (existence, mixture) in births.items()]
        outcomes = [
            {
                taken: observe(mixture, taken, scans, model.sensors)
                for taken in itertools.product(*([MISSED, *range(len(scan))] for scan in scans))
            }
            for _, _, _, mixture in rows
        ]
        for choice in joint_choices(len(rows), scans):
            weight, new_key, new_tracks = prior_weight, [], {}
            for (label, history, presence, _), outcome, taken in zip(rows, outcomes, choice, strict=True):
                if not isinstance(taken, tuple):
                    weight *= 1.0 - presence
                    continue
                factor, new_tracks[label] = outcome[taken]
                weight *= presence * factor
                new_key.append((label, (*history, *taken)))
            if weight > 0.0:
                sorted_key = tuple(sorted(new_key))
                before = posterior.get(sorted_key, (0.0, {}))[0]
                posterior[sorted_key] = (before + weight, new_tracks)
    total = sum(weight for weight, _ in posterior.values())
    return {key: (weight / total, tracks) for key, (weight, tracks) in posterior.items()}, total


def lmb_step(lmb: Lmb, births: Lmb, scans: Sequence[Sequence[Floats]], model: LinearModel) -> tuple[Lmb, float]:
    """Prediction and update of an LMB: all subsets, all joint choices, then each label's marginals; sum of weights."""
    posterior, total = step(hypotheses_of(lmb), births, scans, model)
    return to_lmb(as_glmb(posterior)), total
