"""Label switches and fragmentations of the tracks of targets.

Similar to K. Bernardin and R. Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT
Metrics", EURASIP J. Image and Video Processing, 2008 (mismatches), and to Y. Li, C. Huang and R. Nevatia, "Learning to
associate: HybridBoosted multi-target tracker for crowded scene", CVPR 2009 (fragments).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vedette.densities.estimates import Estimate
from vedette.evaluation.metrics.matching import Matching, match_run
from vedette.kernels.base.types import Ints
from vedette.simulation.truth import Truth


@dataclass(frozen=True, slots=True, eq=False)
class Continuity:
    """Breaks in the tracks of targets, counted at the scan of the next match.

    Attributes:
        label_switches: (num_scans,) number of targets matched to another label than at their last match, at any time.
        fragmentations: (num_scans,) number of targets matched again after scans at which they were alive but not
            matched. Scans at which the target does not exist are not a break.
    """

    label_switches: Ints
    fragmentations: Ints


def continuity_of_run(truth: Truth, estimates: Sequence[Estimate], *, cutoff: float, order: float) -> Continuity:
    """Return the label switches and fragmentations of a run. Raise `InputError` as `match_run` does."""
    return continuity(truth, match_run(truth, estimates, cutoff=cutoff, order=order))


def continuity(truth: Truth, matching: Matching) -> Continuity:
    """Return the label switches and fragmentations from the matching of a run, see `continuity_of_pairs`."""
    switched, broken = continuity_of_pairs(truth, matching)
    return Continuity(
        np.bincount(matching.scans[switched], minlength=matching.num_scans),
        np.bincount(matching.scans[broken], minlength=matching.num_scans),
    )


def continuity_of_pairs(truth: Truth, matching: Matching) -> tuple[Ints, Ints]:
    """Return the pairs of a matching with a label switch, and those after a break.

    Each scan is matched separately. CLEAR MOT instead keeps a pair of the last scan as long as it is within the cutoff,
    and so counts fewer switches among targets closer to each other than that. The first match of a target, and a target
    that is not matched again, count as neither: a late start and an early end are missed targets. The first match after
    a return under the same id is compared with the last match before it.
    """
    ids = truth.ids[matching.truth_rows]
    by_target = np.argsort(ids, kind="stable")  # pairs come in order of scans
    before, after = by_target[:-1], by_target[1:]
    same_target = ids[before] == ids[after]
    switched = same_target & (matching.labels[before] != matching.labels[after]).any(axis=1)
    age = _ages(truth)[matching.truth_rows]
    broken = same_target & (age[after] - age[before] > 1)
    return after[switched], after[broken]


def _ages(truth: Truth) -> Ints:
    """Number of earlier scans at which the target of each row existed, (total,)."""
    by_target = np.argsort(truth.ids, kind="stable")
    _, starts, counts = np.unique(truth.ids[by_target], return_index=True, return_counts=True)
    ages = np.empty(len(by_target), np.int64)
    ages[by_target] = np.arange(len(by_target)) - np.repeat(starts, counts)
    return ages
