"""Rewards of joint actions from the table of changes, and the searches that this structure makes cheap."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vedette.control.rewards.base import LinearReward, PowerReward, combined, unit_volume_of
from vedette.control.rewards.labels import cardinality_variance_of_label
from vedette.control.rewards.power import ExpectedLossReward
from vedette.densities import LMB
from vedette.internal.probabilities import log_expit
from vedette.internal.threads import run_chunks
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.gaussian.linalg import LOG_2PI
from vedette.kernels.planning.ascent import Allowed, Cells, Trace, ascend
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.joint_values import alone_values, joint_values, line_values, start_totals
from vedette.kernels.planning.label_values import EXPECTED_LOSS, FUNCTION, POWER_INTEGRALS, Valuation
from vedette.models.arguments import provides

# Maximum number of lines of an ascent: a hundred sweeps of a hundred sensors.
_MOST_LINES = 10_000

# Samples of labels that a thread evaluates, in a few milliseconds, before it checks the clock.
_QUICK = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class AdditiveRewards:
    """Rewards that are made of sums over labels."""

    table: Table  # changes of each label by the scans of each course
    valuation: Valuation  # contribution of a label to the reward
    bases: tuple[Floats, ...]  # for each sensor, the rows of its own belief without scans
    reward: Any  # its `combine` turns the sums into rewards. None: the reward is the sum itself
    cells: Cells  # expected numbers of undetected targets by cell, and the cells that each course sees
    prices: Floats  # (num_courses,) price of each course, in units of the reward
    num_threads: int  # threads that may share the work. The result does not depend on it
    # number of horizons at whose ends labels are evaluated. The labels of each horizon are separate labels, one horizon
    # after the other
    num_horizons: int = 1

    @property
    def num_samples(self) -> int:
        """Number of samples of each reward."""
        return int(self.table.changes.shape[2])

    @property
    def coefficients(self) -> Floats | None:
        """Coefficients of the sums, if the reward is linear in them, or None if it is not known to be linear."""
        if self.reward is None:
            return np.ones(1)
        values = self.reward.coefficients if provides(self.reward, LinearReward) else None
        return None if values is None else np.asarray(values, np.float64)

    def joint(self) -> "AdditiveRewards":
        """Return the rewards of all sensors, fused: this object."""
        return self

    def alone(self, sensor: int) -> "AdditiveRewards":
        """Return the rewards of one sensor alone, compared with the prediction."""
        first, last = self.table.first_courses[sensor : sensor + 2].tolist()
        offsets = self.table.offsets[first : last + 1]
        own = Table(
            np.array([0, last - first]), offsets, self.table.labels, self.table.changes, self.bases[sensor], np.ones(1)
        )
        cells = self.cells._replace(offsets=self.cells.offsets[first : last + 1])
        return replace(self, table=own, bases=(self.bases[sensor],), cells=cells, prices=self.prices[first:last])

    def __call__(self, actions: Ints) -> Floats:
        """Return rewards (num_joint, num_samples) of joint actions (num_joint, num_sensors).

        -1: the sensor does not scan.
        """
        sums = np.empty((len(actions), self.valuation.num, self.num_samples))

        def work(first: int, last: int) -> None:
            joint_values(self.table, self.valuation, actions, first, last, sums)

        quick = max(8, _QUICK // max(1, sums.shape[2] * len(self.table.start)))
        run_chunks(work, len(actions), self.num_threads, first_piece=quick)
        return np.asarray(self.of_sums(sums) + self._other_terms(actions))

    def with_scans(self, chosen: Ints) -> Floats:
        """Return joint rows (num_labels, bernoulli_size, num_samples) with the scans of a joint action (num_sensors,).

        -1: the sensor does not scan.
        """
        table, rows = self.table, start_totals(self.table)
        for s in np.flatnonzero(chosen >= 0).tolist():
            course = table.first_courses[s] + chosen[s]
            entries = slice(table.offsets[course], table.offsets[course + 1])
            rows[table.labels[entries]] += table.powers[s] * table.changes[entries]
        return rows

    def line(self, chosen: Ints, sensor: int) -> Floats:
        """Return rewards (num_courses, num_samples) of all courses of one sensor, given the other sensors' choices."""
        return self._lines(chosen, sensor, sensor + 1)

    def lines(self, chosen: Ints) -> Floats:
        """Return rewards (num_courses, num_samples) of the lines of all sensors through a joint action."""
        return self._lines(chosen, 0, len(chosen))

    def _lines(self, chosen: Ints, first: int, last: int) -> Floats:
        sums = np.empty((len(self.table.offsets) - 1, self.valuation.num, self.num_samples))

        def work(begin: int, end: int) -> None:
            line_values(self.table, self.valuation, chosen, first + begin, first + end, sums)

        run_chunks(work, last - first, self.num_threads, first_piece=8)
        start, stop = self.table.first_courses[[first, last]].tolist()
        rewards = self.of_sums(sums[start:stop])
        if len(self.cells.worth) or self.prices.any():
            for s in range(first, last):
                begin, end = (self.table.first_courses[s : s + 2] - start).tolist()
                joint = np.tile(chosen, (end - begin, 1))
                joint[:, s] = np.arange(end - begin)
                rewards[begin:end] += self._other_terms(joint)
        return rewards

    def each_alone(self) -> Floats:
        """Return rewards (num_courses, num_samples) of all courses of each sensor alone, sensor by sensor."""
        distinct = {id(base): base for base in self.bases}
        bases, places = np.stack(list(distinct.values())), {key: place for place, key in enumerate(distinct)}
        base_indices = np.array([places[id(base)] for base in self.bases])
        sums = np.empty((len(self.table.offsets) - 1, self.valuation.num, self.num_samples))

        def work(first: int, last: int) -> None:
            alone_values(self.table, self.valuation, bases, base_indices, first, last, sums)

        run_chunks(work, len(base_indices), self.num_threads, first_piece=8)
        rewards = self.of_sums(sums)
        if len(self.cells.worth):
            rewards += self._found_alone()[:, np.newaxis]
        return rewards - self.prices[:, np.newaxis]

    def ascend(self, start: Ints, allowed: Allowed) -> tuple[Ints, float, Trace]:
        """Run one compiled ascent, only for rewards that are linear in their sums."""
        coefficients = self.coefficients
        assert coefficients is not None
        return ascend(self.table, self.valuation, coefficients, self.cells, self.prices, allowed, start, _MOST_LINES)

    def of_sums(self, sums: Floats) -> Floats:
        """Return rewards (..., num_samples) of sums over labels (..., num, num_samples), without cells and prices."""
        sums = np.moveaxis(sums, -2, -1)
        return sums[..., 0] if self.reward is None else combined(self.reward, sums)

    def price(self, actions: Ints) -> Floats:
        """Return prices (num_joint,) of joint actions (num_joint, num_sensors). -1: not scanning, at no price."""
        prices = self.prices[np.maximum(actions, 0) + self.table.first_courses[:-1]]
        return np.asarray(np.where(actions >= 0, prices, 0.0).sum(axis=1))

    def _other_terms(self, actions: Ints) -> Floats:
        """Return (num_joint, 1) the terms of the rewards besides sums over labels: undetected targets less prices."""
        search_values = np.array([self.found(joint) for joint in actions]) if len(self.cells.worth) else 0.0
        return np.asarray(search_values - self.price(actions))[:, np.newaxis]

    def _found_alone(self) -> Floats:
        """Return the value (num_courses,) of the undetected targets that each course finds alone."""
        cells = self.cells
        shares = -cells.worth[cells.cells] * np.expm1(cells.log_miss)
        course = np.repeat(np.arange(len(cells.offsets) - 1), np.diff(cells.offsets))
        return np.asarray(np.bincount(course, shares, len(cells.offsets) - 1), np.float64)

    def found(self, chosen: Ints) -> float:
        """Return the value of the undetected targets that a joint action is expected to find."""
        cells, totals = self.cells, np.zeros(len(self.cells.worth))
        for s in np.flatnonzero(chosen >= 0).tolist():
            course = self.table.first_courses[s] + chosen[s]
            entries = slice(cells.offsets[course], cells.offsets[course + 1])
            totals[cells.cells[entries]] += cells.log_miss[entries]
        return value_found(cells.worth, totals)


