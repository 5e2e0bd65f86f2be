"""What targets and sensors contribute to the reward of a joint action, where rewards are made of sums over labels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.densities.checks import offsets_of
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.explained import Reached, ValueParts, fill_value_parts, no_value_parts
from vedette.threads import run_chunks

# Values of labels from which on they are shared between threads.
_MANY = 100_000


class Shares(NamedTuple):
    """How a reward comes about, in its own unit; means over the samples.

    Together with `baseline`, `sensors` add up to the reward, and so do `existence`, `localisation` and `found`.
    """

    baseline: float  # the reward without any scan
    existence: Floats | None  # (num_labels,) what is gained by knowing better whether each target is there ...
    localisation: Floats | None  # (num_labels,) ... and where; None where the reward is not linear in its sums
    found: float  # what is gained by targets that were not found before
    sensors: Floats  # (num_sensors,) mean of what each adds to those before it, and to those after it
    last: Floats  # (num_sensors,) what each adds to all others
    samples: Floats  # (num_samples,) rewards of the choice


def shares_of(additive: AdditiveRewards, chosen: Ints) -> Shares:
    """The shares in the reward of courses (num_sensors,), one a sensor.

    A sensor's share is its Shapley value on two orders, the printed and the reverse one. A target's gain by existence
    is that of the existence after all scans with the density without any; the rest is localisation.
    """
    parts = _value_parts(additive, chosen)
    found = _found(additive, chosen)
    base = np.broadcast_to(parts.unseen.sum(axis=0)[:, np.newaxis], parts.ahead.shape[1:])
    whole = parts.labels.sum(axis=0)
    ahead = _means(additive, base + np.cumsum(parts.ahead, axis=0)) + found.ahead
    behind = (_means(additive, base + np.cumsum(parts.behind[::-1], axis=0)) + found.behind[::-1])[::-1]
    total, samples = float(found.ahead[-1]), additive.of_sums(whole) + found.ahead[-1]
    start, end = float(_means(additive, base)), float(samples.mean())
    first, last = np.diff(ahead, prepend=start), -np.diff(behind, append=start)
    without = _means(additive, whole - parts.last) + found.without
    coefficients = additive.coefficients
    existence = localisation = None
    if coefficients is not None:
        existence = (parts.existence.mean(axis=2) - parts.unseen) @ coefficients
        localisation = (parts.labels.mean(axis=2) - parts.unseen) @ coefficients - existence
        existence, localisation = (own.reshape(additive.looks, -1).sum(axis=0) for own in (existence, localisation))
    return Shares(start, existence, localisation, total, 0.5 * (first + last), end - without, samples)


def _value_parts(additive: AdditiveRewards, chosen: Ints) -> ValueParts:
    reached = _reached(additive, chosen)
    table, valuation, num_samples = additive.table, additive.valuation, additive.num_samples
    parts = no_value_parts(len(table.start), len(chosen), num_samples, valuation.num)

    def work(first: int, last: int) -> None:
        fill_value_parts(table, valuation, reached, first, last, parts)

    if len(reached.entries) * num_samples < _MANY:
        work(0, num_samples)
    else:
        run_chunks(work, num_samples, additive.num_threads)
    return parts


def _reached(additive: AdditiveRewards, chosen: Ints) -> Reached:
    table = additive.table
    courses = table.first_courses[:-1] + chosen
    spans = [np.arange(table.offsets[course], table.offsets[course + 1]) for course in courses.tolist()]
    entries = np.concatenate([np.empty(0, np.int64), *spans])
    sensors = np.repeat(np.arange(len(spans)), [len(span) for span in spans])
    labels = table.labels[entries]
    order = np.argsort(labels, kind="stable")
    return Reached(offsets_of(np.bincount(labels, minlength=len(table.start))), sensors[order], entries[order])


class _Found(NamedTuple):
    """What is found by the first sensors, by the last ones, and by all but one; each (num_sensors,)."""

    ahead: Floats
    behind: Floats
    without: Floats


def _found(additive: AdditiveRewards, chosen: Ints) -> _Found:
    cells, num_sensors = additive.cells, len(chosen)
    if len(cells.worth) == 0:
        return _Found(*np.zeros((3, num_sensors)))
    missed = np.zeros((num_sensors, len(cells.worth)))
    for s, course in enumerate((additive.table.first_courses[:-1] + chosen).tolist()):
        entries = slice(cells.offsets[course], cells.offsets[course + 1])
        missed[s, cells.cells[entries]] = cells.log_miss[entries]
    none = np.zeros((1, len(cells.worth)))
    ahead = np.concatenate([none, np.cumsum(missed, axis=0)])
    behind = np.concatenate([np.cumsum(missed[::-1], axis=0)[::-1], none])
    return _Found(*(-np.expm1(each) @ cells.worth for each in (ahead[1:], behind[:-1], ahead[:-1] + behind[1:])))


def _means(additive: AdditiveRewards, sums: Floats) -> Floats:
    """Mean rewards (...) of sums (..., num, num_samples)."""
    return np.asarray(additive.of_sums(sums).mean(axis=-1))
