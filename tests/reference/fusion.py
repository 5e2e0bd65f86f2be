"""Generalized covariance intersection on a grid: the normalised product of powers of the whole densities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reference import Floats, Glmb, Label, Lmb, Mixture
from reference.glmb import expand_lmb
from reference.grid import Grid, joint_values, label_sets


@dataclass(frozen=True)
class FusedSet:
    """A label set of a fused density: its probability and each label's mean and covariance given the set."""

    weight: float
    moments: dict[Label, tuple[Floats, Floats]]


def fuse_densities(mixtures: Sequence[Mixture], weights: Sequence[float], grid: Grid) -> tuple[float, Floats, Floats]:
    """Single-target densities: the integral of the product of powers, and the mean and covariance of the fused one."""
    product = np.ones(len(grid.points))
    for mixture, weight in zip(mixtures, weights, strict=True):
        product *= grid.values(mixture) ** weight
    return grid.cell * float(product.sum()), *grid.moments(product)


def fuse_glmb(densities: Sequence[Glmb], weights: Sequence[float], grid: Grid) -> dict[tuple[Label, ...], FusedSet]:
    """Labelled densities (paper eq. 11): pi_1(X)^w_1 pi_2(X)^w_2 ..., normalised over all label sets and states."""
    integrals, moments = {}, {}
    for labels in label_sets(*densities):
        product = np.ones((len(grid.points),) * len(labels))
        for density, weight in zip(densities, weights, strict=True):
            product *= joint_values(density, labels, grid) ** weight
        integrals[labels] = grid.cell ** len(labels) * float(product.sum())
        if integrals[labels] > 0.0:
            moments[labels] = _marginal_moments(product, labels, grid)
    total = sum(integrals.values())
    return {labels: FusedSet(integrals[labels] / total, moments[labels]) for labels in moments}


def _marginal_moments(product: Floats, labels: tuple[Label, ...], grid: Grid) -> dict[Label, tuple[Floats, Floats]]:
    axes = range(len(labels))
    return {
        label: grid.moments(product.sum(axis=tuple(other for other in axes if other != axis)))
        for axis, label in enumerate(labels)
    }


def fuse_lmb(
    densities: Sequence[Lmb], weights: Sequence[float], grid: Grid
) -> dict[Label, tuple[float, Floats, Floats]]:
    """LMB densities (paper eq. 12), fused as the GLMB densities of all their label subsets.

    Returns the existence, mean and covariance of each label; all densities have the same labels.
    """
    fused = fuse_glmb([expand_lmb(density) for density in densities], weights, grid)
    result = {}
    for label in densities[0]:
        holding = [fused_set for labels, fused_set in fused.items() if label in labels]
        existence = sum(fused_set.weight for fused_set in holding)
        # The label's density is the same in every set: the fused density is an LMB.
        mean, cov = max(holding, key=lambda fused_set: fused_set.weight).moments[label]
        result[label] = (existence, mean, cov)
    return result
