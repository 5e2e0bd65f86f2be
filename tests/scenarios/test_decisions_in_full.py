"""Joint decisions where every sensor's scans count in full: the same on the same belief, whatever filter keeps it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from vedette.control import Plan
from vedette.densities import GLMB, LMB, FactoredGLMB, TrackTable, as_glmb
from vedette.scenarios import Scenario, load_scenario, replace_fields
from vedette.scenarios.build import build_experiment, build_planner
from vedette.tracking import State

NUM_LABELS = 3
FILTERS = {
    "lmb": lambda lmb: lmb,
    "factored_glmb": FactoredGLMB.of,
    "delta_glmb": lambda lmb: as_glmb(lmb, max_hypotheses=2**NUM_LABELS)[0],
    "m_delta_glmb": lambda lmb: as_glmb(lmb, max_hypotheses=2**NUM_LABELS)[0],
}


def belief() -> LMB:
    """Three targets of `paper-a`, far from each other."""
    means = np.array([[-60.0, 250.0, 4.0, -3.0], [180.0, -120.0, -4.0, 5.0], [-220.0, -300.0, 0.0, 5.0]])
    cov = np.diag([400.0, 900.0, 16.0, 9.0])
    labels = [(1, i) for i in range(NUM_LABELS)]
    tracks = TrackTable.from_mixtures(labels, [(np.ones(1), mean[None], cov[None]) for mean in means])
    return LMB(tracks, np.array([3.0, 1.0, 2.0]))


def open_names() -> tuple[LMB, GLMB]:
    """Two targets whose names a GLMB leaves open, as they may have been swapped; and the LMB of the likelier names."""
    here, there = np.array([-60.0, 250.0, 4.0, -3.0]), np.array([180.0, -120.0, -4.0, 5.0])
    cov, labels = np.diag([400.0, 900.0, 16.0, 9.0]), [(1, 0), (1, 1)]
    states = np.array([here, there, there, here])
    swapped = GLMB.from_hypotheses(
        TrackTable.from_gaussians(np.array(labels * 2), states, np.array([cov] * 4)), [[0, 1], [2, 3]], [0.55, 0.45]
    )
    tracks = TrackTable.from_gaussians(np.array(labels), states[:2], np.array([cov] * 2))
    return LMB(tracks, np.full(2, np.inf)), swapped


def planned(filters: str, fusion: str, planner: str, held: Any = None, **fields: Any) -> tuple[Scenario, Plan]:
    """A decision of `paper-a` on a belief; without one on that of three targets, as this filter would hold it."""
    changes = {"filter.kind": filters, "fusion.kind": fusion, **fields}
    scenario = replace_fields(load_scenario("paper-a"), changes)
    decides, held = build_planner(scenario, planner, 1), held or FILTERS[filters](belief())
    assert decides is not None
    poses = build_experiment(scenario).poses
    state = State((held,) * len(poses), held, 1, 1.0)
    return scenario, decides.plan(state, poses, rng=np.random.default_rng(0))


@pytest.mark.parametrize("planner", ["jdm", "lookahead"])
@pytest.mark.parametrize("fusion", ["sequential", "central", "parallel", "arithmetic_average", "clmb by views"])
def test_one_belief_is_decided_on_alike_whatever_filter_holds_it(fusion: str, planner: str) -> None:
    kind, _, views = fusion.partition(" by ")
    fields = {"fusion.field_of_view_weighting": True} if views else {}
    _, wanted = planned("lmb", kind, planner, **fields)
    for filters in FILTERS:
        if kind == "parallel" and filters.endswith("delta_glmb"):
            continue  # no such scenario
        _, plan = planned(filters, kind, planner, **fields)
        assert plan.chosen == wanted.chosen
        for own, table in zip(plan.tables, wanted.tables, strict=True):
            np.testing.assert_allclose(own.mean, table.mean, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("fusion", ["sequential", "arithmetic_average", "clmb", "cm_delta_glmb"])
def test_the_expected_loss_is_the_same_under_any_fusion_and_filter(fusion: str) -> None:
    loss = {"control.reward": {"kind": "expected_loss"}}
    _, wanted = planned("lmb", "parallel", "jdm", **loss)
    for filters in FILTERS:
        if fusion == "cm_delta_glmb" and filters == "lmb":
            continue  # no such scenario
        _, plan = planned(filters, fusion, "jdm", **loss)
        np.testing.assert_allclose(plan.tables[0].mean, wanted.tables[0].mean, rtol=1e-9)


@pytest.mark.parametrize("reward", ["cauchy_schwarz", "expected_loss"])
@pytest.mark.parametrize("filters", ["factored_glmb", "delta_glmb", "m_delta_glmb"])
def test_ambiguous_labels_are_resolved_before_a_decision(filters: str, reward: str) -> None:
    """Not half way between the two places where each may be."""
    settled, swapped = open_names()
    held = FactoredGLMB.of(swapped) if filters == "factored_glmb" else swapped
    fields = {"control.reward": {"kind": reward}}
    _, wanted = planned("lmb", "sequential", "jdm", settled, **fields)
    _, plan = planned(filters, "sequential", "jdm", held, **fields)
    assert plan.chosen == wanted.chosen
    np.testing.assert_allclose(plan.tables[0].mean, wanted.tables[0].mean, rtol=1e-9)


def test_a_product_under_covariance_intersection_is_decided_on_as_an_lmb_is() -> None:
    _, wanted = planned("lmb", "clmb", "jdm")
    for fusion in ("clmb", "cm_delta_glmb"):
        _, plan = planned("factored_glmb", fusion, "jdm")
        np.testing.assert_allclose(plan.tables[0].mean, wanted.tables[0].mean, rtol=1e-9)


def test_two_scans_count_twice_under_any_filter() -> None:
    # By powers of one half each, what both sensors see would count once.
    _, full = planned("factored_glmb", "sequential", "jdm")
    _, halved = planned("factored_glmb", "cm_delta_glmb", "jdm")
    assert full.expected_rewards[0][0] > 1.3 * halved.expected_rewards[0][0]


@pytest.mark.parametrize(
    ("filters", "fusion", "reward", "said"),
    [
        ("lmb", "sequential", "expected_loss", None),
        ("factored_glmb", "central", "cauchy_schwarz", None),
        ("factored_glmb", "parallel", "cauchy_schwarz", None),
        ("delta_glmb", "cm_delta_glmb", "cauchy_schwarz", None),
        ("delta_glmb", "cm_delta_glmb", "expected_loss", "cm_delta_glmb"),
        ("lmb", "clmb", "expected_loss", "clmb"),
        ("delta_glmb", "arithmetic_average", "cauchy_schwarz", "arithmetic_average"),
    ],
)
def test_plans_warn_where_decisions_update_fully_and_tracks_are_fused_otherwise(
    filters: str, fusion: str, reward: str, said: str | None
) -> None:
    _, plan = planned(filters, fusion, "jdm", **{"control.reward": {"kind": reward}})
    found = [note for note in plan.notes if note.startswith("joint rewards")]
    wanted = f"joint rewards take all scans in full; tracks are fused by another rule ({said})"
    assert found == ([] if said is None else [wanted])
    # Of a strategy with a reward of its own, by its own reward.
    named = {"planners": {"own": {"kind": "joint", "reward": {"kind": reward}}}}
    _, plan = planned(filters, fusion, "own", **named)
    assert [note for note in plan.notes if note.startswith("joint rewards")] == found


def test_greedy_searches_go_with_glmb_filters_whose_scans_count_in_full() -> None:
    fields = {"control.search": {"kind": "sequential_greedy"}}
    _, plan = planned("delta_glmb", "sequential", "jdm", **fields)
    assert "planned on the LMBs of the GLMB beliefs: ParallelUpdate fuses LMBs" in plan.notes


@pytest.mark.parametrize("planner", ["jdm", "idm", "lookahead"])
def test_plans_warn_that_decisions_ignore_the_network(planner: str) -> None:
    said = "decided by one who hears every sensor at once, whatever the network lets through"
    for network, wanted in (({"radio_range": 300.0}, True), ({"delay": 2}, True), ({}, False), (None, False)):
        _, plan = planned("lmb", "sequential", planner, network=network)
        assert (said in plan.notes) == wanted
