"""Speed of fusion and divergence: through the public functions, and per joint action in a planner's inner loop.

    python benchmarks/fusion_divergence.py [--repeats N]

CPU time of one core, medians over the repeats. Beliefs of two sensors about four targets in a 4-D state: a
delta-GLMB of 20 hypotheses, an LMB of 4 labels. The planner's loop is that of the paper's joint decision: 12 x 12
actions, 40 samples.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from vedette.densities import GLMB, LMB, TrackTable, glmb_to_lmb
from vedette.divergence import cauchy_schwarz
from vedette.fusion import Clmb, CmDeltaGlmb
from vedette.kernels.base.compile import kernel
from vedette.kernels.gaussian.information import row_size, to_information
from vedette.kernels.planning.fused_divergence import Cases, Prediction, fused_glmb_divergence, fused_lmb_divergence

Floats = NDArray[np.float64]
DIM, NUM_LABELS, NUM_ACTIONS, NUM_SAMPLES = 4, 4, 12, 40


def median_seconds(work: Callable[[], object], repeats: int) -> float:
    work()
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return float(np.median(seconds))


def covariance(rng: np.random.Generator) -> Floats:
    root = rng.normal(size=(DIM, DIM))
    return np.asarray(root @ root.T + np.eye(DIM))


def belief(rng: np.random.Generator) -> GLMB:
    """Three versions of each track, 20 hypotheses of 3 or 4 labels."""
    labels = np.repeat([[1, site] for site in range(NUM_LABELS)], 3, axis=0)
    means = 100.0 * np.repeat(np.arange(NUM_LABELS), 3)[:, None] + rng.normal(size=(len(labels), DIM))
    tracks = TrackTable.from_gaussians(labels, means, [covariance(rng) for _ in labels])
    left_out = rng.integers(0, 3 * NUM_LABELS, 20)
    hyps = [[3 * k + int(rng.integers(3)) for k in range(NUM_LABELS) if k != without] for without in left_out]
    return GLMB.from_hypotheses(tracks, hyps, rng.dirichlet(np.ones(20)))


def cases(rng: np.random.Generator, num_sets: int) -> tuple[Cases, Prediction]:
    """Two sensors' cases on one label set of four labels (GLMB), or on four labels (LMB)."""
    num_cases, size = 2 * NUM_ACTIONS * NUM_SAMPLES, row_size(DIM)
    covs = [covariance(rng) for _ in range(20)]
    rows, work = np.empty((num_cases + 1, NUM_LABELS, size)), np.empty((2, DIM, DIM))
    for case in range(num_cases + 1):
        for label in range(NUM_LABELS):
            power, cov = (0.5, covs[rng.integers(20)]) if case < num_cases else (1.0, 4.0 * covs[label])
            to_information(rng.normal(size=DIM), cov, np.zeros(DIM), power, rows[case, label], work[0], work[1])
    offsets = np.arange(num_sets + 1) * (NUM_LABELS // num_sets)
    log_present, log_absent = np.full((num_cases + 1, num_sets), -0.01), np.full((num_cases + 1, num_sets), -4.6)
    held = np.ones((num_cases, num_sets), np.bool_)
    all_cases = Cases(offsets, log_present[:-1], log_absent[:-1], held, rows[:-1])
    return all_cases, Prediction(log_present[-1], log_absent[-1], rows[-1], 0.0, 0.0)


@kernel
def glmb_table(all_cases: Cases, prediction: Prediction, dim: int, out: Floats) -> None:
    chosen, work = np.empty(2, np.int64), np.empty((2, all_cases.rows.shape[2]))
    num_actions, num_samples = out.shape[0], out.shape[2]
    for first in range(num_actions):
        for second in range(num_actions):
            for sample in range(num_samples):
                chosen[0] = first * num_samples + sample
                chosen[1] = (num_actions + second) * num_samples + sample
                out[first, second, sample] = fused_glmb_divergence(all_cases, chosen, prediction, dim, 0.0, work)


@kernel
def lmb_table(all_cases: Cases, prediction: Prediction, dim: int, out: Floats) -> None:
    chosen, work = np.empty(2, np.int64), np.empty((2, all_cases.rows.shape[2]))
    num_actions, num_samples = out.shape[0], out.shape[2]
    for first in range(num_actions):
        for second in range(num_actions):
            for sample in range(num_samples):
                chosen[0] = first * num_samples + sample
                chosen[1] = (num_actions + second) * num_samples + sample
                out[first, second, sample] = fused_lmb_divergence(all_cases, chosen, prediction, dim, 0.0, work)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=51)
    repeats = parser.parse_args().repeats
    rng = np.random.default_rng(0)
    glmbs = [belief(rng) for _ in range(2)]
    lmbs: list[LMB] = [glmb_to_lmb(glmb) for glmb in glmbs]
    halves = (0.5, 0.5)
    public: dict[str, Callable[[], object]] = {
        "fuse two GLMBs, moment matched": lambda: CmDeltaGlmb(halves).fuse(glmbs),
        "fuse two GLMBs, component wise": lambda: CmDeltaGlmb(halves, "component_wise").fuse(glmbs),
        "fuse two GLMBs, quadrature": lambda: CmDeltaGlmb(halves, "quadrature").fuse(glmbs),
        "fuse two LMBs": lambda: Clmb(halves).fuse(lmbs),
        "divergence of two delta-GLMBs": lambda: cauchy_schwarz(*glmbs),
        "divergence of two LMBs": lambda: cauchy_schwarz(*lmbs),
    }
    for name, work in public.items():
        print(f"{name:<34} {1e6 * median_seconds(work, repeats):8.0f} us")
    out = np.empty((NUM_ACTIONS, NUM_ACTIONS, NUM_SAMPLES))
    for name, num_sets, table in (("GLMB, one label set", 1, glmb_table), ("LMB", NUM_LABELS, lmb_table)):
        all_cases, prediction = cases(rng, num_sets)
        seconds = median_seconds(lambda t=table, c=all_cases, p=prediction: t(c, p, DIM, out), repeats)  # type: ignore[misc]
        print(f"joint reward table, {name:<20} {1e3 * seconds:.2f} ms, {1e9 * seconds / out.size:.0f} ns an entry")


if __name__ == "__main__":
    main()
