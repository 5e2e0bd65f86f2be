"""Scores of single targets over a run: coverage, error, error bars and changes of label."""

import math
from typing import NamedTuple

import numpy as np

from vedette.evaluation.metrics.consistency import nees_of_matching
from vedette.evaluation.metrics.matching import match_run
from vedette.evaluation.metrics.trajectories import continuity_of_pairs
from vedette.simulation.records import RunRecord


class TargetScore(NamedTuple):
    """Score of one target over a run, from the estimates that are matched to it.

    Attributes:
        target: id in `Truth.ids`.
        num_scans: number of scans at which it exists.
        covered: share of these with an estimate within the cutoff.
        rmse_m: root mean square error of the position, m, or NaN if it was never covered.
        error_ratio: root of the mean NEES of the position over 2: error over what its covariance says, 1 if that is
            right, or NaN.
        label_switches: number of times that it was matched to another label than before.
    """

    target: int
    num_scans: int
    covered: float
    rmse_m: float
    error_ratio: float
    label_switches: int


def target_scores(record: RunRecord, *, cutoff: float, order: float) -> tuple[TargetScore, ...]:
    """Return the score of every target, in order of ids. Raise `InputError` as `match_run` does."""
    truth, matching = record.truth, match_run(record.truth, record.estimates, cutoff=cutoff, order=order)
    ids, nees = truth.ids[matching.truth_rows], nees_of_matching(truth, matching, position_only=True)
    switched_ids = ids[continuity_of_pairs(truth, matching)[0]]
    scores = list[TargetScore]()
    for target, num in zip(*np.unique(truth.ids, return_counts=True), strict=True):
        own = ids == target
        mean_square, mean_nees = (
            float(x[own].mean()) if own.any() else math.nan for x in (matching.distances**2, nees)
        )
        scores.append(
            TargetScore(
                target=int(target),
                num_scans=int(num),
                covered=float(own.sum() / num),
                rmse_m=math.sqrt(mean_square),
                error_ratio=math.sqrt(0.5 * mean_nees),
                label_switches=int((switched_ids == target).sum()),
            )
        )
    return tuple(scores)
