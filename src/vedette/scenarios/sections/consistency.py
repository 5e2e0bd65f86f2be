"""Consistency of the network, births, constraints, rules and strategies with filters, fusion, sensors and targets."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from vedette.internal.quantities import PLACED, is_doppler
from vedette.kernels.base.types import PLANE
from vedette.scenarios.diagnostics import Finding, Path, describe
from vedette.scenarios.sections.deciding import Lookahead, Revisit
from vedette.scenarios.sections.fusion import LABEL_FUSIONS, SCAN_FUSIONS, Fusion
from vedette.scenarios.sections.planners import NamedJointWithTruth, NamedOracle
from vedette.scenarios.sections.strategies import LookaheadStrategy, Strategy
from vedette.scenarios.sections.tracking import LABELLING, UNLABELLED

if TYPE_CHECKING:
    from vedette.scenarios.sections.fields import ScenarioFields


def network_of_several(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of a network with a single sensor, or without fusion."""
    if model.network is None:
        return
    if len(model.sensors) < 2:
        yield ("network",), "none, as there is a single sensor", "a network"
    elif model.fusion.kind == "none":
        yield ("network",), "none, as nothing is fused", "a network"


def network_of_fusion(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of filters, fusion and network that do not work together."""
    network, fusion = model.network, model.fusion
    if network is None:
        return
    if fusion.kind in SCAN_FUSIONS and network.consensus_rounds is not None:
        wanted = f"none, as under {fusion.kind} sensors send scans, of which there is no average"
        yield ("network", "consensus_rounds"), wanted, describe(network.consensus_rounds)
    if fusion.kind == "parallel" and model.filter.built_kind == "factored_glmb":
        wanted = (
            "lmb with births: labelled, as over a network parallel adds each label's evidence to another prediction"
        )
        yield ("filter", "kind"), wanted, describe(model.filter.kind)
    if fusion.kind == "parallel" and network.delay > 0:
        yield ("network", "delay"), "0, as parallel divides by the prediction of the same time", describe(network.delay)
    if fusion.kind in (*LABEL_FUSIONS, "custom") and not fusion.feeds_back:
        yield ("fusion", "feedback"), "true, as sensors of a network go on from what they have fused", "false"


def births_from_measurements(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of births from measurements: state dimension, labels, places of targets, matching of labels."""
    measured, fusion = model.birth.from_measurements, model.fusion
    if measured is None:
        return
    path, dim = ("birth", "from_measurements"), len(model.motion.components)
    if len(measured.std) != dim:
        yield (*path, "std"), f"{dim} numbers, as a state under motion has", describe(measured.std)
    if model.filter.kind in UNLABELLED:
        yield path, f"none, as {model.filter.kind} filters have no labels", "births from measurements"
    without = [i for i, sensor in enumerate(model.sensors) if sensor.measurement.kind not in (*PLACED, "custom")]
    is_central = isinstance(fusion, Fusion) and fusion.kind in SCAN_FUSIONS
    if not is_central or len(without) == len(model.sensors):  # else some sensors start tracks for all
        for i in without:
            wanted = "a measurement that says where a target is, for birth.from_measurements"
            yield ("sensors", i, "measurement", "kind"), wanted, describe(model.sensors[i].measurement.kind)
    if len(model.sensors) > 1 and isinstance(fusion, Fusion) and fusion.kind in LABEL_FUSIONS:
        when = "without feedback" if not fusion.feeds_back else None if model.network is None else "over a network"
        if when is not None and fusion.matching == "labels":
            wanted = f"assignment, as {when} sensors make labels of their own from their measurements"
            yield ("fusion", "matching"), wanted, describe(fusion.matching)


def matching_of_own_labels(model: ScenarioFields) -> Iterator[Finding]:
    """Yield a fault if labels are matched although all sensors share them."""
    fusion = model.fusion
    if not isinstance(fusion, Fusion) or fusion.matching == "labels" or fusion.kind not in LABEL_FUSIONS:
        return
    if fusion.feedback and model.network is None:
        yield ("fusion", "matching"), "labels, as with feedback all sensors share them", describe(fusion.matching)


def constraints_on_labels(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of constraints on predicted targets if the filter has no labels."""
    for i, constraint in enumerate(model.control.constraints):
        on_labels = constraint.kind == "void_probability" or (isinstance(constraint, Revisit) and not constraint.places)
        if model.filter.kind in UNLABELLED and on_labels:
            wanted = f"another constraint, as {model.filter.kind} filters have no labels to look ahead by"
            yield ("control", "constraints", i, "kind"), wanted, describe(constraint.kind)


def enough_switchable(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults if fewer sensors may scan than cannot be switched off; skipped with custom platforms."""
    fixed = sum(not sensor.switchable for sensor in model.sensors)
    if any(sensor.platform.kind == "custom" for sensor in model.sensors):
        return
    for i, constraint in enumerate(model.control.constraints):
        if constraint.kind != "max_active":
            continue
        if fixed == len(model.sensors):
            yield ("control", "constraints", i, "kind"), "a sensor that is switchable, for max_active", "none"
        elif constraint.sensors < fixed:
            wanted = f"at least {fixed}, as so many sensors are not switchable"
            yield ("control", "constraints", i, "sensors"), wanted, describe(constraint.sensors)


def longer_plans(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of decisions over several periods that are not whole pseudo-updates, or not sums over labels."""
    control = model.control
    given: dict[Path, Lookahead | None] = {("control", "lookahead"): control.lookahead}
    given.update({("planners", name): own for name, own in model.planners.items() if own.kind == "lookahead"})
    for path, own in given.items():
        if own is not None and own.period is not None:
            horizon_period = model.horizon[1]
            steps = own.period / horizon_period
            if round(steps) < 1 or abs(steps - round(steps)) > 1e-9 * steps:
                multiple = f"a whole multiple of control.horizon_period, {horizon_period:g}"
                yield (*path, "period"), multiple, describe(own.period)
    if control.lookahead is not None and control.association != "known" and control.reward.kind != "expected_loss":
        yield ("control", "association"), "known, with a lookahead", describe(control.association)


def targets_of_rules(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of rules without one target for each sensor."""
    for name, own in model.planners.items():
        if own.kind == "assigned_target" and own.targets is not None and len(own.targets) != len(model.sensors):
            wanted = f"{len(model.sensors)} numbers, one a sensor"
            yield ("planners", name, "targets"), wanted, describe(list(own.targets))


def one_patrol(model: ScenarioFields) -> Iterator[Finding]:
    """Yield faults of visits: they need a moving sensor, one constraint, and poses with room for the time of each."""
    constraints, visits = model.control.constraints, model.control.revisit()
    if visits and not any(sensor.platform.top_speed > 0.0 for sensor in model.sensors):
        yield ("control", "constraints", constraints.index(visits), "kind"), "a sensor that moves, for revisit", "none"
    for s, sensor in enumerate(model.sensors):
        if visits and len(sensor.platform.components()) > 2:
            yield ("sensors", s, "platform"), "a pose of at most five components, beside revisit", "more"
        if visits and is_doppler(sensor.measurement.kind):
            wanted = "no range rate, beside revisit, as poses have the velocity of a sensor or the times of its visits"
            yield ("sensors", s, "measurement", "kind"), wanted, describe(sensor.measurement.kind)
    for i, own in enumerate(constraints):
        if isinstance(own, Revisit) and own is not model.control.revisit(of_targets=not own.places):
            yield ("control", "constraints", i, "kind"), "one constraint revisit with all places or targets", "another"


def incompatibility(model: ScenarioFields, strategy: Strategy, *, labels: bool | None = None) -> str:
    """Return the requirement that is not met, and why, if the planner does not suit a scenario; "" if it does.

    labels: True if the filter, already built, labels its targets; None: determined from its kind.
    """
    if strategy.needs_labels and not (model.filter.kind not in UNLABELLED if labels is None else labels):
        others = "nearest, assigned_target, centroid, oracle or custom"
        return f"{others}, as {model.filter.kind} filters have no labels ({LABELLING} do)"
    if isinstance(strategy, LookaheadStrategy):
        reward = strategy.reward or model.control.reward
        if model.control.association != "known" and reward.kind != "expected_loss":
            sums = "with control.association full decisions are no sums over labels (known has them)"
            return f"joint or another, as {sums}"
    return _missing_truth(model) if isinstance(strategy, NamedOracle | NamedJointWithTruth) else ""


def _missing_truth(model: ScenarioFields) -> str:
    """Return the requirement of a planner that uses true targets; "" if these are known completely."""
    motion = model.motion
    if model.targets.kind == "unknown":
        return "one that does not know the targets, as these are unknown"
    if model.targets.kind != "recorded" or motion.kind != "custom" or len(motion.components) == len(PLANE):
        return ""
    return (
        f"another kind, as states have {len(motion.components)} components under motion and the recorded targets "
        f"{len(PLANE)} (a motion of {len(PLANE)} components, or targets that are simulated, would do)"
    )


CONSISTENCY_CHECKS = (
    network_of_several,
    network_of_fusion,
    births_from_measurements,
    matching_of_own_labels,
    constraints_on_labels,
    enough_switchable,
    longer_plans,
    one_patrol,
    targets_of_rules,
)
