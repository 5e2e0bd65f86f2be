"""Products of powers of labelled densities, prepared so that their power integrals with another are sums of rows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vedette.densities.batches import DensityBatch
from vedette.densities.checks import offsets_of
from vedette.densities.label_sets import Label
from vedette.errors import InputError
from vedette.internal.text import shown
from vedette.internal.threads import run_chunks
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.kernels.gaussian.information import row_size
from vedette.kernels.gaussian.linalg import LOG_2PI
from vedette.kernels.labelled.power_integrals import Places, PreparedCases, SensorCases, Terms, power_table, write_rows


class SensorPower(NamedTuple):
    """Factor of one sensor in a product: its cases raised to a power."""

    cases: DensityBatch
    power: float  # above 0
    held: Bools  # (num_cases, num_sets) False if the case counts as lacking the set
    floors: Floats  # (num_cases, n) log weights of substitutes for the 1st, ..., n-th, 1st, ... set that a case lacks

    @classmethod
    def whole(cls, cases: DensityBatch, held: Bools) -> "SensorPower":
        """Return the factor of a single sensor, with nothing missing."""
        return cls(cases, 1.0, held, np.zeros((cases.num_cases, 1)))


@dataclass(frozen=True, slots=True, eq=False)
class PowerProducts:
    """A prediction and the cases of some sensors, prepared for the power integrals of any of their products."""

    laid: PreparedCases  # the cases, concatenated over the sensors
    # (num_sets,), (num_members,) log weights of the prediction and of the determinants of its covariances
    log_weights: Floats
    log_dets: Floats
    rows: Floats  # (num_members, row_size) its information rows
    sensors: Ints  # columns of a joint action whose sensors take part
    first_cases: Ints  # the first case of each of these sensors
    num_samples: int  # as in the cases
    num_threads: int  # as in the cases
    state_dim: int  # length of a target's state

    def z(self, actions: Ints, exponents: Sequence[tuple[float, float]], unit_volume: float = 1.0) -> Floats:
        """Z(a, b) of joint actions (num_joint, num_sensors), shape (num_joint, num_samples, num_exponents).

        Raises `InputError` for exponents that are not finite, or of a single density to a power that is not positive.
        """
        pairs = check_exponents(exponents)
        kinds = [pairs[:, 0] == 0.0, (pairs != 0.0).all(axis=1), pairs[:, 1] == 0.0]
        order = np.concatenate([np.flatnonzero(kind) for kind in kinds])
        alone, crossed, own = (pairs[kind] for kind in kinds)
        terms = self._terms(alone, crossed, own, math.log(unit_volume))
        found = np.empty((len(actions), self.num_samples, len(pairs)))
        taken = np.ascontiguousarray(actions[:, self.sensors])

        def work(first: int, last: int) -> None:
            power_table(self.laid, self.first_cases, taken, terms, first, last, found)

        run_chunks(work, len(actions), self.num_threads)
        return found if (np.diff(order) > 0).all() else np.ascontiguousarray(found[:, :, np.argsort(order)])

    def _terms(self, alone: Floats, crossed: Floats, own: Floats, log_unit_volume: float) -> Terms:
        sizes, dim = np.diff(self.laid.set_offsets), self.state_dim
        changing = np.concatenate([alone, crossed])
        weights = _given(changing, self.log_weights) + (changing.sum(axis=1) - 1.0)[:, None] * sizes * log_unit_volume
        weights[: len(alone)] -= 0.5 * dim * np.log(alone[:, 1:]) * sizes
        powers = own[:, :1]
        integrals = 0.5 * ((1.0 - powers) * (dim * LOG_2PI + self.log_dets) - dim * np.log(powers))
        sums = np.concatenate([np.zeros((len(own), 1)), np.cumsum(integrals, axis=1)], axis=1)
        ends = self.laid.set_offsets
        terms = _given(own, self.log_weights) + (powers - 1.0) * sizes * log_unit_volume
        terms = terms + sums[:, ends[1:]] - sums[:, ends[:-1]]
        starts = self.laid.factor_offsets[:-1]
        totals = np.logaddexp.reduceat(terms, starts, axis=1).sum(axis=1) if len(starts) else np.zeros(len(own))
        rows = crossed[:, 0, None, None] * self.rows
        return Terms(changing[:, 1].copy(), crossed[:, 0].copy(), weights, rows, terms, totals, dim)


def _given(pairs: Floats, log_weights: Floats) -> Floats:
    """Return a w_p, where 0 to the power of 0 is 1."""
    powers = pairs[:, :1]
    return np.where(powers == 0.0, 0.0, np.where(powers == 0.0, 1.0, powers) * log_weights)


def check_exponents(exponents: Sequence[tuple[float, float]]) -> Floats:
    """Return exponents (num, 2). Raises `InputError` unless finite pairs, with one positive if the other is 0."""
    try:
        pairs = np.array(exponents, np.float64).reshape(len(exponents), 2)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"exponents: expected pairs of numbers (a, b); got {shown(exponents)}") from None
    fits = np.isfinite(pairs).all(axis=1) & ((pairs != 0.0).all(axis=1) | (pairs.max(axis=1, initial=-np.inf) > 0.0))
    if not fits.all():
        bad = pairs[~fits][0].tolist()
        raise InputError(f"exponents: expected finite numbers, the one above 0 where the other is 0; got {tuple(bad)}")
    return pairs


def precompute_products(
    shares: Sequence[SensorPower], prediction: DensityBatch, sensors: Sequence[int] | None = None
) -> PowerProducts:
    """Prepare products of one case per sensor, for integrals with the prediction on the sets that any sensor has.

    If a case lacks a set, its floor replaces the weight, and the Gaussians are those of the label's moments over the
    sets that the case has. A label that the case lacks altogether is left out there, and the other sensors' powers are
    scaled to sum to one. sensors: their columns in joint actions, all by default. A set that no chosen case has is left
    out of the integrals.

    Raises `NumericalError` for a covariance that is not positive definite.
    """
    known = {place for share in shares for place in share.cases.places}
    chosen = np.array([i for i, place in enumerate(prediction.places) if place in known], np.int64)
    target = _restricted(prediction, chosen)
    references = target.means[0].copy()
    parts = [_prepare(share, target, references) for share in shares]
    own = _prepare(SensorPower.whole(target, np.ones((1, len(target.sets)), np.bool_)), target, references)
    log_weights, held, rows = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    all_held = bool(np.any([part[1].all(axis=0) for part in parts], axis=0).all())
    laid = PreparedCases(target.factor_offsets, target.set_offsets, log_weights, held, all_held, rows)
    columns = np.arange(len(shares)) if sensors is None else np.array(sensors, np.int64)
    first_cases = offsets_of([share.cases.num_cases for share in shares])[:-1].copy()
    log_dets = np.linalg.slogdet(target.covs[0])[1]
    of_all = shares[0].cases
    return PowerProducts(
        laid, own[0][0], log_dets, own[2][0], columns, first_cases, of_all.num_samples, of_all.num_threads,
        prediction.state_dim,
    )  # fmt: skip


def _restricted(cases: DensityBatch, chosen: Ints) -> DensityBatch:
    """Return the cases on some of their sets, without normalisation. Factors without a set are dropped."""
    counts = np.histogram(chosen, cases.factor_offsets)[0] if len(cases.factors) else np.empty(0, np.int64)
    starts = cases.set_offsets
    members = np.array([m for i in chosen.tolist() for m in range(starts[i], starts[i + 1])], np.int64)
    return DensityBatch(
        cases.kind,
        tuple(name for name, count in zip(cases.factors, counts.tolist(), strict=True) if count),
        offsets_of(counts[counts > 0]),
        tuple(cases.sets[i] for i in chosen.tolist()),
        np.ascontiguousarray(cases.log_weights[:, chosen]),
        np.ascontiguousarray(cases.means[:, members]),
        np.ascontiguousarray(cases.covs[:, members]),
    )


def _prepare(share: SensorPower, target: DensityBatch, references: Floats) -> tuple[Floats, Bools, Floats]:
    """Return log weights, masks of held sets, and rows of a sensor's cases on the sets of `target`."""
    cases = share.cases
    own = {place: i for i, place in enumerate(cases.places)}
    places = np.array([own.get(place, -1) for place in target.places], np.int64)
    lacking = np.zeros((cases.num_cases, 1))  # an additional last column for places of -1
    held = np.concatenate([share.held, lacking > 0.0], axis=1)[:, places]
    floors = share.floors[:, np.arange(len(places)) % share.floors.shape[1]]
    weights = np.concatenate([cases.log_weights, lacking], axis=1)[:, places]
    log_weights = share.power * np.where(held, weights, floors)
    rows = np.empty((cases.num_cases, len(references), int(row_size(cases.state_dim))))
    given = SensorCases(cases.log_weights, share.held, cases.means, cases.covs)
    where = _find_members(cases, target, places, references)

    def work(first: int, last: int) -> None:
        write_rows(given, where, float(share.power), first, last, rows)

    run_chunks(work, cases.num_cases, cases.num_threads)
    return np.ascontiguousarray(log_weights), held, rows


def _find_members(cases: DensityBatch, target: DensityBatch, places: Ints, references: Floats) -> Places:
    starts, own_sets = cases.set_offsets, np.repeat(np.arange(len(cases.sets)), np.diff(cases.set_offsets))
    versions: dict[Label, list[int]] = {}
    for m, label in enumerate(label for labels in cases.sets for label in labels):
        versions.setdefault(label, []).append(m)
    members, found = [], []
    for place, labels in zip(places.tolist(), target.sets, strict=True):
        members += list(range(starts[place], starts[place + 1])) if place >= 0 else [-1] * len(labels)
        found += [versions.get(label, []) for label in labels]
    flat = np.array([m for own in found for m in own], np.int64)
    return Places(np.array(members, np.int64), offsets_of([len(own) for own in found]), flat, own_sets, references)
