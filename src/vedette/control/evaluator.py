"""The evaluator of all planners: expected rewards of actions, and the horizons that they cover."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.additive.table import lay_out
from vedette.control.constraints.paths import VisibilityGraph, visibility_graph
from vedette.control.cost_to_go import CostToGo, attracting_targets
from vedette.control.prediction import Prediction, predicted
from vedette.control.pseudo_posterior_rewards import PseudoPosteriorRewards, SampleRewards
from vedette.control.rewards.base import LabelReward, PowerReward, Reward
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import Belief, MobileSensor, PlanningSettings
from vedette.densities.checks import offsets_of
from vedette.densities.tracks import places_of
from vedette.filters.inputs import model_errors
from vedette.fusion import Fusion, LogLinearPool
from vedette.kernels.base.types import Floats, Ints
from vedette.kernels.planning.ascent import Cells
from vedette.platforms import Options
from vedette.tracking import State


@dataclass(frozen=True, slots=True, eq=False)
class Evaluator:
    """Expected rewards of the actions of one decision; expensive parts are computed once, when it is made.

    Attributes:
        settings: as in the planners.
        options: for each sensor, its actions in printed order and the distinct courses that they lead to, which are
            evaluated.
        prediction: the fused density predicted to the horizon, one Gaussian per track.
        source: source of the rewards: the sensors' pseudo-posteriors, or sums over labels.
        additive: the sums over labels that rewards are made of; None if they are not, and then there are no lines or
            bounds.
        counts: numbers of filter steps, fusions and rewards evaluated so far.
        notes: notes for readers of the decision, in order of occurrence (keys; values are unused).
        horizons: further horizons, beyond that of the settings.
    """

    settings: PlanningSettings
    options: tuple[Options, ...]
    prediction: Belief
    source: PseudoPosteriorRewards | AdditiveRewards
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
    ) -> "Evaluator":
        """Return an evaluator by the sensors' own filters; raises as `JointPlanner.plan`."""
        motion = sensors[0].filter.targets.motion
        prediction: Any = predicted(state.fused, motion, settings.horizon_steps, settings.horizon_period)
        cases = PseudoPosteriorRewards.prepare(sensors, options, fusion, settings, reward, state, prediction, rng=rng)
        return cls(settings, tuple(options), prediction, cases, None, cases.counts, cases.notes)

    @classmethod
    def of_sums(
        cls,
        sensors: Sequence[MobileSensor],
        options: Sequence[Options],
        rule: LogLinearPool,
        settings: PlanningSettings,
        reward: Any,
        state: State,
        *,
        horizons: tuple[PlanningSettings, ...] | None = (),
        graph: VisibilityGraph | None = None,
        rng: np.random.Generator,
    ) -> "Evaluator":
        """Return an evaluator by sums over labels, each followed over every course that reaches it; beliefs are LMBs.

        horizons: further horizons at whose ends the expected loss is evaluated as well; None: those that are needed
        (`vedette.control.cost_to_go.CostToGo.horizons`). graph: of the zones that constraints forbid, for
        paths beyond the horizon; None: there are none. Raises as `JointPlanner.plan`.
        """
        first, prediction = lay_out(sensors, options, rule, settings, reward, state, rng=rng)
        rewards, notes = [first], dict[str, None]()
        if isinstance(reward, ExpectedLossReward) and horizons != ():
            zones = graph or visibility_graph()
            to_go = CostToGo.of(sensors, options, *attracting_targets(prediction), zones, state.undetected)
            horizons, notes = to_go.horizons(settings) if horizons is None else horizons, dict.fromkeys(to_go.notes())
        horizons = horizons or ()
        if horizons:
            motion, times = sensors[0].filter.targets.motion, [own.horizon_times() for own in horizons]
            with model_errors():
                ahead = [Prediction.of(state.fused, motion, own.horizon_steps, own.horizon_period) for own in horizons]
            paths = [own.paths.means[places_of(to_go.labels, own.end.tracks.labels), :, :2] for own in ahead]
            later = to_go.continued(settings.horizon_times(), np.concatenate(times), np.concatenate(paths, axis=1))
            for own, end in zip(horizons, np.cumsum([len(each) for each in times]).tolist(), strict=True):
                part = [each.at(slice(end - own.horizon_steps, end)) for each in later]
                rewards.append(lay_out(sensors, part, rule, own, reward, state, rng=rng)[0])
        counts = {"filter_steps": 0, "rewards": 0}
        for each, own in zip(rewards, (settings, *horizons), strict=True):
            counts["filter_steps"] += len(each.table.labels) * each.num_samples * own.horizon_steps
        source = mean_over_horizons(rewards) if horizons else rewards[0]
        return cls(settings, tuple(options), prediction, source, source, counts, notes, horizons=horizons)

    def joint_shape(self) -> tuple[int, ...]:
        """Number of distinct courses of each sensor."""
        return tuple([len(own.courses) for own in self.options])

    def joint(self) -> SampleRewards:
        """Return a function from joint actions (num_joint, num_sensors) to rewards (num_joint, num_samples).

        Actions are indices of distinct courses. A reward that is not finite is NaN, or raises `NumericalError`.
        """
        return self._counted(self.source.joint())

    def alone(self, sensor: int, others: Sequence[int] | None = None) -> SampleRewards:
        """Return the same function for one sensor's actions (num, 1).

        others: (num_sensors,) courses that the other sensors are assumed to take; None: they are absent, and the
        rewards are those of the sensor's own density.
        """
        if others is None:
            return self._counted(self.source.alone(sensor))
        joint, assumed = self.joint(), np.array(others, np.int64)

        def evaluate(actions: Ints) -> Floats:
            rows = np.tile(assumed, (len(actions), 1))
            rows[:, sensor] = actions[:, 0]
            return joint(rows)

        return evaluate

    def _counted(self, rewards: SampleRewards) -> SampleRewards:
        if self.additive is None:
            return rewards

        def evaluate(actions: Ints) -> Floats:
            values = rewards(actions)
            self.counts["rewards"] += values.size
            return values

        return evaluate


def mean_over_horizons(horizons: Sequence[AdditiveRewards]) -> AdditiveRewards:
    """Return the mean of expected losses at several times, as one table with the labels and cells of each time."""
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
    # Sensors that share rows continue to share them.
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
    """Return the order that sorts concatenated lists of entries by course, and the offsets of the courses."""
    counts = np.stack([np.diff(own) for own in offsets])
    num_lists, num_courses = counts.shape
    lists = np.repeat(np.tile(np.arange(num_courses), num_lists), counts.ravel())
    return np.argsort(lists, kind="stable"), offsets_of(counts.sum(axis=0))
