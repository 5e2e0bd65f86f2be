"""Inner products and Cauchy-Schwarz divergences of multi-target densities by enumeration and quadrature.

The set integral runs over every label set and, for each, over the whole product of state spaces (paper eq. 2); nothing
of the closed forms is used.
"""

from __future__ import annotations

import math

from reference import Glmb, Lmb, Mixture
from reference.glmb import expand_lmb
from reference.grid import Grid, joint_values, label_sets


def inner_product(a: Glmb, b: Glmb, grid: Grid, unit_volume: float = 1.0) -> float:
    """Set integral of K^|X| a(X) b(X) for labelled densities."""
    total = 0.0
    for labels in label_sets(a, b):
        integrand = joint_values(a, labels, grid) * joint_values(b, labels, grid)
        total += (unit_volume * grid.cell) ** len(labels) * float(integrand.sum())
    return total


def cauchy_schwarz(a: Glmb, b: Glmb, grid: Grid, unit_volume: float = 1.0) -> float:
    """-ln <a, b> / sqrt(<a, a> <b, b>) (paper eq. 5) for GLMB densities."""
    cross = inner_product(a, b, grid, unit_volume)
    norms = inner_product(a, a, grid, unit_volume) * inner_product(b, b, grid, unit_volume)
    return -math.log(cross / math.sqrt(norms))


def lmb_cauchy_schwarz(a: Lmb, b: Lmb, grid: Grid, unit_volume: float = 1.0) -> float:
    """The same for LMB densities, as the GLMB densities of all their label subsets."""
    return cauchy_schwarz(expand_lmb(a), expand_lmb(b), grid, unit_volume)


def poisson_inner_product(a: Mixture, b: Mixture, grid: Grid, unit_volume: float = 1.0, max_number: int = 60) -> float:
    """Set integral of K^|X| a(X) b(X) for Poisson densities, given by their intensities (weights sum to the mean).

    Summed over the number of targets; a(X) = exp(-<v_a, 1>) times the product of v_a over X.
    """
    values_a, values_b = grid.values(a), grid.values(b)
    empty = math.exp(-grid.cell * float(values_a.sum()) - grid.cell * float(values_b.sum()))
    one = unit_volume * grid.cell * float((values_a * values_b).sum())
    return empty * sum(one**number / math.factorial(number) for number in range(max_number + 1))


def poisson_cauchy_schwarz(a: Mixture, b: Mixture, grid: Grid, unit_volume: float = 1.0) -> float:
    """-ln <a, b> / sqrt(<a, a> <b, b>) for Poisson densities."""
    cross = poisson_inner_product(a, b, grid, unit_volume)
    norms = poisson_inner_product(a, a, grid, unit_volume) * poisson_inner_product(b, b, grid, unit_volume)
    return -math.log(cross / math.sqrt(norms))
