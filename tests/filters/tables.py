"""Random tables of options, and the enumeration of their joint choices."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from hypothesis import strategies as st

from vedette.kernels.association.assignment import ABSENT, MISSED, Options
from vedette.kernels.association.children import Parents
from vedette.kernels.gaussian.marks import unmarked


def make_options(rows: list[list[tuple[int, float]]], num_measurements: int) -> Options:
    """Options from (column, log weight) pairs of each row, in any order."""
    flat = [sorted(row, key=lambda option: -option[1]) for row in rows]
    columns = [column for row in flat for column, _ in row]
    log_weights = [weight for row in flat for _, weight in row]
    return Options(
        np.cumsum([0, *(len(row) for row in flat)]),
        np.array(columns, np.int64),
        np.array(log_weights, np.float64),
        np.zeros(len(columns), np.int64),
        np.zeros(1),
        np.zeros((1, 1)),
        np.empty((0, 0, 0)),
        unmarked(0),
        num_measurements,
    )


def make_parents(members: list[list[int]], log_weights: Any) -> Parents:
    return Parents(
        np.cumsum([0, *(len(rows) for rows in members)]),
        np.array([row for rows in members for row in rows], np.int64),
        np.array(log_weights, np.float64),
    )


@st.composite
def tables(draw: st.DrawFn, max_rows: int = 4, max_columns: int = 4, max_parents: int = 3) -> Any:
    """(options, parents): sparse or dense, with ties where weights are whole numbers."""
    num_columns = draw(st.integers(0, max_columns))
    num_rows = draw(st.integers(0, max_rows))
    weights = draw(st.sampled_from([st.integers(-3, 1).map(float), st.floats(-30.0, 5.0)]))
    density = draw(st.sampled_from([0.3, 0.7, 1.0]))
    present = st.floats(0.0, 1.0).map(lambda u: u < density)
    rows = []
    for _ in range(num_rows):
        columns = [column for column in (ABSENT, MISSED, *range(num_columns)) if draw(present)]
        rows.append([(column, draw(weights)) for column in columns])
    members = [
        [row for row in range(num_rows) if draw(st.booleans())] for _ in range(draw(st.integers(1, max_parents)))
    ]
    prior = [draw(st.one_of(weights, st.just(-np.inf))) for _ in members]
    return make_options(rows, num_columns), make_parents(members, prior)


def choices_of(options: Options, rows: Any) -> list[tuple[float, tuple[int, ...]]]:
    """Log weight and options of every joint choice of these rows in which no measurement is taken twice."""
    lists = [range(options.offsets[row], options.offsets[row + 1]) for row in rows]
    found = []
    for chosen in itertools.product(*lists):
        taken = [options.columns[option] for option in chosen if options.columns[option] >= 0]
        if len(set(taken)) == len(taken):
            found.append((float(sum(options.log_weights[option] for option in chosen)), chosen))
    return found


def marginals_of(options: Options) -> tuple[float, Any]:
    """Log total weight of all joint choices, and the log marginal probability of each option, by enumeration."""
    choices = choices_of(options, range(len(options.offsets) - 1))
    marginals = np.full(len(options.columns), -np.inf)
    if not choices:
        return -np.inf, marginals
    for weight, chosen in choices:
        marginals[list(chosen)] = np.logaddexp(marginals[list(chosen)], weight)
    total = float(np.logaddexp.reduce([weight for weight, _ in choices]))
    return total, marginals - total


def children_of(options: Options, parents: Parents) -> list[tuple[float, int, tuple[int, ...]]]:
    """Log weight, parent and options of every child of positive weight, heaviest first."""
    found = []
    for parent, log_weight in enumerate(parents.log_weights):
        rows = parents.rows[parents.offsets[parent] : parents.offsets[parent + 1]]
        found += [(float(log_weight) + weight, parent, chosen) for weight, chosen in choices_of(options, rows)]
    return sorted((child for child in found if child[0] > -np.inf), key=lambda child: -child[0])
