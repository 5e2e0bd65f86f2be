"""Episodes: scenario runs that advance from one decision to the next (used by all environments)."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vedette.control import Plan
from vedette.densities import LabelledDensity
from vedette.errors import InputError
from vedette.evaluation.runs import build_score
from vedette.gym.observing import DecisionContext, ObservationEncoder, deciding_sensors
from vedette.gym.windows import Window
from vedette.internal.extras import require_packages
from vedette.internal.unit_warnings import suppress_unit_warnings
from vedette.models.arguments import count, reject
from vedette.scenarios import Scenario, load_scenario
from vedette.scenarios.build import build_experiment, build_parts, build_sensors
from vedette.scenarios.sections.strategies import Strategy
from vedette.simulation import Experiment, RunRecord, ScanOutcome, SimulationRun, Truth
from vedette.simulation.health import Health
from vedette.simulation.journal import Journal
from vedette.simulation.loop import SCENES, advance, run_stream, truth_of_run

AnyScenario: TypeAlias = str | Path | Scenario
Scenarios: TypeAlias = AnyScenario | Sequence[AnyScenario] | Callable[[np.random.Generator], AnyScenario]
Reward: TypeAlias = Callable[[Sequence[ScanOutcome], Truth], float]
AnyReward: TypeAlias = Literal["ospa", "expected_loss"] | Reward
RENDER_MODES = ["rgb_array", "human"]
# These grow with every scan, or are -inf if nothing fits, so their mean over a period is not informative.
_NOT_AVERAGED = ("log_likelihood", "fusion_log_normaliser")


class BuiltScenario:
    """A scenario with the objects that its episodes share."""

    def __init__(self, scenario: AnyScenario, num_labels: int) -> None:
        self.scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.experiment: Experiment = build_experiment(self.scenario)
        if not self.experiment.decision_steps:
            raise InputError(
                f"{self.scenario.name}: expected decisions, as of control.decision_steps; got a scenario without any"
            )
        parts = build_parts(self.scenario, build_sensors(self.scenario), Strategy())
        self.encoder = ObservationEncoder.of(parts._asdict(), num_labels)
        score = build_score(self.scenario)
        assert score is not None  # only the targets of recordings are unknown
        self.score = score

    @property
    def layout(self) -> "Layout":
        """Layout of its observations and actions."""
        return Layout.of(self.encoder.decision_context(self.experiment.tracker.initial(), self.experiment.poses))


class Layout(NamedTuple):
    """The shapes of an observation by name, and the number of actions of each sensor that decides."""

    shapes: dict[str, tuple[int, ...]]
    num_actions: tuple[int, ...]
    deciding: tuple[int, ...]  # indices of these sensors

    @classmethod
    def of(cls, context: DecisionContext) -> "Layout":
        """Return the layout of a decision."""
        options, shown = context.options, context.observation
        deciding = deciding_sensors(options)
        sizes = tuple(len(options[s].actions) for s in deciding)
        return cls({name: array.shape for name, array in shown.items()}, sizes, deciding)


class Episodes:
    """Runs of one or several scenarios, one after the other, each from decision to decision.

    Attributes:
        built: the scenario of the current run.
        layout: of all observations and actions.
        render_mode: how frames are shown.
        world, context: the current run, and the pending decision.
        num_moved: number of actions of the last decision that constraints changed.
    """

    def __init__(self, scenario: Scenarios, reward: AnyReward, num_labels: int, render_mode: str | None) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise reject("render_mode", f"{' or '.join(RENDER_MODES)} or None", render_mode)
        if render_mode is not None:
            require_packages("a picture of an environment", "matplotlib")
        if not callable(reward) and reward not in ("ospa", "expected_loss"):
            raise reject("reward", "ospa, expected_loss or a function of moments and truth", reward)
        self._num_labels, self._reward, self.render_mode = num_labels, reward, render_mode
        self._window: Window | None = None
        self._draw = scenario if callable(scenario) else _scenario_sampler(scenario, num_labels)
        self._seed: int | None = None
        self._run, self.num_moved = 0, 0
        self.built = self._drawn(0, 0)
        self.layout = self.built.layout

    def start(self, seed: int | None, run: int | None) -> None:
        """Start a run: that of a seed and number.

        By default run 0 of a given seed, or the next run of the previous seed.

        If no seed was ever given, one is drawn.
        """
        first = seed is not None or self._seed is None
        if seed is None:
            seed = int(np.random.default_rng().integers(2**31)) if self._seed is None else self._seed
        number = (0 if first else self._run + 1) if run is None else count("run", run)
        self._seed, self._run = count("seed", seed), number
        self.built = self._drawn(self._seed, number)
        experiment = self.built.experiment
        truth = truth_of_run(experiment, self._seed, number)
        self.world = SimulationRun(experiment, seed=self._seed, run=number, truth=truth)
        self._journal = Journal(experiment.name, "policy", self._seed, number, truth, experiment.num_sensors)
        self.num_moved = 0
        self._advance()

    def decide(self, actions: ArrayLike) -> None:
        """Apply the actions of a policy, and advance to the next decision, or to the end."""
        if self._seed is None or self.is_over:
            raise InputError(
                f"step: expected a reset first, as {'there is no run' if self._seed is None else 'the run is over'}"
            )
        chosen, self.num_moved = self.built.encoder.resolve_actions(self.context, actions)
        with suppress_unit_warnings():
            plan = policy_plan("policy", self.context, chosen)
            self._journal.note_decision(plan, explain=self.built.experiment.explain)
            self.world.follow(plan.chosen_actions)
            self._advance()

    def _advance(self) -> None:
        with suppress_unit_warnings():
            self._moments = advance(self.world, self._journal)
            last = self._moments[-1]
            self.context: DecisionContext = self.built.encoder.decision_context(last.state, last.poses)
        if self.render_mode == "human":
            self.render()
        found = Layout.of(self.context)
        if found != self.layout:
            expected = f"{self.built.scenario.name}: expected arrays and actions of one layout at every decision"
            raise InputError(f"{expected}, {self.layout}; got {found}")

    @property
    def is_over(self) -> bool:
        """True if the last scan is done."""
        return self.world.is_over

    def reward(self) -> float:
        """Return the reward of the scans since the last decision."""
        moments, cutoff = self._moments, self.built.scenario.model.ospa.cutoff
        truth = self.world.truth.between(moments[0].step - 1, moments[-1].step)
        if callable(self._reward):
            reward = self._reward(moments, truth)
            try:
                return float(reward)
            except (TypeError, ValueError):
                raise reject("reward", "a function that returns a number", reward) from None
        if self._reward == "ospa":
            return -float(self.built.score(truth, [moment.estimate for moment in moments])[:, 0].mean())
        return -float(np.mean([expected_loss(moment.state.fused, cutoff) for moment in moments]))

    def info(self) -> dict[str, Any]:
        """Return the position in the run and the filters' health since the last decision, without the truth."""
        first, last = self._moments[0].step - 1, self._moments[-1].step
        info: dict[str, Any] = {"seed": self._seed, "run": self._run, "step": last, "time": self._moments[-1].time}
        info |= {"num_moved": self.num_moved}
        kept = {name: getattr(self._journal.health, name)[first:last] for name in Health.__match_args__}
        means = {name: own.mean(axis=0) for name, own in kept.items() if name not in _NOT_AVERAGED}
        info["health"] = {name: np.asarray(own) for name, own in means.items() if np.isfinite(own).all()}
        return info

    def record(self) -> RunRecord:
        """Return the record of the run so far, as `vedette.evaluation.run_scenario` returns it for a planner."""
        num = len(self._journal.estimates)
        return self._journal.record(self.built.score(self.world.truth.first(num), self._journal.estimates))

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture (height, width, 3) of the last scan, a frame of `vedette video`.

        Or show it in a window, and return None.
        """
        if self.render_mode is None:
            return None
        from vedette.evaluation.figures import scan_image

        image = scan_image(self.record(), self.built.scenario)
        if self.render_mode == "rgb_array":
            return image
        self._window = self._window or Window()
        self._window.show(image)
        return None

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
            self._window = None

    def _drawn(self, seed: int, run: int) -> BuiltScenario:
        """Return the scenario of a run, built."""
        found = self._draw(run_stream(seed, run, SCENES))
        return found if isinstance(found, BuiltScenario) else BuiltScenario(found, self._num_labels)


class OfEpisodes:
    """Members of all environments."""

    episodes: Episodes

    @property
    def world(self) -> SimulationRun:
        """The current run, with its truth."""
        return self.episodes.world

    def record(self) -> RunRecord:
        """Return the record of the current run so far, as in a campaign."""
        return self.episodes.record()

    def render(self) -> NDArray[np.uint8] | None:
        """Return the last scan as a frame of `vedette video`, (height, width, 3) for "rgb_array", or show it."""
        return self.episodes.render()

    def close(self) -> None:
        """Close the window."""
        self.episodes.close()


def _scenario_sampler(
    scenario: AnyScenario | Sequence[AnyScenario], num_labels: int
) -> Callable[[np.random.Generator], BuiltScenario]:
    """Return a function that draws one of several scenarios, each built once."""
    given = [scenario] if isinstance(scenario, str | Path | Scenario) else list(scenario)
    if not given:
        raise reject("scenario", "at least one scenario", "none")
    built = [BuiltScenario(own, num_labels) for own in given]
    return lambda rng: built[int(rng.integers(len(built)))]


def policy_plan(name: str, context: DecisionContext, chosen: tuple[int, ...]) -> Plan:
    """Return the plan of a policy."""
    notes = context.mask.notes if context.mask is not None else ()
    return Plan(name, tuple(own.actions for own in context.options), chosen, (), {}, notes)


def expected_loss(belief: Any, cutoff: float) -> float:
    """Return the expected error of the targets in a belief: sum over labels of r min(sqrt(tr P), c), m.

    r is the existence of a label, P the covariance of its position, c the cutoff. Targets that the belief does not hold
    are not included. Raises `InputError` for a belief without labels.
    """
    if not isinstance(belief, LabelledDensity):
        raise reject("reward", "ospa or a function, as the belief has no labels", "expected_loss")
    return sum(
        target.existence * min(float(np.sqrt(np.trace(target.cov[:2, :2]))), cutoff) for target in belief.targets()
    )
