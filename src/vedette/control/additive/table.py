"""The changes of a decision: the effect of each course's scans on each label in reach, and on each cell."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards, valuation_of
from vedette.control.additive.sensor_groups import SensorGroup, SensorGroups, Task, prepare_groups
from vedette.control.prediction import Prediction
from vedette.control.rewards.base import HasMissedCost
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import LMB, UndetectedIntensity
from vedette.densities.checks import offsets_of
from vedette.errors import InputError
from vedette.filters.inputs import model_errors
from vedette.fusion import LogLinearPool
from vedette.internal.threads import run_chunks
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.ascent import Cells
from vedette.kernels.planning.bernoulli_rows import Table
from vedette.kernels.planning.cells import cells_in_view
from vedette.kernels.planning.expected_information import fill_expected_changes
from vedette.kernels.planning.known_changes import Entries, fill_changes
from vedette.kernels.planning.reach import fill_reach, fill_within
from vedette.models.arguments import provides
from vedette.platforms import Options
from vedette.tracking import State

# A label is out of reach if its detection probability is below this for every sample and for the prediction.
LEAST_DETECTION = 1e-6

# Lower limit: a search never empties a cell completely.
_LEAST_LOG_MISS = float(np.log(1e-12))

# Courses that a thread processes before it checks the clock: with samples, and without.
_SAMPLED, _UNSAMPLED = 16, 512

# Maximum size of the changes in bytes; a larger decision is refused, so that it does not run out of memory.
_MOST_BYTES = 8e9


def lay_out(
    sensors: Sequence[MobileSensor],
    options: Sequence[Options],
    rule: LogLinearPool,
    settings: PlanningSettings,
    reward: Any,
    state: State,
    *,
    rng: np.random.Generator,
) -> tuple[AdditiveRewards, LMB]:
    """Return the rewards at the end of the horizon, and the prediction.

    Each label is followed over every course that reaches it.
    """
    fused: Any = state.fused
    num_threads, undetected, motion = settings.threads(), state.undetected, sensors[0].filter.targets.motion
    with model_errors():
        ahead = Prediction.of(fused, motion, settings.horizon_steps, settings.horizon_period)
        task = Task(sensors, options, settings, state, ahead, sampled=not isinstance(reward, ExpectedLossReward))
        start = prepare_groups(task, rule.missing_existence, rng=rng)
        table = lay_out_changes(start, rule, num_threads, sampled=task.sampled)
    prediction = ahead.end
    valuation = valuation_of(reward, prediction, start.prior, 0.0 if undetected is None else undetected.total)
    cells = no_cells(len(table.offsets) - 1)
    if undetected is not None and (worth := undetected_target_value(reward, settings)) > 0.0:
        cells = cells_of(start, undetected, worth, table.first_courses, prediction.state_dim)
    prices = np.concatenate([each.prices for each in options])
    own = reward if task.sampled else None
    return AdditiveRewards(table, valuation, start.bases, own, cells, prices, num_threads), prediction


def lay_out_changes(start: SensorGroups, rule: LogLinearPool, num_threads: int, *, sampled: bool) -> Table:
    """Return the changes of all sensors' courses, by samples or, without samples, their expectation.

    Raises:
        InputError: the changes would take too much memory.
        ModelError, NumericalError: errors of the models and the filters.
    """
    num_sensors, num_samples, size = len(start.bases), start.num_samples, start.prior.shape[1]
    reached = [_reach(group, num_threads, sampled=sampled) for group in start.groups]
    sizes, first_courses = _sizes(start.groups, reached, num_sensors)
    offsets = offsets_of(sizes)
    if offsets[-1] * num_samples * size * 8 > _MOST_BYTES:
        raise InputError(
            f"decision: expected at most {_MOST_BYTES / 1e9:g} GB of what scans may say; got {offsets[-1]} pairs of an "
            f"action and a target in its reach, x {num_samples} samples; take fewer samples or a shorter reach"
        )
    labels, changes = np.empty(offsets[-1], np.int64), np.empty((int(offsets[-1]), size, num_samples))
    own = np.empty(len(labels), np.int64)
    for group, reach in zip(start.groups, reached, strict=True):
        places = places_of_courses(group, first_courses)
        entries = Entries(offsets[places], offsets[places + 1], own)
        reached_labels, counts = np.nonzero(reach)[1], reach.sum(axis=1)
        at = np.repeat(entries.first - offsets_of(counts)[:-1], counts) + np.arange(len(reached_labels))
        own[at], labels[at] = reached_labels, group.labels[reached_labels]
        work = _filling(group, entries, start, changes, sampled)
        run_chunks(work, len(places), num_threads, first_piece=_SAMPLED if sampled else _UNSAMPLED)
    powers = np.array(rule.powers)
    joint = rule.prior_power * start.prior
    for s, power in enumerate(rule.powers):
        joint = joint + power * start.bases[s]
    table = Table(first_courses, offsets, labels, changes, np.ascontiguousarray(joint), powers)
    return table if sampled else _seen(table)


def _seen(table: Table) -> Table:
    """Return the table without the entries of labels that are certain to be missed."""
    detectable = table.changes[:, -1, 0] < 0.0
    course = np.repeat(np.arange(len(table.offsets) - 1), np.diff(table.offsets))
    offsets = offsets_of(np.bincount(course[detectable], minlength=len(table.offsets) - 1))
    return table._replace(offsets=offsets, labels=table.labels[detectable], changes=table.changes[detectable])


def _reach(group: SensorGroup, num_threads: int, *, sampled: bool) -> Ints:
    """Return (num_courses, num_own): 1 where a course reaches a label, or without samples, where it might."""
    num_courses, belief, decision = int(group.course_offsets[-1]), group.belief, group.decision
    out = np.empty((num_courses, len(group.labels)), np.int64)
    if not sampled:
        fill_within(belief.paths, belief.radii, decision.horizon, group.reach, 0, num_courses, out)
        return out

    def work(first: int, last: int) -> None:
        fill_reach(belief, decision, LEAST_DETECTION, group.reach, first, last, out)

    run_chunks(work, num_courses, num_threads, first_piece=_SAMPLED)
    return out


def _sizes(groups: Sequence[SensorGroup], reached: Sequence[Ints], num_sensors: int) -> tuple[Ints, Ints]:
    """Return the number of entries of each course, sensor by sensor, and the first course of each sensor."""
    own: list[Ints] = [np.empty(0, np.int64)] * num_sensors
    first_courses = np.zeros(num_sensors + 1, np.int64)
    for group, reach in zip(groups, reached, strict=True):
        counts = reach.sum(axis=1)
        for i, s in enumerate(group.members):
            own[s] = counts[group.course_offsets[i] : group.course_offsets[i + 1]]
            first_courses[s + 1] = len(own[s])
    return np.concatenate(own), first_courses.cumsum()


def places_of_courses(group: SensorGroup, first_courses: Ints) -> Ints:
    """Return the index of each course of a group among the courses of all sensors."""
    sizes = np.diff(group.course_offsets)
    starts = first_courses[list(group.members)] - group.course_offsets[:-1]
    return np.asarray(np.repeat(starts, sizes) + np.arange(group.course_offsets[-1]))


def _filling(
    group: SensorGroup, entries: Entries, start: SensorGroups, changes: Floats, sampled: bool
) -> Callable[[int, int], None]:
    if not sampled:
        return lambda first, last: fill_expected_changes(
            group.belief, group.decision, entries, group.rows, LEAST_DETECTION, group.reach, first, last, changes
        )
    references = np.ascontiguousarray(start.references[group.labels])
    return lambda first, last: fill_changes(
        group.belief, group.decision, entries, references, group.rows, first, last, changes
    )


def undetected_target_value(reward: Any, settings: PlanningSettings) -> float:
    """Return the value of finding an undetected target, in units of the reward."""
    if not provides(reward, HasMissedCost):
        return settings.undetected_target_value or 0.0
    cost: float = reward.missed_cost
    return cost * (1.0 if settings.undetected_target_value is None else settings.undetected_target_value)


def no_cells(num_courses: int) -> Cells:
    """Return cells without undetected targets."""
    none = np.empty(0)
    return Cells(np.zeros(num_courses + 1, np.int64), np.empty(0, np.int64), none, none)


def cells_of(
    start: SensorGroups, undetected: UndetectedIntensity, worth: float, first_courses: Ints, state_dim: int
) -> Cells:
    """Return the cells that each course sees, from a grid of undetected targets that are assumed not to move.

    worth: value of finding a target, in units of the reward. first_courses: (num_sensors + 1,) first course of each
    sensor. Raises `ModelError` from the sensor models.
    """
    courses, cells, log_miss = [np.empty(0, np.int64)], [np.empty(0, np.int64)], [np.empty(0)]
    states, weights = undetected.grid.states(state_dim), undetected.grid.node_weights()
    with model_errors():
        for group in start.groups:
            sensor, horizon = group.decision.sensor, group.decision.horizon
            offsets, seen, missed = cells_in_view(
                sensor, horizon.poses, horizon.scans, states, weights, LEAST_DETECTION, group.reach
            )
            courses.append(np.repeat(places_of_courses(group, first_courses), np.diff(offsets)))
            cells.append(seen)
            log_miss.append(np.maximum(missed, _LEAST_LOG_MISS))
    course = np.concatenate(courses)
    order, sizes = np.argsort(course, kind="stable"), np.bincount(course, minlength=int(first_courses[-1]))
    found = np.concatenate(cells)[order], np.concatenate(log_miss)[order]
    return Cells(offsets_of(sizes), *found, worth * undetected.expected)
