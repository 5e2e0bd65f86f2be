"""Errors of the ways to take powers of Gaussian mixtures, against integration on a grid.

    python benchmarks/power_of_mixtures.py

Two sensors of weight 1/2 fuse one track. "same": both have two equal components of unit covariance at the given
separation. "different": the second has weights 0.3 and 0.7, components moved by 0.5 and 0.3 along the separation, and
covariances diag(1, ..., 2) and 0.6 I. The separation is along the first axis, or ("oblique") along the diagonal.

Printed for each method: the error of the log of the fused integral (times 1/1000; what a fused log-odds of existence is
wrong by), and the total variation distance of the fused density from the true one (times 1/1000). This is the table of
docs/decisions/0003-power-of-mixtures.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from vedette.densities import LMB, TrackTable
from vedette.fusion import MIXTURE_POWERS, Clmb, FusionLimits

Floats = NDArray[np.float64]
SEPARATIONS = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0)
POINTS_PER_AXIS = {1: 8001, 2: 561}
BORDER = 9.0


def track(weights: Sequence[float], means: Floats, covs: Floats) -> TrackTable:
    return TrackTable.from_mixtures([(0, 0)], [(weights, means, covs)])


def case(kind: str, dim: int, separation: float) -> tuple[TrackTable, TrackTable]:
    direction = np.eye(dim)[0] if kind != "oblique" else np.full(dim, dim**-0.5)
    first = track([0.5, 0.5], np.outer([0.0, separation], direction), np.array([np.eye(dim)] * 2))
    if kind == "same":
        return first, first
    wide = np.diag([*np.ones(dim - 1), 2.0])
    second = track([0.3, 0.7], np.outer([0.5, separation + 0.3], direction), np.array([wide, 0.6 * np.eye(dim)]))
    return first, second


def values(tracks: TrackTable, points: Floats) -> Floats:
    """Density of the one track at the points."""
    total = np.zeros(len(points))
    for log_weight, mean, cov in zip(tracks.log_weights, tracks.means, tracks.covs, strict=True):
        deviations = points - mean
        exponents = -0.5 * np.einsum("pi,ij,pj->p", deviations, np.linalg.inv(cov), deviations)
        total += np.exp(log_weight + exponents) / math.sqrt(np.linalg.det(2.0 * math.pi * cov))
    return total


def errors(first: TrackTable, second: TrackTable) -> Iterator[tuple[float, float]]:
    """Error of the log integral and total variation distance, of each way to take powers."""
    dim = first.state_dim
    reach = max(float(np.abs(tracks.means).max()) for tracks in (first, second)) + BORDER
    axis = np.linspace(-BORDER, reach, POINTS_PER_AXIS[dim])
    points = np.stack(np.meshgrid(*[axis] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    cell = float(axis[1] - axis[0]) ** dim
    product = np.sqrt(values(first, points) * values(second, points))
    integral = cell * float(product.sum())
    for mixture_power in MIXTURE_POWERS:
        limits = FusionLimits(log_min_component_weight=-math.inf, merge_distance=0.0)
        sensors = [LMB(tracks, np.zeros(1)) for tracks in (first, second)]
        fused, _ = Clmb((0.5, 0.5), mixture_power, limits=limits).fuse(sensors)
        log_overlap = float(fused.existence_logit[0])
        distance = 0.5 * cell * float(np.abs(values(fused.tracks, points) - product / integral).sum())
        yield log_overlap - math.log(integral), distance


def main() -> None:
    print("| case | separation | " + " | ".join(name.replace("_", " ") for name in MIXTURE_POWERS) + " |")
    print("| --- | --- | " + " | ".join("---" for _ in MIXTURE_POWERS) + " |")
    for dim, kind in ((1, "same"), (1, "different"), (2, "same"), (2, "different"), (2, "oblique")):
        for separation in SEPARATIONS:
            cells = [f"{1e3 * log:+.1f}, {1e3 * tv:.1f}" for log, tv in errors(*case(kind, dim, separation))]
            print(f"| {dim}-D, {kind} | {separation:g} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
