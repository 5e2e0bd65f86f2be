"""Runs with filters that name no target, and whether the labelled ones are better as theory has it."""

from __future__ import annotations

import numpy as np
import pytest

from vedette.errors import InputError
from vedette.evaluation.runs import run_scenario
from vedette.scenarios import Scenario, list_builtin, load_scenario
from vedette.scenarios.loading import parse_scenario
from vedette.simulation.storage import load_run, save_run

UNLABELLED = ("phd", "cphd", "cb_member")


def with_filter(name: str, kind: str) -> Scenario:
    text = list_builtin()[name].read_text(encoding="utf-8")
    assert text.count("kind: delta_glmb") == 1
    return Scenario(parse_scenario(text.replace("kind: delta_glmb", f"kind: {kind}")))


@pytest.mark.parametrize("kind", UNLABELLED)
def test_a_run_names_its_estimates_anew_at_each_scan_and_can_be_stored(kind, tmp_path):
    scenario = with_filter("polar-10", kind)
    record = run_scenario(scenario, "stationary", seed=3, run=1)
    for scan, estimate in enumerate(record.estimates, start=1):
        estimate.validate()
        assert estimate.labels.tolist() == [[scan, i] for i in range(estimate.num_targets)]
    assert sum(estimate.num_targets for estimate in record.estimates) > 300
    again = run_scenario(scenario, "constant", seed=3, run=1)
    assert again.ospa.tobytes() == record.ospa.tobytes()
    back = load_run(save_run(record, tmp_path / "run"))
    assert back.ospa.tobytes() == record.ospa.tobytes()
    with pytest.raises(
        InputError, match=rf"planner jdm: expected nearest, .*, as {kind} filters have no labels .*; got jdm"
    ):
        run_scenario(scenario, "jdm", seed=3)


def test_built_in_scenes_to_compare_filters_have_one_sensor_and_no_fusion():
    for name in ("linear-10", "polar-10"):
        model = load_scenario(name).model
        assert len(model.sensors) == 1
        assert model.fusion.kind == "none"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["linear-10", "polar-10"])
def test_labelled_filters_are_better_on_the_same_scans(name):
    """Paired over runs: each filter without labels loses to the LMB filter by more than the scatter of runs allows."""
    mean_ospa = {
        kind: np.array(
            [run_scenario(with_filter(name, kind), "stationary", seed=2, run=run).ospa[:, 0].mean() for run in range(8)]
        )
        for kind in ("delta_glmb", "lmb", *UNLABELLED)
    }
    gap = mean_ospa["lmb"] - mean_ospa["delta_glmb"]
    assert abs(gap.mean()) < 0.5
    for kind in UNLABELLED:
        loss = mean_ospa[kind] - mean_ospa["lmb"]
        assert loss.mean() > 5.0 * loss.std(ddof=1) / np.sqrt(len(loss))
