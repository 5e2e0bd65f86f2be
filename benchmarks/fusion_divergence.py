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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vedette.control import CauchySchwarzReward, RenyiReward
from vedette.control.pseudo_posterior_rewards import PlainRewards, lay_out_rewards
from vedette.control.search.problem import all_joint_actions
from vedette.densities import GLMB, LMB, TrackTable, as_lmb
from vedette.densities.batches import DensityBatch
from vedette.divergence import cauchy_schwarz
from vedette.fusion import Clmb, CmDeltaGlmb

Floats = NDArray[np.float64]
DIM, NUM_LABELS, NUM_ACTIONS, NUM_SAMPLES = 4, 4, 12, 40


def no_views(_: object) -> Any:
    """These fusions ask for none."""
    return None


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


def cases(rng: np.random.Generator, kind: str) -> tuple[list[DensityBatch], GLMB | LMB]:
    """Two sensors' cases on one label set of four labels (GLMB), or on four labels (LMB), and the prediction."""
    num_cases, labels = NUM_ACTIONS * NUM_SAMPLES, [(1, site) for site in range(NUM_LABELS)]
    covs = np.array([covariance(rng) for _ in range(20)])
    sensors = []
    for _ in range(2):
        shape = num_cases, NUM_LABELS
        tracks = rng.normal(size=(*shape, DIM)), covs[rng.integers(20, size=shape)]
        if kind == "GLMB":
            own = DensityBatch.of_glmbs([tuple(labels)], np.zeros((num_cases, 1)), *tracks, num_samples=NUM_SAMPLES)
        else:
            own = DensityBatch.of_lmbs(labels, np.full(shape, 4.6), *tracks, num_samples=NUM_SAMPLES)
        sensors.append(own)
    means = rng.normal(size=(NUM_LABELS, DIM))
    lmb = LMB.from_bernoullis(labels, np.full(NUM_LABELS, 0.99), means, 4.0 * covs[:NUM_LABELS])
    return sensors, lmb if kind == "LMB" else GLMB.from_hypotheses(lmb.tracks, [list(range(NUM_LABELS))], [1.0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=51)
    repeats = parser.parse_args().repeats
    rng = np.random.default_rng(0)
    glmbs = [belief(rng) for _ in range(2)]
    lmbs: list[LMB] = [as_lmb(glmb) for glmb in glmbs]
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
    actions = all_joint_actions((NUM_ACTIONS, NUM_ACTIONS))
    rewards = {"Cauchy-Schwarz": CauchySchwarzReward(), "Renyi of order 1/2": RenyiReward(0.5)}
    for kind, fusion in (("GLMB", CmDeltaGlmb(halves)), ("LMB", Clmb(halves))):
        sensors, prediction = cases(rng, kind)
        for name, reward in rewards.items():
            table = lay_out_rewards(sensors, prediction, fusion, reward)
            assert not isinstance(table, str)
            seconds = median_seconds(lambda t=table: t(actions), repeats)  # type: ignore[misc]
            each = 1e9 * seconds / (len(actions) * NUM_SAMPLES)
            print(f"joint rewards, {kind:<4} {name:<19} {1e3 * seconds:.2f} ms, {each:.0f} ns an entry")
            plain = PlainRewards(sensors, prediction, fusion, reward, NUM_SAMPLES, no_views)
            slow = median_seconds(lambda p=plain: p(actions[:2]), 5) / 2 * len(actions)  # type: ignore[misc]
            print(f"  one by one {slow / seconds:.0f} times as long")


if __name__ == "__main__":
    main()
