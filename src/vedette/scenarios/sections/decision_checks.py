"""What must hold between how a scenario tracks and how its sensors decide."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from vedette.scenarios.faults import Finding, Path, describe
from vedette.scenarios.sections.tracking import UNLABELLED

if TYPE_CHECKING:
    from vedette.scenarios.sections.lookahead import Lookahead
    from vedette.scenarios.sections.rewards import AnyReward
    from vedette.scenarios.sections.scenario import ScenarioModel
    from vedette.scenarios.sections.search import AnySearch


def constraints_on_labels(model: ScenarioModel) -> Iterator[Finding]:
    """Constraints that ask where targets will be ask a density with labels."""
    for i, constraint in enumerate(model.control.constraints):
        if model.filter.kind in UNLABELLED and constraint.kind == "void_probability":
            wanted = f"another constraint, as {model.filter.kind} filters have no labels to look ahead by"
            yield ("control", "constraints", i, "kind"), wanted, describe(constraint.kind)


def greedy_of_sums(model: ScenarioModel) -> Iterator[Finding]:
    """Greedy searches ask for rewards of some of the sensors alone, which only sums over labels have."""
    if model.filter.kind in UNLABELLED:
        return
    limits, other = model.control.limits, "coordinate_ascent or another"
    few = len(model.sensors) <= limits.max_glmb_sensors and limits.max_glmb_targets > 0
    of_lmbs = model.fusion.kind != "custom" and model.fusion.decides_in_full
    for path, search, reward in _joint(model):
        if search.kind != "sequential_greedy" or reward.kind == "expected_loss":
            continue
        if model.control.association == "full":
            why = "as with control.association full decisions are no sums over labels"
            yield (*path, "kind"), f"{other}, {why}", describe(search.kind)
        elif few and not of_lmbs and model.filter.kind in ("delta_glmb", "m_delta_glmb"):
            why = f"as decisions on {model.filter.kind} beliefs are no sums over labels"
            hint = "or control.limits.max_glmb_targets of 0, with which they are"
            yield (*path, "kind"), f"{other}, {why}, {hint}", describe(search.kind)


def _joint(model: ScenarioModel) -> Iterator[tuple[Path, AnySearch, AnyReward]]:
    """Of each strategy that decides jointly: where its search stands, the search, and the reward."""
    control = model.control
    yield ("control", "search"), control.search, control.reward
    for name, own in model.planners.items():
        if own.kind == "joint":
            path: Path = ("control", "search") if own.search is None else ("planners", name, "search")
            yield path, own.search or control.search, own.reward or control.reward


def longer_plans(model: ScenarioModel) -> Iterator[Finding]:
    """Decisions over several periods are pseudo-updates apart, and sums over labels."""
    control = model.control
    given: dict[Path, Lookahead | None] = {("control", "lookahead"): control.lookahead}
    given.update({("planners", name): own for name, own in model.planners.items() if own.kind == "lookahead"})
    for path, own in given.items():
        if own is None:
            continue
        if own.period is not None:
            horizon_period = model.horizon[1]
            steps = own.period / horizon_period
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-9 * steps:
                multiple = f"a whole multiple of control.horizon_period, {horizon_period:g}"
                yield (*path, "period"), multiple, describe(own.period)
        if control.association != "known":
            yield ("control", "association"), "known, with a lookahead", describe(control.association)


def targets_of_rules(model: ScenarioModel) -> Iterator[Finding]:
    """Each sensor heads for a target."""
    for name, own in model.planners.items():
        if own.kind == "assigned" and own.targets is not None and len(own.targets) != len(model.sensors):
            wanted = f"{len(model.sensors)} numbers, one a sensor"
            yield ("planners", name, "targets"), wanted, describe(list(own.targets))


DECISION_CHECKS = (constraints_on_labels, greedy_of_sums, longer_plans, targets_of_rules)
