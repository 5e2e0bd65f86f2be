# ruff: noqa: E501
"""The words and places of the faults of filter, fusion, estimates, control and score."""

from __future__ import annotations

from typing import Any

import pytest

from scenarios.minimal import changed
from vedette.errors import ScenarioError
from vedette.scenarios import parse_scenario

CASES = [
    (
        "sensors:\n  - {name: north, position: [0.0, 40.0], heading_deg: 4.0}\n  - {name: south, position: [0.0, -40.0]}",
        "sensors: []",
        ["f.yaml:16:10: sensors: expected a list of at least 1, got an empty list"],
    ),
    (
        "kind: m_delta_glmb",
        "kind: m-delta-glmb",
        [
            'f.yaml:19:16: filter.kind: expected one of delta_glmb, m_delta_glmb, lmb, factored_glmb, phd, cphd, cb_member, custom, got "m-delta-glmb" (did you mean m_delta_glmb?)'
        ],
    ),
    (
        "kind: m_delta_glmb",
        "kind: m_delta_glmb, limits: {max_hypotheses: 0, gate_probability: 0}",
        [
            "f.yaml:19:55: filter.limits.max_hypotheses: expected a number of at least 1, got 0",
            "f.yaml:19:76: filter.limits.gate_probability: expected a number above 0, got 0",
        ],
    ),
    (
        "kind: m_delta_glmb",
        "kind: lmb, assignment: {kind: gibbs, num_samples: 10}",
        [
            'f.yaml:19:40: filter.assignment.kind: expected belief_propagation or ranked or custom, as the filter is lmb, got "gibbs"',
            'f.yaml:20:16: fusion.kind: expected sequential, parallel, clmb, arithmetic_average, central or none, as the filters are lmb, got "cm_delta_glmb"',
        ],
    ),
    (
        "kind: m_delta_glmb",
        "kind: cphd, assignment: {kind: gibbs}, limits: {max_existence: 1.0, max_intensity_components: 0}",
        [
            'f.yaml:19:16: filter.kind: expected a filter with labels by which to fuse, as there are 2 sensors, got "cphd"',
            'f.yaml:19:41: filter.assignment.kind: expected ranked, as the filter is cphd, got "gibbs"',
            "f.yaml:19:73: filter.limits.max_existence: expected a number below 1, got 1.0",
            "f.yaml:19:104: filter.limits.max_intensity_components: expected a number of at least 1, got 0",
            'f.yaml:21:19: estimator.kind: expected map, as cphd filters have no labels, got "marginal"',
        ],
    ),
    (
        "  - {name: south, position: [0.0, -40.0]}\nfilter: {kind: m_delta_glmb}\nfusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}\nestimator: {kind: marginal, threshold: 0.6}",
        "filter: {kind: phd}\nfusion: {kind: clmb}",
        ['f.yaml:19:16: fusion.kind: expected none, as phd filters have no labels by which to fuse, got "clmb"'],
    ),
    (
        "filter: {kind: m_delta_glmb}\nfusion: {kind: cm_delta_glmb, weights: [0.5, 0.5]}",
        "filter: {kind: delta_glmb, assignment: {kind: gibbs}}\nfusion: {kind: central, feedback: true}",
        [
            'f.yaml:19:47: filter.assignment.kind: expected ranked, as one filter takes the scans of all sensors, got "gibbs"',
            "f.yaml:20:35: fusion.feedback: expected false, as nothing is fused while tracking, got true",
        ],
    ),
    (
        "kind: m_delta_glmb",
        "kind: m_delta_glmb, assignment: murty",
        ['f.yaml:19:42: filter.assignment: expected a mapping, got "murty"'],
    ),
    (
        "weights: [0.5, 0.5]",
        "weights: [0.5, 0.4]",
        ["f.yaml:20:40: fusion.weights: expected weights with sum 1, got a sum of 0.9"],
    ),
    (
        "{kind: cm_delta_glmb, weights: [0.5, 0.5]}",
        "{weights: [0.5, 0.5]}",
        [
            "f.yaml:20:9: fusion: expected a mapping with kind: one of sequential, parallel, clmb, cm_delta_glmb, "
            "arithmetic_average, central, none, custom, got no kind"
        ],
    ),
    (
        "weights: [0.5, 0.5]",
        "weights: [1.0]",
        ["f.yaml:20:40: fusion.weights: expected as many weights as sensors, 2, got a list of 1"],
    ),
    (
        "weights: [0.5, 0.5]",
        "weights: [1.5, -0.5]",
        [
            "f.yaml:20:41: fusion.weights[0]: expected a number of at most 1, got 1.5",
            "f.yaml:20:46: fusion.weights[1]: expected a number of at least 0, got -0.5",
        ],
    ),
    (
        "kind: cm_delta_glmb, weights: [0.5, 0.5]",
        "kind: none",
        ['f.yaml:20:16: fusion.kind: expected a fusion, as there are 2 sensors, got "none"'],
    ),
    (
        "weights: [0.5, 0.5]",
        "mixture_power: quadrature, limits: {max_components: 100}",
        [
            "f.yaml:20:83: fusion.limits.max_components: expected a number whose power by 2 sensors is at most max_combinations, 4096, got 100"
        ],
    ),
    (
        "kind: cm_delta_glmb, weights",
        "kind: clmb, feedback: true, weights",
        ["f.yaml:20:32: fusion.feedback: expected false, as m_delta_glmb filters cannot go on from an LMB, got true"],
    ),
    (
        "kind: cm_delta_glmb, weights: [0.5, 0.5]",
        "kind: parallel, by_views: true, matching: assignment",
        [
            'f.yaml:20:16: fusion.kind: expected sequential or another, as parallel is of lmb or factored_glmb filters, and these are m_delta_glmb, got "parallel"',
            "f.yaml:20:36: fusion.by_views: expected false, as parallel does not weigh labels (clmb and arithmetic_average do), got true",
            'f.yaml:20:52: fusion.matching: expected labels, as under parallel all sensors share them, got "assignment"',
        ],
    ),
    (
        "kind: cm_delta_glmb, weights: [0.5, 0.5]",
        "kind: cm_delta_glmb, matching: assignment, feedback: true",
        ['f.yaml:20:41: fusion.matching: expected labels, as with feedback all sensors share them, got "assignment"'],
    ),
    (
        "kind: cm_delta_glmb, weights: [0.5, 0.5]",
        "kind: arithmetic_average, feedback: true",
        ["f.yaml:20:46: fusion.feedback: expected false, as m_delta_glmb filters cannot go on from an LMB, got true"],
    ),
    (
        "kind: cm_delta_glmb, weights: [0.5, 0.5]",
        "kind: sequential, feedback: true",
        ["f.yaml:20:38: fusion.feedback: expected false, as nothing is fused while tracking, got true"],
    ),
    ("threshold: 0.6", "threshold: 1.0", ["f.yaml:21:40: estimator.threshold: expected a number below 1, got 1.0"]),
    (
        "decision_steps: [4, 8]",
        "decision_steps: [4, 25]",
        ["f.yaml:22:31: control.decision_steps[1]: expected a step up to the last, 20, got 25"],
    ),
    (
        "decision_steps: [4, 8]",
        "decision_steps: [8, 4]",
        ["f.yaml:22:31: control.decision_steps[1]: expected more than the one before it, 8, got 4"],
    ),
    (
        "decision_steps: [4, 8]",
        "confidence: 1.0, indifference: 1, max_samples: 8, max_seconds: 0",
        [
            "f.yaml:22:23: control.confidence: expected a number below 1, got 1.0",
            "f.yaml:22:42: control.indifference: expected a number below 1, got 1",
            "f.yaml:22:58: control.max_samples: expected a number of at least 24, got 8",
            "f.yaml:22:74: control.max_seconds: expected a number above 0, got 0",
        ],
    ),
    (
        "decision_steps: [4, 8]",
        "indifference: 0.01, max_samples: 100",
        [
            "f.yaml:22:25: control.indifference: expected confidence beside it, such as 0.95, got 0.01",
            "f.yaml:22:44: control.max_samples: expected confidence beside it, such as 0.95, got 100",
        ],
    ),
    (
        "decision_steps: [4, 8]",
        "decision_times: [3.0, 3.2, 100]",
        [
            "f.yaml:22:33: control.decision_times[1]: expected the time of a scan: 2 s and every 0.5 s after it, got 3.2",
            "f.yaml:22:38: control.decision_times[2]: expected a time from 2 to 11.5 s, got 100.0",
        ],
    ),
    (
        "decision_steps: [4, 8]",
        "decision_steps: [4], decision_times: [3.0]",
        ["f.yaml:22:10: control: expected either decision_steps or decision_times, got both"],
    ),
    (
        "decision_steps: [4, 8]",
        "horizon_steps: 0, horizon_period: 0.0",
        [
            "f.yaml:22:26: control.horizon_steps: expected a number of at least 1, got 0",
            "f.yaml:22:45: control.horizon_period: expected a number above 0, got 0.0",
        ],
    ),
    (
        "decision_steps: [4, 8]",
        "actions_deg: [0, 90]",
        [
            "f.yaml:22:11: control.actions_deg: expected one of association, confidence, constraints, decision_steps, decision_times, detection_threshold, explain, horizon_period, horizon_steps, ideal_measurements, indifference, limits, lookahead, max_samples, max_seconds, num_samples, reward, search, undetected_worth, got an unknown key (the platform of a sensor has it: `platform: {kind: courses, speed: 50.0, headings_deg: [0, 90]}`)"
        ],
    ),
    (
        "decision_steps: [4, 8]",
        "reward: {kind: cauchy_schwarz, unit_volume: 0}",
        ["f.yaml:22:55: control.reward.unit_volume: expected reference or a number above 0, got 0"],
    ),
    (
        "decision_steps: [4, 8]",
        "reward: {kind: renyi, order: 1}",
        ["f.yaml:22:40: control.reward.order: expected a number other than 1, got 1"],
    ),
    (
        "decision_steps: [4, 8]",
        "reward: {kind: entropy}",
        [
            'f.yaml:22:26: control.reward.kind: expected one of cardinality_variance, cauchy_schwarz, expected_gospa, expected_loss, kullback_leibler, peecs, renyi, custom, got "entropy"'
        ],
    ),
    (
        "decision_steps: [4, 8]",
        "ideal_measurements: perfect, detection_threshold: 2",
        [
            'f.yaml:22:31: control.ideal_measurements: expected one of ideal, expected, sampled, got "perfect"',
            "f.yaml:22:61: control.detection_threshold: expected a number of at most 1, got 2",
        ],
    ),
    ("to_step: 20", "to_step: 4", ["f.yaml:23:45: ospa.to_step: expected a step from from_step, 5, on, got 4"]),
    ("to_step: 20", "to_step: 30", ["f.yaml:23:45: ospa.to_step: expected a step up to the last, 20, got 30"]),
    (
        "cutoff: 50.0",
        "cutoff: 0, order: 0.5",
        [
            "f.yaml:23:16: ospa.cutoff: expected a number above 0, got 0",
            "f.yaml:23:26: ospa.order: expected a number of at least 1, got 0.5",
        ],
    ),
]


@pytest.mark.parametrize(("old", "new", "faults"), CASES, ids=[f"{old[:20]} -> {new[:40]}" for old, new, _ in CASES])
def test_faults_are_named_with_their_places(old: str, new: str, faults: list[str]) -> None:
    with pytest.raises(ScenarioError) as error:
        parse_scenario(changed((old, new)), "f.yaml")
    assert error.value.faults == faults


@pytest.mark.parametrize(
    ("network", "feedback", "when"),
    [("", "false", "without feedback"), ("", "true", None), ("network: {hops: 1}\n", "true", "over a network")],
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
