"""Results of pseudo-updates with known association: changes of Bernoulli rows, or densities, for every course."""

from typing import NamedTuple

import numpy as np

from vedette.errors import NumericalError
from vedette.kernels.base.compile import borrowing, kernel
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.information import to_information
from vedette.kernels.planning.batched_prediction import BatchWork
from vedette.kernels.planning.bernoulli_rows import ALL_BUT_CERTAIN, bernoulli_size
from vedette.kernels.planning.ideal import Decision
from vedette.kernels.planning.known_association import MOST_LANES, Followed, follow, make_follow_work, make_followed
from vedette.kernels.planning.lanes import take_matrix, take_state
from vedette.kernels.planning.pseudo_lmb import LmbResults
from vedette.kernels.planning.reach import Belief


class Entries(NamedTuple):
    """The sensor's own labels that each of its courses reaches."""

    first: Ints  # (num_courses,) first entry of each course
    last: Ints  # (num_courses,) the entry after the last of each course
    own: Ints  # (num_entries,) index among the sensor's labels


@kernel
def rows_without_scans(means: Floats, covs: Floats, logits: Floats, references: Floats) -> Floats:
    """Return Bernoulli rows (num, bernoulli_size) of labels with one Gaussian each. Their logits are limited."""
    num, dim = means.shape
    rows, factor, inverse = np.empty((num, bernoulli_size(dim))), np.empty((dim, dim)), np.empty((dim, dim))
    for i in range(num):
        if not to_information(means[i], covs[i], references[i], 1.0, rows[i], factor, inverse):
            raise NumericalError("prediction: covariance of a track is not positive definite")
        rows[i, -2] = min(max(logits[i], -ALL_BUT_CERTAIN), ALL_BUT_CERTAIN)
        rows[i, -1] = 0.0
    return rows


@borrowing
def _write_changes(
    found: Followed, first: int, num: int, reference: Floats, base: Floats, own: BatchWork, row: Floats, changes: Floats
) -> None:
    """Write changes (bernoulli_size, num_samples) of a label, for `num` samples from `first` on."""
    size = len(base)
    for s in range(num):
        for k in range(size - 2):
            row[k] = 0.0
        if found.is_measured[s]:
            take_state(found.means, s, own.mean)
            take_matrix(found.covs, s, own.cov)
            if not to_information(own.mean, own.cov, reference, 1.0, row, own.out_cov, own.scratch.product):
                raise NumericalError("pseudo-update: covariance of a track is not positive definite")
            for k in range(size - 2):
                row[k] -= base[k]
        for k in range(size - 2):
            changes[k, first + s] = row[k]
    for s in range(num):
        changes[size - 2, first + s], changes[size - 1, first + s] = found.log_odds[s], found.log_miss[s]


@kernel
def fill_changes(
    belief: Belief,
    decision: Decision,
    entries: Entries,
    references: Floats,
    bases: Floats,
    first: int,
    last: int,
    changes: Floats,
) -> None:
    """Write changes (num_entries, bernoulli_size, num_samples) of Bernoulli rows, for courses `first:last` of a sensor.

    references: (num_labels, state_dim) reference points of the rows. bases: (num_labels, bernoulli_size) the sensor's
    rows without scans. Both in the order of the sensor's own labels.
    """
    dim, meas_dim, num_samples = references.shape[1], len(decision.sensor.periods), belief.targets.shape[1]
    room = min(num_samples, MOST_LANES)
    work, found, row = make_follow_work(dim, meas_dim, room), make_followed(dim, room), np.empty(bases.shape[1])
    for course in range(first, last):
        for entry in range(entries.first[course], entries.last[course]):
            label = entries.own[entry]
            for start in range(0, num_samples, MOST_LANES):
                num = min(MOST_LANES, num_samples - start)
                follow(belief, decision, course, label, start, num, work, found)
                _write_changes(found, start, num, references[label], bases[label], work.own, row, changes[entry])


@kernel
def pseudo_update_known(belief: Belief, decision: Decision, first: int, last: int, results: LmbResults) -> None:
    """Write densities of courses `first:last` of one sensor for every sample: case `course * num_samples + sample`."""
    tracks, num_samples = belief.prior.tracks, belief.targets.shape[1]
    dim, room = tracks.components.means.shape[1], min(num_samples, MOST_LANES)
    work, found = make_follow_work(dim, len(decision.sensor.periods), room), make_followed(dim, room)
    for course in range(first, last):
        for label in range(len(tracks.labels)):
            for start in range(0, num_samples, MOST_LANES):
                num = min(MOST_LANES, num_samples - start)
                follow(belief, decision, course, label, start, num, work, found)
                for s in range(num):
                    case = course * num_samples + start + s
                    results.logits[case, label] = belief.prior.existence_logit[label] + found.log_odds[s]
                    take_state(found.means, s, results.means[case, label])
                    take_matrix(found.covs, s, results.covs[case, label])
