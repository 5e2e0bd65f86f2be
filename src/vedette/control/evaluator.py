"""The one evaluator behind all planners: expected rewards of actions, from the same pseudo-updates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vedette.control.actions import distinct_headings
from vedette.control.plan import RewardTable
from vedette.control.priors import predicted, restrict
from vedette.control.pseudo import PseudoPosteriors, case_density, draw_futures, pseudo_posteriors
from vedette.control.reward import CauchySchwarzReward, Reward
from vedette.control.settings import MobileSensor, PlanningSettings
from vedette.control.tables import joint_rewards
from vedette.densities import GLMB, LMB
from vedette.errors import InputError, NumericalError
from vedette.fusion import Clmb, CmDeltaGlmb, Fusion
from vedette.kernels.types import Floats, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Evaluator:
    """Everything that the rewards of one decision depend on; the pseudo-updates are run once, in `prepare`.

    Attributes:
        sensors, fusion, settings, reward: as in the planners.
        headings: for each sensor, its headings in printed order.
        distinct: for each sensor, the different directions among them, which are what is evaluated.
        which: for each sensor, which distinct direction each heading is.
        prediction: the fused density predicted to the horizon, one Gaussian a track.
        posteriors: the pseudo-posteriors of each sensor.
        counts: how many filter steps, fusions and divergences have been evaluated so far.
    """

    sensors: tuple[MobileSensor, ...]
    fusion: Fusion[Any, Any]
    settings: PlanningSettings
    reward: Reward
    headings: tuple[Floats, ...]
    distinct: tuple[Floats, ...]
    which: tuple[Ints, ...]
    prediction: GLMB | LMB
    posteriors: tuple[PseudoPosteriors, ...]
    counts: dict[str, int] = field(default_factory=dict)

    @classmethod
    def prepare(
        cls,
        sensors: Sequence[MobileSensor],
        fusion: Fusion[Any, Any],
        settings: PlanningSettings,
        reward: Reward,
        beliefs: Sequence[GLMB | LMB],
        fused: GLMB | LMB,
        poses: Floats,
        *,
        rng: np.random.Generator,
    ) -> Evaluator:
        """Draw the samples, predict, and run the pseudo-updates of every sensor (paper, Algorithm 2, steps 1 to 4)."""
        headings = tuple(sensor.actions.headings(pose) for sensor, pose in zip(sensors, poses, strict=True))
        for s, values in enumerate(headings):
            if len(values) == 0:
                raise InputError(f"sensors[{s}].actions: expected at least one action; got none")
        pairs = [distinct_headings(values) for values in headings]
        prediction = predicted(fused, sensors[0].filter, settings.horizon_steps, settings.horizon_period)
        futures = draw_futures(fused, sensors, settings, rng=rng)
        posteriors = tuple(
            pseudo_posteriors(belief, sensor, pose, pair[0], future, settings)
            for belief, sensor, pose, pair, future in zip(beliefs, sensors, poses, pairs, futures, strict=True)
        )
        steps = sum(len(pair[0]) for pair in pairs) * settings.num_samples * settings.horizon_steps
        counts = {"filter_steps": steps, "fusions": 0, "divergences": 0}
        return cls(
            tuple(sensors), fusion, settings, reward, headings, tuple(pair[0] for pair in pairs),
            tuple(pair[1] for pair in pairs), prediction, posteriors, counts,
        )  # fmt: skip

    def joint_shape(self) -> tuple[int, ...]:
        """Number of distinct directions of each sensor."""
        return tuple(len(values) for values in self.distinct)

    def sample_rewards(self, which: Sequence[int], fusion: Fusion[Any, Any] | None) -> Floats:
        """(num_joint, num_samples) rewards of all joint actions of the sensors `which`, the last one's fastest.

        fusion: None for a single sensor, whose own density is then compared with the prediction.

        Raises:
            NumericalError: a reward is not finite; names the action and the sample.
        """
        posteriors = [self.posteriors[s] for s in which]
        prediction = restrict(self.prediction, frozenset(labels for own in posteriors for labels in own.sets))
        if isinstance(prediction, GLMB) and prediction.num_hyps == 0:
            raise InputError("fused belief: expected a label set in common with the local beliefs; got none")
        if self._is_fast(fusion, posteriors):
            assert isinstance(self.reward, CauchySchwarzReward)
            single = CmDeltaGlmb((1.0,)) if isinstance(prediction, GLMB) else Clmb((1.0,))
            chosen = fusion if isinstance(fusion, CmDeltaGlmb | Clmb) else single
            volume = self.reward.volume(self.prediction)
            rewards = joint_rewards(
                posteriors, prediction, chosen, self.settings.num_samples, volume, self.settings.threads()
            )
        else:
            rewards = self._plain_rewards(posteriors, fusion)
        self.counts["divergences"] += rewards.size
        self.counts["fusions"] += rewards.size if fusion is not None else 0
        self._check_finite(rewards, which)
        return rewards

    def _is_fast(self, fusion: Fusion[Any, Any] | None, posteriors: Sequence[PseudoPosteriors]) -> bool:
        if not isinstance(self.reward, CauchySchwarzReward):
            return False
        kinds = {own.is_lmb for own in posteriors} | {isinstance(self.prediction, LMB)}
        if len(kinds) != 1:
            return False
        if fusion is None:
            return True
        if not isinstance(fusion, Clmb if kinds == {True} else CmDeltaGlmb) or min(fusion.weights) <= 0.0:
            return False
        num_sets = sum(len(own.sets) for own in posteriors)
        return fusion.mixture_power == "moment_matched" and num_sets <= fusion.limits.max_hyps

    def _plain_rewards(self, posteriors: Sequence[PseudoPosteriors], fusion: Fusion[Any, Any] | None) -> Floats:
        """The same by the public functions, one joint action and sample at a time: for any reward and any fusion."""
        num_samples = self.settings.num_samples
        shape = tuple(len(own.log_weights) // num_samples for own in posteriors)
        rewards = np.empty((int(np.prod(shape)), num_samples))
        for joint, actions in enumerate(np.ndindex(*shape)):
            for sample in range(num_samples):
                densities = [
                    case_density(own, action * num_samples + sample)
                    for own, action in zip(posteriors, actions, strict=True)
                ]
                updated = densities[0] if fusion is None else fusion.fuse(densities)[0]
                rewards[joint, sample] = self.reward(self.prediction, updated)
        return rewards

    def _check_finite(self, rewards: Floats, which: Sequence[int]) -> None:
        bad = np.argwhere(~np.isfinite(rewards))
        if len(bad):
            joint, sample = bad[0]
            actions = np.unravel_index(joint, [len(self.distinct[s]) for s in which])
            degrees = [round(float(np.degrees(self.distinct[s][a])), 6) for s, a in zip(which, actions, strict=True)]
            raise NumericalError(
                f"reward of headings {degrees} degrees of sensors {list(which)}, sample {sample}: expected a finite number; "
                f"got {rewards[joint, sample]}"
            )

    def table(self, which: Sequence[int], rewards: Floats) -> RewardTable:
        """Mean and standard error over the samples, spread over the headings in printed order (equal ones share a value)."""
        shape = tuple(len(self.distinct[s]) for s in which)
        num = rewards.shape[1]
        spread = rewards.std(axis=1, ddof=1) / np.sqrt(num) if num > 1 else np.zeros(len(rewards))
        full = np.ix_(*(self.which[s] for s in which))
        return RewardTable(tuple(which), rewards.mean(axis=1).reshape(shape)[full], spread.reshape(shape)[full])

    def first_heading(self, sensor: int, direction: int) -> int:
        """Index in printed order of the first heading that is this distinct direction."""
        return int(np.flatnonzero(self.which[sensor] == direction)[0])
