"""A Stone Soup sensor manager that uses Vedette's planners."""

import copy
import datetime
import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.sensormanager.base import SensorManager

from vedette.control import ExpectedLossReward, IndependentPlanner, JointPlanner, MobileSensor, Plan, PlanningSettings
from vedette.densities import LMB, TrackTable
from vedette.errors import InputError
from vedette.filters import LmbFilter
from vedette.fusion import ParallelUpdate
from vedette.internal.probabilities import logit
from vedette.kernels.base.types import Floats
from vedette.models.arguments import one_of, reject
from vedette.stonesoup.converting import ConvertedModels
from vedette.stonesoup.sensors import convert_pose
from vedette.tracking import State

_STEERED = ("dwell_centre", "position")
_PLANNERS = {"joint": JointPlanner, "independent": IndependentPlanner}


class StoneSoupActions:
    """The actions of one sensor until a time, from Stone Soup's action generators, as a Vedette platform.

    Poses are those of copies that perform the actions, by Stone Soup's own `move` and `act`.
    """

    columns = ("choice",)

    def __init__(self, sensor: Any, carrier: Any, now: datetime.datetime, until: datetime.datetime) -> None:
        self._actors = [actor for actor in (carrier, sensor) if actor is not None]
        self._sensor, self._now = sensor, now
        self.pose = convert_pose(sensor.measurement_model)
        generators = []
        for actor in self._actors:
            own = sorted(actor.actions(until), key=lambda generator: str(generator.attribute))
            for generator in own:
                if generator.attribute not in _STEERED:
                    wanted = f"one of {', '.join(_STEERED)}, as no other changes what a sensor sees here"
                    raise reject(f"{type(actor).__name__}: actionable property", wanted, str(generator.attribute))
            generators.append(list(itertools.product(*own)))
        self.chosen = [dict(zip(self._actors, each, strict=True)) for each in itertools.product(*generators)]
        self._courses: dict[tuple[float, ...], Floats] = {}

    def actions(self, pose: Floats) -> Floats:
        """Return the indices of the actions, shape (num_actions, 1)."""
        return np.arange(float(len(self.chosen)))[:, np.newaxis]

    def course(self, pose: Floats, action: Floats, times: Floats) -> Floats:
        """Return the poses of one action."""
        return np.asarray(self.courses(pose, action[np.newaxis], times)[0])

    def courses(self, pose: Floats, actions: Floats, times: Floats) -> Floats:
        """Return the poses of several actions at once."""
        key = tuple(times.tolist())
        if key not in self._courses:
            self._courses[key] = np.array([self._course(each, times) for each in self.chosen])
        return self._courses[key][actions[:, 0].astype(np.int64)]

    def _course(self, actions: dict[Any, Sequence[Any]], times: Floats) -> Floats:
        memo: dict[int, Any] = {}
        twins = [copy.deepcopy(actor, memo) for actor in self._actors]
        for twin, own in zip(twins, actions.values(), strict=True):
            if own:
                twin.add_actions(own)
        poses = []
        for seconds in times.tolist():
            then = self._now + datetime.timedelta(seconds=seconds)
            for carrier in twins[:-1]:
                carrier.move(then, noise=False)  # `act` does not move platforms without steering
            twins[-1].act(then, noise=False)
            poses.append(convert_pose(twins[-1].measurement_model))
        return np.array(poses)


