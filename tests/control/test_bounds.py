"""Upper bounds on the expected loss against every joint action of random small problems."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.problem import label_upper_bounds
from vedette.control.rewards.labels import cardinality_variance_of_label
from vedette.control.search.problem import all_joint_actions
from vedette.densities.checks import offsets_of
from vedette.kernels.base.types import Floats
from vedette.kernels.planning.ascent import Cells
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.bounds import relaxed_bound
from vedette.kernels.planning.joint_values import label_values
from vedette.kernels.planning.label_values import EXPECTED_LOSS, Valuation

NUM_INFORMATION = 10  # numbers of a lower triangle of four components
LOWER = np.tril_indices(4)


def information_row(matrix: Floats, logit: float) -> Floats:
    row = np.zeros(NUM_INFORMATION + 4 + 4)
    row[:NUM_INFORMATION] = matrix[LOWER]
    row[-3:-1] = 1.0, logit
    return row


def random_information(rng: np.random.Generator, std: float) -> Floats:
    """Information of full or lower rank, about errors of `std` m and a tenth of it a second."""
    root = rng.normal(size=(4, int(rng.integers(1, 5)))) / (std * np.array([1.0, 1.0, 0.1, 0.1]))[:, np.newaxis]
    return np.asarray(root @ root.T)


def random_problem(seed: int, *, order: float, fused: bool) -> AdditiveRewards:
    """Sensors with up to four courses, labels below and beyond the cutoff, cells, and prices.

    fused: the rows before any scan differ from those of the prediction, and sensors have powers below one.
    """
    rng = np.random.default_rng(seed)
    num_labels, num_sensors, num_cells = int(rng.integers(1, 5)), int(rng.integers(1, 5)), int(rng.integers(0, 4))
    sizes = rng.integers(1, 5, num_sensors)
    scale = 10.0 ** rng.uniform(0.5, 3.0, num_labels)
    priors = [random_information(rng, own) + np.diag([1.0, 1.0, 100.0, 100.0]) / own**2 for own in scale]
    logits = rng.normal(0.0, 2.0, num_labels)
    rows = np.array([information_row(own, logit) for own, logit in zip(priors, logits, strict=True)])
    labels, changes, counts = list[int](), list[Floats](), list[int]()
    for _ in range(sizes.sum()):
        seen = np.flatnonzero(rng.random(num_labels) < 0.7)
        counts.append(len(seen))
        for label in seen.tolist():
            change = np.zeros_like(rows[0])
            gain = random_information(rng, float(scale[label] * 10.0 ** rng.uniform(-2.0, 0.5)))
            miss = math.log1p(-(rng.uniform(0.0, 1.0) ** 2))
            change[:NUM_INFORMATION], change[-1] = -math.expm1(miss) * gain[LOWER], miss
            labels.append(label)
            changes.append(change)
    start, powers = rows.copy(), np.ones(num_sensors)
    if fused:
        more = np.array([information_row(random_information(rng, 3.0 * own), 0.0) for own in scale])
        start[:, :NUM_INFORMATION] += more[:, :NUM_INFORMATION]
        powers = rng.uniform(0.2, 1.0, num_sensors)
    cutoff, covs = float(10.0 ** rng.uniform(1.0, 2.5)), np.linalg.inv(np.array(priors))
    unseen = np.minimum(covs[:, 0, 0] + covs[:, 1, 1], cutoff**2)[:, np.newaxis] ** (0.5 * order)
    valuation = Valuation(
        EXPECTED_LOSS,
        1,
        rows,
        unseen,
        np.empty((0, 2)),
        0.0,
        np.array([cutoff**2, 0.5 * order, rng.uniform(0.3, 1.0)]),
        cardinality_variance_of_label,
        np.zeros((num_labels, 4)),
        covs,
    )
    views = [np.flatnonzero(rng.random(num_cells) < 0.6) for _ in range(sizes.sum())]
    log_miss = np.log1p(-rng.uniform(0.0, 0.99, sum(map(len, views))))
    seen_cells = np.concatenate(views).astype(np.int64)
    cells = Cells(offsets_of([len(own) for own in views]), seen_cells, log_miss, rng.uniform(0.0, cutoff, num_cells))
    table = Table(
        offsets_of(sizes),
        offsets_of(counts),
        np.array(labels, np.int64),
        np.array(changes).reshape(len(labels), rows.shape[1], 1),
        start,
        powers,
    )
    prices = rng.uniform(0.0, 0.2 * cutoff, sizes.sum()) * (rng.random() < 0.5)
    return AdditiveRewards(table, valuation, (rows,) * num_sensors, None, cells, prices, 1)


def relaxed(additive: AdditiveRewards) -> float:
    return float(relaxed_bound(additive.table, additive.valuation, additive.cells, additive.prices))


def best_of(additive: AdditiveRewards) -> float:
    sizes: Any = tuple(np.diff(additive.table.first_courses).tolist())
    return float(additive(all_joint_actions(sizes)).max())


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize("order", [1.0, 2.0])
def test_no_joint_action_is_better_than_the_relaxation(order: float, fused: bool) -> None:
    gaps = []
    for seed in range(200):
        additive = random_problem(seed, order=order, fused=fused)
        best, upper = best_of(additive), relaxed(additive)
        assert best <= upper + 1e-9 * max(1.0, abs(best))
        gaps.append((upper - best) / max(abs(best), abs(upper)))
    assert np.median(gaps) < 0.1


def test_the_relaxation_of_one_course_is_exact_below_the_cutoff() -> None:
    """With a single course of each sensor there is nothing to relax, and without the cutoff no line."""
    for seed in range(50):
        additive = random_problem(seed, order=1.0, fused=False)
        table, valuation = additive.table, additive.valuation
        firsts, num = table.first_courses, len(table.powers)
        courses = firsts[:-1]
        entries = np.concatenate([np.arange(table.offsets[own], table.offsets[own + 1]) for own in courses])
        offsets, cell_offsets = (offsets_of(np.diff(own)[courses]) for own in (table.offsets, additive.cells.offsets))
        seen = np.concatenate(
            [np.arange(additive.cells.offsets[own], additive.cells.offsets[own + 1]) for own in courses]
        )
        free = valuation._replace(
            params=np.array([1e12, 0.5, 1.0]),
            own=np.sqrt(valuation.covs[:, 0, 0] + valuation.covs[:, 1, 1])[:, np.newaxis],
        )
        cells = additive.cells._replace(
            offsets=cell_offsets, cells=additive.cells.cells[seen], log_miss=additive.cells.log_miss[seen]
        )
        single = AdditiveRewards(
            table._replace(
                first_courses=np.arange(num + 1),
                offsets=offsets,
                labels=table.labels[entries],
                changes=table.changes[entries],
            ),
            free,
            additive.bases,
            None,
            cells,
            additive.prices[courses],
            1,
        )
        np.testing.assert_allclose(relaxed(single), best_of(single), rtol=1e-9)


def test_labels_that_may_be_seen_in_too_many_ways_have_no_bound_of_their_own() -> None:
    additive = random_problem(1, order=1.0, fused=False)
    assert np.isinf(label_upper_bounds(additive, 0)).all()
    assert np.isfinite(label_upper_bounds(additive, 10**6)).all()


def test_what_rounding_leaves_of_scans_is_no_detection() -> None:
    """An ascent adds and subtracts scans; divided by a detection of 1e-17, what is left of them would be anything."""
    additive = random_problem(2, order=1.0, fused=False)
    before = additive.with_scans(np.full(len(additive.table.powers), -1))
    after = before.copy()
    after[:, -1] = -1e-17
    after[:, :NUM_INFORMATION] *= 1.0 - 1e-15
    np.testing.assert_array_equal(label_values(after, additive.valuation), label_values(before, additive.valuation))
