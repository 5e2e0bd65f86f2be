"""The planners of a scenario."""

from dataclasses import replace
from functools import partial

from vedette.control import MobileSensor, Planner
from vedette.errors import InputError
from vedette.filters import Filter, has_labels
from vedette.fusion import Fusion, ParallelUpdate
from vedette.scenarios.build.sensors import build_scan_times, build_sensors, first_actions
from vedette.scenarios.build.trackers import has_lmb_beliefs, scene_for_program
from vedette.scenarios.loading import Scenario
from vedette.scenarios.sections.consistency import incompatibility
from vedette.scenarios.sections.deciding import Lookahead
from vedette.scenarios.sections.fusion import FULL_INFORMATION_FUSIONS, SINGLE_BELIEF_FUSIONS, CustomFusion
from vedette.scenarios.sections.planners import STRATEGIES, NamedIndependent, NamedPlanner
from vedette.scenarios.sections.strategies import Parts, Strategy
from vedette.simulation.oracle import Schedule
from vedette.tracking import Network


def build_planner(scenario: Scenario, name: str, num_threads: int = 0) -> Planner | None:
    """Return the planner of a strategy; None for `stationary`, with which the sensors never move.

    The strategies are `jdm` (joint), `idm` (independent), `lookahead` (joint, over several decisions), `nearest`,
    `assigned_target`, `centroid` (rules of thumb), `oracle` and `true_targets` (which know the targets), `random`,
    `constant` (sensors keep their first course), and the scenario's own planners.

    Args:
        scenario: with the sensors that the planner controls.
        name: of the strategy.
        num_threads: of a decision; 0: one per processor.

    Raises:
        InputError: an unknown name, joint or independent decisions with filters that have no labels, planners that
            know the targets if these are unknown or lack components of the motion's states, or a custom part that
            cannot be loaded.
    """
    model, folder = scenario.model, scenario.folder
    if name not in (*STRATEGIES, *model.planners):
        known = ", ".join((*STRATEGIES, *model.planners))
        raise InputError(f"planner: expected one of {known}; got {name!r}")
    sensors = build_sensors(scenario)
    strategy = model.strategy(name)
    if reason := incompatibility(model, strategy, labels=has_labels(sensors[0].filter)):
        raise InputError(f"planner {name}: expected {reason}; got {name}")
    parts = build_parts(scenario, sensors, strategy, num_threads)
    if name in model.planners:
        return NamedPlanner(name, model.planners[name].planner(parts, folder))
    try:
        return strategy.planner(parts, folder)
    except InputError as error:
        raise InputError(f"planner {name}: {error}") from error


def build_parts(
    scenario: Scenario, sensors: tuple[MobileSensor, ...], strategy: Strategy, num_threads: int = 0
) -> Parts:
    """Return the parts of a strategy's planner, with sensors from `build_sensors`; raises like `build_planner`."""
    model, folder = scenario.model, scenario.folder
    control, fusion = model.control, _decision_fusion(scenario, sensors[0].filter)
    return Parts(
        sensors,
        fusion,
        replace(control.build(model.horizon, num_threads), end=float(model.time.build()[-1])),
        control.reward.build(folder),
        control.search.build(folder),
        control.others,
        first_actions(scenario, sensors),
        control.build_constraints(folder),
        _decision_notes(scenario, fusion, strategy),
        (control.lookahead or Lookahead()).build(),
        model.estimates_by.build(folder),
        {"schedule": _schedule(scenario), "cutoff": model.ospa.cutoff},
        partial(scene_for_program, scenario),
    )


def _schedule(scenario: Scenario) -> Schedule:
    """Return when the sensors scan and decide, and how their scans are fused, for an oracle."""
    model, num = scenario.model, len(scenario.model.sensors)
    section, powers = model.fusion, (1.0,) * num
    is_shared = section.kind in SINGLE_BELIEF_FUSIONS or isinstance(section, CustomFusion) or section.feeds_back
    if (
        not isinstance(section, CustomFusion)
        and section.kind in ("clmb", "cm_delta_glmb")
        and not section.field_of_view_weighting
    ):
        powers = section.scaled_weights(num)
    birth, scans = model.birth, build_scan_times(scenario)
    rebirths = birth.from_measurements is not None or birth.steps == "every"
    return Schedule(
        model.time.build(), model.decision_steps, powers, is_shared or model.network is not None, rebirths, scans
    )


def _decision_notes(scenario: Scenario, fusion: Fusion, strategy: Strategy) -> tuple[str, ...]:
    """Return notes on decisions that assume another fusion than the tracks', or ignore limits of the network."""
    model, section = scenario.model, scenario.model.fusion
    reward = getattr(strategy, "reward", None) or model.control.reward
    ignores_others = isinstance(strategy, NamedIndependent) and (strategy.others or model.control.others) == "absent"
    notes = []
    in_full = isinstance(fusion, ParallelUpdate) or reward.kind == "expected_loss"
    if in_full and not ignores_others and section.kind not in (*FULL_INFORMATION_FUSIONS, "none"):
        rule = (
            f"{section.kind} by views" if section.kind != "custom" and section.field_of_view_weighting else section.kind
        )
        notes.append(f"joint rewards take all scans in full; tracks are fused by another rule ({rule})")
    if model.network is not None and model.network.build() != Network():
        notes.append("decided by one who hears every sensor at once, whatever the network lets through")
    return tuple(notes)


def _decision_fusion(scenario: Scenario, local: Filter) -> Fusion:
    """Return the custom fusion if there is one; otherwise the fusion of decisions that the section gives."""
    section, num_sensors = scenario.model.fusion, len(scenario.model.sensors)
    if isinstance(section, CustomFusion):
        return section.build(num_sensors, scenario.folder)
    return section.build_of_decisions(num_sensors, of_lmbs=has_lmb_beliefs(local))
