"""The one evaluator behind all planners: expected rewards of actions, and an account of what they took."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vedette.control.additive.look_on import at_all, continued, look_on
from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.additive.table import lay_out
from vedette.control.cases import CaseRewards, SampleRewards
from vedette.control.inputs import Belief
from vedette.control.priors import predicted
from vedette.control.rewards.base import LabelReward, PowerReward, Reward
from vedette.control.rewards.power import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.filters import shared_targets
from vedette.fusion import Fusion, LinearRule
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Options
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
        counts: how much of each thing has been evaluated so far.
        notes: what a reader of the decision must know, in the order in which it came up (keys; no values).
        horizons: further ones, beyond that of the settings.
    """

    settings: PlanningSettings
    options: tuple[Options, ...]
    prediction: Belief
    source: CaseRewards | AdditiveRewards
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
        prediction = _prediction(sensors, state, settings)
        cases = CaseRewards.prepare(sensors, options, fusion, settings, reward, state, prediction, rng=rng)
        return cls(settings, tuple(options), prediction, cases, cases.counts, cases.notes)

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
        (`vedette.control.additive.look_on`). Raises as `JointPlanner.plan`.
        """
        prediction = _prediction(sensors, state, settings)
        found = [lay_out(sensors, options, rule, settings, reward, state, prediction, rng=rng)]
        if horizons is None:
            due = isinstance(reward, ExpectedLossReward)
            horizons = look_on(sensors, options, prediction, settings) if due else ()
        for own in horizons:
            later = [continued(each, settings.horizon_times(), own.horizon_times()) for each in options]
            ahead = _prediction(sensors, state, own)
            found.append(lay_out(sensors, later, rule, own, reward, state, ahead, rng=rng))
        steps = [len(each.table.labels) * each.num_samples for each in found]
        ends = [own.horizon_steps for own in (settings, *horizons)]
        counts = {"filter_steps": int(np.dot(steps, ends)), "rewards": 0}
        source = at_all(found) if horizons else found[0]
        return cls(settings, tuple(options), prediction, source, counts, horizons=horizons)

    @property
    def additive(self) -> AdditiveRewards | None:
        """The sums over labels that rewards are made of; None where they are not: then there are no lines or bounds."""
        return self.source.additive

    def joint_shape(self) -> tuple[int, ...]:
        """Number of different courses of each sensor."""
        return tuple(len(own.courses) for own in self.options)

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


def _prediction(sensors: Sequence[MobileSensor], state: State, settings: PlanningSettings) -> Any:
    motion = shared_targets([sensor.filter for sensor in sensors]).motion
    return predicted(state.fused, motion, settings.horizon_steps, settings.horizon_period)
