"""The share of a hypothesis' joint choices that takes no measurement twice, against full enumeration."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from vedette.kernels.association.assignment import Options
from vedette.kernels.association.joint_totals import MAX_CONTESTED, log_contested_share, make_total_work
from vedette.kernels.association.totals import log_row_totals
from vedette.kernels.gaussian.marks import unmarked


def _options(rng: np.random.Generator, num_rows: int, num_measurements: int) -> Options:
    """Rows with an option without a measurement and some with one, as weights come: heaviest first."""
    columns, log_weights, offsets = [], [], [0]
    for _ in range(num_rows):
        taken = rng.permutation(num_measurements)[: rng.integers(0, 4)]
        weights = np.sort(rng.normal(0.0, 3.0, len(taken) + 1))[::-1]
        columns += list(rng.permutation(np.append(taken, -1)))
        log_weights += list(weights)
        offsets.append(len(columns))
    return _as_options(offsets, columns, log_weights, num_measurements)


def _as_options(offsets: list[int], columns: list[int], log_weights: list[float], num_measurements: int) -> Options:
    none = np.empty(0)
    return Options(
        np.array(offsets),
        np.array(columns, np.int64),
        np.array(log_weights),
        np.full(len(columns), -1),
        none,
        none.reshape(0, 2),
        none.reshape(0, 5, 4),
        unmarked(0),
        num_measurements,
    )


def _enumerated(options: Options, rows: np.ndarray) -> float:
    """Log share of the joint choices of these rows without a measurement that is taken twice."""
    ranges = [range(options.offsets[row], options.offsets[row + 1]) for row in rows]
    total = allowed = 0.0
    for choice in itertools.product(*ranges):
        weight = float(np.exp(options.log_weights[list(choice)].sum()))
        taken = [options.columns[option] for option in choice if options.columns[option] >= 0]
        total += weight
        allowed += weight if len(set(taken)) == len(taken) else 0.0
    return float(np.log(allowed / total))


@pytest.mark.parametrize("seed", range(6))
def test_shares_of_hypotheses_are_those_of_full_enumeration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    options = _options(rng, 12, 8)
    log_totals = log_row_totals(options)
    # Hypotheses of a few rows: most share some with others, and some come twice.
    hypotheses = [np.sort(rng.permutation(12)[: rng.integers(0, 7)]) for _ in range(30)]
    hypotheses += hypotheses[:5]
    work = make_total_work(options, 7, sum(map(len, hypotheses)))
    for rows in hypotheses:
        expected = _enumerated(options, rows) if len(rows) else 0.0
        assert log_contested_share(options, rows, log_totals, work) == pytest.approx(expected, abs=1e-12)


def test_clusters_with_too_many_contested_measurements_are_bounded() -> None:
    num = MAX_CONTESTED + 1
    columns = [*range(-1, num)] * 2
    options = _as_options([0, num + 1, 2 * (num + 1)], columns, [0.0] * len(columns), num)
    work = make_total_work(options, 2, 2)
    assert log_contested_share(options, np.array([0, 1]), log_row_totals(options), work) == 0.0
