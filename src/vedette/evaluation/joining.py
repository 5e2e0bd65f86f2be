"""Joined tracks: an ended label and a new one become one track if the likelihood of the gap supports it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vedette.densities import Estimate, track_histories
from vedette.evaluation.gaps import gap_log_ratios
from vedette.evaluation.observation_history import ObservationHistory
from vedette.evaluation.scans import scans_of_record
from vedette.filters import common_target_model, has_labels
from vedette.kernels.base.types import Floats
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
    record: RunRecord, scenario: Scenario, *, prob_hidden: float = PROB_HIDDEN, threshold: float = THRESHOLD
) -> tuple[Join, ...]:
    """Return the joins of a run's labels by the models of its scenario, in the order of `began`.

    There are none for filters whose targets have no labels.

    prob_hidden: see `ObservationHistory`. threshold: the lowest probability of a join. Raises `InputError` for numbers
    that are not probabilities, and `VedetteError` for models or a recording that cannot be built.
    """
    filters = tuple(sensor.filter for sensor in build_sensors(scenario))
    if not all(map(has_labels, filters)):
        return ()
    scanned = np.array([[scan is not None for scan in scans] for scans in scans_of_record(record, scenario)])
    sensors = tuple(local.sensor for local in filters)
    observations = ObservationHistory(
        common_target_model(filters), sensors, record.times, record.poses, scanned, prob_hidden
    )
    return find_joins(record.estimates, observations, threshold=threshold)


def find_joins(
    estimates: Sequence[Estimate], observations: ObservationHistory, *, threshold: float = THRESHOLD
) -> tuple[Join, ...]:
    """Return the joins like `joins_of_run`, for estimates of successive scans.

    Raises `InputError` for another number of scans.
    """
    probability("threshold", threshold)
    histories = track_histories(estimates, observations.times)
    log_ratios = gap_log_ratios(histories, observations)
    probabilities = _join_probabilities(log_ratios)
    joins = [
        Join(histories[i].label, histories[j].label, float(probabilities[i, j]))
        for i, j in zip(*_best_joins(log_ratios), strict=True)
        if probabilities[i, j] >= threshold and log_ratios[i, j] > -np.inf
    ]
    return tuple(sorted(joins, key=lambda join: join.began))


def _join_probabilities(log_ratios: Floats) -> Floats:
    """Return the probability of each join among those of either of its labels, and none, shape (num, num).

    Exact if one of the two has no other; else a little low, as a rival may itself be joined elsewhere.
    """
    rows, columns = (np.logaddexp.reduce(log_ratios, axis=axis, initial=-np.inf) for axis in (1, 0))
    others = np.logaddexp(rows[:, np.newaxis], columns)
    with np.errstate(invalid="ignore"):
        probabilities = np.where(log_ratios > -np.inf, np.exp(log_ratios - others), 0.0)
    return np.asarray(np.exp(log_ratios - np.logaddexp(0.0, others + np.log1p(-np.minimum(probabilities, 0.5)))))


def _best_joins(log_ratios: Floats) -> tuple[list[int], list[int]]:
    """Return rows and columns of the joins with the largest summed log ratio, each row and column at most once."""
    from scipy.optimize import linear_sum_assignment

    gains = np.maximum(log_ratios, 0.0)
    rows, columns = linear_sum_assignment(gains, maximize=True)
    chosen = gains[rows, columns] > 0.0
    return rows[chosen].tolist(), columns[chosen].tolist()


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
    columns = estimate.means, estimate.covs, estimate.existence, estimate.class_probs
    return Estimate(relabelled, *(column[order] for column in columns))
