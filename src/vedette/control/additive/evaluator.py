"""The evaluator of decisions that are sums over labels: for LMB beliefs, with known association."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from vedette.control.additive.look_on import at_all, continued, look_on
from vedette.control.additive.rewards import AdditiveRewards
from vedette.control.additive.situation import Samples, Sums, starts_of
from vedette.control.additive.table import lay_out_changes
from vedette.control.additive.undetected import cells_of, no_cells
from vedette.control.additive.valuations import valuation_of
from vedette.control.priors import predicted
from vedette.control.rewards.loss import ExpectedLossReward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities import LMB
from vedette.filters import shared_targets
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Options

SampleRewards: TypeAlias = Callable[[Ints], Floats]


@dataclass(frozen=True, slots=True, eq=False)
class AdditiveEvaluator:
    """Everything that the rewards of one decision depend on; the changes are computed once, in `prepare`.

    Attributes:
        sensors, settings: as in the planners.
        options: for each sensor, its actions in printed order and the different courses that they lead to.
        prediction: the fused density at the end of the horizon, of one Gaussian a label.
        additive: the rewards of joint actions.
        counts: how many filter steps and label values have been evaluated so far.
        notes: what a reader of the decision must know, in the order in which it came up (keys; no values).
        looks: horizons beyond that of the settings.
    """

    sensors: tuple[MobileSensor, ...]
    settings: PlanningSettings
    options: tuple[Options, ...]
    prediction: LMB
    additive: AdditiveRewards
    counts: dict[str, int] = field(default_factory=dict)
    notes: dict[str, None] = field(default_factory=dict)
    looks: tuple[PlanningSettings, ...] = ()

    @classmethod
    def prepare(
        cls,
        sensors: Sequence[MobileSensor],
        options: Sequence[Options],
        sums: Sums,
        settings: PlanningSettings,
        reward: Any,
        *,
        looks: tuple[PlanningSettings, ...] | None = (),
        rng: np.random.Generator,
    ) -> AdditiveEvaluator:
        """Draw the samples, predict, and follow every label over every course that reaches it.

        looks: further horizons, at whose ends the expected loss is taken as well; None: those that are due
        (`vedette.control.additive.look_on`). Raises as `JointPlanner.plan`.
        """
        lay_out = partial(cls._lay_out, tuple(sensors), sums, reward, rng=rng)
        evaluator = lay_out(tuple(options), settings)
        if looks is None:
            due = isinstance(reward, ExpectedLossReward)
            looks = look_on(sensors, options, evaluator.prediction, settings) if due else ()
        if not looks:
            return evaluator
        horizon, counts = settings.horizon_times(), dict(evaluator.counts)
        found = [evaluator.additive]
        for own in looks:
            later = lay_out(tuple(continued(each, horizon, own.horizon_times()) for each in options), own)
            counts["filter_steps"] += later.counts["filter_steps"]
            found.append(later.additive)
        return replace(evaluator, additive=at_all(found), counts=counts, looks=looks)

    @classmethod
    def _lay_out(
        cls,
        sensors: tuple[MobileSensor, ...],
        sums: Sums,
        reward: Any,
        options: tuple[Options, ...],
        settings: PlanningSettings,
        *,
        rng: np.random.Generator,
    ) -> AdditiveEvaluator:
        """Up to the end of the horizon."""
        rule, fused, undetected = sums.rule, sums.fused, sums.undetected
        sampled = not isinstance(reward, ExpectedLossReward)
        motion = shared_targets([sensor.filter for sensor in sensors]).motion
        prediction = predicted(fused, motion, settings.horizon_steps, settings.horizon_period)
        assert isinstance(prediction, LMB)
        samples = Samples.draw(fused, sensors, settings, rng=rng) if sampled else Samples.none(fused, settings)
        start = starts_of(
            prediction,
            sums.local,
            sensors,
            [own.courses for own in options],
            samples,
            settings,
            missing_existence=rule.missing_existence,
            time=sums.time,
            detection_at=None if sampled else "mean",
            rng=rng,
        )
        num_samples = samples.targets.shape[1]
        table = lay_out_changes(start, rule, num_samples, settings.threads(), sampled=sampled)
        valuation = valuation_of(reward, prediction, start.prior)
        if undetected is None or settings.undetected_worth == 0.0:
            cells = no_cells(len(table.offsets) - 1)
        else:
            cells = cells_of(start, undetected, settings.undetected_worth, table.first_courses, fused.state_dim)
        additive = AdditiveRewards(
            table,
            valuation,
            start.bases,
            reward if sampled else None,
            cells,
            settings.threads(),
        )
        counts = {"filter_steps": len(table.labels) * num_samples * settings.horizon_steps, "rewards": 0}
        return cls(sensors, settings, options, prediction, additive, counts)

    def joint_shape(self) -> tuple[int, ...]:
        """Number of different courses of each sensor."""
        return tuple(len(own.courses) for own in self.options)

    def joint(self) -> SampleRewards:
        """The function that gives (num_joint, num_samples) rewards of joint actions (num_joint, num_sensors).

        Their actions are numbers of different courses. NaN where a sample's reward is no number.
        """
        return self._counted(self.additive)

    def alone(self, sensor: int) -> SampleRewards:
        """The same of one sensor's own density, actions (num, 1)."""
        return self._counted(self.additive.alone(sensor))

    def _counted(self, rewards: AdditiveRewards) -> SampleRewards:
        def evaluate(actions: Ints) -> Floats:
            found = rewards(actions)
            self.counts["rewards"] += found.size
            return found

        return evaluate

    def account(self) -> tuple[dict[str, int], tuple[str, ...]]:
        """Counts and notes so far, as a plan holds them."""
        return dict(self.counts), tuple(self.notes)
