"""Settled names of the targets of weighted hypotheses, by trying every way to give them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

Label = tuple[int, int]
Hypothesis = tuple[float, dict[Label, list[Any]]]  # weight, and the components (weight, mean, cov) of each label


def moments(components: Sequence[Any]) -> tuple[Any, Any]:
    """Mean and covariance of a mixture."""
    mean = sum(w * m for w, m, _ in components)
    return mean, sum(w * (cov + np.outer(m - mean, m - mean)) for w, m, cov in components)


def settled(hypotheses: Sequence[Hypothesis], distance: float, stay: float = 1e-6) -> list[dict[Label, Label]]:
    """For each hypothesis, the name that each of its labels goes by."""
    labels = list(dict.fromkeys(label for _, tracks in hypotheses for label in tracks))
    openers: list[tuple[Label, Any, Any]] = []  # name and moments of each place
    names: list[dict[Label, Label]] = [{} for _ in hypotheses]
    for h in sorted(range(len(hypotheses)), key=lambda h: -hypotheses[h][0]):
        targets = [(label, *moments(components)) for label, components in hypotheses[h][1].items()]
        best, cost = None, np.inf
        for places in itertools.permutations(range(len(labels)), len(targets)):
            total = 0.0
            for (label, mean, cov), place in zip(targets, places, strict=True):
                if place >= len(openers):
                    total += distance**2
                    continue
                name, other_mean, other_cov = openers[place]
                offset = mean - other_mean
                total += offset @ np.linalg.solve(cov + other_cov, offset) - stay * (name == label)
            if total < cost - 1e-9:
                best, cost = places, total
        assert best is not None
        new = [i for i, place in enumerate(best) if place >= len(openers)]
        for i, place in enumerate(best):
            if i not in new:
                names[h][targets[i][0]] = openers[place][0]
        taken = {name for name, _, _ in openers}
        for own in (True, False):
            for i in new:
                label, mean, cov = targets[i]
                if label in names[h] or (own and label in taken):
                    continue
                name = label if own else next(other for other in labels if other not in taken)
                taken.add(name)
                names[h][label] = name
                openers.append((name, mean, cov))
    return names