def value_found(worth: Floats, log_miss: Floats) -> float:
    """Return the value of the undetected targets found in cells (num_cells,). log_miss: log probability of missing one.

    A dot product would depend on the number of threads.
    """
    return float(-(worth * np.expm1(log_miss)).sum())


def valuation_of(reward: Any, prediction: LMB, prior: Floats, undetected: float = 0.0) -> Valuation:
    """Return the valuation of the labels of a prediction of single Gaussians, for a label reward or a power reward.

    prior: (num_labels, bernoulli_size) rows of the prediction. undetected: expected number of undetected targets.
    """
    gaussians, none = prediction.tracks.to_kernel().components, np.zeros((len(prior), 1))
    unused = cardinality_variance_of_label  # only FUNCTION has a function of its own
    loss = Valuation(
        EXPECTED_LOSS, 1, prior, none, np.empty((0, 2)), 0.0, np.empty(0), unused, gaussians.means, gaussians.covs
    )
    if isinstance(reward, ExpectedLossReward):
        covs, cost = prediction.tracks.covs, reward.cutoff**reward.order
        unseen = np.minimum(covs[:, 0, 0] + covs[:, 1, 1], reward.cutoff**2) ** (0.5 * reward.order)
        # Labels that cost less if they are not reported, by odds: a false one costs c^p if no other target is missing.
        hidden = cost - unseen < cost * np.exp(-prior[:, -2] - undetected)
        own = np.where(hidden, cost, unseen)[:, np.newaxis]
        return loss._replace(own=own, params=np.array([reward.cutoff**2, 0.5 * reward.order, 1.0]))
    if provides(reward, PowerReward):
        log_volume = math.log(unit_volume_of(reward, prediction))
        exponents = np.array([[float(a), float(b)] for a, b in reward.exponents])
        own = _of_prediction(prediction, exponents, log_volume, prior[:, -2])
        powers = loss._replace(kind=POWER_INTEGRALS, num=len(exponents), own=own)
        return powers._replace(exponents=exponents, log_volume=log_volume)
    own, params = np.zeros((len(prior), reward.num_terms)), np.ascontiguousarray(reward.params, np.float64)
    return loss._replace(kind=FUNCTION, num=reward.num_terms, own=own, params=params, function=reward.function)


def _of_prediction(prediction: LMB, exponents: Floats, log_volume: float, logits: Floats) -> Floats:
    """Return log(1 - r) times a, (num_labels, num_exponents), or for pairs (a, 0) the whole term."""
    dim = prediction.state_dim
    log_dets = np.linalg.slogdet(prediction.tracks.covs)[1] + dim * LOG_2PI
    terms = np.outer(log_expit(-logits), exponents[:, 0])
    for e, (a, b) in enumerate(exponents.tolist()):
        if b == 0.0 and a != 0.0:
            # log integral N(m, P)^a = -((a - 1) log|2 pi P| + d log a) / 2.
            integral = -0.5 * ((a - 1.0) * log_dets + dim * math.log(a)) if a > 0.0 else np.full(len(logits), np.inf)
            terms[:, e] += np.logaddexp(0.0, a * logits + integral + (a - 1.0) * log_volume)
    return terms