class PlanningSensorManager(SensorManager):  # type: ignore[misc] # Stone Soup is untyped
    """Stone Soup sensor manager that chooses the sensors' actions with Vedette's planners, several sensors jointly.

    The sensors are those that `models` were converted from, on the ground or on platforms, each of which carries one.
    They are controlled by the `dwell_centre` of a rotating radar and by the movement of a platform. Tracks become a
    labelled multi-Bernoulli, with `metadata["existence"]` as existence probability. Tracks of an earlier time are
    predicted.
    """

    models: Any = Property(doc="What `vedette.stonesoup.convert` made of the sensors.")
    reward: Any = Property(
        default=None, doc="Of `vedette.control`, such as `CauchySchwarzReward()`; default `ExpectedLossReward()`."
    )
    settings: Any = Property(
        default=None,
        doc="Of the planner; the horizon is the time until which actions are carried out, cut into `horizon_steps` "
        "pseudo-updates. Default: one.",
    )
    decisions: str = Property(default="joint", doc='"joint" or "independent".')
    existence: float = Property(default=0.99, doc="Probability of a track that says none.")
    seed: int = Property(default=0, doc="Of the samples.")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if not isinstance(self.models, ConvertedModels):
            raise InputError(f"models: expected what convert() made; got {type(self.models).__name__}")
        if self.reward_function is not None:
            raise reject("reward_function", "none: rewards are of vedette.control, as `reward`", self.reward_function)
        one_of("decisions", self.decisions, _PLANNERS)
        strangers = [sensor for sensor in self.sensors if sensor not in self.models.sources]
        if strangers or len(self.sensors) != len(self.models.sources):
            wanted = f"the {len(self.models.sources)} that models were converted of"
            raise reject("sensors", wanted, ", ".join(type(s).__name__ for s in strangers) or f"{len(self.sensors)}")
        for platform in self.platforms:
            if len(platform.sensors) > 1:
                raise reject("platforms", "one sensor on each", f"{len(platform.sensors)} on one")
        self.plan: Plan | None = None
        self._rng = np.random.default_rng(self.seed)

    def choose_actions(
        self, tracks: Any, timestamp: datetime.datetime, nchoose: int = 1, return_reward: bool = False, **kwargs: Any
    ) -> Any:
        """Return the actions until `timestamp`, in the form of other sensor managers. `plan` has the plan behind them.

        Returns:
            A list of one dictionary, with the actions of each sensor, and platform. With `return_reward` also an array
                of the expected reward, for independent decisions their sum.

        Raises:
            InputError: no time left, an actionable property that no sensor here supports, more than one choice
                requested.
        """
        if nchoose != 1:
            raise reject("nchoose", "1, the best", nchoose)
        now = self._now(tracks)
        seconds = (timestamp - now).total_seconds()
        if seconds <= 0.0:
            raise reject("timestamp", f"a time after the tracks and sensors, {now}", str(timestamp))
        settings = PlanningSettings(horizon_steps=1) if self.settings is None else self.settings
        settings = replace(settings, horizon_period=seconds / settings.horizon_steps)
        carriers = {sensor: platform for platform in self.platforms for sensor in platform.sensors}
        choices = [StoneSoupActions(s, carriers.get(s), now, timestamp) for s in self.models.sources]
        mobile = tuple(
            MobileSensor(LmbFilter(self.models.targets, sensor), choice)
            for sensor, choice in zip(self.models.sensors, choices, strict=True)
        )
        reward = ExpectedLossReward() if self.reward is None else self.reward
        planner = _PLANNERS[self.decisions](mobile, ParallelUpdate(), settings, reward)
        belief = self._belief(tracks, now)
        state = State((belief,) * len(mobile), belief, 1, 0.0)
        self.plan = planner.plan(state, np.array([choice.pose for choice in choices]), rng=self._rng)
        config = {
            actor: actions
            for choice, index in zip(choices, self.plan.chosen, strict=True)
            for actor, actions in choice.chosen[index].items()
        }
        if return_reward:
            return [config], np.array([sum(mean for mean, _ in self.plan.expected_rewards)])
        return [config]

    def _now(self, tracks: Any) -> datetime.datetime:
        """Return the latest known time."""
        times = [track.timestamp for track in tracks] + [sensor.timestamp for sensor in self.models.sources]
        known: list[datetime.datetime] = [time for time in times if time is not None]
        if not known:
            raise reject("tracks", "one or more, or sensors with a timestamp", "neither")
        return max(known)

    def _belief(self, tracks: Any, now: datetime.datetime) -> LMB:
        layout, means, covs, logits = self.models.layout, [], [], []
        for track in sorted(tracks, key=lambda track: str(track.id)):
            mean = layout.states(np.asarray(track.mean, np.float64).T)[0]
            cov = layout.covs(np.asarray(track.covar, np.float64)[np.newaxis])[0]
            seconds = (now - track.timestamp).total_seconds()
            moved = self.models.predicted(mean, cov, seconds) if seconds > 0.0 else (mean, cov)
            means.append(moved[0])
            covs.append(moved[1])
            logits.append(logit(float(getattr(track, "metadata", {}).get("existence", self.existence))))
        if not means:
            return LMB.empty(self.models.targets.birth)
        labels = np.column_stack([np.ones(len(means), np.int64), np.arange(len(means))])
        return LMB(TrackTable.from_gaussians(labels, np.array(means), np.array(covs)), np.array(logits))
