"""Analysis of a decision after it was made, from its evidence."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from vedette.control.contributions import Contributions
from vedette.control.evidence import Part
from vedette.control.explanation import Bound, Counterfactual, Explanation, RunnerUp, TargetGains
from vedette.errors import InputError
from vedette.kernels.base.types import Floats, Ints
from vedette.models.arguments import reject
from vedette.platforms import Actions, Options

_CASE_BY_CASE = "rewards were evaluated case by case, where every sensor scans and targets are not told apart"
_NOT_LINEAR = "this reward is not a sum over targets"
_NOT_FINITE = "a reward without some of the scans is no finite number"
_ONLY_ONE = "no other joint action was evaluated"
_SAME_NUMBER = 1e-6


@dataclass(frozen=True, eq=False)
class DecisionAnalysis:
    """A decision with its evidence, which can be analysed. Neither copied nor pickled: a copy is None."""

    planner: str  # name of the planner
    parts: tuple[Part, ...]  # the decisions made as units. The reward is the sum of theirs
    bound: Bound | None = field(default=None)  # of the plan

    def __reduce__(self) -> Any:
        return type(None), ()

    def __call__(self) -> Explanation:
        """Return the explanation for `Plan.explain`."""
        return self._explanation

    @cached_property
    def _explanation(self) -> Explanation:
        chosen = tuple(own.text(action) for own, action in zip(self._actions, self._chosen_actions, strict=True))
        reward = sum(part.evidence.mean_of(part.chosen) for part in self.parts)
        runner_up = self._runner_up()
        missing = {} if runner_up is not None else {"runner_up": _ONLY_ONE}
        return Explanation(
            planner=self.planner,
            chosen=chosen,
            reward=float(reward),
            standard_error=_error(np.sum(self._samples, axis=0)),
            evaluations=sum(part.evidence.num_evaluated for part in self.parts),
            **self._shares(missing),
            runner_up=runner_up,
            bound=self.bound,
            missing=missing,
            price=float(sum(own.prices[course] for own, course in zip(self._options, self._courses, strict=True))),
            answer=self.counterfactual,
        )

    @property
    def _options(self) -> tuple[Options, ...]:
        return self.parts[0].evidence.evaluator.options

    @property
    def _actions(self) -> tuple[Actions, ...]:
        return tuple(own.actions for own in self._options)

    @property
    def _courses(self) -> list[int]:
        return [course for part in self.parts for course in part.chosen]

    @property
    def _chosen_actions(self) -> tuple[int, ...]:
        return tuple(own.first_action(course) for own, course in zip(self._options, self._courses, strict=True))

    @cached_property
    def _contributions(self) -> tuple[Contributions | None, ...]:
        """Contributions of each part, or None if its rewards are evaluated case by case."""
        return tuple(part.shares() for part in self.parts)

    @cached_property
    def _samples(self) -> tuple[Floats, ...]:
        """Rewards (num_samples,) of the choice, for each part."""
        return tuple(
            part.evidence.rewards(np.array([part.chosen]))[0] if shares is None else shares.samples
            for part, shares in zip(self.parts, self._contributions, strict=True)
        )

    def _shares(self, missing: dict[str, str]) -> dict[str, Any]:
        """Return the fields of an `Explanation` with contributions. Reasons for None are put in `missing`."""
        names = ("baseline", "of_targets", "of_undetected", "of_sensors", "reward_without_sensor")
        contributions: dict[str, Any] = dict.fromkeys(names)
        each = [shares for shares in self._contributions if shares is not None]
        if len(each) < len(self.parts):
            missing.update(dict.fromkeys(names, _CASE_BY_CASE))
            return contributions
        if not all(_is_finite(shares) for shares in each):
            missing.update(dict.fromkeys(names, _NOT_FINITE))
            return contributions
        last = np.concatenate([shares.last for shares in each])
        reward = sum(part.evidence.mean_of(part.chosen) for part in self.parts)
        contributions["baseline"] = sum(shares.baseline for shares in each)
        contributions["of_undetected"] = sum(shares.found for shares in each)
        contributions["of_sensors"] = np.concatenate([shares.sensors for shares in each])
        contributions["reward_without_sensor"] = reward - last
        contributions["of_targets"] = self._targets(each)
        if contributions["of_targets"] is None:
            missing["of_targets"] = _NOT_LINEAR
        return contributions

    def _targets(self, each: Sequence[Contributions]) -> TargetGains | None:
        existence = [shares.existence for shares in each if shares.existence is not None]
        localisation = [shares.localisation for shares in each if shares.localisation is not None]
        if not existence:
            return None
        prediction: Any = self.parts[0].evidence.evaluator.prediction
        return TargetGains(prediction.tracks.labels.copy(), np.sum(existence, axis=0), np.sum(localisation, axis=0))

    def _runner_up(self) -> RunnerUp | None:
        """Return the best other joint action, or for an independent decision, one sensor's own second best."""
        candidates = [
            (part.evidence.mean_of(part.chosen) - best[1], place, best[0])
            for place, part in enumerate(self.parts)
            if (best := part.evidence.best_other(part.chosen)) is not None
        ]
        if not candidates:
            return None
        margin, place, other = min(candidates)
        part = self.parts[place]
        actions = list(self._chosen_actions)
        words = []
        for s, course, chosen in zip(part.evidence.which, other, part.chosen, strict=True):
            if course != chosen:
                actions[s] = self._options[s].first_action(course)
                words.append(f"sensor {s + 1} with {self._actions[s].text(actions[s])}")
        rewards = part.evidence.rewards(np.array([other]))[0]
        return RunnerUp(tuple(actions), ", ".join(words), margin, _error(self._samples[place] - rewards))

    def counterfactual(self, sensor: int, action: int | None, columns: dict[str, float]) -> Counterfactual:
        """Return the answer of `Explanation.counterfactual`."""
        num = len(self._options)
        if isinstance(sensor, bool) or not isinstance(sensor, int | np.integer) or not 0 <= sensor < num:
            raise reject("sensor", f"the number of one of {num} sensors, from 0", sensor)
        index = self._index(int(sensor), action, columns)
        place = next(place for place, part in enumerate(self.parts) if sensor in part.evidence.which)
        part = self.parts[place]
        other = list(part.chosen)
        other[part.evidence.which.index(int(sensor))] = int(self._options[sensor].which[index])
        difference = part.evidence.rewards(np.array([other]))[0] - self._samples[place]
        off = float(difference.mean())
        assert self._explanation.reward is not None
        return Counterfactual(
            int(sensor), self._actions[sensor].text(index), self._explanation.reward + off, off, _error(difference)
        )

    def _index(self, sensor: int, action: int | None, columns: dict[str, float]) -> int:
        own, chosen = self._actions[sensor], self._chosen_actions[sensor]
        if (action is None) == (not columns):
            raise InputError("had: expected either the number of an action or the numbers of its columns")
        if action is not None:
            if isinstance(action, bool) or not isinstance(action, int | np.integer) or not 0 <= action < len(own):
                raise reject("action", f"the number of one of {len(own)} actions, from 0", action)
            return int(action)
        unknown = [name for name in columns if name not in own.columns]
        if unknown:
            raise InputError(f"had: expected columns {', '.join(own.columns) or '(none)'}; got {unknown[0]}")
        numbers = zip(own.columns, own.values[chosen].tolist(), strict=True)
        requested = np.array([columns.get(name, value) for name, value in numbers])
        close = own.differences(requested) <= _SAME_NUMBER * np.maximum(1.0, np.abs(requested))
        fits = np.flatnonzero(close.all(axis=1))
        if len(fits) == 0:
            request = ", ".join(f"{name} {value:g}" for name, value in columns.items())
            raise InputError(f"had: expected something that sensor {sensor + 1} could do ({_few(own)}); got {request}")
        return int(fits[0])


def _few(own: Actions) -> str:
    """Return some of the actions as text."""
    words = [own.text(i) for i in range(min(len(own), 5))]
    return "; ".join(words) + ("; ..." if len(own) > len(words) else "")


def _error(samples: Floats) -> float | None:
    """Return the standard error of a mean over samples, or None with a single sample."""
    num = len(samples)
    return float(samples.std(ddof=1) / math.sqrt(num)) if num > 1 else None


def _is_finite(shares: Contributions) -> bool:
    values: list[Floats | Ints | float] = [shares.baseline, shares.found, shares.sensors, shares.last]
    return all(bool(np.isfinite(value).all()) for value in values)
