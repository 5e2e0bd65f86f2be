"""Rewards of joint actions from the sensors' pseudo-posteriors, for any reward, fusion and density.

If fusion and reward allow it, the densities are precomputed and rewards are made of power integrals. Otherwise the
public functions are called for each joint action and sample.
"""

import functools
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from vedette.control.pseudo_updates import draw_futures, pseudo_posteriors
from vedette.control.rewards.base import (
    LabelReward,
    PowerReward,
    Reward,
    combined,
    may_replace,
    reward_value,
    unit_volume_of,
)
from vedette.control.settings import Belief, MobileSensor, PlanningSettings, scans_within
from vedette.densities.batches import DensityBatch
from vedette.errors import NumericalError, SlowRewardWarning
from vedette.fusion import FieldsOfView, Fusion, PrecomputedFusion, SupportsPrecomputation, precompute_single_sensor
from vedette.kernels.base.types import Bools, Floats, Ints
from vedette.models.arguments import provides
from vedette.platforms import Options
from vedette.tracking import State

SampleRewards: TypeAlias = Callable[[Ints], Floats]

# Measured on decisions of paper-a, two sensors with 13 actions each: benchmarks/planning.py --one-by-one.
SLOWER_BY = "a joint decision of two sensors takes 40 to 70 times as long, an independent one 4 to 6 times,"


@dataclass(frozen=True, slots=True, eq=False)
class PseudoPosteriorRewards:
    """Rewards from the sensors' own filters, whose pseudo-updates are run once, in `prepare`."""

    sensors: tuple[MobileSensor, ...]  # as in the planners
    fusion: Fusion  # as in the planners
    settings: PlanningSettings  # as in the planners
    reward: Reward | PowerReward | LabelReward  # as in the planners
    options: tuple[Options, ...]  # for each sensor
    prediction: Belief  # the fused density predicted to the horizon, one Gaussian per track
    posteriors: tuple[DensityBatch, ...]  # the pseudo-posteriors of each sensor
    scanned: tuple[Bools, ...]  # for each sensor (num_courses,) whether it scans within the horizon
    counts: dict[str, int]  # numbers of filter steps, fusions and divergences evaluated so far
    notes: dict[str, None]  # notes for readers of the decision, in order of occurrence (keys, whose values are unused)

    @classmethod
    def prepare(
        cls,
        sensors: Sequence[MobileSensor],
        options: Sequence[Options],
        fusion: Fusion,
        settings: PlanningSettings,
        reward: Reward | PowerReward | LabelReward,
        state: State,
        prediction: Belief,
        *,
        rng: np.random.Generator,
    ) -> "PseudoPosteriorRewards":
        """Draw the samples and run the pseudo-updates of every sensor (paper section III-B, steps 1 to 4)."""
        labels, futures = draw_futures(state.fused, sensors, settings, rng=rng)
        scans = scans_within(sensors, options, state.time, settings)
        posteriors = tuple(
            pseudo_posteriors(belief, sensor, own.courses, labels, future, settings, when)
            for belief, sensor, own, future, when in zip(state.local, sensors, options, futures, scans, strict=True)
        )
        steps = sum(len(own.courses) for own in options) * settings.num_samples * settings.horizon_steps
        counts = {"filter_steps": steps, "fusions": 0, "divergences": 0}
        scanned = tuple(np.asarray(own.any(axis=1)) for own in scans)
        return cls(
            tuple(sensors), fusion, settings, reward, tuple(options), prediction, posteriors, scanned, counts, {}
        )

    def joint(self) -> SampleRewards:
        """Return the reward function of all sensors, fused."""
        return self.rewards(range(len(self.sensors)), self.fusion)

    def alone(self, sensor: int) -> SampleRewards:
        """Return the reward function of one sensor's own density. Its actions have shape (num, 1)."""
        return self.rewards((sensor,), None)

    def rewards(self, sensors: Sequence[int], fusion: Fusion | None) -> SampleRewards:
        """Return a function from joint actions (num_joint, num of `sensors`) to rewards (num_joint, num_samples).

        sensors: those that act. Actions are indices of distinct courses. fusion: None for a single sensor, whose
        own density is compared with the prediction. The function raises `NumericalError` with the action and the sample
        if a reward is not finite.
        """
        compute = self._compute([self.posteriors[s] for s in sensors], fusion)

        def evaluate(actions: Ints) -> Floats:
            prices = [self.options[s].prices[own] for s, own in zip(sensors, actions.T, strict=True)]
            rewards = np.asarray(compute(actions) - np.sum(prices, axis=0)[:, np.newaxis])
            self.counts["divergences"] += rewards.size
            self.counts["fusions"] += rewards.size if fusion is not None else 0
            self._check_finite(sensors, actions, rewards)
            return rewards

        return evaluate

    def _compute(self, posteriors: Sequence[DensityBatch], fusion: Fusion | None) -> SampleRewards:
        compute_or_reason = lay_out_rewards(posteriors, self.prediction, fusion, self.reward)
        if not isinstance(compute_or_reason, str):
            return compute_or_reason
        self.notes[f"rewards were computed one by one: {compute_or_reason}"] = None
        warn_slow(compute_or_reason)
        return PlainRewards(posteriors, self.prediction, fusion, self.reward, self.settings.num_samples, self.views)

    def views(self, chosen: Sequence[int]) -> FieldsOfView:
        """Return the fields of view at the ends of the chosen courses, with the prediction before the updates."""
        models = tuple(sensor.filter.sensor for sensor in self.sensors)
        poses = np.stack([own.courses[course, -1] for own, course in zip(self.options, chosen, strict=True)])
        scanned = tuple(bool(own[course]) for own, course in zip(self.scanned, chosen, strict=True))
        return FieldsOfView(models, poses, scanned, self.prediction)

    def _check_finite(self, sensors: Sequence[int], actions: Ints, rewards: Floats) -> None:
        bad = np.argwhere(~np.isfinite(rewards))
        if len(bad):
            joint, sample = bad[0].tolist()
            courses = zip(sensors, actions[joint].tolist(), strict=True)
            named = (
                f"action {self.options[s].actions.text(self.options[s].first_action(course))} of sensor {s + 1}"
                for s, course in courses
            )
            raise NumericalError(
                f"reward of {' and '.join(named)}, sample {sample}: expected a finite number; "
                f"got {rewards[joint, sample]}"
            )


