"""L1 distance of two labelled densities by sampling, in plain NumPy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

Label = tuple[int, int]
Hypotheses = Sequence[
    tuple[float, dict[Label, list[Any]]]
]  # weight, and the components (weight, mean, cov) of each label


def _draw(hypotheses: Hypotheses, num: int, rng: np.random.Generator) -> dict[tuple[Label, ...], list[Any]]:
    """Samples by label set; each (num_labels, dim)."""
    drawn: dict[tuple[Label, ...], list[Any]] = {}
    weights = np.array([w for w, _ in hypotheses])
    for h in rng.choice(len(weights), num, p=weights / weights.sum()):
        tracks, states = hypotheses[h][1], []
        for label in sorted(tracks):
            shares = np.array([w for w, _, _ in tracks[label]])
            _, mean, cov = tracks[label][rng.choice(len(shares), p=shares / shares.sum())]
            states.append(mean + np.linalg.cholesky(cov) @ rng.standard_normal(len(mean)))
        drawn.setdefault(tuple(sorted(tracks)), []).append(np.array(states))
    return drawn


def _mixture(components: list[Any], states: Any) -> Any:
    """(num,) density of a mixture at (num, dim) states."""
    total = np.zeros(len(states))
    for weight, mean, cov in components:
        factor = np.linalg.cholesky(cov)
        white = np.linalg.solve(factor, (states - mean).T)
        log_density = (
            -0.5 * (white**2).sum(axis=0) - np.log(np.diag(factor)).sum() - 0.5 * len(mean) * np.log(2 * np.pi)
        )
        total += weight * np.exp(log_density)
    return total


def _density(hypotheses: Hypotheses, labels: tuple[Label, ...], states: Any) -> Any:
    """(num,) at (num, num_labels, dim) states of targets with these labels."""
    total, known = np.zeros(len(states)), {}
    for weight, tracks in hypotheses:
        if tuple(sorted(tracks)) != labels:
            continue
        product = np.full(len(states), weight)
        for i, label in enumerate(labels):
            key = id(tracks[label])
            if key not in known:
                known[key] = _mixture(tracks[label], states[:, i])
            product = product * known[key]
        total += product
    return total


def l1_distance(a: Hypotheses, b: Hypotheses, num: int, rng: np.random.Generator) -> tuple[float, float]:
    """The distance, 0 to 2, and its standard error, from `num` samples of either."""
    values = []
    for source in (a, b):
        for labels, states in _draw(source, num, rng).items():
            of_a, of_b = (_density(each, labels, np.array(states)) for each in (a, b))
            values.append(2.0 * np.abs(of_a - of_b) / (of_a + of_b))
    joined = np.concatenate(values)
    return float(joined.mean()), float(joined.std() / np.sqrt(len(joined)))
