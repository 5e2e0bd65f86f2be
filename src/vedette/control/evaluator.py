"""The one evaluator behind all planners: expected rewards of actions, and how far ahead they are taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.additive.table import lay_out
from vedette.control.cases import CaseRewards, SampleRewards
from vedette.control.priors import predicted
from vedette.control.rewards.base import LabelReward, PowerReward, Reward
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import Belief, MobileSensor, PlanningSettings
from vedette.densities import LMB
from vedette.densities.checks import offsets_of
from vedette.fusion import Fusion, LinearRule
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.ascent import Cells
from vedette.models.functions import numbers_at
from vedette.platforms import Options
from vedette.platforms.camera import line_of_sight
from vedette.tracking import State


@dataclass(frozen=True, slots=True, eq=False)
class Evaluator:
    """Everything that the rewards of one decision depend on; what takes long is done once, when it is prepared.

    Attributes:
        settings: as in the planners.
        options: for each sensor, its actions in printed order and the different courses that they lead to, which are
            what is evaluated.
        prediction: the fused density predicted to the horizon, one Gaussian a track.
        source: which rewards come from: the sensors' pseudo-posteriors, or sums over labels.
        additive: the sums over labels that rewards are made of; None where they are not: then there are no lines or
            bounds.
        counts: how much of each thing has been evaluated so far.
        notes: what a reader of the decision must know, in the order in which it came up (keys; no values).
        horizons: further ones, beyond that of the settings.
    """

    settings: PlanningSettings
    options: tuple[Options, ...]
    prediction: Belief
    source: CaseRewards | AdditiveRewards
    additive: AdditiveRewards | None
    counts: dict[str, int]
    notes: dict[str, None] = field(default_factory=dict)
    horizons: tuple[PlanningSettings, ...] = ()

    @classmethod
    def of_cases(
        cls,
        sensors: Sequence[MobileSensor],
        options: Sequence[Options],
        fusion: Fusion,
        settings: PlanningSettings,
        reward: Reward | PowerReward | LabelReward,
        state: State,
        *,
        rng: np.random.Generator,
    ) -> Evaluator:
        """By the sensors' own filters; raises as `JointPlanner.plan`."""
        motion = sensors[0].filter.targets.motion
        prediction: Any = predicted(state.fused, motion, settings.horizon_steps, settings.horizon_period)
        cases = CaseRewards.prepare(sensors, options, fusion, settings, reward, state, prediction, rng=rng)
        return cls(settings, tuple(options), prediction, cases, None, cases.counts, cases.notes)

    @classmethod
    def of_sums(
        cls,
        sensors: Sequence[MobileSensor],
        options: Sequence[Options],
        rule: LinearRule,
        settings: PlanningSettings,
        reward: Any,
        state: State,
        *,
        horizons: tuple[PlanningSettings, ...] | None = (),
        rng: np.random.Generator,
    ) -> Evaluator:
        """By sums over labels, each followed over every course that reaches it; beliefs are LMBs.

        horizons: further ones, at whose ends the expected loss is taken as well; None: those that are due
        (`vedette.control.evaluator.look_on`). Raises as `JointPlanner.plan`.
        """
        motion = sensors[0].filter.targets.motion
        prediction: Any = predicted(state.fused, motion, settings.horizon_steps, settings.horizon_period)
        found = [lay_out(sensors, options, rule, settings, reward, state, prediction, rng=rng)]
        if horizons is None:
            due = isinstance(reward, ExpectedLossReward)
            horizons = look_on(sensors, options, prediction, settings) if due else ()
        for own in horizons:
            later = [continued(each, settings.horizon_times(), own.horizon_times()) for each in options]
            ahead = predicted(state.fused, motion, own.horizon_steps, own.horizon_period)
            found.append(lay_out(sensors, later, rule, own, reward, state, ahead, rng=rng))
        counts = {"filter_steps": 0, "rewards": 0}
        for each, own in zip(found, (settings, *horizons), strict=True):
            counts["filter_steps"] += len(each.table.labels) * each.num_samples * own.horizon_steps
        source = at_all(found) if horizons else found[0]
        return cls(settings, tuple(options), prediction, source, source, counts, horizons=horizons)

    def joint_shape(self) -> tuple[int, ...]:
        """Number of different courses of each sensor."""
        return tuple([len(own.courses) for own in self.options])

    def joint(self) -> SampleRewards:
        """The function that gives (num_joint, num_samples) rewards of joint actions (num_joint, num_sensors).

        Their actions are numbers of different courses. NaN, or a `NumericalError`, where a reward is not finite.
        """
        return self._counted(self.source.joint())

    def alone(self, sensor: int) -> SampleRewards:
        """The same of one sensor's own density, actions (num, 1)."""
        return self._counted(self.source.alone(sensor))

    def _counted(self, rewards: SampleRewards) -> SampleRewards:
        if self.additive is None:
            return rewards

        def evaluate(actions: Ints) -> Floats:
            found = rewards(actions)
            self.counts["rewards"] += found.size
            return found

        return evaluate