def lay_out_rewards(
    cases: Sequence[DensityBatch],
    prediction: Belief,
    fusion: Fusion | None,
    reward: Reward | PowerReward | LabelReward,
) -> SampleRewards | str:
    """Return a function that equals `PlainRewards` for all joint actions and samples at once, or the reason for none.

    fusion: None for a single sensor.
    """
    if not provides(reward, PowerReward) or not may_replace(reward, "combine", "__call__"):
        return f"{_name(reward)} is a function of two densities"
    precomputed: PrecomputedFusion | None = None
    if fusion is None:
        precomputed = precompute_single_sensor(cases[0], prediction)
    elif provides(fusion, SupportsPrecomputation) and may_replace(fusion, "precompute", "fuse"):
        precomputed = fusion.precompute(cases, prediction)
    if precomputed is None:
        return f"{'a sensor alone' if fusion is None else _name(fusion)} cannot lay out these beliefs"
    z, volume = precomputed.z, unit_volume_of(reward, prediction)
    return lambda actions: combined(reward, z(actions, reward.exponents, volume))


def _name(thing: Any) -> str:
    named = getattr(thing, "func", thing)  # the function of a partial
    return str(getattr(named, "__name__", type(named).__name__))


@functools.cache
def warn_slow(reason: str) -> None:
    """Warn, once per process, that rewards are computed one by one."""
    warnings.warn(
        f"rewards are computed one by one: {SLOWER_BY} as by a PowerReward under a fusion that lays out; {reason}",
        SlowRewardWarning,
        stacklevel=2,
    )


@dataclass(slots=True, eq=False)
class PlainRewards:
    """Any reward by `fusion.fuse` and the reward function, one joint action and sample at a time."""

    posteriors: Sequence[DensityBatch]  # one for each sensor
    prediction: Belief  # the fused density at the horizon
    fusion: Fusion | None  # None for a single sensor, whose own density is then compared with the prediction
    reward: Reward | PowerReward | LabelReward  # as in the planners
    num_samples: int  # as in the planners
    # returns the fields of view at the end of a joint action, which a fusion may need
    views: Callable[[Sequence[int]], FieldsOfView]
    _densities: dict[tuple[int, int], Belief] = field(default_factory=dict)

    def __call__(self, actions: Ints) -> Floats:
        """Return rewards (num_joint, num_samples) of joint actions (num_joint, num_sensors)."""
        rewards = np.empty((len(actions), self.num_samples))
        for joint, chosen in enumerate(actions.tolist()):
            views = None if self.fusion is None else self.views(chosen)
            for sample in range(self.num_samples):
                densities = [self._density(s, action, sample) for s, action in enumerate(chosen)]
                updated = densities[0] if self.fusion is None else self.fusion.fuse(densities, views)[0]
                rewards[joint, sample] = reward_value(self.reward, self.prediction, updated)
        return rewards

    def _density(self, sensor: int, action: int, sample: int) -> Belief:
        key = sensor, action * self.num_samples + sample
        if key not in self._densities:
            self._densities[key] = self.posteriors[sensor].density(key[1])
        return self._densities[key]
