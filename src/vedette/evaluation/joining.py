"""Joined tracks: an ended label and a new one become one track if the likelihood of the gap supports it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vedette.densities import Estimate, track_histories
from vedette.evaluation.gaps import GapRatios, gap_log_ratios
from vedette.evaluation.observation_history import ObservationHistory
from vedette.evaluation.scans import scans_of_record
from vedette.filters import common_target_model, has_labels
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import probability
from vedette.scenarios import Scenario
from vedette.scenarios.build import build_sensors
from vedette.simulation.records import RunRecord

# Chosen on scenes 0 to 39 of benchmarks/joined_tracks.py; raising one has the effect of lowering the other.
PROB_HIDDEN, THRESHOLD = 0.5, 0.95
Label = tuple[int, int]


class Join(NamedTuple):
    """Label `began` continues label `ended` (birth step and index each), with this probability."""

    ended: Label
    began: Label
    probability: float


def joins_of_run(
    record: RunRecord,
    scenario: Scenario,
    *,
    prob_hidden: float = PROB_HIDDEN,
    threshold: float = THRESHOLD,
    progress: Callable[[int], object] = lambda scan: None,
) -> tuple[Join, ...]:
    """Return the joins of a run's labels by the models of its scenario, in the order of `began`.

    There are none for filters whose targets have no labels.

    prob_hidden: see `ObservationHistory`. threshold: the lowest probability of a join. progress: called with the
    number of every finished scan. Raises `InputError` for numbers that are not probabilities, and `VedetteError` for
    models or a recording that cannot be built.
    """
    filters = tuple(sensor.filter for sensor in build_sensors(scenario))
    if not all(map(has_labels, filters)):
        return ()
    scanned = np.array([[scan is not None for scan in scans] for scans in scans_of_record(record, scenario)])
    sensors = tuple(local.sensor for local in filters)
    observations = ObservationHistory(
        common_target_model(filters), sensors, record.times, record.poses, scanned, prob_hidden
    )
    return find_joins(record.estimates, observations, threshold=threshold, progress=progress)


def find_joins(
    estimates: Sequence[Estimate],
    observations: ObservationHistory,
    *,
    threshold: float = THRESHOLD,
    progress: Callable[[int], object] = lambda scan: None,
) -> tuple[Join, ...]:
    """Return the joins like `joins_of_run`, for estimates of successive scans.

    Raises `InputError` for another number of scans.
    """
    probability("threshold", threshold)
    histories = track_histories(estimates, observations.times)
    pairs = gap_log_ratios(histories, observations, progress=progress)
    probabilities = _join_probabilities(pairs, len(histories))
    joins = [
        Join(histories[pairs.ended[k]].label, histories[pairs.began[k]].label, float(probabilities[k]))
        for k in _best_joins(pairs).tolist()
        if probabilities[k] >= threshold
    ]
    return tuple(sorted(joins, key=lambda join: join.began))


def _join_probabilities(pairs: GapRatios, num_labels: int) -> Floats:
    """Return the probability of each pair's join among those of either of its labels, and none, shape (num_pairs,).

    Exact if one of the two has no other, else a little low, as a rival may itself be joined elsewhere.
    """
    ended, began, log_ratios = pairs
    rows, columns = np.full(num_labels, -np.inf), np.full(num_labels, -np.inf)
    np.logaddexp.at(rows, ended, log_ratios)
    np.logaddexp.at(columns, began, log_ratios)
    others = np.logaddexp(rows[ended], columns[began])
    probabilities = np.exp(log_ratios - others)
    return np.asarray(np.exp(log_ratios - np.logaddexp(0.0, others + np.log1p(-np.minimum(probabilities, 0.5)))))


def _best_joins(pairs: GapRatios) -> Ints:
    """Return the indices of the pairs with the largest summed log ratio, each label at most once in either role."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    gains = np.flatnonzero(pairs.log_ratios > 0.0)
    ended, rows = np.unique(pairs.ended[gains], return_inverse=True)
    began, columns = np.unique(pairs.began[gains], return_inverse=True)
    # A column of its own for each row, without a gain; 1 is added to all weights, as an edge of weight 0 is none.
    own = np.arange(len(ended))
    weights = np.concatenate([pairs.log_ratios[gains], np.zeros(len(own))]) + 1.0
    places = np.concatenate([rows, own]), np.concatenate([columns, len(began) + own])
    if not len(gains):
        return gains
    graph = coo_array((weights, places), shape=(len(own), len(began) + len(own))).tocsr()
    matched = min_weight_full_bipartite_matching(graph, maximize=True)[1]
    return np.asarray(gains[matched[rows] == columns])


def track_names(joins: Sequence[Join]) -> dict[Label, Label]:
    """Return, for each label that continues another, the first label of its track."""
    names: dict[Label, Label] = {}
    for join in sorted(joins, key=lambda join: join.began):
        names[join.began] = names.get(join.ended, join.ended)
    return names


def with_joined_tracks(record: RunRecord, joins: Sequence[Join]) -> RunRecord:
    """Return the record with every label replaced by the first of its track, so that measures score whole tracks."""
    names = track_names(joins)
    return replace(record, estimates=tuple(_relabel(estimate, names) for estimate in record.estimates))


def _relabel(estimate: Estimate, names: dict[Label, Label]) -> Estimate:
    labels = [names.get((step, index), (step, index)) for step, index in estimate.labels.tolist()]
    order = sorted(range(len(labels)), key=labels.__getitem__)
    relabelled = np.array(labels, np.int64).reshape(-1, 2)[order]
    columns = estimate.means, estimate.covs, estimate.existence, estimate.class_probs, estimate.mode_probs
    return Estimate(relabelled, *(column[order] for column in columns))