# Targets that exist with less probability draw no sensor from afar.
_LEAST_EXISTENCE = 0.1
# A sensor goes so much longer than it takes to its target, to see it for a while.
_STAY = 1.25
# Where it is asked how far a sensor sees, m, and in how many directions.
_DISTANCES, _DIRECTIONS = np.geomspace(1.0, 1e6, 121), 8
# Pseudo-updates on the way. A step is no longer than a sensor sees, so that it does not pass a target unseen.
_LEAST_STEPS, _MOST_STEPS = 4, 12


def look_on(
    sensors: Sequence[MobileSensor], options: Sequence[Options], prediction: LMB, settings: PlanningSettings
) -> tuple[PlanningSettings, ...]:
    """The settings of further horizons, half way and at the end; none where all see what there is to see.

    Within the horizon, a sensor that sees 250 m and goes 20 m has nothing to gain from a target 300 m off, and of
    courses worth the same the first is taken. So all sensors are taken to go on as they do, until each may have come to
    a target and each target may be reached by one of them, and the loss is the mean of those at all these times.

    prediction: at the end of the horizon.
    """
    horizon = settings.horizon_steps * settings.horizon_period
    places = prediction.tracks.means[prediction.existence >= _LEAST_EXISTENCE, :2]
    speeds = np.array([_speed(own, horizon) for own in options])
    if len(places) == 0 or not (speeds > 0.0).all():
        return ()
    reaches = np.array([_sight(sensor, own.pose) for sensor, own in zip(sensors, options, strict=True)])
    ends = [own.courses[:, -1, :2] for own in options]
    gaps = np.stack([np.hypot(*(own[:, np.newaxis] - places).transpose(2, 0, 1)).min(axis=0) for own in ends])
    seconds = np.maximum(gaps - reaches[:, np.newaxis], 0.0) / speeds[:, np.newaxis]
    beyond = _STAY * max(float(seconds.min(axis=0).max()), float(seconds.min(axis=1).max()))
    if beyond == 0.0:
        return ()
    rate = float((speeds / reaches).max())
    total = min(horizon + beyond, max(_MOST_STEPS / rate, 2.0 * horizon))
    num = min(max(_LEAST_STEPS, math.ceil(total * rate)), _MOST_STEPS)
    return tuple(replace(settings, horizon_steps=steps, horizon_period=total / num) for steps in (num // 2, num))


def continued(own: Options, horizon: Floats, times: Floats) -> Options:
    """The options with courses (num_courses, num_times, pose_dim) at other times, s, from now on.

    horizon: (num_steps,) s of the poses that there are. Between them a sensor goes straight; after the last it goes on
    by as much as it went over the whole horizon, again and again, and what else its pose has stays.
    """
    start = np.broadcast_to(own.pose, (len(own.courses), 1, len(own.pose)))
    known = np.concatenate([start, own.courses], axis=1)
    ends = np.concatenate([[0.0], horizon])
    rounds = np.maximum(np.ceil(times / ends[-1] - 1e-9) - 1.0, 0.0)
    within = times - rounds * ends[-1]
    after = np.searchsorted(ends, within - 1e-9).clip(1, len(horizon))
    share = ((within - ends[after - 1]) / (ends[after] - ends[after - 1]))[:, np.newaxis]
    courses = np.where(rounds[:, np.newaxis] > 0.0, known[:, -1:], known[:, after])
    moved = known[:, -1:, :2] - known[:, :1, :2]
    straight = known[:, after - 1, :2] * (1.0 - share) + known[:, after, :2] * share
    courses[:, :, :2] = straight + rounds[:, np.newaxis] * moved
    return own._replace(courses=np.ascontiguousarray(courses))


def at_all(horizons: Sequence[AdditiveRewards]) -> AdditiveRewards:
    """The mean of expected losses at several times, which are as of so many labels more; cells likewise."""
    first, num = horizons[0], len(horizons)
    order, offsets = _in_turn([own.table.offsets for own in horizons])
    num_labels = len(first.table.start)
    labels = np.concatenate([own.table.labels + k * num_labels for k, own in enumerate(horizons)])
    changes = np.concatenate([own.table.changes for own in horizons])
    start = np.concatenate([own.table.start for own in horizons])
    table = first.table._replace(offsets=offsets, labels=labels[order], changes=changes[order], start=start)
    several = [own.valuation for own in horizons]
    valuation = first.valuation._replace(
        params=first.valuation.params * np.array([1.0, 1.0, 1.0 / num]),
        prior=np.concatenate([own.prior for own in several]),
        own=np.concatenate([own.own for own in several]),
        references=np.concatenate([own.references for own in several]),
        covs=np.concatenate([own.covs for own in several]),
    )
    of_sensors = list(zip(*(own.bases for own in horizons), strict=True))
    # Sensors that share their rows go on sharing them.
    distinct = {tuple(map(id, each)): each for each in of_sensors}
    joined = {key: np.concatenate(each) for key, each in distinct.items()}
    bases = tuple(joined[tuple(map(id, each))] for each in of_sensors)
    return replace(first, table=table, valuation=valuation, bases=bases, cells=_cells(horizons), num_horizons=num)


def _cells(horizons: Sequence[AdditiveRewards]) -> Cells:
    several = [own.cells for own in horizons]
    order, offsets = _in_turn([own.offsets for own in several])
    num_cells = len(several[0].worth)
    cells = np.concatenate([own.cells + k * num_cells for k, own in enumerate(several)])
    log_miss = np.concatenate([own.log_miss for own in several])
    return Cells(offsets, cells[order], log_miss[order], np.concatenate([own.worth for own in several]) / len(horizons))


def _in_turn(offsets: Sequence[Ints]) -> tuple[Ints, Ints]:
    """The order in which entries that stand one list after the other go course by course, and their offsets."""
    counts = np.stack([np.diff(own) for own in offsets])
    num_lists, num_courses = counts.shape
    lists = np.repeat(np.tile(np.arange(num_courses), num_lists), counts.ravel())
    return np.argsort(lists, kind="stable"), offsets_of(counts.sum(axis=0))


def _sight(sensor: MobileSensor, pose: Floats) -> float:
    """m, the distance up to which it detects at least half as well as it does anywhere, in the best direction."""
    model, dim = sensor.filter.sensor.detection, sensor.filter.targets.state_dim
    states = np.zeros((len(_DISTANCES) * _DIRECTIONS, dim))
    angles = line_of_sight(pose) + 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    states[:, :2] = pose[:2] + (_DISTANCES[:, np.newaxis, np.newaxis] * around).reshape(-1, 2)
    chances = numbers_at(model.function, states, pose, model.params).reshape(-1, _DIRECTIONS).max(axis=1)
    return float(_DISTANCES[np.flatnonzero(chances >= 0.5 * chances.max())[-1]])


def _speed(own: Options, horizon: float) -> float:
    """m/s of the course that goes farthest."""
    offsets = own.courses[:, -1, :2] - own.pose[:2]
    return float(np.hypot(offsets[:, 0], offsets[:, 1]).max()) / horizon
