"""Networks, births from measurements and filters in turn: what a scenario builds, and what it refuses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.filters import LmbFilter, MultiSensorGlmbFilter, MultiSensorLmbFilter, SequentialLmbFilter
from vedette.fusion import Clmb, CmDeltaGlmb, LabelMatchedFusion, ParallelUpdate
from vedette.scenarios import Scenario, load_scenario, parse_scenario
from vedette.scenarios.build import build_experiment
from vedette.scenarios.summary import summary_rows
from vedette.scenarios.warnings import scenario_warnings
from vedette.tracking import BeliefNetwork, Central, Distributed, ScanNetwork

FILTER = "kind: m_delta_glmb"
FUSION = "fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}"
SITES = """  sites:
    - {existence: 0.1, mean: [0.0, 0.0, 0.0, 0.0], std: [5.0, 5.0, 2.0, 2.0]}
"""
MEASURED = "  from_measurements: {expected: 0.4, max_existence: 0.1, std: [9.0, 8.0, 3.0, 2.0]}\n"


def tracker_of(filter_: str, fusion: str, *more: tuple[str, str]) -> Any:
    text = changed((FILTER, f"kind: {filter_}"), (FUSION, f"fusion: {fusion}"), *more)
    return build_experiment(Scenario(parse_scenario(text, "f.yaml"), Path("f.yaml"))).tracker


@pytest.mark.parametrize(
    ("kind", "fusion", "central"),
    [
        ("lmb", "sequential", SequentialLmbFilter),
        ("lmb", "central", MultiSensorLmbFilter),
        ("delta_glmb", "sequential", MultiSensorGlmbFilter),
        ("m_delta_glmb", "central", MultiSensorGlmbFilter),
    ],
)
def test_scans_go_to_one_filter_or_over_the_radio(kind: str, fusion: str, central: type) -> None:
    alone = tracker_of(kind, f"{{kind: {fusion}}}")
    assert isinstance(alone, Central)
    assert isinstance(alone.filter, central)
    radio = tracker_of(
        kind, f"{{kind: {fusion}}}\nnetwork: {{radio_range: 50.0, max_hops: 2, link_loss_probability: 0.1, delay: 1}}"
    )
    assert isinstance(radio, ScanNetwork)
    assert isinstance(radio.filter, central)
    network = radio.network
    assert (network.radio_range, network.max_hops, network.link_loss_probability, network.delay) == (50.0, 2, 0.1, 1)
    assert isinstance(radio.merging, LabelMatchedFusion if kind == "lmb" else CmDeltaGlmb)


def test_beliefs_go_to_a_fusion_or_over_the_radio() -> None:
    alone = tracker_of("lmb", "{kind: parallel}")
    assert isinstance(alone, Distributed)
    assert alone.feedback
    assert isinstance(alone.fusion, ParallelUpdate)
    radio = tracker_of("lmb", "{kind: parallel}\nnetwork: {consensus_rounds: 7}")
    assert isinstance(radio, BeliefNetwork)
    assert radio.network.consensus_rounds == 7
    assert math.isinf(radio.network.radio_range)
    assert isinstance(radio.merging, LabelMatchedFusion)
    views = tracker_of("lmb", "{kind: clmb, field_of_view_weighting: true, feedback: true}\nnetwork: {}")
    assert isinstance(views.fusion, Clmb)
    assert views.fusion.field_of_view_weighting
    own = tracker_of("m_delta_glmb", "{kind: cm_delta_glmb, feedback: true}\nnetwork: {link_loss_probability: 0.2}")
    assert isinstance(own.merging, CmDeltaGlmb)


def test_births_from_measurements_beside_sites_or_instead() -> None:
    both = tracker_of("lmb", "{kind: sequential}", (SITES, SITES + MEASURED)).targets.birth
    assert both.num_sites == 1
    np.testing.assert_array_equal(both.from_measurements.std, [9.0, 8.0, 3.0, 2.0])
    assert (both.from_measurements.expected, both.from_measurements.max_existence) == (0.4, 0.1)
    interleaved = ("constant_velocity, sigma_v: 1.0", "constant_velocity, sigma_v: 1.0, state_order: interleaved")
    alone = tracker_of("lmb", "{kind: sequential}", (SITES, MEASURED), interleaved).targets.birth
    assert (alone.num_sites, alone.state_dim) == (0, 4)
    np.testing.assert_array_equal(alone.from_measurements.std, [9.0, 3.0, 8.0, 2.0])


def test_deletion_by_spread_is_a_limit_of_the_filters() -> None:
    tracker = tracker_of("lmb, limits: {max_position_std: 40.0}", "{kind: clmb}")
    assert isinstance(tracker.filters[0], LmbFilter)
    assert tracker.filters[0].limits.max_position_std == 40.0
    assert math.isinf(tracker_of("lmb", "{kind: clmb}").filters[0].limits.max_position_std)


def test_show_lists_messages_and_births() -> None:
    text = changed(
        (FILTER, "kind: lmb"), (FUSION, "fusion: {kind: sequential}\nnetwork: {radio_range: 80.0}"), (SITES, MEASURED)
    )
    told = dict(summary_rows(parse_scenario(text, "f.yaml")))
    assert told["network"] == "radio range 80 m, link loss probability 0, delay 0"
    assert told["births"] == "no site; 0.4 per scan from measurements"


def test_late_beliefs_and_late_births_warn(tmp_path: Path) -> None:
    file = tmp_path / "late.yaml"
    for fusion, warned in (("{kind: clmb, feedback: true}", True), ("{kind: sequential}", False)):
        file.write_text(
            changed(
                (FILTER, "kind: lmb"),
                ("steps: [1, 5]", "steps: every"),
                (FUSION, f"fusion: {fusion}\nnetwork: {{delay: 2}}"),
            )
        )
        told = [line for line in scenario_warnings(load_scenario(file)) if "come 2 or more scans late" in line]
        assert bool(told) == warned
        assert all("take fusion: {kind: sequential}" in line for line in told)


@pytest.mark.parametrize(
    ("network", "feedback", "when"),
    [("", "false", "without feedback"), ("", "true", None), ("network: {max_hops: 1}\n", "true", "over a network")],
)
def test_labels_that_sensors_make_from_measurements_are_to_be_matched(network: str, feedback: str, when: Any) -> None:
    measured = "  from_measurements: {std: [5.0, 5.0, 2.0, 2.0]}\n"
    births = "  steps: [1, 5]\n", f"  steps: [1, 5]\n{measured}"
    rule = "fusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}"
    for matching in ("labels", "assignment"):
        fusion = f"{network}fusion: {{kind: cm_delta_glmb, feedback: {feedback}, matching: {matching}}}"
        text = changed(births, (rule, fusion))
        if (matching == "labels") == (when is None):
            parse_scenario(text)
            continue
        wanted = f"assignment, as {when} sensors make labels" if when else "labels, as with feedback all sensors share"
        with pytest.raises(ScenarioError, match=f"fusion.matching: expected {wanted}"):
            parse_scenario(text)
