"""The one evaluator behind all planners: expected rewards of actions, from the same pseudo-updates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from vedette.control.inputs import Belief
from vedette.control.laid_rewards import lay_out_rewards, warn_slow
from vedette.control.plain import PlainRewards
from vedette.control.priors import predicted
from vedette.control.pseudo import draw_futures, pseudo_posteriors
from vedette.control.rewards.base import LabelReward, PowerReward, Reward
from vedette.control.search import all_joint_actions
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.densities.cases import LabelledCases
from vedette.errors import NumericalError
from vedette.filters import shared_targets
from vedette.fusion import Fusion, Views
from vedette.kernels.base.types import Floats, Ints
from vedette.platforms import Options
from vedette.tracking import State

SampleRewards: TypeAlias = Callable[[Ints], Floats]


@dataclass(frozen=True, slots=True, eq=False)
class Evaluator:
    """Everything that the rewards of one decision depend on; the pseudo-updates are run once, in `prepare`.

    Attributes:
        sensors, fusion, settings, reward: as in the planners.
        options: for each sensor, its actions in printed order and the different courses that they lead to, which are
            what is evaluated.
        prediction: the fused density predicted to the horizon, one Gaussian a track.
        posteriors: the pseudo-posteriors of each sensor.
        looks: whether each sensor scans within the horizon.
        counts: how many filter steps, fusions and divergences have been evaluated so far.
        notes: what a reader of the decision must know, in the order in which it came up (keys; no values).
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion
    settings: PlanningSettings
    reward: Reward | PowerReward | LabelReward
    options: tuple[Options, ...]
    prediction: Belief
    posteriors: tuple[LabelledCases, ...]
    looks: tuple[bool, ...]
    counts: dict[str, int] = field(default_factory=dict)
    notes: dict[str, None] = field(default_factory=dict)

    @classmethod
    def prepare(
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
        """Draw the samples, predict, and run the pseudo-updates of every sensor (paper section III-B, steps 1 to 4).

        Raises as `JointPlanner.plan`.
        """
        targets = shared_targets([sensor.filter for sensor in sensors])
        prediction = predicted(state.fused, targets.motion, settings.horizon_steps, settings.horizon_period)
        labels, futures = draw_futures(state.fused, sensors, settings, rng=rng)
        scans = tuple(sensor.scans(state.time, settings) for sensor in sensors)
        posteriors = tuple(
            pseudo_posteriors(belief, sensor, own.courses, labels, future, settings, when)
            for belief, sensor, own, future, when in zip(state.local, sensors, options, futures, scans, strict=True)
        )
        steps = sum(len(own.courses) for own in options) * settings.num_samples * settings.horizon_steps
        counts = {"filter_steps": steps, "fusions": 0, "divergences": 0}
        looks = tuple(bool(own.any()) for own in scans)
        return cls(tuple(sensors), fusion, settings, reward, tuple(options), prediction, posteriors, looks, counts)

    def joint_shape(self) -> tuple[int, ...]:
        """Number of different courses of each sensor."""
        return tuple(len(own.courses) for own in self.options)

    def joint(self) -> SampleRewards:
        """Of all sensors, fused: the function that gives (num_joint, num_samples) rewards; see `rewards`."""
        return self.rewards(range(len(self.sensors)), self.fusion)

    def alone(self, sensor: int) -> SampleRewards:
        """Of one sensor's own density, actions (num, 1)."""
        return self.rewards((sensor,), None)

    def rewards(self, which: Sequence[int], fusion: Fusion | None) -> SampleRewards:
        """The function that gives (num_joint, num_samples) rewards of joint actions (num_joint, num of `which`).

        which: the sensors that act. Their actions are numbers of different courses. fusion: None for a single sensor,
        whose own density is then compared with the prediction. The function raises `NumericalError` where a reward is
        not finite, which names the action and the sample.
        """
        compute = self._compute([self.posteriors[s] for s in which], fusion)

        def evaluate(actions: Ints) -> Floats:
            rewards = compute(actions)
            self.counts["divergences"] += rewards.size
            self.counts["fusions"] += rewards.size if fusion is not None else 0
            self._check_finite(which, actions, rewards)
            return rewards

        return evaluate

    def _compute(self, posteriors: Sequence[LabelledCases], fusion: Fusion | None) -> SampleRewards:
        laid = lay_out_rewards(posteriors, self.prediction, fusion, self.reward)
        if not isinstance(laid, str):
            return laid
        self.notes[f"rewards were computed one by one: {laid}"] = None
        warn_slow(laid)
        return PlainRewards(posteriors, self.prediction, fusion, self.reward, self.settings.num_samples, self.views)

    def views(self, chosen: Sequence[int]) -> Views:
        """What the sensors could see at the end of chosen courses, and what all their updates began with."""
        models = tuple(sensor.filter.sensor for sensor in self.sensors)
        poses = np.stack([own.courses[course, -1] for own, course in zip(self.options, chosen, strict=True)])
        return Views(models, poses, self.looks, self.prediction)

    def sample_rewards(self, which: Sequence[int], fusion: Fusion | None) -> Floats:
        """(num_joint, num_samples) rewards of all joint actions of the sensors `which`, the last one's fastest."""
        shape = self.joint_shape()
        return self.rewards(which, fusion)(all_joint_actions(tuple(shape[s] for s in which)))

    def account(self) -> tuple[dict[str, int], tuple[str, ...]]:
        """Counts and notes so far, as a plan holds them."""
        return dict(self.counts), tuple(self.notes)

    def _check_finite(self, which: Sequence[int], actions: Ints, rewards: Floats) -> None:
        bad = np.argwhere(~np.isfinite(rewards))
        if len(bad):
            joint, sample = bad[0].tolist()
            courses = zip(which, actions[joint].tolist(), strict=True)
            named = (
                f"action {self.options[s].actions.text(self.options[s].first_action(course))} of sensor {s + 1}"
                for s, course in courses
            )
            raise NumericalError(
                f"reward of {' and '.join(named)}, sample {sample}: expected a finite number; "
                f"got {rewards[joint, sample]}"
            )
