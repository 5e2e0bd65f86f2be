"""Checks of the radio network and of births from measurements: their consistency with filters and fusion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from vedette.internal.quantities import PLACED
from vedette.scenarios.diagnostics import Finding, describe
from vedette.scenarios.sections.fusion import LABEL_FUSIONS, SCAN_FUSIONS, Fusion
from vedette.scenarios.sections.tracking import UNLABELLED

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
    path, dim = ("birth", "from_measurements"), model.motion.state_dim
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


NETWORK_CHECKS = (network_of_several, network_of_fusion, births_from_measurements, matching_of_own_labels)
